//! How light crosses cloud.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::PhaseFunction;

/// Scattering, phase function and ambient light.
///
/// A resource; changes take effect in the next frame and never rebuild a pipeline.
#[derive(Resource, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Resource, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudLighting {
    /// Terms N of the multiple-scattering sum (thesis, 3.8): 1 is single scattering, 0 no sunlight. Each costs
    /// one exponential a sample. With `diffusion` each but the first holds only what the one before it has lost on the
    /// way: in thin cloud nothing is scattered twice. Default 6.
    #[reflect(@0..=16_u32)]
    pub octaves: u32,
    /// a: factor on the optical depth from one octave to the next (thesis, 3.9). Default 0.69,
    /// so that the last of six octaves reaches as deep as the path tracer says.
    #[reflect(@0.0..=1.0_f32)]
    pub attenuation: f32,
    /// b: factor on the contribution from one octave to the next. Energy is bounded with `diffusion`, and without it
    /// where this is at most `attenuation`. Default 1, fitted.
    #[reflect(@0.0..=1.0_f32)]
    pub contribution: f32,
    /// c: factor on the phase function's asymmetry from one octave to the next (Wrenninge). With
    /// `diffusion` a narrow forward peak is followed apart, and this is the rest's. Default 0.65, fitted.
    #[reflect(@0.0..=1.0_f32)]
    pub eccentricity: f32,
    /// Strength of the sun's light that has been scattered so often that it diffuses, which the octaves lose (with two
    /// octaves or more): radiance at the lit side, in units of the sun's illuminance over 4π. Inside it is weighed
    /// against sky and ground by the optical depth to each; costs six samples of the medium. 0 is the thesis alone.
    /// Default 5.25, fitted to the path tracer.
    #[reflect(@0.0..=40.0_f32)]
    pub diffusion: f32,
    /// Asymmetry of that light at its source: how much of it goes on away from the sun (0 all ways alike). That it is
    /// brighter from where it comes from is part of it in any case. Default 0, fitted.
    #[reflect(@0.0..=0.9_f32)]
    pub diffusion_asymmetry: f32,
    /// The phase function of layers that have none of their own. Default [`PhaseFunction::HgDraine`].
    pub phase: PhaseFunction,
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
    /// Upper bound of a phase value (1/sr). The diffraction peak of real droplets reaches 10²…10⁴ within a
    /// degree of the sun and would alias. What is cut there is lost: at 12 µm 2 % of single scattering with the
    /// default, 28 % (all within 1.6° of the sun) with 30. Default 500.
    #[reflect(@0.1..=100_000.0_f32)]
    pub phase_limit: f32,
    /// Factor on the sun's own light, on clouds and on the ground below; the sky keeps its light. Default 1: as the
    /// scene's light says.
    #[reflect(@0.0..=100.0_f32)]
    pub sun_strength: f32,
    /// Factor on the ambient light: sky and ground around the cloud, and what of them shines through where it is thin.
    /// Default 1.
    #[reflect(@0.0..=100.0_f32)]
    pub ambient_strength: f32,
    /// Tint of the ambient light, linear RGB. Default white.
    #[reflect(@0.0..=10.0_f32)]
    pub ambient_tint: Vec3,
    /// How much of its colour the ambient light loses, towards grey of the same luminance (Högfeldt's ambient desaturate;
    /// 0 none, 1 all). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub ambient_desaturation: f32,
    /// Mean radiance of the sky where the scene has no `Atmosphere`, as a share of the illuminance of the scene's sun
    /// (1/sr, linear RGB). All of it while the sun stands 3° or more above the horizon of the ground below the camera; less
    /// the lower it is, 41 % at 0° and 2 % at −3°, and none from −6° on (the cube of a smoothstep over the elevation).
    /// Default (0.026, 0.037, 0.055): a clear day's.
    #[reflect(@0.0..=1.0_f32)]
    pub sky_fallback: Vec3,
    /// Albedo of the ground below, linear RGB: its bounce lights the bases. Default (0.2, 0.2, 0.18).
    #[reflect(@0.0..=1.0_f32)]
    pub ground_albedo: Vec3,
    /// Powder term `1 − e^(−2τ)` (Costa, 2.20), an artist's darkening of sunlit edges (0 off, 1 full). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub powder: f32,
    /// Amount of aerial perspective between camera and cloud, with Bevy's atmosphere only (0..1): by its tables, above 15 to
    /// 25 km of altitude and with `AtmosphereMode::Raymarched` by a march of 12 steps a ray. Default 1.
    #[reflect(@0.0..=1.0_f32)]
    pub aerial_perspective: f32,
    /// Where the blend with the background begins, as a share of the distance at which a cloud ends:
    /// `quality.max_distance`, or a high layer's horizon. Default 0.6.
    #[reflect(@0.0..=1.0_f32)]
    pub fade_start: f32,
}

impl Default for CloudLighting {
    fn default() -> Self {
        Self {
            octaves: 6,
            attenuation: 0.69,
            contribution: 1.0,
            eccentricity: 0.65,
            diffusion: 5.25,
            diffusion_asymmetry: 0.0,
            phase: PhaseFunction::HgDraine,
            g: 0.8,
            g_back: -0.3,
            lobe_mix: 0.3,
            droplet_diameter: 12.0,
            halo: 0.0,
            phase_limit: 500.0,
            sun_strength: 1.0,
            ambient_strength: 1.0,
            ambient_tint: Vec3::ONE,
            ambient_desaturation: 0.0,
            sky_fallback: Vec3::new(0.026, 0.037, 0.055),
            ground_albedo: Vec3::new(0.2, 0.2, 0.18),
            powder: 0.0,
            aerial_perspective: 1.0,
            fade_start: 0.6,
        }
    }
}
