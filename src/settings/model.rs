//! Where cloud is: what the density model reads.

use bevy::{math::DVec3, prelude::*};
use serde::{Deserialize, Serialize};

/// How noise eats into the dimensional profile `d`, with noise value `N`.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum Erosion {
    /// `saturate(N − (1 − d))` (thesis, equation 3.2). Soft everywhere; a cloud is only as dense as its noise.
    Subtract,
    /// `remap(d, 1 − N, 1, 0, 1)` (Schneider). Keeps cores dense and edges crisp; the default.
    #[default]
    Remap,
}

/// The cloud layer: its altitude, maps, noise, wind and density.
///
/// A resource; changes take effect in the next frame and never rebuild a pipeline. Out-of-range values
/// are reported and ignored (see [`validate`](super::Validate::validate)). Lengths in metres.
#[derive(Resource, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Resource, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudModel {
    /// Whether this layer is shown; [`CloudLayers`](super::CloudLayers) have their own. Default true.
    pub enabled: bool,
    /// Altitude of the lower shell, where bases sit (m above the planet's surface). Default 1300.
    #[reflect(@-400.0..=30_000.0_f32)]
    pub bottom: f32,
    /// Altitude of the upper shell (m); must be above `bottom`. Default 3300. A thicker shell costs more steps.
    #[reflect(@-300.0..=40_000.0_f32)]
    pub top: f32,
    /// Added to the coverage map: −1 is a clear sky, 0 the map as it is, 1 overcast. Default 0.04.
    #[reflect(@-1.0..=1.0_f32)]
    pub coverage: f32,
    /// Global cloud type: 0 stratus (thin, low) to 1 cumulus (tall). Default 0.95.
    #[reflect(@0.0..=1.0_f32)]
    pub cloud_type: f32,
    /// How much the type map lowers the global type from place to place (0..1). Default 0.6.
    #[reflect(@0.0..=1.0_f32)]
    pub type_variation: f32,
    /// Side of one repeat of the coverage map (m). Default 26 000.
    #[reflect(@500.0..=1_000_000.0_f32)]
    pub map_scale: f32,
    /// Side of one repeat of the type map (m). Default 14 000.
    #[reflect(@500.0..=1_000_000.0_f32)]
    pub type_scale: f32,
    /// Strength of the second, larger and rotated reading of the coverage map, which gathers clouds into
    /// groups and hides the map's repetition (0..1). Default 0.5.
    #[reflect(@0.0..=1.0_f32)]
    pub map_variation: f32,
    /// Global density ρc, a factor on the eroded density (thesis, equation 3.2). Default 1.
    #[reflect(@0.0..=10.0_f32)]
    pub density: f32,
    /// Extinction coefficient σt at density 1 (1/m). Cumulus water is about 0.02 to 0.1. Default 0.05.
    #[reflect(@0.0..=1.0_f32)]
    pub extinction: f32,
    /// Single-scattering albedo, σs/σt, linear RGB (0..1). Default 0.9995: water hardly absorbs.
    #[reflect(@0.0..=1.0_f32)]
    pub albedo: Vec3,
    /// How noise erodes the profile. Default [`Erosion::Remap`].
    pub erosion: Erosion,
    /// Strength of the erosion: 0 shows the bare profile, 1 the full noise. Default 1.
    #[reflect(@0.0..=1.0_f32)]
    pub noise_strength: f32,
    /// Side of one repeat of the billowy (inverted Worley) noise (m). Default 5200.
    #[reflect(@50.0..=100_000.0_f32)]
    pub billow_scale: f32,
    /// Side of one repeat of the fine billows read from the same volume (m). Default 900.
    #[reflect(@20.0..=50_000.0_f32)]
    pub detail_scale: f32,
    /// Share of the fine billows in the billowy noise (0..1; Ford's program: 0.4). Default 0.25.
    #[reflect(@0.0..=1.0_f32)]
    pub detail_strength: f32,
    /// Side of one repeat of the wispy (Perlin fBm) noise (m). Default 1900.
    #[reflect(@20.0..=100_000.0_f32)]
    pub wisp_scale: f32,
    /// Height in the layer (0 base, 1 top) by which wispy noise has given way to billowy noise. Default 0.2.
    #[reflect(@0.01..=1.0_f32)]
    pub wisp_height: f32,
    /// Wind velocity (m/s, world axes; y moves the noise upward). Default (8, 0, 3).
    #[reflect(@-300.0..=300.0_f32)]
    pub wind: Vec3,
    /// Horizontal lean of a cloud's top along the wind (m over the layer's thickness). Default 350.
    #[reflect(@0.0..=20_000.0_f32)]
    pub wind_skew: f32,
    /// Rise of the noise through the clouds (m/s): shapes evolve instead of only sliding. Default 0.8.
    #[reflect(@-50.0..=50.0_f32)]
    pub evolution: f32,
    /// Where the layer is at time zero (m, f64). Transitions keep a sky in place with it. Default 0.
    #[reflect(@-1.0e12..=1.0e12_f32)]
    pub drift: DVec3,
    /// Position of the world's origin on the planet's map (m, f64): change it when a floating origin shifts, by as much as
    /// all entities are moved back. Move the `Atmosphere`'s along as well (Bevy gives it no `Transform`), or Bevy's sky does
    /// not stay where it is; left at its default place, its planet still does for clouds. It is 6360 km away, where
    /// transforms have steps of half a metre: shift by whole metres. Far from the planet's top (+Y of its centre) the map is
    /// stretched across the line to there, so clouds are narrower: by 0.4 % after 1000 km, to two thirds after 10 000 km.
    /// Default 0.
    #[reflect(@-1.0e12..=1.0e12_f32)]
    pub world_offset: DVec3,
}

impl Default for CloudModel {
    fn default() -> Self {
        Self {
            enabled: true,
            bottom: 1300.0,
            top: 3300.0,
            coverage: 0.04,
            cloud_type: 0.95,
            type_variation: 0.6,
            map_scale: 26_000.0,
            type_scale: 14_000.0,
            map_variation: 0.5,
            density: 1.0,
            extinction: 0.05,
            albedo: Vec3::splat(0.9995),
            erosion: Erosion::Remap,
            noise_strength: 1.0,
            billow_scale: 5200.0,
            detail_scale: 900.0,
            detail_strength: 0.25,
            wisp_scale: 1900.0,
            wisp_height: 0.2,
            wind: Vec3::new(8.0, 0.0, 3.0),
            wind_skew: 350.0,
            evolution: 0.8,
            drift: DVec3::ZERO,
            world_offset: DVec3::ZERO,
        }
    }
}
