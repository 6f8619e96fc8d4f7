//! How far baking is: written by the render world, read by the main world.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
};

use bevy::prelude::*;

use super::{slots::SlotStates, weather_maps::LayerMaps};

/// How far the baking of textures is. Read it to wait for them or to show a bar; writing to it does nothing.
///
/// A change to [`CloudTextures`](crate::settings::CloudTextures) or
/// [`CloudTextureSlots`](crate::settings::CloudTextureSlots) shows here from the next frame on.
#[derive(Resource, Reflect, Clone, Copy, PartialEq, Debug)]
#[reflect(Resource, Default, PartialEq)]
pub struct CloudTextureStatus {
    /// Whether textures are being baked, or a user's images being loaded. Always false where clouds cannot be drawn.
    pub baking: bool,
    /// Share of the work done, 0 to 1; 1 when nothing is being baked.
    pub progress: f32,
    /// Frames that the bake under way, or the last one, has been spread over.
    pub frames: u32,
    /// The most work one of those frames did, in texel-octaves: at most [`frame_budget`](Self::frame_budget).
    pub largest_frame: u32,
    /// What one frame may do, in texel-octaves: see
    /// [`TEXEL_OCTAVES_PER_FRAME`](super::TEXEL_OCTAVES_PER_FRAME).
    pub frame_budget: u32,
}

impl Default for CloudTextureStatus {
    fn default() -> Self {
        Self { baking: true, progress: 0.0, frames: 0, largest_frame: 0, frame_budget: 0 }
    }
}

/// The two worlds run side by side, so what they share is atomics.
#[derive(Resource, Clone, Default)]
pub(super) struct Progress(pub Arc<ProgressCells>);

#[derive(Default)]
pub(super) struct ProgressCells {
    /// Whether there is a render half at all.
    pub enabled: AtomicBool,
    /// Counts what has been asked for; `done` is the count of what has been delivered.
    pub asked: AtomicU32,
    pub done: AtomicU32,
    share_bits: AtomicU32,
    frames: AtomicU32,
    largest_frame: AtomicU32,
    pub frame_budget: AtomicU32,
}

impl ProgressCells {
    pub(super) fn ask(&self) {
        self.asked.fetch_add(1, Relaxed);
    }

    /// The render world has all that has been asked for.
    pub(super) fn finish(&self) {
        self.set_share(1.0);
        self.done.store(self.asked.load(Relaxed), Relaxed);
    }

    pub(super) fn set_share(&self, share: f32) {
        self.share_bits.store(share.to_bits(), Relaxed);
    }

    pub(super) fn start_counting(&self) {
        self.frames.store(0, Relaxed);
        self.largest_frame.store(0, Relaxed);
    }

    pub(super) fn count_frame(&self, work: u64) {
        self.frames.fetch_add(1, Relaxed);
        self.largest_frame.fetch_max(u32::try_from(work).unwrap_or(u32::MAX), Relaxed);
    }
}

/// Runs first in the frame, so that what was asked for in the last frame already counts.
pub(super) fn report(
    progress: Res<Progress>,
    slots: Res<SlotStates>,
    maps: Res<LayerMaps>,
    mut status: ResMut<CloudTextureStatus>,
) {
    let cells = &progress.0;
    let enabled = cells.enabled.load(Relaxed);
    let working = enabled && cells.asked.load(Relaxed) != cells.done.load(Relaxed);
    let baking = working || enabled && (slots.loading || maps.published().pending);
    let now = CloudTextureStatus {
        baking,
        progress: if working { f32::from_bits(cells.share_bits.load(Relaxed)).min(0.999) } else { 1.0 },
        frames: cells.frames.load(Relaxed),
        largest_frame: cells.largest_frame.load(Relaxed),
        frame_budget: cells.frame_budget.load(Relaxed),
    };
    status.set_if_neq(now);
}
