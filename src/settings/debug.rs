//! Looking at one stage of the clouds alone.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{CloudLighting, CloudModel, CloudQuality, PhaseFunction, TemporalMode, snake_case};

/// What a [`CloudView`](super::CloudView) shows in place of finished clouds. A change drops the view's history.
///
/// Greys reach the camera as radiance over exposure: 1 is a colour of 1 before tone mapping, as is a white wall. Those
/// that say "shader" have a march of their own, compiled when first asked for; until then the finished clouds stay. The
/// others only change settings of this view for as long as they are on.
///
/// The maps ask the model for a function `debug_value` (see `docs/shaders.md`). A [`ModelShader`](crate::ModelShader)
/// without it gets one error in the log; the finished clouds stay, and `CloudStatus::is_ready` is false until another
/// view is chosen.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq, Hash)]
pub enum CloudDebugView {
    /// The finished clouds; the default.
    #[default]
    None,
    /// Coverage (0..1, thesis, equation 3.1) as grey on the lower shell; shader. Needs the model's `debug_value`.
    CoverageMap,
    /// Cloud type (0 stratus to 1 cumulus) as grey on the lower shell; shader. Needs the model's `debug_value`.
    TypeMap,
    /// The dimensional profile (0..1, thesis, equation 3.1): a volume as grey as its profile, without noise or light;
    /// shader.
    DimensionalProfile,
    /// The density after erosion (thesis, equation 3.2): a volume of one grey, without light; shader.
    ErodedDensity,
    /// The sun's light scattered once: no octaves, diffusion or ambient light.
    SingleScattering,
    /// The sun's light alone, scattered as often as `lighting.octaves` and `lighting.diffusion` say.
    MultipleScattering,
    /// Light scattered alike in all directions, in place of `lighting.phase`.
    NoPhase,
    /// Steps a ray took, on a logarithmic scale: black and blue are few, red and yellow more, white is
    /// `quality.max_steps`; shader.
    Steps,
    /// Transmittance as grey: 0 is opaque, 1 clear; shader.
    Transmittance,
    /// Mean distance of the cloud as grey: 0 at the camera, 1 at `quality.max_distance`; shader.
    CloudDepth,
    /// One frame, without the sliding window.
    SingleFrame,
    /// For programs: how many steps each ray took, exactly. The march does all that it does for finished clouds and writes
    /// the count in the light's place; [`CloudCounts`](crate::CloudCounts) reads it from a
    /// [`CloudFrame`](crate::CloudFrame). Shader, as of the next two.
    StepCount,
    /// For programs: how many times each ray asked the model for a medium, towards the light included.
    SampleCount,
    /// For programs: how many textures each ray read (a sample or load is one, however it is filtered): the model's and the
    /// march's own. What a [`ModelShader`](crate::ModelShader) reads by itself is not counted.
    ReadCount,
}

/// Which march shader a debug view needs.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) enum DebugShader {
    /// The normal one.
    #[default]
    None,
    /// With `DEBUG_VIEW`.
    March,
    /// With `DEBUG_MAP` too, which asks the model for `debug_value`.
    Map,
    /// The normal one with `COUNTS`.
    Count,
}

impl DebugShader {
    /// Whether it shows a value of the march, for which no cloud is lit.
    pub(crate) fn shows_values(self) -> bool {
        matches!(self, Self::March | Self::Map)
    }
}

impl CloudDebugView {
    /// All of them, [`None`](Self::None) first.
    pub const ALL: [Self; 15] = [
        Self::None,
        Self::CoverageMap,
        Self::TypeMap,
        Self::DimensionalProfile,
        Self::ErodedDensity,
        Self::SingleScattering,
        Self::MultipleScattering,
        Self::NoPhase,
        Self::Steps,
        Self::Transmittance,
        Self::CloudDepth,
        Self::SingleFrame,
        Self::StepCount,
        Self::SampleCount,
        Self::ReadCount,
    ];

    /// Its name in snake_case, such as `coverage_map`.
    pub fn name(self) -> String {
        snake_case(&format!("{self:?}"))
    }

    /// The debug view of this name in snake_case, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|view| view.name() == name)
    }

    /// The mode in `debug.wesl` or `count.wesl`; 0 where the normal shader does.
    pub(crate) fn shader_mode(self) -> u32 {
        match self {
            Self::CoverageMap => 1,
            Self::TypeMap => 2,
            Self::DimensionalProfile => 3,
            Self::ErodedDensity => 4,
            Self::Steps => 5,
            Self::Transmittance => 6,
            Self::CloudDepth => 7,
            Self::StepCount => 8,
            Self::SampleCount => 9,
            Self::ReadCount => 10,
            Self::None | Self::SingleScattering | Self::MultipleScattering | Self::NoPhase | Self::SingleFrame => 0,
        }
    }

    /// The march it needs.
    pub(crate) fn shader(self) -> DebugShader {
        match self {
            Self::CoverageMap | Self::TypeMap => DebugShader::Map,
            Self::StepCount | Self::SampleCount | Self::ReadCount => DebugShader::Count,
            _ if self.shader_mode() > 0 => DebugShader::March,
            _ => DebugShader::None,
        }
    }

    /// Makes its changes to a view's quality.
    pub(crate) fn change_quality(self, quality: &mut CloudQuality) {
        if self == Self::SingleFrame {
            quality.temporal = TemporalMode::Off;
        }
    }

    /// Makes its changes to the lighting.
    pub(crate) fn change_lighting(self, lighting: &mut CloudLighting) {
        match self {
            Self::SingleScattering => {
                lighting.octaves = 1;
                lighting.ambient_strength = 0.0;
            }
            Self::MultipleScattering => lighting.ambient_strength = 0.0,
            Self::NoPhase => lighting.phase = PhaseFunction::Isotropic,
            // Air in front of a value would change it.
            _ if self.shader().shows_values() => lighting.aerial_perspective = 0.0,
            _ => {}
        }
    }

    /// Makes its changes to the model.
    pub(crate) fn change_model(self, model: &mut CloudModel) {
        if self == Self::DimensionalProfile {
            model.noise_strength = 0.0;
        }
    }
}
