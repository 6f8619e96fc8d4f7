//! Leaving a cloud: what held frames saw of it from within is not laid over what is ahead.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{Motion, Picture, REST, picture, pose, quality, rms, sky, start_over, truth};
use crate::support::{
    app::View,
    gpu::run_updates,
    temporal_modes::{ALONE, HELD},
};

/// A way below the tops of clouds, 10 m a frame: 600 m/s at 60 frames a second.
const WAY: Motion =
    Motion { from: Vec3::new(0.0, 1400.0, -1200.0), pitch: 0.7, metres: Vec3::new(0.0, 0.0, -10.0), ..REST };
/// Frames up to the one that leaves the cloud, and those after it that are judged.
const FRAMES: u32 = 16;
const AFTER: [u32; 5] = [0, 1, 2, 4, 8];

/// Most by which the mean transmittance may be off, and most that errors may be, in the mean of the frames judged.
///
/// Transmittance is off by -.014, -.002, -.036 and -.040; were nothing to fade by -.030, -.055, -.060 and -.083.
/// Errors of the last two are .060 and .065; were nothing to fade .093 and .131, and were no more texels marched close to
/// cloud .122 and .119.
const MOST: [[f32; 2]; 4] = [[0.021, 0.12], [0.02, 0.1], [0.047, 0.077], [0.055, 0.085]];

fn mean_transmittance(picture: &Picture) -> f32 {
    picture.iter().map(|p| p.w).sum::<f32>() / picture.len() as f32
}

/// After how many frames of the way a cloud is left whose fog hid nearly everything.
fn left_after(app: &mut App, view: &View, sun: Entity) -> u32 {
    app.insert_resource(quality(ALONE));
    let mut in_fog = false;
    for k in 0..200 {
        pose(app, view, sun, WAY, k);
        run_updates(app, 1);
        let through = mean_transmittance(&picture(app, view));
        if in_fog && through > 0.15 {
            return k;
        }
        in_fog = through < 0.05 || in_fog;
    }
    panic!("no cloud on the way is left");
}

#[test]
fn what_has_been_flown_through_is_not_laid_over_what_is_ahead() {
    let (mut app, view, sun) = sky();
    let left = left_after(&mut app, &view, sun);
    assert!(left >= FRAMES, "the cloud is left after {left} frames, before there is a past");
    let truths = AFTER.map(|after| {
        pose(&mut app, &view, sun, WAY, left + after);
        truth(&mut app, &view, MarchResolution::Full)
    });
    let mut wrong = Vec::new();
    for (mode, [most_off, most]) in HELD.into_iter().zip(MOST) {
        app.insert_resource(quality(mode));
        start_over(&mut app, &view);
        let (mut off, mut error) = (0.0, 0.0);
        for k in left - (FRAMES - 1)..=left + AFTER[AFTER.len() - 1] {
            pose(&mut app, &view, sun, WAY, k);
            run_updates(&mut app, 1);
            if let Some(i) = AFTER.iter().position(|after| left + after == k) {
                let now = picture(&app, &view);
                off += (mean_transmittance(&now) - mean_transmittance(&truths[i])) / AFTER.len() as f32;
                error += rms(&now, &truths[i]) / AFTER.len() as f32;
            }
        }
        println!("{mode:?}: {off:+.4} of transmittance and an error of {error:.4} after {left} frames");
        if off.abs() >= most_off || error >= most {
            wrong.push(format!("{mode:?}: off by {off} and {error}, not {most_off} and {most}"));
        }
    }
    assert!(wrong.is_empty(), "on leaving a cloud: {wrong:#?}");
}
