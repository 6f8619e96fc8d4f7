//! A uniform slab of cloud behind the unchanged renderer, and what is seen of it in closed form.
//!
//! What is drawn is stored as f16. A device may round or cut (Mesa's software driver cuts): up to 2⁻¹⁰ = 9.8e-4 of the
//! value.

use std::f64::consts::PI;

use bevy::{
    light::light_consts::lux,
    math::{DVec2, DVec3},
    prelude::*,
};
use bevy_cumulus::{
    prelude::*,
    reference::planet::{PLANET_RADIUS, altitude, shell_intervals},
};

use super::{
    app::{Sky, View, cloud_pixels, spawn_sun, spawn_view},
    gpu::run_updates,
    shared::SharedApp,
    uniform_slab::UniformSlab,
};

pub const BOTTOM: f64 = 1500.0;
pub const TOP: f64 = 2500.0;
pub const ALBEDO: [f64; 3] = [0.9, 0.75, 0.5];

/// The last place of f16, and a little for what f32 adds on the way; and the smallest step of f16.
pub const STORED: f64 = 1.05e-3;
pub const LEAST: f64 = 6e-8;
pub const SIZE: UVec2 = UVec2::new(9, 7);

/// Constant extinction (1/m) between two altitudes.
pub fn slab(extinction: f64) -> UniformSlab {
    UniformSlab {
        albedo: DVec3::from_array(ALBEDO).as_vec3(),
        ..UniformSlab::new(BOTTOM as f32, TOP as f32, extinction as f32)
    }
}

/// Single scattering by an isotropic medium, and nothing else.
pub fn plain_light() -> CloudLighting {
    CloudLighting {
        octaves: 1,
        diffusion: 0.0,
        phase: bevy_cumulus::settings::PhaseFunction::Isotropic,
        ambient_strength: 0.0,
        powder: 0.0,
        aerial_perspective: 0.0,
        fade_start: 1.0,
        ..default()
    }
}

/// Every sample where the closed form has it, and none left out.
pub fn exact_march(step: f32) -> CloudQuality {
    CloudQuality {
        resolution: MarchResolution::Full,
        step,
        step_growth: 0.0,
        max_steps: 8192,
        light_steps: 0,
        light_growth: 1.0,
        transmittance_stop: 0.0,
        density_skip: 0.0,
        max_distance: 2_000_000.0,
        offsets: false,
        temporal: TemporalMode::Off,
        ..default()
    }
}

pub fn slab_app(extinction: f64, sun: Vec3) -> (SharedApp, View) {
    view_of(&slab(extinction), sun)
}

/// A view of this slab.
pub fn view_of(slab: &UniformSlab, sun: Vec3) -> (SharedApp, View) {
    let mut app = slab.app();
    app.insert_resource(plain_light());
    spawn_sun(&mut app, -sun);
    let view = spawn_view(&mut app, SIZE, Transform::default(), Sky::Black);
    (app, view)
}

/// A viewpoint: the camera's altitude (m) and pitch (degrees up).
pub fn looking(height: f32, pitch: f32) -> Transform {
    Transform::from_xyz(0.0, height, 0.0).with_rotation(Quat::from_rotation_x(pitch.to_radians()))
}

/// Directions through the middles of the pixels, row by row.
pub fn directions(camera: &Transform) -> Vec<DVec3> {
    directions_through(camera, |_| DVec2::splat(0.5))
}

/// Directions through a place (0 to 1, from the top left) in each pixel, row by row.
pub fn directions_through(camera: &Transform, place: impl Fn(UVec2) -> DVec2) -> Vec<DVec3> {
    let half = (f64::from(PerspectiveProjection::default().fov) / 2.0).tan();
    let size = SIZE.as_dvec2();
    (0..SIZE.y)
        .flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y)))
        .map(|pixel| {
            let at = (pixel.as_dvec2() + place(pixel)) / size;
            let (across, up) = ((2.0 * at.x - 1.0) * half * size.x / size.y, (1.0 - 2.0 * at.y) * half);
            camera.rotation.as_dquat() * DVec3::new(across, up, -1.0).normalize()
        })
        .collect()
}

pub fn spans(height: f64, mu: f64) -> Vec<[f64; 2]> {
    shell_intervals(height, mu, BOTTOM, TOP, PLANET_RADIUS, 1e7)
}

/// Metres of slab along a ray, and how far f32 may be off: what a last place of the ray's slope changes, and of the length.
pub fn length_in_slab(height: f64, mu: f64) -> (f64, f64) {
    let length = |mu: f64| spans(height, mu).iter().map(|[a, b]| b - a).sum::<f64>();
    let exact = length(mu);
    let moved = |by: f64| (length((mu + by).clamp(-1.0, 1.0)) - exact).abs();
    let far = spans(height, mu).last().map_or(0.0, |[_, b]| *b);
    (exact, moved(4e-7).max(moved(-4e-7)) + 2e-6 * far)
}

/// Radiance of a wholly opaque, unshadowed slab: ϖ · p · E, with p = 1/4π.
pub fn full_radiance(channel: usize) -> f64 {
    ALBEDO[channel] * f64::from(lux::RAW_SUNLIGHT) / (4.0 * PI)
}

/// Turns the camera and returns each pixel with its ray's slope.
pub fn seen_from(app: &mut App, view: &View, (height, pitch): (f32, f32)) -> Vec<(Vec4, DVec3)> {
    let camera = looking(height, pitch);
    app.world_mut().entity_mut(view.camera).insert(camera);
    run_updates(app, 1);
    cloud_pixels(app, view).into_iter().zip(directions(&camera)).collect()
}

/// What a ray gathers of a source along the slab: ∫ σt e^(−σt s) source(σt d(s)) ds, with d the slab between the point
/// and the sun; s counts metres of slab. Midpoint rule, 400 pieces a span (error below 1e-5 here).
pub fn gathered(height: f64, ray: DVec3, sun: DVec3, extinction: f64, source: impl Fn(f64) -> f64) -> f64 {
    const PIECES: u32 = 400;
    let (mut passed, mut sum) = (0.0, 0.0);
    for [a, b] in spans(height, ray.y) {
        let piece = (b - a) / f64::from(PIECES);
        for i in 0..PIECES {
            let p = DVec3::Y * height + ray * (a + piece * (f64::from(i) + 0.5));
            let up = (p + DVec3::Y * PLANET_RADIUS).normalize();
            let to_sun: f64 = spans(altitude(p, PLANET_RADIUS), up.dot(sun)).iter().map(|[a, b]| b - a).sum();
            let inside = -(-extinction * piece).exp_m1();
            sum += (-extinction * passed).exp() * source(extinction * to_sun) * inside;
            passed += piece;
        }
    }
    sum
}
