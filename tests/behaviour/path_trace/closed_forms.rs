//! The path tracer against answers from outside: closed forms, Chandrasekhar's H, and adding–doubling in f64.

use std::f64::consts::PI;

use bevy::{light::light_consts::lux, prelude::*};
use bevy_cumulus::{
    CloudNoise,
    prelude::*,
    reference::phase::{HgDraine, Phase, hg, schlick_k},
};

use crate::support::{
    adding_doubling::{Slab, gauss, h_function, moments},
    app::{Sky, cloud_pixels, read_image, spawn_sun, spawn_view},
    gpu::{run_compute, run_updates, shader_app},
    path_trace::{
        SKY, THICKNESS, assert_near, frames, light_from, mean, noise, sky_light, slab, spawn_pinhole, sun_light,
        traced_app,
    },
    scene::{settle, spawn_box},
};

#[test]
fn transmittance_and_single_scattering_are_the_closed_forms() {
    // So little albedo in the first channel that second scattering is a thousandth of the first; the third keeps the
    // paths alive.
    let (depth, albedo, mu_sun) = (0.8, 1e-3, 0.9);
    for mu in [0.4, 0.7, -0.5] {
        let mut app = traced_app(Some(slab(depth, [albedo, albedo, 1.0])), sun_light(PhaseFunction::HenyeyGreenstein));
        let light = light_from(mu_sun);
        spawn_sun(&mut app, light);
        let view = spawn_pinhole(&mut app, UVec2::new(96, 64), mu);
        let [r, _, _, a] = mean(&mut app, &view, 24);
        assert_near(a, (-depth / mu.abs()).exp(), 0.01, "transmittance");
        let cosine = mu * mu_sun;
        let g = f64::from(CloudLighting::default().g);
        let sun = f64::from(lux::RAW_SUNLIGHT) * albedo * hg(g, cosine);
        // Integrals of e^(−t/μ0) e^(−…/μ) over the slab, seen from below and from above.
        let integral = if mu > 0.0 {
            mu_sun / (mu_sun - mu) * ((-depth / mu_sun).exp() - (-depth / mu).exp())
        } else {
            mu_sun / (mu_sun - mu) * (1.0 - (-depth * (1.0 / mu_sun - 1.0 / mu)).exp())
        };
        assert_near(r, sun * integral, 0.01, &format!("single scattering at μ = {mu}"));
    }
}

#[test]
fn clouds_merge_with_the_background_as_in_the_march() {
    let (depth, end, start) = (6.0, 700.0, 0.2);
    let mut app = traced_app(Some(slab(depth, [0.9; 3])), sun_light(PhaseFunction::Isotropic));
    app.world_mut().resource_mut::<CloudLighting>().fade_start = start as f32;
    app.world_mut().resource_mut::<CloudQuality>().max_distance = end as f32;
    spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_pinhole(&mut app, UVec2::new(96, 64), 1.0);
    // From 20 m on; what is lost of the light behind, by how much of it is shown.
    let (steps, extinction) = (20_000, depth / THICKNESS);
    let dt = (end - 20.0) / f64::from(steps);
    let opacity: f64 = (0..steps)
        .map(|k| {
            let t = (f64::from(k) + 0.5) * dt;
            let u = ((t + 20.0 - start * end) / (end - start * end)).clamp(0.0, 1.0);
            extinction * dt * (-extinction * t).exp() * (1.0 - u * u * (3.0 - 2.0 * u))
        })
        .sum();
    let [.., traced] = mean(&mut app, &view, 40);
    assert_near(1.0 - traced, opacity, 0.01, "path-traced opacity");
    let fine = CloudQuality {
        step: 4.0,
        step_growth: 0.0,
        max_steps: 1000,
        transmittance_stop: 0.0,
        offsets: false,
        ..default()
    };
    app.insert_resource(CloudQuality { temporal: TemporalMode::Off, max_distance: end as f32, ..fine });
    let [.., marched] = mean(&mut app, &view, 2);
    assert_near(1.0 - marched, opacity, 0.01, "marched opacity");
}

#[test]
fn paths_end_at_the_scene_with_any_number_of_samples() {
    let depth = 3.0;
    let mut app = traced_app(Some(slab(depth, [0.9; 3])), sun_light(PhaseFunction::Isotropic));
    spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_pinhole(&mut app, UVec2::new(96, 64), 1.0);
    let within = Transform::from_xyz(0.0, 1500.5, 0.0);
    let board = spawn_box(&mut app, Vec3::new(40.0, 1.0, 40.0), within, Vec3::ONE);
    for msaa in [Msaa::Off, Msaa::Sample4] {
        app.world_mut().entity_mut(view.camera).insert(msaa);
        for (visibility, seen) in [(Visibility::Hidden, 1.0), (Visibility::Visible, 0.5)] {
            app.world_mut().entity_mut(board).insert(visibility);
            settle(&mut app);
            let [light, .., through] = mean(&mut app, &view, 24);
            assert_near(through, (-depth * seen).exp(), 0.01, &format!("transmittance, {msaa:?}, {seen} of the slab"));
            assert!(light > 0.0, "no light with {msaa:?}");
        }
    }
}

#[test]
fn in_a_white_furnace_clouds_vanish() {
    let lighting = CloudLighting { ground_albedo: Vec3::ONE, ..sky_light(PhaseFunction::HgDraine) };
    let mut app = traced_app(None, lighting);
    app.insert_resource(CloudModel { albedo: Vec3::ONE, coverage: 0.3, ..default() });
    spawn_sun(&mut app, Vec3::NEG_Y);
    for pitch in [25.0_f32, -60.0] {
        let height = if pitch > 0.0 { 10.0 } else { 5000.0 };
        let looking = Transform::from_xyz(0.0, height, 0.0).with_rotation(Quat::from_rotation_x(pitch.to_radians()));
        let view = spawn_view(&mut app, UVec2::new(32, 18), looking, Sky::Black);
        let [r, g, b, a] = mean(&mut app, &view, 4);
        assert!(a < 0.9, "hardly any cloud is seen: {a}");
        for channel in [r, g, b] {
            assert_near(channel / SKY + a, 1.0, 1e-3, "the furnace");
        }
        app.world_mut().entity_mut(view.camera).despawn();
    }
}

#[test]
fn a_half_space_reflects_as_chandrasekhar_says() {
    let albedo = [0.5, 0.9, 0.99];
    // τ = 80 is deep enough: at albedo .99 light dies out over six mean free paths.
    for mu in [0.2, 0.6, 1.0] {
        let mut app = traced_app(Some(slab(80.0, albedo)), sky_light(PhaseFunction::Isotropic));
        spawn_sun(&mut app, Vec3::NEG_Y);
        let view = spawn_pinhole(&mut app, UVec2::new(128, 96), -mu);
        let found = mean(&mut app, &view, frames(24));
        for (found, albedo) in found.into_iter().zip(albedo) {
            let plane_albedo = 1.0 - (1.0 - albedo).sqrt() * h_function(albedo)(mu);
            assert_near(found / SKY, plane_albedo, noise(), &format!("sky, albedo {albedo}, μ {mu}"));
        }
    }
    for mu_sun in [0.3, 0.8] {
        let mut app = traced_app(Some(slab(80.0, albedo)), sun_light(PhaseFunction::Isotropic));
        spawn_sun(&mut app, light_from(mu_sun));
        let mu = 0.7;
        let view = spawn_pinhole(&mut app, UVec2::new(96, 64), -mu);
        let found = mean(&mut app, &view, frames(24));
        for (found, albedo) in found.into_iter().zip(albedo) {
            let h = h_function(albedo);
            let factor = albedo / (4.0 * PI) * mu_sun / (mu + mu_sun) * h(mu) * h(mu_sun);
            let expected = f64::from(lux::RAW_SUNLIGHT) * factor;
            assert_near(found, expected, noise(), &format!("sun at {mu_sun}, albedo {albedo}"));
        }
    }
}

#[test]
fn adding_reproduces_chandrasekhar_first() {
    for albedo in [0.5, 0.9, 0.99] {
        for mu in [0.05, 0.2, 0.6, 1.0] {
            let slab = Slab::new(200.0, albedo, &[1.0], 32, mu);
            let exact = 1.0 - (1.0 - albedo).sqrt() * h_function(albedo)(mu);
            assert_near(slab.sky_reflected(), exact, 1e-4, &format!("albedo {albedo}, μ {mu}"));
        }
    }
    // Nothing is lost where nothing is absorbed.
    let slab = Slab::new(3.0, 1.0, &moments(48, |x| hg(0.75, x)), 24, 0.4);
    let all = slab.sky_reflected() + slab.sky_scattered_through() + (-3.0_f64 / 0.4).exp();
    assert_near(all, 1.0, 1e-4, "energy");
}

#[test]
fn finite_slabs_reflect_and_transmit_as_adding_says() {
    let albedo = [0.6, 0.9, 0.999];
    for (phase, g) in [(PhaseFunction::Isotropic, 0.0), (PhaseFunction::HenyeyGreenstein, 0.8)] {
        let moments = moments(48, |x| hg(g, x));
        for depth in [0.7, 4.0] {
            let mu = 0.7;
            let slabs = albedo.map(|albedo| Slab::new(depth, albedo, &moments, 24, mu));
            for up in [1.0, -1.0] {
                let mut app = traced_app(Some(slab(depth, albedo)), sky_light(phase));
                spawn_sun(&mut app, Vec3::NEG_Y);
                let view = spawn_pinhole(&mut app, UVec2::new(128, 96), up * mu);
                // Little comes through the thick one at the least albedo: one path in seventy.
                let count = if depth > 1.0 && up > 0.0 { 192 } else { 32 };
                let found = mean(&mut app, &view, frames(count));
                for (found, slab) in found.into_iter().zip(&slabs) {
                    let side = if up > 0.0 { slab.sky_scattered_through() } else { slab.sky_reflected() };
                    assert_near(found / SKY, side, noise(), &format!("{phase:?}, τ {depth}, μ {}", up * mu));
                }
            }
        }
    }
}

/// The narrow peak of the droplets' phase function is followed from the sun backwards: as much light must arrive.
#[test]
fn sunlight_through_droplets_is_what_adding_says() {
    let diameter = 5.0;
    let droplets = HgDraine::from_diameter(diameter).unwrap();
    // The peak of the smallest droplets, the widest there is, needs 400 moments.
    let n = 200;
    let moments = moments(2 * n, |x| droplets.value(x));
    let (depth, albedo) = (3.0, [0.8, 0.95, 0.999]);
    let mu = 0.75;
    let slabs = albedo.map(|albedo| Slab::new(depth, albedo, &moments, n, mu));
    for up in [1.0, -1.0] {
        let lighting = CloudLighting { droplet_diameter: diameter as f32, ..sun_light(PhaseFunction::HgDraine) };
        let mut app = traced_app(Some(slab(depth, albedo)), lighting);
        spawn_sun(&mut app, light_from(mu));
        let view = spawn_pinhole(&mut app, UVec2::new(128, 96), up);
        let found = mean(&mut app, &view, frames(160));
        for (found, slab) in found.into_iter().zip(&slabs) {
            let [above, below] = slab.sun_seen_vertically();
            let expected = f64::from(lux::RAW_SUNLIGHT) * if up > 0.0 { below } else { above };
            assert_near(found, expected, noise(), &format!("sun through droplets, looking {up}"));
        }
    }
}

#[test]
fn directions_follow_the_phase_function() {
    const COUNT: usize = 1 << 16;
    let mut app = shader_app();
    let draine = Phase::HgDraine(HgDraine::from_diameter(12.0).unwrap());
    let phases = [
        Phase::Isotropic,
        Phase::HenyeyGreenstein { g: 0.85 },
        Phase::HenyeyGreenstein { g: -0.4 },
        Phase::TwoLobe { g: 0.8, g_back: -0.3, mix: 0.3 },
        draine,
        Phase::Rayleigh,
        Phase::CornetteShanks { g: 0.7 },
        Phase::Schlick { k: schlick_k(0.75) },
        Phase::Schlick { k: -0.4 },
    ];
    for phase in phases {
        let (kind, params) = phase.shader_parameters();
        let [x, y, z, w] = params;
        let source = format!(
            "import bevy_cumulus::reference::path_tracer::{{rng::{{Rng, random, seed_rng}},
                scatter::{{narrow_share, scatter_narrow, scatter_broad}}}};
            @group(0) @binding(0) var<storage, read> values: array<f32>;
            @group(0) @binding(1) var<storage, read_write> results: array<f32>;
            @compute @workgroup_size(64)
            fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                if id.x >= {COUNT}u {{ return; }}
                var rng = seed_rng(vec2(id.x & 255u, id.x >> 8u), 3u, 0u);
                let axis = normalize(vec3(values[0], values[1], values[2]));
                let params = vec4({x:?}, {y:?}, {z:?}, {w:?});
                var d: vec3<f32>;
                if random(&rng) < narrow_share({kind}u, params) {{
                    d = scatter_narrow(params, axis, &rng);
                }} else {{
                    d = scatter_broad({kind}u, params, axis, &rng);
                }}
                results[2u * id.x] = dot(d, axis);
                results[2u * id.x + 1u] = dot(d, normalize(cross(axis, vec3(0.3, 0.5, -0.9))));
            }}"
        );
        let found = run_compute(&mut app, &source, &[0.3, -0.8, 0.2], 2 * COUNT, COUNT as u32);
        let (cosines, sides): (Vec<f64>, Vec<f64>) =
            found.chunks_exact(2).map(|pair| (f64::from(pair[0]), f64::from(pair[1]))).unzip();
        for limit in [-0.8, -0.3, 0.2, 0.6, 0.9, 0.99, 0.9995] {
            let share = cosines.iter().filter(|c| **c < limit).count() as f64 / COUNT as f64;
            // The integral from the back, where all of them are smooth.
            let nodes = gauss(400);
            let density = |x: f64| 2.0 * PI * phase.value(x, 1.0);
            let exact: f64 = nodes.iter().map(|(x, w)| w * (limit + 1.0) * density(-1.0 + x * (limit + 1.0))).sum();
            let deviation = (exact * (1.0 - exact) / COUNT as f64).sqrt();
            assert!((share - exact).abs() < 4.5 * deviation + 1e-6, "{phase:?}: {share} below {limit}, not {exact}");
        }
        let mean = cosines.iter().sum::<f64>() / COUNT as f64;
        assert!((mean - phase.mean_cosine()).abs() < 4.5 / (COUNT as f64).sqrt(), "{phase:?}: mean cosine {mean}");
        // No azimuth is preferred.
        let lean = sides.iter().sum::<f64>() / COUNT as f64;
        assert!(lean.abs() < 4.5 / (COUNT as f64).sqrt(), "{phase:?} leans by {lean}");
    }
}

#[test]
fn random_numbers_are_uniform_and_streams_do_not_correlate() {
    const COUNT: usize = 1 << 15;
    let mut app = shader_app();
    let source = format!(
        "import bevy_cumulus::reference::path_tracer::rng::{{Rng, random, seed_rng}};
        @group(0) @binding(0) var<storage, read> values: array<f32>;
        @group(0) @binding(1) var<storage, read_write> results: array<f32>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
            if id.x >= {COUNT}u {{ return; }}
            var rng = seed_rng(vec2(id.x & 127u, id.x >> 7u), u32(values[0]), u32(values[1]));
            for (var k = 0u; k < 4u; k++) {{
                results[4u * id.x + k] = random(&rng);
            }}
        }}"
    );
    let draw = |app: &mut App, sample, seed| run_compute(app, &source, &[sample, seed], 4 * COUNT, COUNT as u32);
    let [frames, seeds] = [[[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]]
        .map(|pair| pair.map(|[sample, seed]| draw(&mut app, sample, seed)));
    let correlation = |a: &dyn Fn(usize) -> f32, b: &dyn Fn(usize) -> f32| -> f64 {
        (0..COUNT - 1).map(|i| (f64::from(a(i)) - 0.5) * (f64::from(b(i)) - 0.5)).sum::<f64>() / COUNT as f64 * 12.0
    };
    let bound = 4.5 / (COUNT as f64).sqrt();
    for values in &frames {
        assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
        let mut bins = [0_u32; 64];
        values.iter().for_each(|v| bins[(v * 64.0) as usize] += 1);
        let expected = values.len() as f64 / 64.0;
        let chi2: f64 = bins.iter().map(|n| (f64::from(*n) - expected).powi(2) / expected).sum();
        // 63 degrees of freedom: 25 to 120 holds all but one in 10⁵.
        assert!((25.0..120.0).contains(&chi2), "χ² = {chi2}");
        // Successive numbers, and the first numbers of neighbouring pixels.
        assert!(correlation(&|i| values[4 * i], &|i| values[4 * i + 1]).abs() < bound);
        assert!(correlation(&|i| values[4 * i], &|i| values[4 * i + 4]).abs() < bound);
    }
    assert!(correlation(&|i| frames[0][4 * i], &|i| frames[1][4 * i]).abs() < bound, "frames are alike");
    assert!(correlation(&|i| seeds[0][4 * i], &|i| seeds[1][4 * i]).abs() < bound, "seeds are alike");
}

#[test]
fn samples_add_up_while_nothing_moves_and_their_noise_is_known() {
    let mut app = traced_app(Some(slab(2.0, [0.99; 3])), sky_light(PhaseFunction::Isotropic));
    spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_pinhole(&mut app, UVec2::new(64, 48), 0.8);
    let noise = app.world_mut().resource_mut::<Assets<Image>>().add(CloudNoise::image(64, 48));
    app.world_mut().entity_mut(view.camera).insert(CloudNoise(noise.clone()));
    let [truth, ..] = mean(&mut app, &view, 200);
    let read = |app: &mut App, frames: u32| -> (Vec<f64>, Vec<[f32; 4]>) {
        mean(app, &view, frames);
        let pixels = cloud_pixels(app, &view).iter().map(|p| f64::from(p.x)).collect();
        (pixels, bytemuck::pod_collect_to_vec(&read_image(app, &noise)))
    };
    for frames in [16, 64] {
        let (pixels, noise) = read(&mut app, frames);
        assert!(noise.iter().all(|n| n[2] == frames as f32), "not {frames} samples: {}", noise[0][2]);
        assert!(noise.iter().all(|n| n[3] == 0.0), "something was lost");
        // Every pixel looks for the same value: their scatter is the error that each should report.
        let scatter = (pixels.iter().map(|p| (p - truth).powi(2)).sum::<f64>() / pixels.len() as f64).sqrt();
        let reported = (noise.iter().map(|n| f64::from(n[0]).powi(2)).sum::<f64>() / noise.len() as f64).sqrt();
        assert_near(reported, scatter, 0.05, "standard error");
    }
    // The smallest motion starts over.
    app.world_mut().get_mut::<Transform>(view.camera).unwrap().translation.x += 0.1;
    run_updates(&mut app, 3);
    let noise: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read_image(&app, &noise));
    assert_eq!(noise[0][2], 3.0, "motion does not start over");
}
