//! A window at a lower resolution shows more than it marches.

use bevy_cumulus::prelude::*;

use super::{MOTIONS, REST, WINDOW, picture, pose, quality, rms, sky, start_over, truth};
use crate::support::{gpu::run_updates, temporal_modes::Mode};

const FRAMES: u32 = 16;
/// A mean of as many samples, of which nothing is known but the texel: the picture that is carried on.
const MEAN: Mode = (TemporalMode::Exponential, UpscaleBlock::Two);
/// The most that the window's error may be, in that mean's: at rest, and in motion.
const MOST: [f32; 2] = [0.75, 0.9];

#[test]
fn a_window_is_finer_than_its_texels() {
    let (mut app, view, sun) = sky();
    for (motion, most) in [REST, MOTIONS[0]].into_iter().zip(MOST) {
        pose(&mut app, &view, sun, motion, FRAMES - 1);
        let truth = truth(&mut app, &view, MarchResolution::Full);
        for resolution in [MarchResolution::Half, MarchResolution::Quarter] {
            let [window, mean] = [WINDOW, MEAN].map(|mode| {
                app.insert_resource(CloudQuality { resolution, ..quality(mode) });
                start_over(&mut app, &view);
                for k in 0..FRAMES {
                    pose(&mut app, &view, sun, motion, k);
                    run_updates(&mut app, 1);
                }
                rms(&picture(&app, &view), &truth)
            });
            let what = format!("{resolution:?} {}", motion.name);
            println!("{what}: {window:.4} by the window, {mean:.4} by the mean");
            assert!(window < most * mean, "{what}: {window}, and {mean} for the mean");
        }
    }
}
