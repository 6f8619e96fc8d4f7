//! How many steps the march takes, and that what it leaves out is not missed.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{View, cloud_pixels, new_clouds_app, spawn_sun, until_drawn},
    gpu::run_updates,
    scene::{exact, settle, spawn_linear, steps},
    shared::SharedApp,
    slab::{exact_march, slab_app},
};

const SIZE: UVec2 = UVec2::new(24, 14);

fn mean(values: impl Iterator<Item = f32> + Clone) -> f32 {
    values.clone().sum::<f32>() / values.count().max(1) as f32
}

/// The built-in clouds from the ground, each step where it always is.
fn built_in() -> (SharedApp, View) {
    // A map whose texels are not as wide as the gaps between clouds: else nothing is known to be empty.
    let textures = CloudTextures { volume_size: 32, map_size: 512, ..default() };
    let mut app = SharedApp::with_textures("clouds of a larger map", textures, new_clouds_app);
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()));
    let view = spawn_linear(&mut app, SIZE, up);
    until_drawn(&mut app);
    settle(&mut app);
    (app, view)
}

fn seen_with(app: &mut App, view: &View, quality: CloudQuality) -> Vec<Vec4> {
    app.insert_resource(quality);
    run_updates(app, 2);
    cloud_pixels(app, view)
}

#[test]
fn long_steps_through_empty_air_miss_nothing() {
    let (mut app, view) = built_in();
    // Small steps fall on the same places, whether or not long ones come between.
    let quality = |long_step| CloudQuality { long_step, step: 60.0, step_growth: 0.0, ..exact(MarchResolution::Full) };
    for coverage in [0.0, -0.5, -1.0] {
        app.world_mut().resource_mut::<CloudModel>().coverage = coverage;
        let uniform = seen_with(&mut app, &view, quality(1));
        let uniform_steps = steps(&mut app, &view);
        let adaptive = seen_with(&mut app, &view, quality(4));
        let adaptive_steps = steps(&mut app, &view);
        for (k, (a, b)) in uniform.iter().zip(&adaptive).enumerate() {
            // The last place of f16, though the same is added up.
            assert!((a.w - b.w).abs() <= 1e-3, "{coverage}, pixel {k}: {} and {} pass", a.w, b.w);
            assert!((a.xyz() - b.xyz()).abs().max_element() <= 1e-3 * a.xyz().max_element(), "pixel {k}: {a} and {b}");
        }
        let is_open = |p: &Vec4| p.w > 0.999;
        let (open, cloudy) = (uniform.iter().filter(|p| is_open(p)), uniform.iter().filter(|p| p.w < 0.5));
        let (open, cloudy) = (open.count(), cloudy.count());
        let of_open = |steps: &[f32]| mean(uniform.iter().zip(steps).filter(|(p, _)| is_open(p)).map(|(_, n)| *n));
        let ratio = of_open(&adaptive_steps) / of_open(&uniform_steps);
        println!("coverage {coverage}: {open} open pixels, where {ratio} of the steps are left; {cloudy} cloudy ones");
        assert!(open > 20 && (coverage < 0.0 || cloudy > 20), "{coverage}: {open} open and {cloudy} cloudy pixels");
        // Where a model's bound sees what its noise takes away, asking costs a step in four; in a clear sky the long step
        // is four small ones.
        let most = match coverage {
            0.0 => 1.26,
            -0.5 => 1.0,
            _ => 0.27,
        };
        assert!((0.245..most).contains(&ratio), "coverage {coverage}: {ratio} of the steps are left in open sky");
    }
}

#[test]
fn growing_steps_change_little_with_long_ones() {
    let (mut app, view) = built_in();
    // Here small steps fall elsewhere: they are as long as the first of their block.
    let quality = |long_step| CloudQuality { long_step, step: 40.0, ..exact(MarchResolution::Full) };
    let [uniform, adaptive] = [1, 4].map(|long_step| seen_with(&mut app, &view, quality(long_step)));
    let bright = |pixels: &[Vec4]| mean(pixels.iter().map(|p| p.y));
    let through = |pixels: &[Vec4]| mean(pixels.iter().map(|p| p.w));
    let (brighter, clearer) = (bright(&adaptive) / bright(&uniform) - 1.0, through(&adaptive) - through(&uniform));
    let apart = mean(uniform.iter().zip(&adaptive).map(|(a, b)| (a.w - b.w).abs()));
    println!("brighter by {brighter}, clearer by {clearer}, {apart} apart in the mean");
    // The march's own noise, several times over: a step of 60 m for one of 40 is as far from it.
    assert!(brighter.abs() < 2e-3 && clearer.abs() < 2e-3 && apart < 2e-3);
}

#[test]
fn no_ray_takes_more_steps_than_it_may() {
    let (mut app, _) = slab_app(1e-3, Vec3::Y);
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(60_f32.to_radians()));
    let view = spawn_linear(&mut app, UVec2::new(8, 6), up);
    until_drawn(&mut app);
    for long_step in [1, 4] {
        let [free, bound] = [512, 20].map(|max_steps| {
            app.insert_resource(CloudQuality { long_step, max_steps, ..exact_march(20.0) });
            run_updates(&mut app, 2);
            steps(&mut app, &view)
        });
        for (k, (free, bound)) in free.iter().zip(&bound).enumerate() {
            // The last block is finished.
            let most = (20 + long_step + 1) as f32;
            assert!(*bound <= most + 0.5, "long step {long_step}, ray {k}: {bound} steps");
            assert!(*free > 2.0 * most, "long step {long_step}, ray {k}: only {free} steps if it may take any");
        }
    }
}

#[test]
fn the_stop_saves_steps() {
    const EXTINCTION: f32 = 4e-3;
    const STOP: f32 = 0.075;
    let (mut app, _) = slab_app(EXTINCTION.into(), Vec3::Y);
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(45_f32.to_radians()));
    let view = spawn_linear(&mut app, UVec2::new(8, 6), up);
    until_drawn(&mut app);
    let [without, with] = [0.0, STOP].map(|transmittance_stop| {
        app.insert_resource(CloudQuality { transmittance_stop, max_steps: 512, long_step: 1, ..exact_march(20.0) });
        run_updates(&mut app, 2);
        steps(&mut app, &view)
    });
    let expected = (-STOP.ln() / (EXTINCTION * 20.0)).ceil();
    for (k, (with, without)) in with.iter().zip(&without).enumerate() {
        assert!((with - expected).abs() < 0.5, "ray {k}: {with} steps, not {expected}, of {without}");
        assert!(*without > 1.4 * expected, "ray {k}: only {without} steps without the stop");
    }
}
