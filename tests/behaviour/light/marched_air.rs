//! The air between clouds and the camera, and the sky above them, from where Bevy's tables do not reach.

use bevy::{
    light::{
        atmosphere::{PhaseFunction as AirPhase, ScatteringMedium},
        light_consts::lux,
    },
    math::DVec3,
    pbr::{AtmosphereMode, AtmosphereSettings},
    prelude::*,
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{Sky, View, cloud_pixels, spawn_sun, spawn_view, until_drawn},
    gpu::needs_atmosphere,
    scene::{exact, settle},
    shared::SharedApp,
    uniform_slab::UniformSlab,
};

const SIZE: UVec2 = UVec2::new(24, 16);
const TOP: f32 = 1500.0;
/// Where sunlight goes.
const LIGHT: Vec3 = Vec3::new(-0.4, -1.0, -0.3);

/// Bevy's earth: radius of the ground, and height of the air (m).
const GROUND: f64 = 6_360_000.0;
const AIR: f64 = 100_000.0;

/// An opaque deck of this albedo up to [`TOP`], under Bevy's atmosphere.
fn deck(albedo: f32, lighting: CloudLighting) -> (SharedApp, View) {
    let slab = UniformSlab { albedo: Vec3::splat(albedo), ..UniformSlab::new(500.0, TOP, 0.05) };
    let mut app = slab.app();
    app.insert_resource(CloudQuality { step: 20.0, ..exact(MarchResolution::Full) }).insert_resource(lighting);
    spawn_sun(&mut app, LIGHT);
    let view = spawn_view(&mut app, SIZE, Transform::default(), Sky::Atmosphere);
    until_drawn(&mut app);
    (app, view)
}

/// Mean radiance of the clouds, looking down by `pitch` degrees from this altitude.
fn seen_from(app: &mut App, view: &View, altitude: f32, pitch: f32) -> Vec3 {
    let down = Quat::from_rotation_x(-pitch.to_radians());
    app.world_mut().entity_mut(view.camera).insert(Transform::from_xyz(0.0, altitude, 0.0).with_rotation(down));
    settle(app);
    let pixels = cloud_pixels(app, view);
    assert!(pixels.iter().all(|p| p.is_finite() && p.w < 0.02), "the deck is not opaque from {altitude} m");
    pixels.iter().map(|p| p.truncate()).sum::<Vec3>() / pixels.len() as f32
}

#[test]
fn marched_air_is_what_bevys_table_holds() {
    needs_atmosphere();
    // A deck that sends no light of its own, within the table's 32 km.
    let (mut app, view) = deck(0.0, CloudLighting::default());
    for (altitude, pitch) in [(4000.0, 50.0), (8000.0, 60.0)] {
        let [table, marched] = [AtmosphereMode::LookupTexture, AtmosphereMode::Raymarched].map(|mode| {
            let mut air = app.world_mut().get_mut::<AtmosphereSettings>(view.camera).expect("it has an atmosphere");
            air.rendering_method = mode;
            seen_from(&mut app, &view, altitude, pitch)
        });
        println!("from {altitude} m: {table} in the table, {marched} marched");
        assert!(table.min_element() > 10.0, "there is no air: {table}");
        assert!(
            (marched / table - 1.0).abs().max_element() < 0.1,
            "from {altitude} m: {marched}, {table} in the table"
        );
    }
}

/// Where a ray from `p` (from the planet's centre) meets a sphere of this radius: the nearer and the farther place.
fn sphere(p: DVec3, ray: DVec3, radius: f64) -> [f64; 2] {
    let along = p.dot(ray);
    let root = (along * along - p.length_squared() + radius * radius).sqrt();
    [-along - root, -along + root]
}

/// What Bevy's medium scatters towards the camera and takes away at a point (1/m), its optical density there.
fn air_at(medium: &ScatteringMedium, p: DVec3, cosine: f32) -> [DVec3; 2] {
    let falls = 1.0 - ((p.length() - GROUND) / AIR) as f32;
    medium.terms.iter().fold([DVec3::ZERO; 2], |[turned, taken], term| {
        let there = f64::from(term.falloff.sample(falls.clamp(0.0, 1.0)));
        let phase = match &term.phase {
            AirPhase::Isotropic | AirPhase::Rayleigh | AirPhase::Mie { .. } => term.phase.sample(cosine),
            _ => None,
        };
        let phase = f64::from(phase.expect("a phase function in closed form").red);
        let [scattered, lost] = [term.scattering, term.absorption + term.scattering].map(|c| c.as_dvec3() * there);
        [turned + scattered * phase, taken + lost]
    })
}

/// Optical depth of the air from `p` out into space.
fn depth_to_space(medium: &ScatteringMedium, p: DVec3, ray: DVec3) -> DVec3 {
    const STEPS: i32 = 64;
    let end = sphere(p, ray, GROUND + AIR)[1];
    // Shorter steps where air is denser.
    let at = |k: f64| end * (k / f64::from(STEPS)).powi(2);
    let step = |k: i32| {
        let [a, b] = [at(f64::from(k)), at(f64::from(k + 1))];
        air_at(medium, p + ray * (0.5 * (a + b)), 0.0)[1] * (b - a)
    };
    (0..STEPS).map(step).sum()
}

/// Sunlight that the air before the deck scatters once, and into this ray (cd/m²): an integral over the medium's own
/// numbers, which shares nothing with the shader.
fn scattered_once(medium: &ScatteringMedium, eye: DVec3, ray: DVec3, sun: DVec3) -> DVec3 {
    const STEPS: i32 = 200;
    let start = sphere(eye, ray, GROUND + AIR)[0].max(0.0);
    let way = sphere(eye, ray, GROUND + f64::from(TOP))[0] - start;
    let at = |k: i32| {
        let u = f64::from(k) / f64::from(STEPS);
        start + way * u * (2.0 - u)
    };
    let (mut light, mut depth) = (DVec3::ZERO, DVec3::ZERO);
    for k in 0..STEPS {
        let dt = at(k + 1) - at(k);
        let p = eye + ray * (0.5 * (at(k) + at(k + 1)));
        let [turned, taken] = air_at(medium, p, ray.dot(sun) as f32);
        let all = depth + taken * (0.5 * dt) + depth_to_space(medium, p, sun);
        light += turned * (-all).exp() * dt;
        depth += taken * dt;
    }
    light * f64::from(lux::RAW_SUNLIGHT)
}

/// The mean over the rays that [`seen_from`] takes.
fn mean_scattered_once(altitude: f32, pitch: f32) -> DVec3 {
    let medium = ScatteringMedium::earth(256, 256);
    let eye = DVec3::Y * (GROUND + f64::from(altitude));
    let down = Quat::from_rotation_x(-pitch.to_radians());
    let half = (0.5 * PerspectiveProjection::default().fov).tan();
    let ray = |k: u32| {
        let [x, y] = [k % SIZE.x, k / SIZE.x].map(|n| 2.0 * n as f32 + 1.0);
        let ahead = Vec3::new((x - SIZE.x as f32) * half, (SIZE.y as f32 - y) * half, -(SIZE.y as f32));
        (down * ahead).as_dvec3().normalize()
    };
    let count = SIZE.x * SIZE.y;
    let sun = (-LIGHT).as_dvec3().normalize();
    (0..count).map(|k| scattered_once(&medium, eye, ray(k), sun)).sum::<DVec3>() / f64::from(count)
}

#[test]
fn from_space_there_is_blue_air_before_the_clouds() {
    needs_atmosphere();
    let (mut app, view) = deck(0.0, CloudLighting::default());
    // How many times as much all light is as that which is scattered once: from 8 km by Bevy's table, from space as
    // marched.
    let [table, marched] = [8_000.0, 400_000.0].map(|altitude| {
        let light = seen_from(&mut app, &view, altitude, 50.0);
        let once = mean_scattered_once(altitude, 50.0).as_vec3();
        println!("from {altitude} m: {light} cd/m², {once} scattered once, {} times as much", light / once);
        light / once
    });
    // More the bluer, and the air that both look through is nearly the same: that above 8 km is a third of it.
    let near = (marched / table - 1.0).abs().max_element();
    assert!(near < 0.2, "from space {marched} times what is scattered once, in the table {table} times");
    assert!(marched.cmpgt(Vec3::splat(1.2)).all() && marched.cmplt(Vec3::splat(2.5)).all(), "{marched}");
}

#[test]
fn from_space_clouds_are_lit_by_the_sky_that_is_over_them() {
    needs_atmosphere();
    // By sky and ground alone, through no air.
    let lighting = CloudLighting { octaves: 0, diffusion: 0.0, aerial_perspective: 0.0, ..default() };
    let (mut app, view) = deck(0.999, lighting);
    let near = seen_from(&mut app, &view, TOP + 50.0, 80.0);
    for altitude in [10_000.0, 400_000.0] {
        let far = seen_from(&mut app, &view, altitude, 80.0);
        println!("{near} from near, {far} from {altitude} m");
        // Bevy's sky table is made in 16 even steps, of which the first passes over half of the densest air.
        assert!((far / near - 1.0).abs().max_element() < 0.25, "{near} from near, {far} from {altitude} m");
    }
}
