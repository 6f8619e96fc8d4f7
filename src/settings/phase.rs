//! How light that meets cloud is turned.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{CloudLighting, GoodSettings, MAX_OWN_PHASES, check::check_ranges};

/// The angular distribution of scattered light. Each integrates to 1 over the sphere.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum PhaseFunction {
    /// 1/4π: no direction is preferred.
    Isotropic,
    /// `3 (1 + cos²θ) / 16π`: haze much finer than the light's wavelength (Costa, 2.10, with the 1/4π it lacks).
    Rayleigh,
    /// Henyey–Greenstein with asymmetry `g` (thesis, equation 3.11).
    HenyeyGreenstein,
    /// Cornette–Shanks with asymmetry `g`: Henyey–Greenstein that becomes Rayleigh's where `g` is 0 (Högfeldt, 5.5).
    CornetteShanks,
    /// Schlick's approximation of Henyey–Greenstein, without a power: `k = 1.55g − 0.55g³`, at most 0.999.
    Schlick,
    /// `(1 − lobe_mix)·HG(g) + lobe_mix·HG(g_back)`.
    TwoLobe,
    /// Jendersie & d'Eon's fit to Mie scattering from `droplet_diameter` (thesis, 3.13 to 3.17); the default.
    #[default]
    HgDraine,
    /// Mie's theory itself for droplets of `droplet_diameter`, in colour: fogbow, glory and corona. Computed in the
    /// background, in 0.3 s at 10 µm and 3 s at 50; until then it is the fit above, as it always is
    /// in octaves after the first.
    Mie,
    /// The ice crystals of cirrus, rough ones, with a 22° halo of strength `halo`. Octaves after the first have no halo.
    Ice,
    /// A table of your own, from [`CloudLayer::phase_file`](crate::CloudLayer::phase_file) or
    /// [`CloudPhaseTables`](crate::CloudPhaseTables); in octaves after the first
    /// Henyey–Greenstein with the table's asymmetry. Until it is loaded, Henyey–Greenstein with `g`.
    Table,
}

/// The phase function of one cloud layer, with its parameters.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudPhase {
    /// The phase function. Default [`PhaseFunction::HgDraine`].
    pub function: PhaseFunction,
    /// Asymmetry of Henyey–Greenstein, Cornette–Shanks, Schlick and of the forward lobe (−1 back, 1 forward).
    /// Default 0.8.
    #[reflect(@-0.99..=0.99_f32)]
    pub g: f32,
    /// Asymmetry of the second lobe of [`PhaseFunction::TwoLobe`]. Default −0.3.
    #[reflect(@-0.99..=0.99_f32)]
    pub g_back: f32,
    /// Share of the second lobe (0..1). Default 0.3.
    #[reflect(@0.0..=1.0_f32)]
    pub lobe_mix: f32,
    /// Droplet diameter of [`PhaseFunction::HgDraine`] and [`PhaseFunction::Mie`] (µm). Default 12.
    #[reflect(@5.0..=50.0_f32)]
    pub droplet_diameter: f32,
    /// Strength of the 22° halo of [`PhaseFunction::Ice`] (0 rough crystals, 1 smooth prisms). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub halo: f32,
}

impl Default for CloudPhase {
    fn default() -> Self {
        Self::from(&CloudLighting::default())
    }
}

impl From<&CloudLighting> for CloudPhase {
    fn from(lighting: &CloudLighting) -> Self {
        Self {
            function: lighting.phase,
            g: lighting.g,
            g_back: lighting.g_back,
            lobe_mix: lighting.lobe_mix,
            droplet_diameter: lighting.droplet_diameter,
            halo: lighting.halo,
        }
    }
}

/// Phase functions for a model of one's own ([`ModelShader`](crate::ModelShader)) to mix: the first is slot 1 of
/// `Medium::phase` and the third slot 3; more are ignored. Slot 0 is always [`CloudLighting`]'s. Default none.
///
/// Each costs a few values of it a ray, and nothing a step. One that is out of range is reported, and all stay as they
/// were.
#[derive(Resource, Reflect, Clone, PartialEq, Debug, Default)]
#[reflect(Resource, Default, PartialEq)]
pub struct ModelPhases(pub Vec<CloudPhase>);

/// Slots 1 to 3 as the renderer sees them: those of the layers, or where there are none the last good [`ModelPhases`].
#[derive(Resource, Clone, PartialEq, Debug, Default)]
pub(crate) struct GoodPhases(pub Vec<CloudPhase>);

pub(crate) fn keep_good_phases(
    phases: Option<Res<ModelPhases>>,
    settings: Res<GoodSettings>,
    mut good: ResMut<GoodPhases>,
    mut own: Local<Vec<CloudPhase>>,
    mut told: Local<Option<String>>,
) {
    if let Some(phases) = phases.filter(|phases| phases.is_changed()) {
        let wrong =
            phases.0.iter().enumerate().find_map(|(i, phase)| check_ranges(phase, &format!("phases[{i}]")).err());
        match wrong {
            Some(error) => error!("clouds: {error}; the last good phase functions stay"),
            None => own.clone_from(&phases.0),
        }
    }
    let layers = &settings.0.layers;
    let slots = layers.phases().into_iter().map(|slot| slot.phase);
    let now = if layers.0.is_empty() { own.clone() } else { slots.collect() };
    good.set_if_neq(GoodPhases(now));
    let left = layers.without_slot().map(|(i, layer)| format!("layers.{i}.phase ({:?})", layer.name));
    if *told != left {
        if let Some(left) = &left {
            warn!(
                "clouds: {left} takes the light's phase function: layers may have {MAX_OWN_PHASES} different ones of their own"
            );
        }
        *told = left;
    }
}
