//! Light and phase functions, by pictures.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{
    Expect::{By, Over, Times, Under},
    Row, each, layer_rows, model_rows,
    picture::{PictureLab, SharedLab, into_the_sun, up, with_the_sun},
    scene::Scene,
};
use crate::support::scene::exact;

/// A closed deck from 1500 m to 2500 m, without noise, of this extinction (1/m); frames stand alone. The sun's light
/// only, scattered once, by Henyey and Greenstein's phase function.
pub fn deck(extinction: f32) -> Scene {
    let mut scene = model_rows::bare();
    let model = &scene.settings.model;
    scene.settings.model = CloudModel { bottom: 1500.0, top: 2500.0, coverage: 1.0, extinction, ..model.clone() };
    scene.settings.quality = CloudQuality { light_steps: 6, ..exact(MarchResolution::Full) };
    scene.settings.lighting = CloudLighting {
        octaves: 1,
        diffusion: 0.0,
        ambient_strength: 0.0,
        phase: PhaseFunction::HenyeyGreenstein,
        g: 0.5,
        ..default()
    };
    scene.pose = up(60.0);
    scene
}

/// An optical depth of about five.
pub fn thick() -> Scene {
    deck(0.008)
}

/// An optical depth of less than one.
pub fn thin() -> Scene {
    deck(0.001)
}

fn octaves() -> Scene {
    let mut scene = thick();
    scene.settings.lighting.octaves = 6;
    scene
}

fn diffuse() -> Scene {
    let mut scene = octaves();
    scene.settings.lighting.diffusion = 5.25;
    scene
}

/// Lit by sky and ground alone, but for the little that clouds around send of the sun's light: so dense that it is a
/// few hundredths.
fn ambient() -> Scene {
    let mut scene = deck(0.05);
    let lighting = &mut scene.settings.lighting;
    (lighting.octaves, lighting.ambient_strength, lighting.ground_albedo) = (0, 1.0, Vec3::ZERO);
    scene
}

fn thin_with(phase: PhaseFunction) -> Scene {
    let mut scene = thin();
    scene.settings.lighting.phase = phase;
    scene
}

fn two_lobes() -> Scene {
    thin_with(PhaseFunction::TwoLobe)
}

fn droplets() -> Scene {
    thin_with(PhaseFunction::HgDraine)
}

fn ice() -> Scene {
    thin_with(PhaseFunction::Ice)
}

/// Thin cloud from the ground to the horizon, which ends at 20 km.
pub fn horizon() -> Scene {
    let mut scene = deck(0.002);
    scene.settings.quality.max_distance = 20_000.0;
    scene.pose = up(8.0);
    scene
}

/// Light that goes on, over light that comes back.
fn forward(lab: &mut PictureLab, scene: &Scene) -> f32 {
    lab.towards(scene, into_the_sun()).light() / lab.towards(scene, with_the_sun()).light()
}

fn back(lab: &mut PictureLab, scene: &Scene) -> f32 {
    lab.towards(scene, with_the_sun()).light()
}

/// Where ice has its halo, over what lies within that.
fn halo(lab: &mut PictureLab, scene: &Scene) -> f32 {
    let picture = lab.towards(scene, into_the_sun());
    picture.ring(21.5, 23.5) / picture.ring(17.0, 20.0)
}

/// Light around the sun but for the nearest, over that farther away: less of it the larger droplets are, whose peak is
/// narrower.
fn aureole(lab: &mut PictureLab, scene: &Scene) -> f32 {
    let picture = lab.towards(scene, into_the_sun());
    picture.ring(2.0, 8.0) / picture.ring(15.0, 25.0)
}

fn light(lab: &mut PictureLab, scene: &Scene) -> f32 {
    lab.of(scene).light()
}

pub fn rows() -> Vec<Row<PictureLab>> {
    [sun(), sky(), phase()].into_iter().flatten().collect()
}

#[rustfmt::skip]
fn sun() -> Vec<Row<PictureLab>> {
    vec![
        each("lighting.octaves", thick, ["1", "6"], light, Over(1.5)),
        each("lighting.octaves", thick, ["1", "0"], light, Under(1e-6)),
        // The smaller the factor on the depth, the deeper light gets.
        each("lighting.attenuation", octaves, ["0.7", "0.3"], light, Over(1.5)),
        each("lighting.contribution", octaves, ["1", "0.5"], light, Under(0.8)),
        each("lighting.eccentricity", || { let mut s = octaves(); s.set("model.extinction", "0.003"); s },
            ["0.2", "0.95"], forward, Over(1.5)),
        each("lighting.diffusion", octaves, ["0", "5.25"], light, Over(1.3)),
        each("lighting.diffusion", diffuse, ["5", "10"], light, Over(1.5)),
        each("lighting.diffusion_asymmetry", diffuse, ["0", "0.6"], forward, Over(1.5)),
        each("lighting.sun_strength", thin, ["1", "2"], light, Times(2.0, 2e-3)),
        each("lighting.powder", thin, ["0", "1"], light, Under(0.8)),
        // Most of a cloud fades before it ends.
        each("lighting.fade_start", horizon, ["0.9", "0.1"], |lab, s| lab.of(s).transmittance(), Over(1.1)),
    ]
}

#[rustfmt::skip]
fn sky() -> Vec<Row<PictureLab>> {
    vec![
        each("lighting.ambient_strength", ambient, ["1", "2"], light, Times(2.0, 0.04)),
        each("lighting.ambient_tint", ambient, ["1,1,1", "0.5,1,1"], |lab, s| lab.of(s).colour().x, Times(0.5, 0.04)),
        each("lighting.ambient_tint", ambient, ["1,1,1", "1,0.5,1"], |lab, s| lab.of(s).colour().y, Times(0.5, 0.04)),
        each("lighting.ambient_tint", ambient, ["1,1,1", "1,1,0.5"], |lab, s| lab.of(s).colour().z, Times(0.5, 0.04)),
        // Blue over red: none is left of it.
        each("lighting.ambient_desaturation", ambient, ["0", "1"],
            |lab, s| { let c = lab.of(s).colour(); c.z / c.x - 1.0 }, Under(5e-3)),
        each("lighting.sky_fallback", ambient, ["0.02,0.04,0.06", "0.04,0.04,0.06"],
            |lab, s| lab.of(s).colour().x, Times(2.0, 0.04)),
        each("lighting.sky_fallback", ambient, ["0.02,0.04,0.06", "0.02,0.08,0.06"],
            |lab, s| lab.of(s).colour().y, Times(2.0, 0.04)),
        each("lighting.sky_fallback", ambient, ["0.02,0.04,0.06", "0.02,0.04,0.12"],
            |lab, s| lab.of(s).colour().z, Times(2.0, 0.04)),
        each("lighting.ground_albedo", ambient, ["0,0,0", "1,0,0"],
            |lab, s| { let c = lab.of(s).colour(); c.x / c.y }, Over(1.02)),
        each("lighting.ground_albedo", ambient, ["0,0,0", "0,1,0"],
            |lab, s| { let c = lab.of(s).colour(); c.y / c.z }, Over(1.02)),
        each("lighting.ground_albedo", ambient, ["0,0,0", "0,0,1"],
            |lab, s| { let c = lab.of(s).colour(); c.z / c.x }, Over(1.02)),
    ]
}

#[rustfmt::skip]
fn phase() -> Vec<Row<PictureLab>> {
    vec![
        each("lighting.phase", thin, ["henyey_greenstein", "isotropic"], forward, Under(0.3)),
        each("lighting.g", thin, ["0.2", "0.7"], forward, Over(3.0)),
        each("lighting.g_back", two_lobes, ["-0.2", "-0.7"], back, Over(1.5)),
        each("lighting.lobe_mix", two_lobes, ["0.1", "0.8"], forward, Under(0.5)),
        each("lighting.droplet_diameter", droplets, ["6", "40"], aureole, Under(0.6)),
        each("lighting.halo", ice, ["0", "1"], halo, Over(1.1)),
        each("lighting.phase_limit", || { let mut s = thin(); s.set("lighting.g", "0.9"); s }, ["500", "1"],
            |lab, s| lab.towards(s, into_the_sun()).brightest(), Under(0.3)),
    ]
}

/// A thin layer all over, whose phase function is its own: not that of the light.
fn layer() -> Scene {
    let clouds = CloudLayer {
        coverage: 1.0,
        base: 1500.0,
        thickness: 1000.0,
        shape_strength: 0.0,
        detail_strength: 0.0,
        turbulence: 0.0,
        extinction: 0.001,
        own_phase: true,
        phase: CloudPhase { function: PhaseFunction::HenyeyGreenstein, g: 0.5, ..default() },
        ..layer_rows::cumulus()
    };
    let mut scene = thin();
    scene.settings.lighting.g = -0.5;
    scene.settings.model.enabled = false;
    scene.settings.layers = CloudLayers(vec![clouds]);
    scene
}

fn layer_with(function: &str) -> Scene {
    let mut scene = layer();
    scene.set("layers.0.phase.function", function);
    scene
}

fn layer_with_table() -> Scene {
    let mut scene = layer_with("table");
    scene.set("layers.0.phase.g", "0.5");
    scene
}

#[rustfmt::skip]
pub fn of_layers() -> Vec<Row<PictureLab>> {
    vec![
        each("layers.0.own_phase", layer, ["false", "true"], forward, Over(3.0)),
        each("layers.0.phase.function", layer, ["henyey_greenstein", "isotropic"], forward, Under(0.3)),
        each("layers.0.phase.g", layer, ["0.2", "0.7"], forward, Over(3.0)),
        each("layers.0.phase.g_back", || layer_with("two_lobe"), ["-0.2", "-0.7"], back, Over(1.5)),
        each("layers.0.phase.lobe_mix", || layer_with("two_lobe"), ["0.1", "0.8"], forward, Under(0.5)),
        each("layers.0.phase.droplet_diameter", || layer_with("hg_draine"), ["6", "40"], aureole, Under(0.6)),
        each("layers.0.phase.halo", || layer_with("ice"), ["0", "1"], halo, Over(1.1)),
        // A table that sends light back, in place of Henyey and Greenstein's function that does not.
        each("layers.0.phase_file", layer_with_table, ["", "back.phase.csv"], forward, Under(0.3)),
    ]
}

/// Black cloud, so that all light is the air's.
fn black() -> Scene {
    let mut scene = thick();
    scene.settings.model.albedo = Vec3::ZERO;
    scene.pose = up(15.0);
    scene
}

#[rustfmt::skip]
pub fn air() -> Vec<Row<SharedLab>> {
    vec![
        each("lighting.aerial_perspective", black, ["0", "1"], |lab, s| lab.of(s).light(), By(300.0, 6000.0)),
        each("lighting.aerial_perspective", black, ["0.5", "1"], |lab, s| lab.of(s).light(), Times(2.0, 0.02)),
    ]
}
