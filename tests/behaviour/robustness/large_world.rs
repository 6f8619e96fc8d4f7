//! Far from the origin, after hours of wind, and through a floating origin's shift.

use bevy::{light::Atmosphere, math::DVec3, prelude::*};
use bevy_cumulus::{prelude::*, reference::planet::PLANET_RADIUS};

use crate::support::{
    app::{Sky, View, cloud_pixels, clouds_app, spawn_sun, spawn_view, until_drawn},
    gpu::{needs_atmosphere, run_updates},
    shared::SharedApp,
};

const SIZE: UVec2 = UVec2::new(64, 36);
const WIND: f32 = 20.0;
const LIGHT: Vec3 = Vec3::new(-0.4, -1.0, -0.3);

struct World {
    app: SharedApp,
    view: View,
    sun: Entity,
}

fn world(temporal: TemporalMode) -> World {
    world_under(temporal, Sky::Black)
}

fn world_under(temporal: TemporalMode, sky: Sky) -> World {
    let mut app = clouds_app();
    app.insert_resource(CloudModel { wind: Vec3::new(WIND, 0.0, 0.0), evolution: 0.0, ..default() });
    let resolution = MarchResolution::Full;
    app.insert_resource(CloudQuality {
        temporal,
        resolution,
        step: 160.0,
        light_steps: 3,
        window: 8,
        ..CloudQuality::high()
    });
    let sun = spawn_sun(&mut app, LIGHT);
    let view = spawn_view(&mut app, SIZE, Transform::default(), sky);
    until_drawn(&mut app);
    World { app, view, sun }
}

impl World {
    /// Moves camera, sun and the world's offset along the planet by so many metres, to the east (+X). `shift` is what the
    /// world's origin is away from the ground below.
    fn stand(&mut self, metres: f64, seconds: f64, shift: Vec3) {
        let angle = metres / PLANET_RADIUS;
        let (sin, cos) = angle.sin_cos();
        let turned = Quat::from_rotation_z(-angle as f32);
        let up = Vec3::new(sin as f32, cos as f32, 0.0);
        let ground = DVec3::new(PLANET_RADIUS * sin, PLANET_RADIUS * (cos - 1.0), 0.0);
        let looking = turned * Quat::from_rotation_x(0.35);
        let world = self.app.world_mut();
        let offset = ground + shift.as_dvec3();
        world.resource_mut::<CloudModel>().world_offset = offset;
        // The planet is one of the world's things, though Bevy gives it no transform.
        let centre = Transform::from_translation((DVec3::NEG_Y * PLANET_RADIUS - offset).as_vec3());
        let planets: Vec<Entity> = world.query_filtered::<Entity, With<Atmosphere>>().iter(world).collect();
        for planet in planets {
            world.entity_mut(planet).insert(centre);
        }
        world.resource_mut::<CloudClock>().seconds = seconds;
        let place = Transform::from_translation(up * 10.0 - shift).with_rotation(looking);
        world.entity_mut(self.view.camera).insert(place);
        let light = Transform::default().looking_to(turned * LIGHT, up);
        world.entity_mut(self.sun).insert(light);
    }

    /// What is seen once the window is full: radiance over its mean, and transmittance.
    fn picture(&mut self) -> Vec<Vec4> {
        self.app.world_mut().get_mut::<CloudView>(self.view.camera).unwrap().reset += 1;
        run_updates(&mut self.app, 8);
        self.now()
    }

    fn now(&self) -> Vec<Vec4> {
        let pixels = cloud_pixels(&self.app, &self.view);
        let mean = pixels.iter().map(|p| p.truncate().element_sum() / 3.0).sum::<f32>() / pixels.len() as f32;
        pixels.into_iter().map(|p| (p.truncate() / mean).extend(p.w)).collect()
    }
}

/// How a shift of the origin at this distance (m) shows: difference of the picture from the one before from frame to frame,
/// over the shift, and where all that is held is lost; and the picture before.
fn over_shift(world: &mut World, far: f64, settled: u32) -> ([f32; 3], Vec<Vec4>) {
    world.stand(far, 5000.0, Vec3::ZERO);
    world.picture();
    run_updates(&mut world.app, settled);
    let before = world.now();
    let next = |world: &mut World| {
        run_updates(&mut world.app, 1);
        rms(&before, &world.now())
    };
    let usual = next(world);
    world.stand(far, 5000.0, Vec3::new(65_536.0, -4096.0, -131_072.0));
    let shifted = next(world);
    world.app.world_mut().get_mut::<CloudView>(world.view.camera).unwrap().reset += 1;
    let restarted = next(world);
    ([usual, shifted, restarted], before)
}

fn rms(a: &[Vec4], b: &[Vec4]) -> f32 {
    (a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f32>() / a.len() as f32).sqrt()
}

#[test]
fn ten_thousand_km_away_after_139_hours_of_wind_no_metre_is_lost() {
    const FAR: f64 = 1e7;
    const LATE: f64 = FAR / WIND as f64;
    let mut world = world(TemporalMode::SlidingWindow);
    world.stand(FAR, LATE, Vec3::ZERO);
    let here = world.picture();
    // Who goes with the wind sees the same sky. In f32 place and wind would go by steps of a metre there.
    let mut off = 0.0_f32;
    for seconds in [0.118, 0.231, 0.377] {
        world.stand(FAR + f64::from(WIND) * seconds, LATE + seconds, Vec3::ZERO);
        off = off.max(rms(&here, &world.picture()));
    }
    // An error does show.
    world.stand(FAR + 20.0, LATE, Vec3::ZERO);
    let aside = rms(&here, &world.picture());
    println!("{off:.5} apart; {aside:.5} where 20 m are lost");
    // A little changes in truth: which places of the map are read goes with the wind, too.
    assert!(off < 0.1 * aside, "{off} apart, where 20 m of error make {aside}");
}

#[test]
fn an_origin_that_shifts_far_away_leaves_no_smear() {
    const FAR: f64 = 1e7;
    for temporal in [TemporalMode::SlidingWindow, TemporalMode::Exponential, TemporalMode::Upscale] {
        let mut world = world(temporal);
        let ([usual, shifted, restarted], _) = over_shift(&mut world, FAR, 16);
        println!(
            "{temporal:?}: {usual:.5} from frame to frame, {shifted:.5} over the shift, {restarted:.5} if all is lost"
        );
        assert!(shifted < 2.0 * usual + 2e-3, "{temporal:?}: {shifted} for {usual}");
        assert!(restarted > 2.0 * shifted, "{temporal:?}: a restart is as good, so nothing is tested");
    }
}

#[test]
fn the_planet_of_an_atmosphere_shifts_with_the_origin() {
    needs_atmosphere();
    // Near enough that the planet's transform, in steps of half a metre, is as right before as after.
    const FAR: f64 = 1e5;
    let mut world = world_under(TemporalMode::SlidingWindow, Sky::Atmosphere);
    let ([usual, shifted, restarted], before) = over_shift(&mut world, FAR, 8);
    // And none of it is held from before.
    let anew = rms(&before, &world.picture());
    // An error of the planet's place does show.
    world.stand(FAR + 20.0, 5000.0, Vec3::ZERO);
    let aside = rms(&before, &world.picture());
    println!(
        "{usual:.5} from frame to frame, {shifted:.5} over the shift, {restarted:.5} if all is lost, {anew:.5} anew; \
         {aside:.5} where 20 m are lost"
    );
    // The planet's transform rounds to half a metre, so held frames are reprojected by that. None is dropped.
    assert!(usual < 2e-3 && shifted < 0.2 * restarted, "{shifted} for {usual}, {restarted} if all is lost");
    assert!(anew < 0.3 * aside, "{anew}, where 20 m of error make {aside}");
}
