//! Every way of combining frames.

use bevy_cumulus::prelude::*;

/// A temporal mode, and the blocks that `Upscale` marches one texel of.
pub type Mode = (TemporalMode, UpscaleBlock);

/// Every frame stands alone.
pub const ALONE: Mode = (TemporalMode::Off, UpscaleBlock::Two);

/// Those that keep something of earlier frames.
pub const HELD: [Mode; 4] = [
    (TemporalMode::SlidingWindow, UpscaleBlock::Two),
    (TemporalMode::Exponential, UpscaleBlock::Two),
    (TemporalMode::Upscale, UpscaleBlock::Two),
    (TemporalMode::Upscale, UpscaleBlock::Four),
];

/// All of them, [`ALONE`] first.
pub fn all() -> impl Iterator<Item = Mode> {
    [ALONE].into_iter().chain(HELD)
}

/// This quality in a mode.
pub fn in_mode((temporal, block): Mode, quality: CloudQuality) -> CloudQuality {
    CloudQuality { temporal, block, ..quality }
}
