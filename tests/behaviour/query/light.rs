//! What passes through cloud: the twin's integrals against fine marches, on the GPU and on the CPU.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::testing::model_bindings;
use bevy_cumulus::{
    prelude::*,
    reference::{
        field::LocalModel,
        planet::{Planet, layer_intervals},
    },
    settings::CloudZone,
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use super::{field_app, layers, sky, small, until_current};
use crate::support::{app::spawn_sun, evaluate::on_gpu_with, gpu::run_updates};

const STEPS: u32 = 4096;

/// Optical depth of a segment from a to b by its midpoints.
const MARCH: &str = "
    let a = vec3<f32>(values[i], values[i + 1u], values[i + 2u]);
    let b = vec3<f32>(values[i + 3u], values[i + 4u], values[i + 5u]);
    var sum = 0.0;
    for (var k = 0u; k < STEPSu; k++) {
        sum += sample_medium(mix(a, b, (f32(k) + 0.5) / STEPS.0), 0.0).extinction;
    }
    results[o] = sum * distance(a, b) / STEPS.0;";

fn march_on_gpu(app: &mut App, camera: DVec3, segments: &[[f32; 6]]) -> Vec<f64> {
    let group = model_bindings(app, camera).expect("the model can be bound");
    let body = MARCH.replace("STEPS", &STEPS.to_string());
    let found = on_gpu_with(app, Some(&group), "import bevy_cumulus::model::model::sample_medium;", &body, segments);
    found.into_iter().map(|[depth]| f64::from(depth)).collect()
}

/// Somewhere in the middle of the clouds.
fn eye(rng: &mut StdRng) -> DVec3 {
    DVec3::new(rng.random_range(-2e4..2e4), rng.random_range(800.0..3500.0), rng.random_range(-2e4..2e4))
}

fn direction(rng: &mut StdRng, up: std::ops::Range<f64>) -> DVec3 {
    let (y, angle): (f64, f64) = (rng.random_range(up), rng.random_range(0.0..std::f64::consts::TAU));
    let across = (1.0 - y * y).sqrt();
    DVec3::new(across * angle.cos(), y, across * angle.sin())
}

fn local(twin: &LocalModel<'_, impl bevy_cumulus::reference::field::ModelTextures>, a: DVec3, b: DVec3) -> [f32; 6] {
    let [a, b] = [a, b].map(|p| twin.local(p).as_vec3());
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

fn cloudy(app: &mut App) {
    app.insert_resource(CloudModel {
        coverage: 0.45,
        extinction: 0.01,
        world_offset: DVec3::new(5e4, 0.0, 0.0),
        ..default()
    });
    app.insert_resource(CloudClock { seconds: 900.0, speed: 0.0 });
    run_updates(app, 1);
}

/// Counts of clear, dimmed and dark.
fn spread(values: &[f64]) -> [usize; 3] {
    let count = |range: std::ops::Range<f64>| values.iter().filter(|v| range.contains(*v)).count();
    [count(0.999..2.0), count(0.05..0.95), count(-1.0..0.05)]
}

/// Transmittances from the twin, and the worst and the mean of their differences from marches on the GPU.
fn against_the_gpu(app: &mut App, seconds: f64, segments: usize) -> (Vec<f64>, f64, f64) {
    let sky = sky(app);
    let mut rng = StdRng::seed_from_u64(80);
    let (mut all, mut worst, mut bias) = (Vec::new(), 0.0_f64, 0.0);
    for _ in 0..8 {
        let camera = eye(&mut rng);
        let ends: Vec<DVec3> = (0..segments)
            .map(|_| camera + direction(&mut rng, -0.5..0.5) * 10_f64.powf(rng.random_range(2.0..4.3)))
            .collect();
        let planet = Planet::default();
        let twin = LocalModel::new(sky.model(), sky.layers(), seconds, camera, planet, sky.textures()).unwrap();
        let segments: Vec<[f32; 6]> = ends.iter().map(|b| local(&twin, camera, *b)).collect();
        for (b, depth) in ends.iter().zip(march_on_gpu(app, camera, &segments)) {
            let (gpu, cpu) = ((-depth).exp(), sky.transmittance(camera, *b));
            worst = worst.max((gpu - cpu).abs());
            bias += gpu - cpu;
            all.push(cpu);
        }
    }
    bias /= all.len() as f64;
    println!("{:?} clear, dimmed, dark; worst {worst:.5}, mean {bias:+.6}", spread(&all));
    (all, worst, bias)
}

#[test]
fn transmittance_is_that_of_a_fine_march_on_the_gpu() {
    let mut app = field_app(small(4));
    cloudy(&mut app);
    let (all, worst, bias) = against_the_gpu(&mut app, 900.0, 64);
    assert!(spread(&all).iter().all(|n| *n > 50), "{:?}", spread(&all));
    assert!(worst < 0.005 && bias.abs() < 3e-4, "worst {worst}, mean {bias}");
}

#[test]
fn transmittance_through_layers_is_that_of_a_fine_march_on_the_gpu() {
    let mut app = field_app(small(4));
    cloudy(&mut app);
    let thin = |layer: CloudLayer| CloudLayer { extinction: layer.extinction * 0.1, ..layer };
    app.insert_resource(CloudLayers(vec![
        CloudLayer { coverage: -0.35, rain: 0.3, ..thin(layers::storm()) },
        CloudLayer { extinction: 0.002, base: 2500.0, coverage: -0.3, far_coverage: 0.0, ..layers::sheet() },
    ]));
    app.world_mut().resource_mut::<CloudModel>().coverage = 0.0;
    // One place is cleared, one is overcast.
    for (x, strength) in [(-9000.0, -1.0), (9000.0, 0.7)] {
        let zone = CloudZone { radius: 7000.0, edge: 3000.0, strength };
        app.world_mut().spawn((zone, Transform::from_xyz(x, 0.0, 2000.0)));
    }
    until_current(&mut app);
    let (all, worst, bias) = against_the_gpu(&mut app, 900.0, 32);
    assert!(spread(&all).iter().all(|n| *n > 5), "{:?}", spread(&all));
    assert!(worst < 0.005 && bias.abs() < 5e-4, "worst {worst}, mean {bias}");
}

#[test]
fn sunlight_is_that_of_a_fine_march_on_the_gpu() {
    let mut app = field_app(small(4));
    cloudy(&mut app);
    let mut rng = StdRng::seed_from_u64(81);
    let (mut all, mut worst, mut bias, mut sun) = (Vec::new(), 0.0_f64, 0.0, None);
    for k in 0..10 {
        if let Some(old) = sun {
            app.world_mut().despawn(old);
        }
        let towards = direction(&mut rng, if k % 2 == 0 { 0.05..0.3 } else { 0.3..1.0 });
        sun = Some(spawn_sun(&mut app, -towards.as_vec3()));
        run_updates(&mut app, 1);
        let sky = sky(&app);
        let towards = sky.sun().expect("there is a sun");
        for _ in 0..8 {
            let camera = eye(&mut rng);
            let twin =
                LocalModel::new(sky.model(), sky.layers(), 900.0, camera, Planet::default(), sky.textures()).unwrap();
            let up = twin.local_direction(towards).y;
            let parts = layer_intervals(twin.eye_altitude(), up, twin.bounds(), twin.radius(), f64::INFINITY);
            let segments: Vec<[f32; 6]> =
                parts.iter().map(|[s, e]| local(&twin, camera + towards * *s, camera + towards * *e)).collect();
            let depth: f64 =
                if segments.is_empty() { 0.0 } else { march_on_gpu(&mut app, camera, &segments).iter().sum() };
            let (gpu, cpu) = ((-depth).exp(), sky.sun_visibility(camera));
            worst = worst.max((gpu - cpu).abs());
            bias += gpu - cpu;
            all.push(cpu);
        }
    }
    bias /= all.len() as f64;
    println!("{:?} clear, dimmed, dark; worst {worst:.5}, mean {bias:+.6}", spread(&all));
    assert!(spread(&all).iter().all(|n| *n > 5), "{:?}", spread(&all));
    assert!(worst < 0.005 && bias.abs() < 5e-4, "worst {worst}, mean {bias}");
    // Under the horizon there is no sun.
    assert_eq!(sky(&app).visibility_towards(Vec3::Y * 5000.0, Vec3::new(1.0, -0.1, 0.0)), 0.0);
}

#[test]
fn the_quadrature_is_as_good_as_it_says() {
    let mut app = field_app(CloudTextures { volume_size: 64, map_size: 256, ..small(4) });
    let mut rng = StdRng::seed_from_u64(82);
    let (mut all, mut worst, mut share) = (Vec::new(), 0.0_f64, 0.0_f64);
    let plain = CloudModel::default();
    for model in [
        CloudModel { coverage: 0.45, extinction: 0.01, ..plain.clone() },
        CloudModel {
            erosion: Erosion::Subtract,
            coverage: 0.5,
            extinction: 0.02,
            detail_scale: 300.0,
            detail_strength: 0.7,
            ..plain.clone()
        },
        CloudModel { coverage: 0.3, ..plain },
    ] {
        app.insert_resource(model);
        run_updates(&mut app, 1);
        let sky = sky(&app);
        for _ in 0..40 {
            let a = eye(&mut rng);
            let b = a + direction(&mut rng, -0.3..0.3) * 10_f64.powf(rng.random_range(2.0..4.0));
            let twin = LocalModel::new(sky.model(), sky.layers(), 0.0, a, Planet::default(), sky.textures()).unwrap();
            let length = (b - a).length();
            let steps = (length / 0.5) as u32;
            let at = |k: u32| twin.local(a.lerp(b, (f64::from(k) + 0.5) / f64::from(steps)));
            let sum: f64 = (0..steps).map(|k| twin.sample_medium(at(k), 0.0).extinction).sum();
            let exact = sum * length / f64::from(steps);
            let depth = sky.optical_depth(a, b);
            worst = worst.max((sky.transmittance(a, b) - (-exact).exp()).abs());
            share = share.max((depth - exact).abs() / exact.max(0.5));
            all.push((-exact).exp());
        }
    }
    println!("{:?} clear, dimmed, dark; transmittance off by {worst:.6}, depth by {share:.6} of it", spread(&all));
    assert!(spread(&all).iter().all(|n| *n > 10), "{:?}", spread(&all));
    assert!(worst < 1e-3, "transmittance off by {worst}");
    assert!(share < 2e-3, "optical depth off by {share} of it");
}
