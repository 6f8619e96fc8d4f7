//! Low and sunken suns where the scene has no `Atmosphere`: the planet hides the sun from what lies in its shadow, and
//! the sky's light goes with the sun. March, path tracer and queries against closed forms.

use std::f64::consts::PI;

use bevy::{
    camera::Exposure,
    light::{SunDisk, light_consts::lux},
    math::DVec3,
    prelude::*,
};
use bevy_cumulus::{
    prelude::*,
    reference::planet::{PLANET_RADIUS, altitude, visible_sun},
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::{
    query::{field_app, sky, small},
    support::{
        app::{Sky, View, spawn_sun, spawn_view},
        evaluate::{COUNT, R, on_gpu},
        gpu::{run_updates, shader_app},
        path_trace::mean,
        shared::SharedApp,
        slab::{exact_march, plain_light},
        uniform_slab::UniformSlab,
    },
};

/// 1/m: so thin that each point is lit as if it were alone.
const EXTINCTION: f64 = 2e-5;
const ALBEDO: f64 = 0.9;
const SUN: f64 = lux::RAW_SUNLIGHT as f64;
/// The sun's angular diameter where the light has no `SunDisk` (rad).
const DISC: f64 = SunDisk::EARTH.angular_size as f64;
/// How far march and path tracer may be off, as a share of what the whole sun gives. The march's is three times the last
/// place of f16; the path tracer's is three times its noise, and the light that is scattered twice.
const MARCHED: f64 = 3e-3;
const TRACED: f64 = 3e-2;
/// Samples of the path tracer.
const FRAMES: u32 = 100;

/// A straight look through a small cloud: from where, which way, and where it enters and leaves the cloud (m). The cloud is
/// a disc between two altitudes, this far along +x, and ends where a step of 20 m does. Those that are looked at level lie
/// aside, where none of the places is at which the ground's shade is looked for.
#[derive(Clone, Copy, Debug)]
struct Look {
    name: &'static str,
    height: f64,
    direction: DVec3,
    cloud: [f64; 2],
    altitudes: [f32; 2],
    aside: f32,
}

const BELOW: Look = Look {
    name: "from below",
    height: 10.0,
    direction: DVec3::Y,
    cloud: [1490.0, 2490.0],
    altitudes: [1500.0, 2500.0],
    aside: 0.0,
};
const ABOVE: Look =
    Look { name: "from above", height: 6000.0, direction: DVec3::NEG_Y, cloud: [3500.0, 4500.0], ..BELOW };
const LOW: Look = Look {
    name: "at 500 m",
    height: 500.0,
    direction: DVec3::X,
    cloud: [2000.0, 2600.0],
    altitudes: [450.0, 550.0],
    aside: 2300.0,
};
const HIGH: Look = Look { name: "at 10 km", height: 10_000.0, altitudes: [9950.0, 10_050.0], ..LOW };

impl Look {
    fn slab(&self) -> UniformSlab {
        let [bottom, top] = self.altitudes;
        UniformSlab {
            albedo: Vec3::splat(ALBEDO as f32),
            disc: Some([300.0, self.aside]),
            // Most paths then find some of the thin cloud.
            majorant: 50.0,
            ..UniformSlab::new(bottom, top, EXTINCTION as f32)
        }
    }

    /// Mean over the cloud of a value at points, each weighed by how much of it is seen; times the cloud's opacity.
    fn seen(&self, value: impl Fn(DVec3) -> f64) -> f64 {
        let [start, end] = self.cloud;
        let steps = 1000;
        let dt = (end - start) / f64::from(steps);
        let at = |k: i32| (f64::from(k) + 0.5) * dt;
        let point = |k: i32| DVec3::Y * self.height + self.direction * (start + at(k));
        (0..steps).map(|k| EXTINCTION * dt * (-EXTINCTION * at(k)).exp() * value(point(k))).sum()
    }

    /// Radiance of the cloud in this sun's light alone, scattered once and evenly.
    fn sunlit(&self, towards: DVec3, size: f64) -> f64 {
        let share = |p: DVec3| {
            let mu = towards.dot((p + DVec3::Y * PLANET_RADIUS).normalize());
            visible_sun(altitude(p, PLANET_RADIUS), mu, size, PLANET_RADIUS)
        };
        SUN * ALBEDO / (4.0 * PI) * self.seen(share)
    }
}

/// Direction to a sun of this elevation (degrees).
fn towards(elevation: f64) -> DVec3 {
    let (sine, cosine) = elevation.to_radians().sin_cos();
    let azimuth = 40_f64.to_radians();
    DVec3::new(cosine * azimuth.sin(), sine, -cosine * azimuth.cos())
}

/// The share of the sky's light that [`CloudLighting::sky_fallback`] promises at this elevation (degrees).
fn twilight(elevation: f64) -> f64 {
    let t = ((elevation + 6.0) / 9.0).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t)).powi(3)
}

/// The scene of these tests: its app, camera and sun.
struct Stage {
    app: SharedApp,
    view: View,
    sun: Entity,
}

impl Stage {
    fn new() -> Self {
        let mut app = BELOW.slab().traced_app();
        let sun = spawn_sun(&mut app, Vec3::NEG_Y);
        let view = spawn_view(&mut app, UVec2::new(24, 16), Transform::default(), Sky::Black);
        let narrow = PerspectiveProjection { fov: 0.002, ..default() };
        // Thin cloud in little light is stored as f16.
        let exposure = Exposure { ev100: 0.0 };
        app.world_mut().entity_mut(view.camera).insert((Projection::Perspective(narrow), exposure));
        Self { app, view, sun }
    }

    fn light(&mut self, lighting: CloudLighting) {
        self.app.insert_resource(lighting);
    }

    fn set_sun(&mut self, elevation: f64) {
        let light = Transform::default().looking_to(-towards(elevation).as_vec3(), Vec3::X);
        self.app.world_mut().entity_mut(self.sun).insert(light);
    }

    /// Mean radiance of the cloud, marched and path traced.
    fn radiance(&mut self, look: Look) -> [f64; 2] {
        let traced = CloudQuality { max_distance: 20_000.0, ..CloudQuality::reference() };
        [self.marched(look), self.drawn(look, traced, FRAMES)]
    }

    fn marched(&mut self, look: Look) -> f64 {
        self.drawn(look, CloudQuality { max_distance: 20_000.0, ..exact_march(20.0) }, 2)
    }

    fn drawn(&mut self, look: Look, quality: CloudQuality, frames: u32) -> f64 {
        let up = if look.direction.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let from = Transform::from_xyz(0.0, look.height as f32, 0.0);
        let pose = from.looking_to(look.direction.as_vec3(), up);
        self.app.world_mut().entity_mut(self.view.camera).insert(pose);
        self.app.insert_resource(quality).insert_resource(look.slab().settings());
        run_updates(&mut self.app, 1);
        mean(&mut self.app, &self.view, frames)[1]
    }

    /// Compares what is seen with what is expected, in units of `whole`.
    fn check(&mut self, look: Look, case: &str, expected: f64, whole: f64) {
        let found = self.radiance(look).map(|radiance| radiance / whole);
        println!("{case} {}: {found:.4?}, {:.4} expected", look.name, expected / whole);
        for ((what, allowed), found) in [("marched", MARCHED), ("path traced", TRACED)].into_iter().zip(found) {
            let off = (found - expected / whole).abs();
            let allowed = if expected == 0.0 { 1e-6 } else { allowed };
            assert!(off <= allowed, "{case} {}, {what}: {found}, not {}", look.name, expected / whole);
        }
    }
}

/// Light by the sun alone, scattered once, as far as that can be chosen.
fn sunlight() -> CloudLighting {
    CloudLighting { sky_fallback: Vec3::ZERO, ground_albedo: Vec3::ZERO, ..plain_light() }
}

/// Light by the sky alone.
fn skylight() -> CloudLighting {
    CloudLighting {
        sun_strength: 0.0,
        ground_albedo: Vec3::ZERO,
        phase: PhaseFunction::Isotropic,
        fade_start: 1.0,
        ..default()
    }
}

#[test]
fn low_and_sunken_suns_light_clouds_as_far_as_the_planet_lets_them() {
    let mut stage = Stage::new();
    stage.light(sunlight());
    clouds_are_lit_by_the_part_of_the_sun_over_their_horizon(&mut stage);
    high_clouds_are_lit_after_low_ones(&mut stage);
    stage.light(skylight());
    the_sky_darkens_with_the_sun(&mut stage);
    the_ground_is_lit_by_the_part_of_the_sun_over_its_horizon(&mut stage);
    stage.light(CloudLighting { fade_start: 1.0, ..default() });
    at_night_all_is_dark(&mut stage);
}

fn clouds_are_lit_by_the_part_of_the_sun_over_their_horizon(stage: &mut Stage) {
    let whole = |look: Look| look.sunlit(DVec3::Y, DISC);
    // From 1.5 and 2.5 km the horizon lies 1.24° and 1.61° down; the disc has a radius of 0.27°.
    for elevation in [58.0, 3.0, 0.5, -0.5, -1.4, -2.0, -8.0, -90.0] {
        stage.set_sun(elevation);
        let looks = if [58.0, -1.4, -8.0].contains(&elevation) { &[BELOW, ABOVE][..] } else { &[BELOW] };
        for look in looks {
            let expected = look.sunlit(towards(elevation), DISC);
            stage.check(*look, &format!("sun at {elevation}°"), expected, whole(*look));
        }
    }
    stage.set_sun(-1.4);
    for (disc, name) in [(SunDisk { angular_size: 0.06, intensity: 1.0 }, "a large sun"), (SunDisk::OFF, "no disc")] {
        let size = disc.angular_size.into();
        stage.app.world_mut().entity_mut(stage.sun).insert(disc);
        stage.check(BELOW, name, BELOW.sunlit(towards(-1.4), size), whole(BELOW));
    }
    stage.app.world_mut().entity_mut(stage.sun).insert(SunDisk::EARTH);
}

fn high_clouds_are_lit_after_low_ones(stage: &mut Stage) {
    // Horizons 0.72° and 3.21° down.
    for (elevation, low, high) in [(3.0, true, true), (-2.0, false, true), (-8.0, false, false)] {
        stage.set_sun(elevation);
        for (look, is_lit) in [(LOW, low), (HIGH, high)] {
            let whole = look.sunlit(DVec3::Y, DISC);
            let expected = if is_lit { whole } else { 0.0 };
            stage.check(look, &format!("sun at {elevation}°"), expected, whole);
        }
    }
}

fn the_sky_darkens_with_the_sun(stage: &mut Stage) {
    let fallback = f64::from(CloudLighting::default().sky_fallback.y);
    // In thin cloud under an even sky what is scattered came from above the horizon: half, and what its dip adds.
    let above = |p: DVec3| {
        let h = altitude(p, PLANET_RADIUS);
        0.5 + 0.5 * (h * (2.0 * PLANET_RADIUS + h)).sqrt() / (PLANET_RADIUS + h)
    };
    let whole = ALBEDO * fallback * SUN * BELOW.seen(above);
    stage.set_sun(58.0);
    let noon = stage.radiance(BELOW);
    assert!((noon[1] / whole - 1.0).abs() < TRACED, "the sky gives {}, not {whole}", noon[1]);
    for elevation in [3.0, 0.5, -0.5, -2.0, -4.0, -8.0, -90.0] {
        stage.set_sun(elevation);
        let found = stage.radiance(BELOW);
        let share = twilight(elevation);
        println!(
            "sky at {elevation}°: {:.4?} of noon's, {share:.4} expected",
            [found[0] / noon[0], found[1] / noon[1]]
        );
        for ((found, noon), allowed) in found.into_iter().zip(noon).zip([MARCHED, TRACED]) {
            let allowed = if share == 0.0 { 0.0 } else { allowed };
            assert!(
                (found / noon - share).abs() <= allowed,
                "sky at {elevation}°: {found} of {noon}, not {share} of it"
            );
        }
    }
}

fn the_ground_is_lit_by_the_part_of_the_sun_over_its_horizon(stage: &mut Stage) {
    // Only the march can leave out the sun's own light on the cloud. Scattered evenly: droplets turn little of it down.
    let lighting = CloudLighting { sun_strength: 1.0, sky_fallback: Vec3::ZERO, ..skylight() };
    stage.light(CloudLighting { octaves: 0, diffusion: 0.0, ground_albedo: Vec3::splat(0.2), ..lighting });
    let mut lit_at = |elevation: f64| {
        stage.set_sun(elevation);
        stage.marched(BELOW)
    };
    let noon = lit_at(58.0) / 58_f64.to_radians().sin();
    assert!(noon > 0.0, "the ground gives no light");
    for elevation in [3.0, 0.1] {
        let sine = f64::to_radians(elevation).sin();
        let (found, expected) = (lit_at(elevation) / noon, sine * visible_sun(0.0, sine, DISC, PLANET_RADIUS));
        println!("ground at {elevation}°: {found:.6} of a sun overhead's, {expected:.6} expected");
        assert!((found / expected - 1.0).abs() < 0.01, "ground at {elevation}°: {found}, not {expected}");
    }
    for elevation in [-0.5, -8.0, -90.0] {
        assert_eq!(lit_at(elevation), 0.0, "the ground shines under a sun at {elevation}°");
    }
}

fn at_night_all_is_dark(stage: &mut Stage) {
    for look in [BELOW, ABOVE, HIGH] {
        stage.set_sun(58.0);
        let noon = stage.radiance(look);
        for elevation in [-8.0, -90.0] {
            stage.set_sun(elevation);
            for ((what, found), noon) in ["marched", "path traced"].into_iter().zip(stage.radiance(look)).zip(noon) {
                assert!(found < 1e-3 * noon, "{what} {}, sun at {elevation}°: {found}, {noon} at noon", look.name);
            }
        }
    }
}

#[test]
fn queries_see_the_part_of_the_sun_over_the_horizon() {
    let mut app = field_app(small(4));
    app.insert_resource(CloudModel { extinction: 0.0, ..default() });
    for disc in [None, Some(SunDisk { angular_size: 0.06, intensity: 1.0 }), Some(SunDisk::OFF)] {
        let size = disc.as_ref().map_or(DISC, |disc| disc.angular_size.into());
        let mut partly = 0;
        for elevation in [58.0, 3.0, 0.5, 0.1, -0.5, -1.4, -2.0, -8.0, -90.0] {
            let sun = spawn_sun(&mut app, -towards(elevation).as_vec3());
            if let Some(disc) = disc.clone() {
                app.world_mut().entity_mut(sun).insert(disc);
            }
            run_updates(&mut app, 1);
            for h in [0.0, 500.0, 1500.0, 2500.0, 10_000.0] {
                let mu = towards(elevation).y;
                let (found, expected) =
                    (sky(&app).sun_visibility(DVec3::Y * h), visible_sun(h, mu, size, PLANET_RADIUS));
                assert!((found - expected).abs() < 1e-4, "{elevation}° from {h} m: {found}, not {expected}");
                partly += u32::from(found > 0.0 && found < 1.0);
            }
            app.world_mut().despawn(sun);
        }
        assert_eq!(partly > 0, size > 0.0, "a sun of {size} rad is partly hidden {partly} times");
    }
}

#[test]
fn the_shader_sees_as_much_of_the_sun_as_the_reference() {
    let mut rng = StdRng::seed_from_u64(14);
    let suns: Vec<[f32; 3]> = (0..COUNT)
        .map(|k| {
            let h = if k % 8 == 0 { rng.random_range(-100.0..0.0) } else { 10_f32.powf(rng.random_range(0.0..7.0)) };
            let size = [0.0, SunDisk::EARTH.angular_size, 0.06, 0.5][k % 4];
            let dip = (PLANET_RADIUS / (PLANET_RADIUS + f64::from(h).max(0.0))).acos();
            // Most of them about as far from the horizon as the disc is large.
            let spread = if k % 5 == 0 { 2.0 } else { 0.7 * f64::from(size.max(2e-5)) };
            [h, (rng.random_range(-spread..spread) - dip).sin() as f32, size]
        })
        .collect();
    let found: Vec<[f32; 1]> = on_gpu(
        &mut shader_app(),
        "import bevy_cumulus::model::planet::visible_sun;",
        &format!("results[o] = visible_sun(values[i], values[i + 1u], values[i + 2u], {R:?});"),
        &suns,
    );
    let mut partly = 0;
    for (sun, [found]) in suns.iter().zip(found) {
        let [h, mu, size] = sun.map(f64::from);
        let exact = visible_sun(h, mu, size, PLANET_RADIUS);
        // The sine of the sun's height over the horizon is a sum of products of about 1; WGSL allows asin an error of
        // 2.5e-4 of itself.
        let allowed = 4e-7 / (0.5 * size).max(1e-5) + 3e-4;
        assert!((f64::from(found) - exact).abs() < allowed, "{sun:?}: {found}, not {exact}");
        partly += u32::from(exact > 0.01 && exact < 0.99);
    }
    assert!(partly > COUNT as u32 / 4, "only {partly} suns are partly hidden");
}
