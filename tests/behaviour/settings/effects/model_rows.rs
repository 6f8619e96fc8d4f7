//! The thesis's layer, zones and the clock, by the field.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{
    Expect::{By, Over, Times, Under},
    Row, both, each,
    field::FieldLab,
    scene::Scene,
};
use crate::support::gpu::run_updates;

fn of(model: CloudModel, heights: [f32; 2]) -> Scene {
    let settings = CloudSettings {
        model,
        textures: CloudTextures { volume_size: 32, map_size: 64, ..default() },
        clock: CloudClock { seconds: 0.0, speed: 0.0 },
        ..default()
    };
    Scene { settings, wide: 9000.0, heights, ..default() }
}

/// Broken cloud that does not lean.
pub fn broken() -> Scene {
    of(CloudModel { coverage: 0.2, wind_skew: 0.0, ..default() }, [1000.0, 4600.0])
}

/// The profile alone.
pub fn bare() -> Scene {
    of(CloudModel { noise_strength: 0.0, type_variation: 0.0, ..broken().settings.model }, [1000.0, 4600.0])
}

/// The same where clouds gather as much as they may.
fn gathered() -> Scene {
    of(CloudModel { map_variation: 1.0, coverage: 0.0, ..bare().settings.model }, [1300.0, 2300.0])
}

/// Tall towers all over, whose type alone varies: it decides how high they reach.
pub fn of_types() -> Scene {
    of(CloudModel { coverage: 1.0, type_variation: 1.0, ..bare().settings.model }, [1300.0, 3300.0])
}

/// So tall that noise alone makes a difference between these altitudes: billows only, and at rest.
pub fn billows() -> Scene {
    let model = CloudModel {
        bottom: 0.0,
        top: 40_000.0,
        coverage: 1.0,
        cloud_type: 1.0,
        type_variation: 0.0,
        erosion: Erosion::Subtract,
        wisp_height: 0.01,
        wind: Vec3::ZERO,
        wind_skew: 0.0,
        evolution: 0.0,
        ..default()
    };
    of(model, [6000.0, 9000.0])
}

/// As [`billows`], of wisps only.
pub fn wisps() -> Scene {
    of(CloudModel { wisp_height: 1.0, ..billows().settings.model }, [4000.0, 5000.0])
}

/// Broken cloud at rest.
fn at_rest() -> Scene {
    of(CloudModel { wind: Vec3::ZERO, evolution: 0.0, ..broken().settings.model }, [1300.0, 3300.0])
}

/// Broken cloud in a wind along x, and nothing else that moves.
fn windy() -> Scene {
    of(CloudModel { wind: Vec3::new(10.0, 0.0, 0.0), ..at_rest().settings.model }, [1300.0, 3300.0])
}

/// Closed cloud, with a zone that does nothing yet.
fn zoned() -> Scene {
    let mut scene = bare();
    scene.settings.model.coverage = 0.6;
    scene.zone = Some(CloudZone { radius: 6000.0, edge: 1000.0, strength: 0.0 });
    scene
}

/// The same, cleared.
fn cleared() -> Scene {
    let mut scene = zoned();
    scene.set("zone.strength", "-1");
    scene
}

/// Both fields after some seconds: how they differ, as they are and followed by `shift`.
pub fn after(lab: &mut FieldLab, seconds: f64, a: &Scene, b: &Scene, shift: impl Fn(f32) -> Vec3) -> [f32; 2] {
    let [a, b] = [a, b].map(|scene| {
        let mut scene = scene.clone();
        scene.settings.clock.seconds += seconds;
        scene
    });
    lab.moves(&a, &b, shift)
}

/// What is left of a difference where the field was followed: rounding, and what the planet's curve does to altitudes.
pub const FOLLOWED: super::Expect = Under(0.05);

pub fn rows() -> Vec<Row<FieldLab>> {
    [places(), clouds(), noise(), motion()].into_iter().flatten().collect()
}

#[rustfmt::skip]
fn places() -> Vec<Row<FieldLab>> {
    vec![
        each("model.enabled", bare, ["false", "true"], |lab, s| lab.of(s).cover(), By(0.1, 1.0)),
        // Altitudes to within what 6000 points miss.
        each("model.bottom", bare, ["1300", "1800"], |lab, s| lab.of(s).lowest(), By(450.0, 550.0)),
        each("model.top", bare, ["3300", "4300"], |lab, s| lab.of(s).highest(), By(850.0, 1100.0)),
        each("model.map_scale", gathered, ["13000", "39000"], |lab, s| lab.roughness(s, Vec3::X * 400.0), Under(0.6)),
        each("model.type_scale", of_types, ["7000", "28000"], |lab, s| lab.roughness(s, Vec3::X * 300.0), Under(0.6)),
        each("model.map_variation", gathered, ["0", "1"], |lab, s| lab.of(s).cover(), Under(0.9)),
        // A floating origin: what was W away stands at the origin.
        both("model.world_offset", at_rest, ["0,0,0", "2000,0,-1000"],
            |lab, a, b| lab.moves(a, b, |_| Vec3::new(-2000.0, 0.0, 1000.0)), FOLLOWED),
        each("zone.strength", zoned, ["0", "-1"], |lab, s| lab.of(s).cover(), Under(0.8)),
        each("zone.strength", || { let mut s = zoned(); s.set("model.coverage", "0"); s }, ["0", "1"],
            |lab, s| lab.of(s).only(|p| p.ground.length() < 4900.0).cover(), Over(1.2)),
        each("zone.radius", cleared, ["3000", "8000"], |lab, s| lab.of(s).cover(), Under(0.6)),
        // Well inside nothing is left; with a wide edge there is, in its outer part.
        each("zone.edge", cleared, ["100", "6000"],
            |lab, s| lab.of(s).only(|p| p.ground.length() < 5900.0).cover(), By(0.05, 1.0)),
    ]
}

#[rustfmt::skip]
fn clouds() -> Vec<Row<FieldLab>> {
    vec![
        each("model.coverage", bare, ["0", "0.3"], |lab, s| lab.of(s).cover(), Over(1.3)),
        each("model.coverage", bare, ["0.2", "-1"], |lab, s| lab.of(s).cover(), Under(1e-6)),
        // Stratus is thin and low.
        each("model.cloud_type", bare, ["1", "0"], |lab, s| lab.of(s).altitude(), By(-1500.0, -300.0)),
        each("model.type_variation", bare, ["0", "1"], |lab, s| lab.of(s).altitude(), By(-800.0, -50.0)),
        each("model.density", broken, ["1", "2"], |lab, s| lab.of(s).density(), Times(2.0, 1e-4)),
        each("model.extinction", broken, ["0.05", "0.1"], |lab, s| lab.of(s).extinction(), Times(2.0, 1e-4)),
        each("model.albedo", broken, ["0.8,0.8,0.8", "0.4,0.8,0.8"], |lab, s| lab.of(s).albedo().x, Times(0.5, 1e-4)),
        each("model.albedo", broken, ["0.8,0.8,0.8", "0.8,0.4,0.8"], |lab, s| lab.of(s).albedo().y, Times(0.5, 1e-4)),
        each("model.albedo", broken, ["0.8,0.8,0.8", "0.8,0.8,0.4"], |lab, s| lab.of(s).albedo().z, Times(0.5, 1e-4)),
    ]
}

#[rustfmt::skip]
fn noise() -> Vec<Row<FieldLab>> {
    vec![
        // Cores stay dense by the remap; without it cloud is only as dense as its noise.
        each("model.erosion", broken, ["remap", "subtract"], |lab, s| lab.of(s).densest(), Under(0.9)),
        each("model.noise_strength", broken, ["0", "1"], |lab, s| lab.of(s).density(), Under(0.7)),
        each("model.billow_scale", billows, ["3000", "12000"], |lab, s| lab.roughness(s, Vec3::X * 150.0), Under(0.7)),
        // The more of the fine billows, the rougher on their scale; and the finer they are.
        each("model.detail_strength", billows, ["0", "1"], |lab, s| lab.roughness(s, Vec3::X * 60.0), Over(1.5)),
        each("model.detail_scale", || { let mut s = billows(); s.set("model.detail_strength", "1"); s },
            ["900", "3600"], |lab, s| lab.roughness(s, Vec3::X * 60.0), Under(0.6)),
        each("model.wisp_scale", wisps, ["1900", "7600"], |lab, s| lab.roughness(s, Vec3::X * 60.0), Under(0.6)),
        // Of wisps that take nothing more is left the higher they reach.
        each("model.wisp_height", || { let mut s = broken(); s.set("slots.wisp", "white"); s }, ["0.05", "1"],
            |lab, s| lab.of(s).density(), Over(1.1)),
    ]
}

#[rustfmt::skip]
fn motion() -> Vec<Row<FieldLab>> {
    vec![
        both("model.wind", at_rest, ["0,0,0", "10,0,-5"],
            |lab, a, b| after(lab, 100.0, a, b, |_| Vec3::new(1000.0, 0.0, -500.0)), FOLLOWED),
        both("model.wind", billows, ["0,0,0", "0,5,0"],
            |lab, a, b| after(lab, 100.0, a, b, |_| Vec3::Y * 500.0), FOLLOWED),
        both("model.evolution", billows, ["0", "5"],
            |lab, a, b| after(lab, 100.0, a, b, |_| Vec3::Y * 500.0), FOLLOWED),
        both("model.drift", at_rest, ["0,0,0", "1000,0,-500"],
            |lab, a, b| lab.moves(a, b, |_| Vec3::new(1000.0, 0.0, -500.0)), FOLLOWED),
        both("model.drift", billows, ["0,0,0", "0,500,0"], |lab, a, b| lab.moves(a, b, |_| Vec3::Y * 500.0), FOLLOWED),
        // From 1300 m to 3300 m tops go 500 m downwind.
        both("model.wind_skew", windy, ["0", "500"],
            |lab, a, b| lab.moves(a, b, |h| Vec3::X * ((h - 1300.0) / 2000.0 * 500.0)), FOLLOWED),
        both("clock.seconds", windy, ["0", "100"], |lab, a, b| lab.moves(a, b, |_| Vec3::X * 1000.0), FOLLOWED),
        each("clock.speed", windy, ["10", "30"], seconds_of_ten_frames, Times(3.0, 1e-3)),
    ]
}

/// Cloud seconds that ten frames take.
fn seconds_of_ten_frames(lab: &mut FieldLab, scene: &Scene) -> f32 {
    lab.show(scene);
    run_updates(lab.app(), 10);
    lab.app().world().resource::<CloudClock>().seconds as f32
}
