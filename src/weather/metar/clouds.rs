//! The report's sky as layers of clouds.

use bevy::math::Vec3;

use super::{CloudGroup, CloudKind, MetarSky, Precipitation, PrecipitationKind};
use crate::{
    settings::{CloudLayer, CloudLayers, CloudPreset, MAX_LAYERS},
    weather::{
        WeatherRecipe, WindProfile,
        sky::{along_wind, genus, sky_of},
    },
};

/// As in `layers.rs`: where middle and high clouds begin (m above ground).
const MIDDLE: f32 = 2000.0;
const HIGH: f32 = 6000.0;
/// Overcast with its base below this is stratus (m above ground).
const STRATUS: f32 = 600.0;
/// Where anvils spread: the tropopause of temperate latitudes (m).
const TROPOPAUSE: f32 = 11_500.0;
/// Contrast that is just seen, as an optical depth: Koschmieder's ln 50.
const KOSCHMIEDER: f32 = 3.912;
/// Visibility of fog of which the report says no more (m).
const USUAL_FOG: f32 = 500.0;

impl MetarSky {
    /// The reported sky as layers, from low to high: each group with its cover and base, the genus that is most likely at its
    /// height (as [`genus`](Self::genus) says) and its look from that genus's preset, wind by [`WindProfile`], and rain where
    /// the report says that it rains. Fog lies on the ground. `latitude` in degrees north; another `seed` gives other clouds of the same report.
    pub fn layers(&self, latitude: f32, seed: u32) -> CloudLayers {
        let mut layers: Vec<CloudLayer> = Vec::new();
        if self.fog || self.groups.iter().any(|group| group.is_obscured) {
            layers.push(self.fog_layer(seed));
        }
        let groups: Vec<&CloudGroup> = self.groups.iter().filter(|group| !group.is_obscured).collect();
        let raining = self.precipitation.and_then(|falls| Some((falls, self.raining_group(&groups, falls)?)));
        for (i, group) in groups.iter().enumerate().take(MAX_LAYERS - layers.len()) {
            let mut layer = self.layer(group, i, latitude, seed);
            if let Some((falls, which)) = raining
                && which == i
            {
                self.let_rain(&mut layer, falls);
            } else {
                layer.rain = 0.0;
            }
            layer.rain_depth = (layer.base - self.elevation).clamp(0.0, 20_000.0);
            layers.push(layer);
        }
        CloudLayers(layers)
    }

    /// A sky of [those layers](Self::layers), for [`CloudWeather::transition_to`](crate::CloudWeather::transition_to).
    pub fn sky(&self, latitude: f32, seed: u32) -> CloudPreset {
        sky_of(self.layers(latitude, seed))
    }

    /// The name of the built-in preset whose first layer a group looks like. METAR names TCU and CB alone; the rest is by
    /// height, cover and rain (WMO, International Cloud Atlas).
    pub fn genus(&self, group: &CloudGroup) -> &'static str {
        let height = group.base - self.elevation;
        let is_closed = group.oktas >= 7.0;
        let steady =
            self.precipitation.is_some_and(|falls| !falls.is_showery && falls.kind != PrecipitationKind::Drizzle);
        match group.kind {
            Some(CloudKind::Cumulonimbus) => "Cumulonimbus",
            Some(CloudKind::ToweringCumulus) => "ToweringCumulus",
            None if group.is_obscured => "Stratus",
            None if is_closed && steady && height < MIDDLE => "Nimbostratus",
            None if height < MIDDLE => match group.oktas {
                ..5.0 => "Cumulus",
                _ if is_closed && height < STRATUS => "Stratus",
                _ => "Stratocumulus",
            },
            None if height < HIGH => {
                if is_closed {
                    "Altostratus"
                } else {
                    "Altocumulus"
                }
            }
            None => {
                if is_closed {
                    "Cirrostratus"
                } else {
                    "Cirrus"
                }
            }
        }
    }

    fn layer(&self, group: &CloudGroup, i: usize, latitude: f32, seed: u32) -> CloudLayer {
        let plain = genus(self.genus(group));
        let surface = self.wind.map_or(Vec3::ZERO, |wind| wind.velocity());
        let wind = WindProfile { surface, roughness: 0.1, latitude }.at(group.base - self.elevation);
        let streets = self.recipe(group).streets;
        let map = WeatherRecipe {
            seed: plain.map.seed.wrapping_add(seed).wrapping_add(17 * i as u32),
            cover: group.oktas,
            streets: plain.map.streets.max(streets),
            ..plain.map
        };
        let base = group.base.clamp(-400.0, 30_000.0);
        let thickness = match group.kind {
            Some(CloudKind::Cumulonimbus) => (TROPOPAUSE - base).clamp(3000.0, 20_000.0),
            _ => plain.thickness,
        };
        let map = if wind == Vec3::ZERO { map } else { along_wind(map, wind) };
        CloudLayer {
            name: format!("{} {i}", plain.name),
            map,
            base,
            thickness,
            wind,
            coverage: 0.0,
            far_coverage: 0.0,
            ..plain
        }
    }

    /// From which group it falls: the storm, else what towers where it is showery, else the lowest that is mostly closed, else
    /// the lowest.
    fn raining_group(&self, groups: &[&CloudGroup], falls: Precipitation) -> Option<usize> {
        let of = |kind| groups.iter().position(|group| group.kind == Some(kind));
        let showers = || of(CloudKind::ToweringCumulus).filter(|_| falls.is_showery);
        let closed = || groups.iter().position(|group| group.oktas >= 5.0);
        of(CloudKind::Cumulonimbus).or_else(showers).or_else(closed).or((!groups.is_empty()).then_some(0))
    }

    /// Extinction is as the reported visibility has it (Koschmieder), else 1.076 R^0.67 dB/km for R mm/h (Carbonneau and
    /// Wisely 1998).
    fn let_rain(&self, layer: &mut CloudLayer, falls: Precipitation) {
        let seen = self.visibility.filter(|metres| *metres < 10_000.0 && !self.fog);
        let by_rate = 1.076 * falls.rate.powf(0.67) * std::f32::consts::LN_10 / 10.0 / 1000.0;
        layer.rain = (falls.rate / 10.0).sqrt().clamp(0.2, 1.0);
        layer.rain_extinction = seen.map_or(by_rate, |metres| KOSCHMIEDER / metres.max(80.0)).min(0.05);
    }

    /// Fog from the ground up: as deep as one sees into it, as thick as the visibility says.
    fn fog_layer(&self, seed: u32) -> CloudLayer {
        let plain = genus("Stratus");
        let seen = self.groups.iter().find(|group| group.is_obscured && group.base_is_known);
        let depth = seen.map_or(100.0, |group| 1.5 * (group.base - self.elevation)).clamp(30.0, 500.0);
        let visibility = self.visibility.filter(|metres| *metres < 1000.0).unwrap_or(USUAL_FOG).max(20.0);
        CloudLayer {
            name: "fog".to_owned(),
            map: WeatherRecipe { seed: plain.map.seed.wrapping_add(seed), cover: 8.0, ..plain.map },
            coverage: 1.0,
            far_coverage: 0.0,
            base: self.elevation.clamp(-400.0, 30_000.0),
            base_rise: 0.0,
            thickness: depth,
            // Densest on the ground, where it stands.
            peak_height: 0.02,
            shape_gain: 3.0,
            shape_strength: 0.2,
            base_to_top: 0.0,
            density: 1.0,
            extinction: (KOSCHMIEDER / visibility).min(1.0),
            wind: self.wind.map_or(Vec3::ZERO, |wind| wind.velocity()),
            wind_skew: 0.0,
            rain: 0.0,
            ..plain
        }
    }
}

impl CloudLayers {
    /// The layers of a METAR report: see [`MetarSky::layers`].
    pub fn from_metar(sky: &MetarSky, latitude: f32, seed: u32) -> Self {
        sky.layers(latitude, seed)
    }
}
