//! The shaders' maths against the CPU's, over many random inputs.
//!
//! Inputs are f32 and taken as exact, so what is compared is the arithmetic. `U` is the unit roundoff of f32: an exact
//! operation, rounded, is wrong by one U relatively; WGSL allows a division or square root about five.

use bevy::{
    app::App,
    math::{DVec2, DVec3, Vec3},
};
use bevy_cumulus::reference::{
    integrate::{mean_transmittance, step_energy_conserving, step_naive},
    planet::{PLANET_RADIUS, altitude, map_position},
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::support::{
    evaluate::{COUNT, R, U, on_gpu, worst},
    gpu::shader_app,
};

#[test]
fn altitude_is_within_two_centimetres_up_to_60_km_away() {
    let mut rng = StdRng::seed_from_u64(1);
    let points: Vec<[f32; 3]> = (0..COUNT)
        .map(|_| {
            let camera: f32 = rng.random_range(-100.0..30_000.0);
            let away = loop {
                let p = Vec3::from_array([(); 3].map(|()| rng.random_range(-60_000.0..60_000.0)));
                if p.length() < 60_000.0 {
                    break p;
                }
            };
            [away.x, camera + away.y, away.z]
        })
        .collect();
    let found = altitudes_on_gpu(&mut shader_app(), &points);
    let error = |(p, [h]): (&[f32; 3], &[f32; 1])| ((altitude(double(*p), PLANET_RADIUS) - f64::from(*h)).abs(), *p);
    let (error, p) = worst(points.iter().zip(&found).map(error));
    println!("altitude: worst {error} m at {p:?}");
    assert!(error < 0.02, "{error} m at {p:?}");
}

#[test]
fn altitude_stays_good_a_thousand_kilometres_away_and_finite_everywhere() {
    let mut rng = StdRng::seed_from_u64(2);
    let mut points: Vec<[f32; 3]> =
        (0..COUNT).map(|_| [1e6, 3e5, 1e6].map(|size: f32| rng.random_range(-size..size))).collect();
    points.extend([[0.0; 3], [0.0, -R, 0.0], [0.0, -2.0 * R, 0.0], [0.0, -3.0 * R, 1.0], [5e7, 1e8, 1.0]]);
    let found = altitudes_on_gpu(&mut shader_app(), &points);
    for (p, [h]) in points.iter().zip(found) {
        let exact = altitude(double(*p), PLANET_RADIUS);
        // One rounding of y and of the lift, each at most |y| + |h| in size, and the lift's own eight.
        let lift = exact - f64::from(p[1]);
        let allowed = 2.0 * U * (exact.abs() + f64::from(p[1]).abs()) + 8.0 * U * lift.abs();
        // Behind the planet's centre the distance to it is what gets rounded.
        let allowed = if p[1] <= -R { allowed.max(2.0) } else { allowed };
        assert!((exact - f64::from(h)).abs() <= allowed, "{h} m, not {exact} m, at {p:?}");
    }
}

fn altitudes_on_gpu(app: &mut App, points: &[[f32; 3]]) -> Vec<[f32; 1]> {
    on_gpu(
        app,
        "import bevy_cumulus::model::planet::altitude;",
        &format!("results[o] = altitude(vec3<f32>(values[i], values[i + 1u], values[i + 2u]), {R});"),
        points,
    )
}

fn double(p: [f32; 3]) -> DVec3 {
    Vec3::from_array(p).as_dvec3()
}

#[test]
fn map_coordinates_agree_with_the_reference() {
    let mut rng = StdRng::seed_from_u64(4);
    let mut points: Vec<[f32; 3]> = (0..COUNT)
        .map(|k| {
            let size = [100.0_f32, 60_000.0, 1e6, 6e6][k % 4];
            // Both sides of where the polynomial gives way to half angles.
            let x = if k % 40 == 3 { 0.2 * R } else { rng.random_range(-size..size) };
            let z = if k % 40 == 3 { rng.random_range(-10.0..10.0) } else { rng.random_range(-size..size) };
            [x, rng.random_range(-size.min(3e4)..3e4), z]
        })
        .collect();
    points.extend([[0.0, 2000.0, 0.0], [1e-20, 0.0, 0.0], [0.0, -R, 0.0], [0.0, -3.0 * R, 0.0], [0.0, -R, 1.0]]);
    points.extend([[-3.0 * R, -1.5 * R, 4.0], [0.0, -1.9 * R, 6e6]]);
    let found: Vec<[f32; 2]> = on_gpu(
        &mut shader_app(),
        "import bevy_cumulus::model::planet::map_position;",
        &format!(
            "let found = map_position(vec3<f32>(values[i], values[i + 1u], values[i + 2u]), {R});
    results[o] = found.x;
    results[o + 1u] = found.y;"
        ),
        &points,
    );
    let (error, p) = worst(points.iter().zip(&found).map(|(p, [x, z])| {
        let exact = map_position(double(*p), PLANET_RADIUS);
        let error = (exact - DVec2::new((*x).into(), (*z).into())).length();
        // Over the horizon's edge the polynomial's first missing term shows: 1.3e-5 at most.
        let beyond = if p[1] < -R { 0.05 } else { 1.0 };
        (beyond * error / exact.length().max(1e-3), *p)
    }));
    println!("map position: worst {error} of its length, at {p:?}");
    // Some 16 roundings, divisions and roots among them: 1 m at 1000 km.
    assert!(error < 1e-6, "{error} of its length, at {p:?}");
}

#[test]
fn a_step_of_the_march_agrees_with_the_reference() {
    let mut rng = StdRng::seed_from_u64(5);
    let mut steps: Vec<[f32; 3]> = (0..COUNT)
        .map(|_| {
            let depth = 10_f64.powf(rng.random_range(-12.0..2.0));
            let dt: f32 = rng.random_range(0.5..5000.0);
            [rng.random_range(0.0..1e5), (depth / f64::from(dt)) as f32, dt]
        })
        .collect();
    steps.extend([[3.0, 0.0, 90.0], [0.0, 0.1, 90.0], [1.0, 1.0, 1e4], [1.0, 0.5, 1.0], [1.0, 0.499_999_97, 1.0]]);
    let found: Vec<[f32; 3]> = on_gpu(
        &mut shader_app(),
        "import bevy_cumulus::render::march::integrate::{step_energy_conserving, step_naive};",
        "let source = values[i] * vec3<f32>(1.0, 0.5, 0.25);
    let step = step_energy_conserving(source, values[i + 1u], values[i + 2u]);
    results[o] = step.x;
    results[o + 1u] = step.z;
    results[o + 2u] = step_naive(source, values[i + 1u], values[i + 2u]).y;",
        &steps,
    );
    for (step, found) in steps.iter().zip(&found) {
        let [source, sigma_t, dt] = step.map(f64::from);
        let exact = step_energy_conserving(source * DVec3::new(1.0, 0.5, 0.25), sigma_t, dt);
        // WGSL allows exp(−x) 3 + 2x units of 2 U; 1 − exp(−x) divides that by at least 0.39.
        let allowed = 2e-6 * exact;
        assert!((f64::from(found[0]) - exact.x).abs() <= allowed.x, "{step:?}: {found:?}, not {exact}");
        assert!((f64::from(found[1]) - exact.z).abs() <= allowed.z, "{step:?}: {found:?}, not {exact}");
        let naive = step_naive(source * DVec3::new(1.0, 0.5, 0.25), sigma_t, dt).y;
        // exp(−x) is off by up to (3 + 2x)·2 U of itself; its x by half a unit, and what is under f32's least is 0.
        let allowed = naive * U * (12.0 + 6.0 * sigma_t * dt) + f64::from(f32::MIN_POSITIVE) * (1.0 + source * dt);
        assert!((f64::from(found[2]) - naive).abs() <= allowed, "{step:?}: {found:?}, not {naive}");
    }
    assert!(mean_transmittance(1e-30) == 1.0);
}
