//! What a sky may cost: steps, resolution, temporal accumulation.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Size of the marched buffer against the view's.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum MarchResolution {
    /// One ray a pixel.
    Full,
    /// One ray for 2×2 pixels; the default. Each frame of [`TemporalMode::SlidingWindow`] samples another place of them,
    /// so that the picture is nearly as fine as with [`Full`](Self::Full).
    #[default]
    Half,
    /// One ray for 4×4 pixels.
    Quarter,
}

impl MarchResolution {
    /// Pixels a marched texel spans along each axis: 1, 2 or 4.
    pub fn divisor(self) -> u32 {
        match self {
            Self::Full => 1,
            Self::Half => 2,
            Self::Quarter => 4,
        }
    }
}

/// How the light that clouds send to the camera is found.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum CloudMethod {
    /// A ray march with the lighting model of [`CloudLighting`](super::CloudLighting); the default.
    #[default]
    March,
    /// One path a pixel and frame, of any length, averaged for as long as nothing moves: the truth that the march
    /// approximates, for stills and for judging the rest. It reads the model, sun, sky, phase function (in full, without
    /// `phase_limit`), ground albedo, cut-off distance, fade and aerial perspective, and nothing else of lighting and
    /// quality. Hundreds of frames make a picture; see [`CloudNoise`](crate::CloudNoise). Objects of the scene hide
    /// clouds, but cast no shadow on them. Where [`ModelShader`](crate::ModelShader) lacks `extinction_bound`, nothing is
    /// drawn.
    PathTrace,
}

/// How frames are combined over time.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum TemporalMode {
    /// Every frame stands alone.
    Off,
    /// The thesis's unified TAA (4.5): the mean of the last `window` frames. While the camera stands still that is one
    /// addition and one subtraction; in motion each held frame is reprojected by its own camera, which costs in
    /// proportion to `window` but far less than a march. Where marched texels are larger than pixels, each pixel takes the
    /// samples around it, which costs in proportion to `window` too. What no longer fits is left out. A ray to what comes
    /// into view or was hidden before takes twice the steps; after a cut none does, and single frames show their noise.
    /// The default.
    #[default]
    SlidingWindow,
    /// The last picture, reprojected, with `alpha` of the newest frame blended in (Högfeldt 6.1). Two frames of memory;
    /// changes of light lag by about 1/`alpha` frames, and motion softens it.
    Exponential,
    /// One texel of each `block` is marched a frame; the others are taken from the last picture. Cheapest; fast motion and
    /// changes of light show late or soft. What was hidden or off the screen is marched whole at once, and so is cloud that
    /// the camera flies close by, of which little is held: up to what [`Exponential`](Self::Exponential) costs there. A texel
    /// shows the mean of its last `window` samples, of 8 at most: more would take hundreds of frames to change.
    Upscale,
}

/// Of which blocks of texels [`TemporalMode::Upscale`] marches one a frame.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum UpscaleBlock {
    /// 2×2: a quarter is marched; the default.
    #[default]
    Two,
    /// 4×4: a sixteenth is marched, or a quarter where the picture is of fewer than five samples: after a cut, and behind
    /// what has just come into view.
    Four,
}

impl UpscaleBlock {
    /// Texels along one side: 2 or 4.
    pub fn side(self) -> u32 {
        match self {
            Self::Two => 2,
            Self::Four => 4,
        }
    }
}

/// How one step of the march is integrated.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum Integration {
    /// Exact for a constant medium within the step, whatever its length (thesis, equation 8); the default.
    #[default]
    EnergyConserving,
    /// `L·σs·Δ` weighted by the transmittance at the step's end (thesis 4.3, figure 5.11): too dark for long steps. For
    /// comparison.
    Naive,
}

/// Steps, thresholds, resolution and temporal mode.
///
/// A resource for all views; [`CloudView::quality`](super::CloudView::quality) overrides it for one. Start from
/// [`low`](Self::low), [`medium`](Self::medium), [`high`](Self::high) (the default), [`ultra`](Self::ultra) or
/// [`reference`](Self::reference).
#[derive(Resource, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Resource, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudQuality {
    /// How light is found. Default [`CloudMethod::March`].
    pub method: CloudMethod,
    /// Size of the marched buffer. Cost falls with its area. Default [`MarchResolution::Half`].
    pub resolution: MarchResolution,
    /// Length of a step inside cloud near the camera (m). Cost is inverse to it. Default 100.
    #[reflect(@0.5..=5000.0_f32)]
    pub step: f32,
    /// Growth of the step with distance: a step is at least this share of the distance. Default 0.009.
    #[reflect(@0.0..=0.2_f32)]
    pub step_growth: f32,
    /// Length of a step through empty air, in small steps (1 turns adaptive stepping off). Default 4.
    #[reflect(@1..=16_u32)]
    pub long_step: u32,
    /// Empty small steps in a row after which the march tries a long one, and tries again where there might have been cloud.
    /// Default 6.
    #[reflect(@1..=64_u32)]
    pub empty_steps: u32,
    /// Steps a ray may take, long and small together: once it has taken half of them, they grow so that the rest reaches to
    /// its end. Default 768.
    #[reflect(@1..=8192_u32)]
    pub max_steps: u32,
    /// Samples towards the sun for each lit sample (0: the sun is never shadowed). Cost is linear in it. They shrink to fit
    /// the way through the clouds where it is shorter; where it is longer, as under a low sun, one more is taken for each
    /// 500 m, up to 30 km.
    /// Default 6.
    #[reflect(@0..=64_u32)]
    pub light_steps: u32,
    /// Length of the first step towards the sun (m). Default 45.
    #[reflect(@0.5..=5000.0_f32)]
    pub light_step: f32,
    /// Factor from one step towards the sun to the next: 1 is uniform. Default 1.9.
    #[reflect(@1.0..=4.0_f32)]
    pub light_growth: f32,
    /// The march stops where transmittance falls to this (thesis: 0.075); what lies behind is only guessed at, for the sky
    /// that shines through. Default 0.02.
    #[reflect(@0.0..=0.9_f32)]
    pub transmittance_stop: f32,
    /// Samples whose density is below this are skipped (thesis: 0.01). Default 0.002.
    #[reflect(@0.0..=0.9_f32)]
    pub density_skip: f32,
    /// Cut-off distance (m): nothing is marched beyond but high layers (bases from 2500 m on, and some from 2000 m), which
    /// are seen until they pass below the horizon, at 180 km and more. From 2 km up it grows with altitude, so that from
    /// 12 km clouds reach past the horizon, and from space (60 km) all do to the planet's rim; steps grow with distance, so
    /// that costs some dozens of them. Default 150 000.
    #[reflect(@100.0..=2_000_000.0_f32)]
    pub max_distance: f32,
    /// Added to the mip level of all noise: above 0 is smoother and cheaper. Default 0.
    #[reflect(@-4.0..=8.0_f32)]
    pub lod_bias: f32,
    /// How a step is integrated. Default [`Integration::EnergyConserving`].
    pub integration: Integration,
    /// Blue-noise and n-rooks offsets of pixel and depth samples (thesis 4.4): without them steps show as bands.
    /// Default true.
    pub offsets: bool,
    /// How frames are combined. Default [`TemporalMode::SlidingWindow`].
    pub temporal: TemporalMode,
    /// Frames in the sliding window. Memory is linear in it (12 bytes a marched texel and frame: 100 MB at half of 1920×1080
    /// with 16); time is not while the camera stands still. Default 16.
    #[reflect(@1..=16_u32)]
    pub window: u32,
    /// Share of the newest frame in [`TemporalMode::Exponential`] (Högfeldt 6.1): lower is smoother and lags more.
    /// Default 0.05.
    #[reflect(@0.005..=1.0_f32)]
    pub alpha: f32,
    /// What [`TemporalMode::Upscale`] marches a frame. Default [`UpscaleBlock::Two`].
    pub block: UpscaleBlock,
    /// Random numbers of [`CloudMethod::PathTrace`]: another seed makes another, independent picture. Default 0.
    #[reflect(@0..=4_294_967_295_u32)]
    pub seed: u32,
}

impl Default for CloudQuality {
    fn default() -> Self {
        Self::high()
    }
}

impl CloudQuality {
    /// For weak GPUs: a quarter of the resolution, long steps, 90 km.
    pub fn low() -> Self {
        Self {
            resolution: MarchResolution::Quarter,
            step: 140.0,
            step_growth: 0.014,
            max_steps: 512,
            max_distance: 90_000.0,
            window: 8,
            ..Self::high()
        }
    }

    /// Between [`low`](Self::low) and [`high`](Self::high); half of its memory.
    pub fn medium() -> Self {
        Self { resolution: MarchResolution::Half, max_distance: 120_000.0, ..Self::low() }
    }

    /// The default: half resolution, 16 frames, 150 km.
    pub fn high() -> Self {
        Self {
            method: CloudMethod::March,
            resolution: MarchResolution::Half,
            step: 100.0,
            step_growth: 0.009,
            long_step: 4,
            empty_steps: 6,
            max_steps: 768,
            light_steps: 6,
            light_step: 45.0,
            light_growth: 1.9,
            transmittance_stop: 0.02,
            density_skip: 0.002,
            max_distance: 150_000.0,
            lod_bias: 0.0,
            integration: Integration::EnergyConserving,
            offsets: true,
            temporal: TemporalMode::SlidingWindow,
            window: 16,
            alpha: 0.05,
            block: UpscaleBlock::Two,
            seed: 0,
        }
    }

    /// For stills and strong GPUs: every pixel, short steps, 16 frames, 150 km.
    pub fn ultra() -> Self {
        Self {
            resolution: MarchResolution::Full,
            step: 60.0,
            step_growth: 0.006,
            max_steps: 2048,
            transmittance_stop: 0.005,
            density_skip: 0.001,
            ..Self::high()
        }
    }

    /// The truth, for stills: [`CloudMethod::PathTrace`] at every pixel, 150 km. Noise falls with the square root of the
    /// frames drawn while nothing moves.
    pub fn reference() -> Self {
        Self { method: CloudMethod::PathTrace, resolution: MarchResolution::Full, ..Self::ultra() }
    }

    /// The preset of this name (`low`, `medium`, `high`, `ultra`, `reference`), if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "low" => Self::low(),
            "medium" => Self::medium(),
            "high" => Self::high(),
            "ultra" => Self::ultra(),
            "reference" => Self::reference(),
            _ => return None,
        })
    }

    /// Whether [`CloudMethod::PathTrace`] is chosen.
    pub(crate) fn is_path_traced(&self) -> bool {
        self.method == CloudMethod::PathTrace
    }

    /// Pixels a texel of the clouds spans along each axis: those of the resolution, 1 where paths are traced.
    pub(crate) fn divisor(&self) -> u32 {
        if self.is_path_traced() { 1 } else { self.resolution.divisor() }
    }

    /// Frames held: `window` for [`TemporalMode::SlidingWindow`], else 1; 1 too where paths are traced, whose sum alone is
    /// kept.
    pub fn held_frames(&self) -> u32 {
        match self.temporal {
            _ if self.is_path_traced() => 1,
            TemporalMode::Off | TemporalMode::Exponential | TemporalMode::Upscale => 1,
            TemporalMode::SlidingWindow => self.window.clamp(1, 16),
        }
    }

    /// Whether one picture is carried on from frame to frame, in place of a window of frames.
    pub(crate) fn carries_picture(&self) -> bool {
        !self.is_path_traced() && matches!(self.temporal, TemporalMode::Exponential | TemporalMode::Upscale)
    }

    /// Texels along one side of the blocks of which one is marched a frame.
    pub(crate) fn block_side(&self) -> u32 {
        if self.carries_picture() && self.temporal == TemporalMode::Upscale { self.block.side() } else { 1 }
    }

    /// Samples that a texel of a carried picture is the mean of; older ones fade.
    pub(crate) fn samples_kept(&self) -> f32 {
        match self.temporal {
            TemporalMode::Exponential => 1.0 / self.alpha,
            TemporalMode::Upscale => self.window.min(8) as f32,
            _ => self.window as f32,
        }
    }
}
