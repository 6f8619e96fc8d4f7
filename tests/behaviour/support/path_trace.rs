//! Uniform slabs before the path tracer: one direction, lit by the sun or by the sky alone.

use bevy::{light::light_consts::lux, math::DVec3, prelude::*};
use bevy_cumulus::prelude::*;

use super::{
    app::{Sky, View, cloud_pixels, new_clouds_app, spawn_view, until_drawn},
    full,
    gpu::run_updates,
    shared::SharedApp,
    uniform_slab::UniformSlab,
};

pub const BOTTOM: f64 = 1000.0;
pub const THICKNESS: f64 = 1000.0;

/// Radiance of the sky (cd/m²).
pub const SKY: f64 = 1000.0;

/// A uniform slab of this vertical optical depth; one albedo a colour channel.
pub fn slab(depth: f64, albedo: [f64; 3]) -> UniformSlab {
    mixed_slab(depth, albedo, [1.0, 0.0, 0.0, 0.0])
}

/// The same, with these shares of the phase functions.
pub fn mixed_slab(depth: f64, albedo: [f64; 3], phase: [f64; 4]) -> UniformSlab {
    let (bottom, top) = (BOTTOM as f32, (BOTTOM + THICKNESS) as f32);
    UniformSlab {
        albedo: DVec3::from_array(albedo).as_vec3(),
        phase: phase.map(|share| share as f32),
        ..UniformSlab::new(bottom, top, (depth / THICKNESS) as f32)
    }
}

/// Paths, a sky of radiance `sky` everywhere above, no ground bounce.
pub fn traced_app(slab: Option<UniformSlab>, lighting: CloudLighting) -> SharedApp {
    let mut app = match slab {
        Some(slab) => slab.traced_app(),
        None => SharedApp::only_one("path-traced clouds", new_clouds_app),
    };
    app.insert_resource(CloudQuality { max_distance: 2_000_000.0, ..CloudQuality::reference() });
    app.insert_resource(CloudLighting { fade_start: 1.0, aerial_perspective: 0.0, ..lighting });
    app
}

/// Light by the sky alone, under a sun overhead that gives none itself: without one in the scene there is no sky.
pub fn sky_light(phase: PhaseFunction) -> CloudLighting {
    let fallback = (SKY / f64::from(lux::RAW_SUNLIGHT)) as f32;
    CloudLighting {
        phase,
        sky_fallback: Vec3::splat(fallback),
        sun_strength: 0.0,
        ground_albedo: Vec3::ZERO,
        ..default()
    }
}

/// Light by the sun alone.
pub fn sun_light(phase: PhaseFunction) -> CloudLighting {
    CloudLighting { sky_fallback: Vec3::ZERO, sun_strength: 1.0, ..sky_light(phase) }
}

/// A camera that sees one direction: up by `mu`, the cosine to the vertical, from just outside the slab.
pub fn spawn_pinhole(app: &mut App, size: UVec2, mu: f64) -> View {
    let height = if mu > 0.0 { BOTTOM - 20.0 } else { BOTTOM + THICKNESS + 20.0 };
    let direction = DVec3::new((1.0 - mu * mu).max(0.0).sqrt(), mu, 0.0).as_vec3();
    let looking = Transform::from_xyz(0.0, height as f32, 0.0).looking_to(direction, Vec3::Z);
    let view = spawn_view(app, size, looking, Sky::Black);
    let narrow = PerspectiveProjection { fov: 0.002, ..default() };
    app.world_mut().entity_mut(view.camera).insert(Projection::Perspective(narrow));
    view
}

/// Mean radiance and transmittance after so many frames, one sample a pixel each.
pub fn mean(app: &mut App, view: &View, frames: u32) -> [f64; 4] {
    until_drawn(app);
    // A new start, so that as many samples are counted as were asked for.
    app.world_mut().get_mut::<CloudView>(view.camera).unwrap().reset += 1;
    run_updates(app, frames);
    let pixels = cloud_pixels(app, view);
    let sum = pixels.iter().fold([0.0; 4], |sum, p| std::array::from_fn(|i| sum[i] + f64::from(p[i])));
    sum.map(|s| s / pixels.len() as f64)
}

/// Frames for a mean that is known to 1 % of itself by `scripts/test --full`: otherwise a quarter of them.
pub fn frames(full_count: u32) -> u32 {
    if full() { full_count } else { full_count.div_ceil(4) }
}

/// How far such a mean may be off, as a share of itself: a quarter of the samples has twice the noise.
pub fn noise() -> f64 {
    if full() { 0.01 } else { 0.02 }
}

pub fn assert_near(found: f64, expected: f64, relative: f64, what: &str) {
    assert!((found / expected - 1.0).abs() < relative, "{what}: {found}, not {expected}");
}

/// Where the sun stands for its light to come from `mu` above the horizon, 90° to the side of the pinhole's direction.
pub fn light_from(mu: f64) -> Vec3 {
    -DVec3::new(0.0, mu, (1.0 - mu * mu).sqrt()).as_vec3()
}
