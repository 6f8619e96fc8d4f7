//! Layers of clouds from the state of the air.

use super::{Steering, WeatherRecipe, WindProfile};
use crate::settings::{CloudLayer, CloudLayers, CloudModel, CloudPreset, SettingsError};

/// Deeper cumulus than this is towering (m).
const TOWERING: f32 = 3000.0;

/// The main layer of a genus's preset.
pub(super) fn genus(name: &str) -> CloudLayer {
    CloudPreset::named(name).and_then(|preset| preset.layers.0.into_iter().next()).unwrap_or_default()
}

/// A sky of these layers alone.
pub(super) fn sky_of(layers: CloudLayers) -> CloudPreset {
    CloudPreset { model: CloudModel { enabled: false, ..Default::default() }, layers, ..Default::default() }
}

/// Directions of a map's streets, ripples and streaks along the wind.
pub(super) fn along_wind(map: WeatherRecipe, wind: bevy::math::Vec3) -> WeatherRecipe {
    let along = wind.z.atan2(wind.x).to_degrees();
    WeatherRecipe { street_direction: along, ripple_direction: along, streak_direction: along, ..map }
}

impl Steering {
    /// The layers that this weather brings: cumulus from the condensation level up, and a stratiform layer under the top of
    /// the mixed layer or of the condensation level, whichever is higher; each is left out where it covers less than a
    /// hundredth of the sky. `elevation` is the ground's altitude (m), `latitude` in degrees north, another `seed` gives other
    /// clouds of the same weather. What a genus looks like is taken from its preset.
    ///
    /// # Errors
    /// The first field found out of range.
    pub fn layers(&self, elevation: f32, latitude: f32, seed: u32) -> Result<CloudLayers, SettingsError> {
        let air = WindProfile { surface: self.surface_wind(), roughness: self.roughness, latitude };
        let mut layers = Vec::new();
        let (_, hints) = self.steer(&WeatherRecipe::default())?;
        let depth = (hints.top - hints.base).max(150.0);
        let level = hints.base.max(0.8 * hints.mixed_layer);
        let kind = if depth > TOWERING { "ToweringCumulus" } else { "Cumulus" };
        for (name, kind, cover, base, thickness) in [
            ("convective", kind, hints.convective, hints.base, Some(depth)),
            ("stratiform", "Stratocumulus", hints.stratiform, level, None),
        ] {
            if cover < 0.08 {
                continue;
            }
            let plain = genus(kind);
            let (map, _) = self.steer(&WeatherRecipe { seed: plain.map.seed.wrapping_add(seed), ..plain.map })?;
            let wind = air.at(base);
            layers.push(CloudLayer {
                name: name.to_owned(),
                map: along_wind(WeatherRecipe { cover, ..map }, wind),
                coverage: 0.0,
                far_coverage: 0.0,
                base: (elevation + base).clamp(-400.0, 30_000.0),
                thickness: thickness.unwrap_or(plain.thickness).clamp(10.0, 20_000.0),
                wind,
                rain: 0.0,
                ..plain
            });
        }
        Ok(CloudLayers(layers))
    }

    /// A sky of [those layers](Self::layers), for [`CloudWeather::transition_to`](crate::CloudWeather::transition_to).
    ///
    /// # Errors
    /// The first field found out of range.
    pub fn sky(&self, elevation: f32, latitude: f32, seed: u32) -> Result<CloudPreset, SettingsError> {
        self.layers(elevation, latitude, seed).map(sky_of)
    }

    fn surface_wind(&self) -> bevy::math::Vec3 {
        let (sin, cos) = self.wind_direction.to_radians().sin_cos();
        bevy::math::Vec3::new(cos, 0.0, sin) * self.wind_speed
    }
}
