//! How much a view that hardly changes does change from frame to frame.

use anyhow::{Context as _, Result};

use super::{
    Bench,
    plan::{FLICKER_FRAMES, FLICKERS, MODES, Motion, Take},
};
use crate::{engine::Job, picture::Picture};

pub fn job(motion: &Motion, mode: usize, frame: u32) -> String {
    format!("{}_{mode}_{frame}", motion.name)
}

/// Of each view, for each mode.
pub fn measure(bench: &Bench) -> Result<Vec<Vec<f64>>> {
    FLICKERS.iter().map(|motion| of_view(bench, motion)).collect()
}

fn of_view(bench: &Bench, motion: &Motion) -> Result<Vec<f64>> {
    let scene = motion.scene;
    let effective = &bench.engine.effective(&format!("--scene {scene}"))?;
    let take = Take { motion, effective, zoom: bench.zoom };
    let first = *motion.judged.first().context("a view without a frame")?;
    let mut jobs = Vec::new();
    for (mode, way) in MODES.iter().enumerate() {
        // Each starts over at the same place, and ends a frame later.
        for k in 0..FLICKER_FRAMES {
            let frames = way.memory + k;
            let options = format!("{} {} {}", take.coming_to(first + k, frames)?, way.options, bench.sky());
            jobs.push(Job { name: job(motion, mode, k), options, frames, picture: true });
        }
    }
    bench.engine.render(scene, &bench.size, &jobs, &bench.progress)?;
    let of_mode = |mode| {
        let pictures = (0..FLICKER_FRAMES).map(|k| bench.picture(scene, &job(motion, mode, k), effective));
        Ok(flicker(&pictures.collect::<Result<Vec<_>>>()?))
    };
    (0..MODES.len()).map(of_mode).collect()
}

/// Root of the mean variance over time of the pixels' brightness as shown, over the mean brightness; 0 for nothing.
fn flicker(pictures: &[Picture]) -> f64 {
    let count = pictures.len() as f64;
    let Some(first) = pictures.first() else { return 0.0 };
    let (mut variance, mut total) = (0.0, 0.0);
    for (x, y, _) in first.shown.enumerate_pixels() {
        let of = |p: &Picture| {
            let [r, g, b] = p.shown.get_pixel(x, y).0.map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let mean = pictures.iter().map(of).sum::<f64>() / count;
        variance += pictures.iter().map(|p| (of(p) - mean).powi(2)).sum::<f64>() / count;
        total += mean;
    }
    let pixels = f64::from(first.shown.width() * first.shown.height()).max(1.0);
    if total > 0.0 { (variance / pixels).sqrt() / (total / pixels) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::plain;

    #[test]
    fn flicker_is_the_share_that_changes() {
        let grey = |code| plain([code; 3], [1.0; 4]);
        assert_eq!(flicker(&[]), 0.0);
        assert_eq!(flicker(&[grey(100), grey(100)]), 0.0);
        assert!((flicker(&[grey(90), grey(110)]) - 0.1).abs() < 1e-9);
    }
}
