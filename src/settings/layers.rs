//! Weather-map layers: clouds of any number of kinds at once.

use bevy::{math::DVec3, prelude::*};
use serde::{Deserialize, Serialize};

use super::{CloudPhase, PhaseFunction, SettingsError, Validate};
use crate::weather::WeatherRecipe;

/// Most layers that are shown at once.
pub const MAX_LAYERS: usize = 8;

/// How a layer is drawn.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum LayerKind {
    /// Shape and detail volumes erode it: anything with a body. Three or four samples of textures each step; the default.
    #[default]
    Volume,
    /// Thin high cloud: fibres and cells in the plane, bent by turbulence. About half the cost, and fewer steps.
    Sheet,
}

/// What is read from a layer's map.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum MapChannels {
    /// R coverage, G height, B base altitude (Högfeldt 4.4); the default.
    #[default]
    Rgb,
    /// R is coverage; height is full, the base is flat. So four layers can share one image.
    Red,
    /// G is coverage.
    Green,
    /// B is coverage.
    Blue,
    /// A is coverage. One that is full everywhere is taken for a picture without alpha, which is an error.
    Alpha,
}

/// One layer of clouds from a weather map. Layers may overlap in altitude; what is between them costs next to nothing.
///
/// Density (Högfeldt 4.1): coverage · height signal, eroded by shape noise, then by detail where it is thinner than
/// `edge_threshold`, times a linear gradient from base to top. Lengths in metres.
#[derive(Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudLayer {
    /// What it is called; transitions match layers of the same name. Default empty.
    pub name: String,
    /// Whether it is shown. Default true.
    pub enabled: bool,
    /// How it is drawn. Default [`LayerKind::Volume`].
    pub kind: LayerKind,
    /// The map, made from numbers. Changing one makes it again in the background; the old one stays until then.
    pub map: WeatherRecipe,
    /// Path of an image asset in the recipe's place: PNG, EXR (with the feature `exr`, on by default), or what else Bevy is
    /// built to load, such as KTX2 (not compressed). It tiles over `map.scale`. Hot-reloaded. Default none.
    pub map_file: String,
    /// An image in the recipe's place, and in the file's: set in code. Default none.
    #[serde(skip)]
    pub map_image: Option<Handle<Image>>,
    /// What is read from that image. Default [`MapChannels::Rgb`].
    pub map_channels: MapChannels,
    /// Added to the map's coverage: −1 is a clear sky, 1 overcast. Default 0.
    #[reflect(@-1.0..=1.0_f32)]
    pub coverage: f32,
    /// Factor on coverage before it is cut off at 1: how soon a cloud is whole inwards from its edge. Default 1.
    #[reflect(@0.1..=10.0_f32)]
    pub sharpness: f32,
    /// Added to coverage far away: more or less cloud at the horizon (Högfeldt 4.4). Default 0.
    #[reflect(@-1.0..=1.0_f32)]
    pub far_coverage: f32,
    /// Where that begins (m from the camera, along the ground). Default 10 000.
    #[reflect(@0.0..=1_000_000.0_f32)]
    pub far_start: f32,
    /// Where it is whole (m). Default 60 000.
    #[reflect(@1.0..=2_000_000.0_f32)]
    pub far_end: f32,
    /// Altitude of the lowest bases (m). Default 1200.
    #[reflect(@-400.0..=30_000.0_f32)]
    pub base: f32,
    /// How much higher a base is where the map's B is 1 (m). Default 300.
    #[reflect(@0.0..=10_000.0_f32)]
    pub base_rise: f32,
    /// Height of a cloud where the map's G is 1 (m). Default 1400.
    #[reflect(@10.0..=20_000.0_f32)]
    pub thickness: f32,
    /// Where in its height the signal peaks: 0.5 is Högfeldt's parabola (5.1), less makes bases flat. Default 0.25.
    #[reflect(@0.02..=0.98_f32)]
    pub peak_height: f32,
    /// Peak of the height signal (Högfeldt's base-and-top multiplier). Default 1.
    #[reflect(@0.0..=4.0_f32)]
    pub profile_strength: f32,
    /// Linear gradient from base to top (Högfeldt's base-to-top multiplier): 0 none, 1 nothing at the base. Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub base_to_top: f32,
    /// Spread of tops: 1 is a storm's anvil. Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub anvil: f32,
    /// Factor on the profile before erosion (Högfeldt's thickness multiplier). Default 1.3.
    #[reflect(@0.0..=8.0_f32)]
    pub shape_gain: f32,
    /// How much shape noise erodes (0..1). Default 0.9.
    #[reflect(@0.0..=1.0_f32)]
    pub shape_strength: f32,
    /// Side of one repeat of the shape noise (m). Default 4500.
    #[reflect(@50.0..=200_000.0_f32)]
    pub shape_scale: f32,
    /// How much longer shapes are along the wind than across. Default 1.
    #[reflect(@1.0..=50.0_f32)]
    pub stretch: f32,
    /// Angle from the wind to that direction, clockwise from above (°). Default 0.
    #[reflect(@-180.0..=180.0_f32)]
    pub stretch_angle: f32,
    /// How much detail takes at the edges (0..1). Default 0.35.
    #[reflect(@0.0..=1.0_f32)]
    pub detail_strength: f32,
    /// Density below which detail is added (Högfeldt 4.5.2). Default 0.7.
    #[reflect(@0.01..=1.0_f32)]
    pub edge_threshold: f32,
    /// Side of one repeat of the detail noise (m). Default 800.
    #[reflect(@10.0..=50_000.0_f32)]
    pub detail_scale: f32,
    /// Volume: wisps against billows near the base (0..1). Sheet: cells against fibres. Default 0.7.
    #[reflect(@0.0..=1.0_f32)]
    pub wispiness: f32,
    /// Farthest that curled turbulence moves shapes, most at the base (m). Default 90.
    #[reflect(@0.0..=10_000.0_f32)]
    pub turbulence: f32,
    /// Height (0 base, 1 top) where that has ended. Default 0.4.
    #[reflect(@0.01..=10.0_f32)]
    pub turbulence_height: f32,
    /// Side of one repeat of the turbulence (m). Default 3000.
    #[reflect(@50.0..=200_000.0_f32)]
    pub turbulence_scale: f32,
    /// Factor on the density. Default 1.
    #[reflect(@0.0..=10.0_f32)]
    pub density: f32,
    /// Extinction coefficient σt at density 1 (1/m). Water cloud 0.02 to 0.1, cirrus 0.0001 to 0.002. Default 0.05.
    #[reflect(@0.0..=1.0_f32)]
    pub extinction: f32,
    /// Single-scattering albedo σs/σt, linear RGB. Default 0.9995.
    #[reflect(@0.0..=1.0_f32)]
    pub albedo: Vec3,
    /// Whether `phase` is used in place of [`CloudLighting`](super::CloudLighting)'s phase function. Layers may have three
    /// different ones of their own; what is more takes the light's, with a warning. Default false.
    pub own_phase: bool,
    /// The layer's own phase function.
    pub phase: CloudPhase,
    /// Path of the table that [`PhaseFunction::Table`] reads, an asset (`*.phase.csv`, see
    /// [`CloudPhaseTable`](crate::CloudPhaseTable)). Hot-reloaded. Default none: that of its slot in
    /// [`CloudPhaseTables`](crate::CloudPhaseTables).
    pub phase_file: String,
    /// Precipitation (0..1): a thicker, darker base and shafts of rain below it. Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub rain: f32,
    /// Extinction coefficient of full rain (1/m). Heavy rain 0.002. Default 0.0012.
    #[reflect(@0.0..=0.05_f32)]
    pub rain_extinction: f32,
    /// How far below `base` the shafts end (m); they dry out towards it. With `rain` below 0.1 they end sooner.
    /// Default 2000.
    #[reflect(@0.0..=20_000.0_f32)]
    pub rain_depth: f32,
    /// How far shafts trail behind the cloud for each metre that drops fall, into slower air (m/m). Default 0.4.
    #[reflect(@0.0..=10.0_f32)]
    pub rain_slant: f32,
    /// Wind velocity (m/s, world axes; y moves the noise upward). Default (8, 0, 3).
    #[reflect(@-300.0..=300.0_f32)]
    pub wind: Vec3,
    /// Horizontal lean of a cloud's top along the wind (m over `thickness`): shear over the height of one layer, whose clouds
    /// drift as a whole. Layers at other altitudes have winds of their own, as
    /// [`WindProfile`](crate::weather::WindProfile) gives them. Default 250.
    #[reflect(@-20_000.0..=20_000.0_f32)]
    pub wind_skew: f32,
    /// Rise of the noise through the clouds (m/s): shapes evolve instead of only sliding. Default 0.8.
    #[reflect(@-50.0..=50.0_f32)]
    pub evolution: f32,
    /// Clouds dissolve and others form where a slow wave passes: its speed over the map (m/s). Default 1.5.
    #[reflect(@-50.0..=50.0_f32)]
    pub renewal: f32,
    /// How far that wave has come at time zero (m, f64). Transitions keep clouds from jumping with it. Default 0.
    #[reflect(@-1.0e12..=1.0e12_f32)]
    pub renewal_drift: f64,
    /// Where the layer is at time zero (m, f64). Transitions keep a sky in place with it. Default 0.
    #[reflect(@-1.0e12..=1.0e12_f32)]
    pub drift: DVec3,
}

impl Default for CloudLayer {
    fn default() -> Self {
        Self {
            name: String::new(),
            enabled: true,
            kind: LayerKind::Volume,
            map: WeatherRecipe::default(),
            map_file: String::new(),
            map_image: None,
            map_channels: MapChannels::Rgb,
            coverage: 0.0,
            sharpness: 1.0,
            far_coverage: 0.0,
            far_start: 10_000.0,
            far_end: 60_000.0,
            base: 1200.0,
            base_rise: 300.0,
            thickness: 1400.0,
            peak_height: 0.25,
            profile_strength: 1.0,
            base_to_top: 0.0,
            anvil: 0.0,
            shape_gain: 1.3,
            shape_strength: 0.9,
            shape_scale: 4500.0,
            stretch: 1.0,
            stretch_angle: 0.0,
            detail_strength: 0.35,
            edge_threshold: 0.7,
            detail_scale: 800.0,
            wispiness: 0.7,
            turbulence: 90.0,
            turbulence_height: 0.4,
            turbulence_scale: 3000.0,
            density: 1.0,
            extinction: 0.05,
            albedo: Vec3::splat(0.9995),
            own_phase: false,
            phase: CloudPhase::default(),
            phase_file: String::new(),
            rain: 0.0,
            rain_extinction: 0.0012,
            rain_depth: 2000.0,
            rain_slant: 0.4,
            wind: Vec3::new(8.0, 0.0, 3.0),
            wind_skew: 250.0,
            evolution: 0.8,
            renewal: 1.5,
            renewal_drift: 0.0,
            drift: DVec3::ZERO,
        }
    }
}

impl CloudLayer {
    /// Lowest altitude that it reaches, rain included (m). Rain ends at the surface; where there is hardly any, its shafts
    /// are shorter, so that rain that sets in grows down from the base.
    pub fn bottom(&self) -> f32 {
        /// From so much rain on they are `rain_depth` long.
        const FULL: f32 = 0.1;
        let depth = self.rain_depth * (self.rain / FULL).clamp(0.0, 1.0);
        (self.base - depth).max(self.base.min(0.0))
    }

    /// Its own phase function, if it has one.
    pub(crate) fn its_phase(&self) -> Option<OwnPhase<'_>> {
        let file = if self.phase.function == PhaseFunction::Table { self.phase_file.trim() } else { "" };
        self.own_phase.then_some(OwnPhase { phase: self.phase, file })
    }

    /// Highest altitude that it reaches (m).
    pub fn top(&self) -> f32 {
        self.base + self.base_rise + self.thickness
    }
}

/// A layer's own phase function; layers with equal ones share a slot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct OwnPhase<'a> {
    pub phase: CloudPhase,
    /// Of its table; empty for that of the slot.
    pub file: &'a str,
}

/// Phase functions of their own that layers may have at once.
pub(crate) const MAX_OWN_PHASES: usize = 3;

/// Weather-map layers, in any order; up to [`MAX_LAYERS`]. They add to [`CloudModel`](super::CloudModel)'s own layer.
///
/// A resource; changes take effect in the next frame and never rebuild a pipeline. Default empty.
#[derive(Resource, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[reflect(Resource, Default, Serialize, Deserialize, PartialEq)]
#[serde(transparent)]
pub struct CloudLayers(pub Vec<CloudLayer>);

impl CloudLayers {
    /// Those that are enabled, with their places in the list.
    pub fn shown(&self) -> impl Iterator<Item = (usize, &CloudLayer)> {
        self.0.iter().enumerate().filter(|(_, layer)| layer.enabled).take(MAX_LAYERS)
    }

    /// Distance from the ground to where the last of high layers passes below the horizon (m); 0 without any.
    pub(crate) fn highest_horizon(&self, radius: f64) -> f32 {
        self.shown().map(|(_, layer)| horizon_of(layer.bottom(), radius)).fold(0.0, f32::max)
    }

    /// The different phase functions of layers that have their own: slots 1 to 3.
    pub(crate) fn phases(&self) -> Vec<OwnPhase<'_>> {
        let mut phases = Vec::new();
        for own in self.shown().filter_map(|(_, layer)| layer.its_phase()) {
            if phases.len() < MAX_OWN_PHASES && !phases.contains(&own) {
                phases.push(own);
            }
        }
        phases
    }

    /// The first layer whose own phase function is one too many, and its place.
    pub(crate) fn without_slot(&self) -> Option<(usize, &CloudLayer)> {
        let slots = self.phases();
        self.shown().find(|(_, layer)| layer.its_phase().is_some_and(|own| !slots.contains(&own)))
    }
}

/// Distance from the ground to where a high layer of this base passes below the horizon (m): cirrus is seen much farther
/// than cumulus, and few long steps show it. Lower layers, where this is 0, end at `quality.max_distance`; there is no step
/// in between, so that a layer may rise. Twin of `shown_until` of `render/march/far.wesl`.
fn horizon_of(base: f32, radius: f64) -> f32 {
    /// What counts as low, and as high (m).
    const HIGH: [f32; 2] = [2000.0, 2500.0];
    let share = ((base - HIGH[0]) / (HIGH[1] - HIGH[0])).clamp(0.0, 1.0);
    let horizon = (2.0 * radius * f64::from(base.max(0.0))).sqrt() as f32;
    horizon * (share * share * (3.0 - 2.0 * share))
}

impl Validate for CloudLayers {
    const ROOT: &'static str = "layers";

    fn validate_relations(&self) -> Result<(), SettingsError> {
        if self.0.len() > MAX_LAYERS {
            return Err(SettingsError::TooManyLayers { count: self.0.len(), most: MAX_LAYERS });
        }
        for (i, layer) in self.0.iter().enumerate() {
            let size = layer.map.size;
            if !size.is_power_of_two() {
                let field = format!("layers.{i}.map.size");
                return Err(SettingsError::NotPowerOfTwo { field, value: size, min: 64, max: 2048 });
            }
            if layer.far_end <= layer.far_start {
                return Err(SettingsError::Inverted {
                    low: format!("layers.{i}.far_start"),
                    low_value: layer.far_start,
                    high: format!("layers.{i}.far_end"),
                    high_value: layer.far_end,
                });
            }
        }
        Ok(())
    }
}
