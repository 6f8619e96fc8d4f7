//! Leaving a cloud: what held frames saw of it from within is not laid over what is ahead.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{Motion, REST, at_rest_and_moving, pose, quality, sky, truth};
use crate::support::{
    app::{View, cloud_pixels},
    gpu::run_updates,
    temporal_modes::{ALONE, HELD},
};

/// A way from below the clouds' bases on, and steps along it to look for a cloud that is left (m).
const WAY: Motion = Motion { from: Vec3::new(0.0, 1400.0, 300.0), pitch: 0.7, ..REST };
const AHEAD: Vec3 = Vec3::NEG_Z;
const LOOK: f32 = 30.0;
/// 200 m/s at 60 frames a second.
const STEP: f32 = 10.0 / 3.0;
const FRAMES: u32 = 24;

/// Errors at most. They are .079, .077, .065 and .066; the last two would be .099 and .114 were no more texels marched so close
/// to cloud. Were nothing to fade either, all would be .081, .115, .152 and .201: the window has left the cloud behind by then
/// in any case.
const MOST: [f32; 4] = [0.1, 0.095, 0.08, 0.08];

fn mean_transmittance(app: &App, view: &View) -> f32 {
    let pixels = cloud_pixels(app, view);
    pixels.iter().map(|p| p.w).sum::<f32>() / pixels.len() as f32
}

/// How far along the way a cloud is left whose fog hid nearly everything.
fn left_after(app: &mut App, view: &View, sun: Entity) -> f32 {
    app.insert_resource(quality(ALONE));
    let mut in_fog = false;
    for k in 0..160 {
        pose(app, view, sun, Motion { metres: AHEAD * LOOK, ..WAY }, k);
        run_updates(app, 1);
        let through = mean_transmittance(app, view);
        if in_fog && through > 0.3 {
            return k as f32 * LOOK;
        }
        in_fog = through < 0.05 || in_fog && through < 0.3;
    }
    panic!("no cloud on the way is left");
}

#[test]
fn what_has_been_flown_through_is_not_laid_over_what_is_ahead() {
    let (mut app, view, sun) = sky();
    let end = left_after(&mut app, &view, sun);
    let motion = Motion { from: WAY.from + AHEAD * (end - STEP * (FRAMES - 1) as f32), metres: AHEAD * STEP, ..WAY };
    pose(&mut app, &view, sun, motion, FRAMES - 1);
    let truth = truth(&mut app, &view, MarchResolution::Full);
    for (mode, most) in HELD.into_iter().zip(MOST) {
        let [rest, moving] = at_rest_and_moving(&mut app, &view, sun, (motion, FRAMES), mode, &truth);
        println!("{mode:?}: {rest:.4} at rest, {moving:.4} leaving a cloud after {end} m");
        assert!(moving < most, "{mode:?}: {moving} leaving a cloud after {end} m, {most} at most");
    }
}
