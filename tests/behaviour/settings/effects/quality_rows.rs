//! Steps, resolution and time, and what a camera carries, by pictures and by the steps they took.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{
    Expect::{By, Over, Times, Under},
    Row, both, each,
    lighting_rows::{deck, horizon, thick, thin},
    model_rows,
    picture::{PictureLab, SharedLab, up},
    scene::Scene,
};
use crate::support::scene::CLEAR;

/// Broken cloud, of the sun's light.
fn broken() -> Scene {
    let mut scene = thick();
    scene.settings.model = model_rows::broken().settings.model;
    scene.pose = up(35.0);
    scene
}

/// Small steps through a sky with hardly any cloud.
fn sparse() -> Scene {
    let mut scene = broken();
    scene.settings.model.coverage = -0.25;
    scene.settings.quality = CloudQuality { step: 25.0, step_growth: 0.0, ..scene.settings.quality };
    scene
}

/// The same past some clouds.
fn scattered() -> Scene {
    let mut scene = sparse();
    scene.settings.model.coverage = -0.05;
    scene.settings.quality.max_steps = 4096;
    scene.pose = up(15.0);
    scene
}

/// Closed cloud that is all noise.
fn closed() -> Scene {
    let mut scene = broken();
    let model = &scene.settings.model;
    scene.settings.model = CloudModel { coverage: 1.0, erosion: Erosion::Subtract, extinction: 0.005, ..model.clone() };
    scene
}

/// A smooth deck in long steps, which show as bands.
fn banded() -> Scene {
    let mut scene = deck(0.003);
    scene.settings.quality.step = 300.0;
    scene
}

/// Where steps begin is by chance, so that they show as noise.
fn noisy() -> Scene {
    let mut scene = banded();
    scene.settings.quality.offsets = true;
    scene
}

fn in_mode(temporal: TemporalMode) -> Scene {
    let mut scene = noisy();
    scene.settings.quality.temporal = temporal;
    scene
}

fn window() -> Scene {
    in_mode(TemporalMode::SlidingWindow)
}

/// Small steps, all of them taken.
fn even() -> Scene {
    let mut scene = thin();
    let quality = &scene.settings.quality;
    let quality = CloudQuality { step: 20.0, step_growth: 0.0, long_step: 1, max_steps: 4096, ..quality.clone() };
    scene.settings.quality = quality;
    scene
}

/// Uneven shade, of which steps towards the sun find more or less.
fn shaded() -> Scene {
    let mut scene = broken();
    scene.settings.model.extinction = 0.01;
    scene.settings.quality = CloudQuality { light_steps: 6, light_growth: 1.0, ..scene.settings.quality };
    scene
}

/// The slab of the path tracer's own tests: of the settings it takes the light and the quality.
fn slab() -> Scene {
    let mut scene = thin();
    scene.settings.quality = CloudQuality::reference();
    scene
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

fn mean_steps(lab: &mut PictureLab, scene: &Scene) -> f32 {
    mean(&lab.steps(scene))
}

/// How unlike pixels are that lie side by side, once there have been more frames than a window has.
fn noise(lab: &mut PictureLab, scene: &Scene) -> f32 {
    lab.after(scene, 20).roughness()
}

/// How a frame differs from the one before.
fn flicker(lab: &mut PictureLab, scene: &Scene) -> f32 {
    let [before, after] = lab.two(scene, 20, |_| ());
    before.difference(&after)
}

/// How far the light is off what the finest steps towards the sun show.
fn shade_error(lab: &mut PictureLab, scene: &Scene) -> f32 {
    let mut fine = scene.clone();
    let quality = &fine.settings.quality;
    fine.settings.quality = CloudQuality { light_steps: 64, light_step: 20.0, light_growth: 1.02, ..quality.clone() };
    let fine = lab.of(&fine);
    lab.of(scene).difference(&fine)
}

pub fn rows() -> Vec<Row<PictureLab>> {
    [march(), time()].into_iter().flatten().collect()
}

#[rustfmt::skip]
pub fn traced() -> Vec<Row<SharedLab>> {
    vec![
        // Paths are noise at first, steps are not.
        each("quality.method", slab, ["march", "path_trace"], |lab, s| lab.of(s).roughness(), Over(5.0)),
        both("quality.seed", slab, ["0", "1"], |lab, a, b| {
            let (first, other, again) = (lab.of(a), lab.of(b), lab.of(a));
            [first.difference(&again), first.difference(&other)]
        }, By(0.1, 10.0)),
    ]
}

#[rustfmt::skip]
fn march() -> Vec<Row<PictureLab>> {
    vec![
        // Pixels between texels are a mean of those.
        each("quality.resolution", broken, ["full", "quarter"], |lab, s| lab.of(s).roughness(), Under(0.8)),
        each("quality.step", even, ["20", "40"], mean_steps, Times(0.5, 0.05)),
        each("quality.step_growth", even, ["0", "0.02"], mean_steps, Under(0.6)),
        each("quality.long_step", sparse, ["1", "8"], mean_steps, Under(0.8)),
        each("quality.empty_steps", scattered, ["1", "32"], mean_steps, Over(1.2)),
        each("quality.max_steps", even, ["4096", "24"],
            |lab, s| lab.steps(s).into_iter().fold(0.0, f32::max), By(-200.0, -15.0)),
        each("quality.max_steps", even, ["24", "12"],
            |lab, s| lab.steps(s).into_iter().fold(0.0, f32::max), Times(0.5, 0.2)),
        // The sun is not shadowed at all.
        each("quality.light_steps", thick, ["6", "0"], |lab, s| lab.of(s).light(), Over(3.0)),
        each("quality.light_steps", shaded, ["2", "16"], shade_error, Under(0.7)),
        each("quality.light_step", || { let mut s = shaded(); s.set("quality.light_steps", "1"); s }, ["20", "5000"],
            shade_error, Over(1.2)),
        each("quality.light_growth", || { let mut s = shaded(); s.set("quality.light_step", "300"); s }, ["1", "4"],
            shade_error, Over(1.2)),
        each("quality.transmittance_stop", || { let mut s = even(); s.set("model.extinction", "0.01"); s },
            ["0.01", "0.5"], mean_steps, Under(0.7)),
        each("quality.density_skip", broken, ["0.002", "0.5"], |lab, s| lab.of(s).transmittance(), Over(1.1)),
        each("quality.max_distance", horizon, ["20000", "5000"], |lab, s| lab.of(s).transmittance(), Over(1.2)),
        each("quality.lod_bias", closed, ["0", "6"], |lab, s| lab.of(s).roughness(), Under(0.7)),
        // Too dark for long steps.
        each("quality.integration", || { let mut s = thick(); s.set("quality.step", "200"); s },
            ["energy_conserving", "naive"], |lab, s| lab.of(s).light(), Under(0.8)),
    ]
}

#[rustfmt::skip]
fn time() -> Vec<Row<PictureLab>> {
    vec![
        each("quality.offsets", banded, ["false", "true"], noise, Over(2.0)),
        each("quality.temporal", noisy, ["off", "sliding_window"], noise, Under(0.5)),
        each("quality.window", window, ["2", "16"], noise, Under(0.6)),
        each("quality.alpha", || in_mode(TemporalMode::Exponential), ["0.05", "0.8"], flicker, Over(3.0)),
        // Pixels that a frame changes: a quarter or a sixteenth of those with cloud, once pictures are no longer young.
        each("quality.block", || in_mode(TemporalMode::Upscale), ["two", "four"], |lab, s| {
            let [before, after] = lab.two(s, 100, |_| ());
            before.changed(&after)
        }, Times(0.25, 0.3)),
        // Blue noise that is the same everywhere shows no noise.
        each("slots.blue_noise", noisy, ["none", "black"], noise, Under(0.6)),
    ]
}

#[rustfmt::skip]
pub fn of_views() -> Vec<Row<PictureLab>> {
    vec![
        each("view.enabled", broken, ["true", "false"],
            |lab, s| (lab.shown(s) - CLEAR).abs().max_element(), Under(0.01)),
        each("view.quality", broken, ["none", "near"], |lab, s| 1.0 - lab.of(s).transmittance(), Under(1e-6)),
        // From a mean of 16 frames to a single one.
        each("view.reset", window, ["0", "1"], |lab, s| {
            let by = s.view.reset;
            let [_, after] = lab.two(s, 20, |view| view.reset += by);
            after.roughness()
        }, Over(1.5)),
        // The grey of thin cloud's transmittance, in place of its light.
        each("view.debug", thin, ["none", "transmittance"], |lab, s| lab.of(s).transmittance(), Under(1e-6)),
        // Red glass before the clouds, and behind them.
        each("view.order", thick, ["before_transparent", "after_transparent"],
            |lab, s| lab.shown_with_glass(s).x, Under(0.5)),
    ]
}
