//! The phase functions in use: slot 0 is [`CloudLighting`]'s own, the others are layers'.

use bevy::prelude::*;

use crate::{
    reference::phase::Phase,
    settings::{CloudLighting, CloudPhase},
};

/// Slots that a medium can mix: `Medium::phase` has a share for each.
pub(crate) const PHASE_SLOTS: usize = 4;

/// The phase functions of a view.
#[derive(Clone, Debug)]
pub(crate) struct PhaseSlots(Vec<Phase>);

impl PhaseSlots {
    /// Slot 0 from the lighting, then one for each of up to three `layers`; more are ignored.
    pub fn new(lighting: &CloudLighting, layers: &[CloudPhase]) -> Self {
        let own = CloudPhase::from(lighting);
        let all = std::iter::once(&own).chain(layers).take(PHASE_SLOTS);
        // Settings are validated before they get here, so the fallback is never seen.
        Self(all.map(|phase| Phase::of(phase).unwrap_or(Phase::Isotropic)).collect())
    }

    /// How many are in use, 1 to 4.
    pub fn count(&self) -> u32 {
        self.0.len() as u32
    }

    fn each<T: Copy>(&self, unused: T, of: impl Fn(&Phase) -> T) -> [T; PHASE_SLOTS] {
        std::array::from_fn(|slot| self.0.get(slot).map_or(unused, &of))
    }

    /// Kinds of `phase.wesl`.
    pub fn kinds(&self) -> UVec4 {
        self.each(0, |phase| phase.shader_parameters().0).into()
    }

    /// Parameters of `phase.wesl`.
    pub fn params(&self) -> [Vec4; PHASE_SLOTS] {
        self.each(Vec4::ZERO, |phase| phase.shader_parameters().1.into())
    }

    /// How diffuse light falls with optical depth: ¾(1 − ⟨cosθ⟩).
    pub fn fall(&self) -> Vec4 {
        self.each(0.0, |phase| 0.75 * (1.0 - phase.mean_cosine() as f32)).into()
    }

    /// Factors on optical depth and asymmetry of the first octave, each by slot.
    ///
    /// Light in the diffraction peak hardly turns: it reaches deeper, and leaves a little wider. Both shares are fitted
    /// to the path tracer. Single scattering alone (one octave), or the octaves alone (no diffusion), are the thesis's.
    pub fn first_octave(&self, lighting: &CloudLighting) -> [Vec4; 2] {
        if !diffuses(lighting) {
            return [Vec4::ONE; 2];
        }
        let peaks = Vec4::from(self.each(0.0, |phase| phase.peak_share() as f32));
        [Vec4::ONE - 0.6 * peaks, Vec4::ONE - 0.02 * peaks]
    }
}

/// Whether sunlight diffuses: it takes more than one octave.
pub(crate) fn diffuses(lighting: &CloudLighting) -> bool {
    lighting.octaves > 1 && lighting.diffusion > 0.0
}
