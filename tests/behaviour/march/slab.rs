//! A uniform slab through the unchanged renderer: a model of one's own, and answers in closed form to test against.
//! `slab_settings` turns on, one by one, what is off here.
//!
//! What is drawn is stored as f16. A device may round or cut (Mesa's software driver cuts): up to 2⁻¹⁰ = 9.8e-4 of the
//! value.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{Sky, cloud_pixels, new_clouds_app, spawn_sun, spawn_view, until_drawn},
    gpu::{assert_shaders_compile, run_until, run_updates},
    slab::{
        BOTTOM, LEAST, SIZE, STORED, TOP, directions, exact_march, full_radiance, gathered, length_in_slab, looking,
        plain_light, seen_from, slab_app, spans,
    },
    uniform_slab::slab_text,
};

/// The viewpoints of the tests: below, inside and above the slab.
const VIEWPOINTS: [(f32, f32); 9] = [
    (10.0, -20.0),
    (10.0, 70.0),
    (10.0, 30.0),
    (1900.0, 60.0),
    (1900.0, 0.0),
    (1900.0, -50.0),
    (6000.0, -80.0),
    (6000.0, -10.0),
    (300_000.0, -70.0),
];

/// What rays through the slab were found to be.
#[derive(Default, Debug)]
struct Found {
    clear: u32,
    thin: u32,
    thick: u32,
    twice: u32,
    worst: f64,
}

fn check_unshadowed(extinction: f64, viewpoints: &[(f32, f32)]) -> Found {
    const STEP: f64 = 170.0;
    let (mut app, view) = slab_app(extinction, Vec3::new(0.3, 1.0, 0.2));
    app.insert_resource(exact_march(STEP as f32));
    until_drawn(&mut app);
    let mut found = Found::default();
    for viewpoint in viewpoints {
        for (seen, ray) in seen_from(&mut app, &view, *viewpoint) {
            let (length, slack) = length_in_slab(viewpoint.0.into(), ray.y);
            let exact = (-extinction * length).exp();
            match length {
                0.0 => found.clear += 1,
                _ if exact > 0.3 => found.thin += 1,
                _ => found.thick += 1,
            }
            found.twice += u32::from(spans(viewpoint.0.into(), ray.y).len() == 2);
            // 1e-7 a step: f32 multiplies that many.
            let allowed = exact * (STORED + extinction * slack + 1e-7 * length / STEP) + LEAST;
            let error = (f64::from(seen.w) - exact).abs();
            found.worst = found.worst.max(error / allowed);
            assert!(error <= allowed, "{viewpoint:?} {ray}: T = {}, not {exact} ± {allowed:e}", seen.w);
            for (channel, value) in seen.xyz().to_array().into_iter().enumerate() {
                let full = full_radiance(channel);
                let exact_light = full * (1.0 - exact);
                let allowed = STORED * exact_light + full * (exact * extinction * slack + 2e-6);
                let error = (f64::from(value) - exact_light).abs();
                assert!(error <= allowed, "{viewpoint:?} {ray}: {value} cd/m², not {exact_light} ± {allowed}");
            }
        }
    }
    println!("slab, σt {extinction}, worst as a share of the allowed: {found:?}");
    found
}

#[test]
fn transmittance_and_unshadowed_light_are_exact() {
    let found = check_unshadowed(4e-4, &VIEWPOINTS);
    assert!(found.clear > 10 && found.thin > 50 && found.thick > 50, "{found:?}");
    // Thin enough to see through both crossings of a ray that dips below the slab and comes out again.
    let found = check_unshadowed(4e-6, &[(1900.0, -0.8), (4000.0, -1.65), (300_000.0, -17.2277)]);
    assert!(found.twice >= 10 && found.thin > 100, "{found:?}");
}

/// Of sunlight that is scattered once.
fn single_scattering(height: f64, ray: DVec3, sun: DVec3, extinction: f64) -> f64 {
    gathered(height, ray, sun, extinction, |depth| (-depth).exp())
}

#[test]
fn shadowed_light_is_the_integral_along_the_curved_shell() {
    let sun = Vec3::new(0.5, 1.0, -0.3).normalize();
    // Optical depth towards the sun, straight through the slab: 0.35 and 2.3.
    for extinction in [3e-4, 2e-3] {
        let (mut app, view) = slab_app(extinction, sun);
        // The longest way to the sun is 1000 m over the sun's height, some more for points that see it lower.
        let light_step = (1000.0 / f64::from(sun.y) * 1.06 / 64.0) as f32;
        let step = 40.0_f32;
        app.insert_resource(CloudQuality { light_steps: 64, light_step, ..exact_march(step) });
        until_drawn(&mut app);
        // A light step counts whole or not at all: the depth is off by at most half a step. And the shadow changes within
        // a step of the view by its second derivative: (σt · step)² / 24, for a ray that runs along the sun's.
        let depth = extinction * f64::from(light_step) / 2.0;
        let tolerance = STORED + depth.exp_m1() + (2.0 * extinction * f64::from(step)).powi(2) / 24.0;
        let (mut worst, mut mean, mut count) = (0.0_f64, 0.0, 0);
        for viewpoint in [(10.0, 60.0), (10.0, 25.0), (1900.0, 50.0), (1900.0, -40.0), (6000.0, -75.0), (6000.0, -35.0)]
        {
            for (seen, ray) in seen_from(&mut app, &view, viewpoint) {
                let share = single_scattering(viewpoint.0.into(), ray, sun.as_dvec3(), extinction);
                let length = length_in_slab(viewpoint.0.into(), ray.y).0;
                if length == 0.0 {
                    assert_eq!(seen, Vec4::W, "{viewpoint:?} {ray}");
                    continue;
                }
                for (channel, value) in seen.xyz().to_array().into_iter().enumerate() {
                    let exact = full_radiance(channel) * share;
                    let error = f64::from(value) / exact - 1.0;
                    worst = worst.max(error.abs());
                    mean += error;
                    count += 1;
                    assert!(
                        error.abs() <= tolerance,
                        "σt {extinction}, {viewpoint:?} {ray}: {value} cd/m², not {exact} ± {:.2} %",
                        100.0 * tolerance
                    );
                }
            }
        }
        mean /= f64::from(count);
        println!("slab, σt {extinction}: worst {worst:.2e}, mean {mean:.2e}, allowed {tolerance:.2e}, {count} values");
        assert!(count > 600, "only {count} values");
        // Half steps too many and too few cancel: only what f16 cuts off is left.
        assert!(mean.abs() < 0.5 * STORED + 0.1 * tolerance, "{mean:e} on average");
    }
}

#[test]
fn long_steps_keep_energy_only_where_they_are_integrated() {
    let extinction = 0.01;
    let step = 300.0;
    let (mut app, view) = slab_app(extinction, Vec3::Y);
    app.insert_resource(exact_march(step));
    until_drawn(&mut app);
    let viewpoint = (10.0, 75.0);
    let rays = seen_from(&mut app, &view, viewpoint);
    app.insert_resource(CloudQuality { integration: Integration::Naive, ..exact_march(step) });
    run_updates(&mut app, 1);
    for ((conserving, ray), naive) in rays.into_iter().zip(cloud_pixels(&app, &view)) {
        let (length, _) = length_in_slab(viewpoint.0.into(), ray.y);
        // Σ Tᵢ₊₁ σt Δᵢ, with the last step cut at the slab's end.
        let (mut too_dark, mut start) = (0.0, 0.0);
        while start < length {
            let dt = f64::from(step).min(length - start);
            start += dt;
            too_dark += (-extinction * start).exp() * extinction * dt;
        }
        let exact = 1.0 - (-extinction * length).exp();
        for channel in 0..3 {
            let share = |pixel: Vec4| f64::from(pixel[channel]) / full_radiance(channel);
            let (found, naive) = (share(conserving), share(naive));
            assert!((found / exact - 1.0).abs() < 2e-3, "{ray}: {found}, not {exact}");
            assert!((naive / too_dark - 1.0).abs() < 2e-3, "{ray}: {naive}, not {too_dark}");
            // σt Δ e^(−σt Δ) / (1 − e^(−σt Δ)) = 0.157 of the light that there is.
            assert!(naive < 0.2 * exact, "{ray}: {naive} is not too dark");
        }
    }
}

#[test]
fn a_model_may_come_after_the_plugin_and_change() {
    let mut app = new_clouds_app();
    app.insert_resource(plain_light()).insert_resource(exact_march(170.0));
    spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_view(&mut app, SIZE, looking(10.0, 60.0), Sky::Black);
    let matches = |app: &App, extinction: f64| {
        let rays = directions(&looking(10.0, 60.0));
        cloud_pixels(app, &view).iter().zip(rays).all(|(seen, ray)| {
            let exact = (-extinction * length_in_slab(10.0, ray.y).0).exp();
            (f64::from(seen.w) / exact - 1.0).abs() < 2e-3
        })
    };
    for extinction in [4e-4, 9e-4] {
        // At once the first time, before the built-in model has loaded.
        app.insert_resource(slab_text(BOTTOM as f32, TOP as f32, extinction as f32));
        run_until(&mut app, &format!("the slab of {extinction}/m is drawn"), 60, |app| {
            assert_shaders_compile(app);
            app.world().resource::<CloudStatus>().is_ready() && matches(app, extinction)
        });
        // And it stays.
        run_updates(&mut app, 4);
        assert!(matches(&app, extinction), "the slab of {extinction}/m is gone again");
    }
}
