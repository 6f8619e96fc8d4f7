//! Named skies, and skies from `.ron` files.

use std::path::Path;

use bevy::{asset::AssetPath, prelude::*};
use serde::{Deserialize, Serialize};

use super::{CloudLayers, CloudLighting, CloudModel, CloudTextures, PresetError, SettingsError, Validate};
use crate::textures::weather_maps::asset_path;

/// A sky: what to put into [`CloudModel`], [`CloudLighting`] and [`CloudTextures`]. Quality is not part of it.
///
/// In a file (`*.clouds.ron`) every field that is left out keeps its default. It is also an asset.
#[derive(Asset, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudPreset {
    /// The thesis's layer.
    pub model: CloudModel,
    /// Weather-map layers.
    pub layers: CloudLayers,
    /// How light crosses it.
    pub lighting: CloudLighting,
    /// What the textures are baked from.
    pub textures: CloudTextures,
    /// Elevation of the sun this sky was made for (degrees). Advice: the plugin never moves your light.
    #[reflect(@LOWEST_SUN..=HIGHEST_SUN)]
    pub sun_elevation: Option<f32>,
}

const LOWEST_SUN: f32 = -90.0;
const HIGHEST_SUN: f32 = 90.0;

/// Names and texts of the presets that come with the crate.
const BUILT_IN: [(&str, &str); 23] = [
    ("ClearDay", include_str!("../../assets/presets/clear_day.clouds.ron")),
    ("FairWeather", include_str!("../../assets/presets/fair_weather.clouds.ron")),
    ("Overcast", include_str!("../../assets/presets/overcast.clouds.ron")),
    ("Sunset", include_str!("../../assets/presets/sunset.clouds.ron")),
    ("Cirrus", include_str!("../../assets/presets/cirrus.clouds.ron")),
    ("Cirrocumulus", include_str!("../../assets/presets/cirrocumulus.clouds.ron")),
    ("Cirrostratus", include_str!("../../assets/presets/cirrostratus.clouds.ron")),
    ("Altocumulus", include_str!("../../assets/presets/altocumulus.clouds.ron")),
    ("Altostratus", include_str!("../../assets/presets/altostratus.clouds.ron")),
    ("Nimbostratus", include_str!("../../assets/presets/nimbostratus.clouds.ron")),
    ("Stratocumulus", include_str!("../../assets/presets/stratocumulus.clouds.ron")),
    ("Stratus", include_str!("../../assets/presets/stratus.clouds.ron")),
    ("Cumulus", include_str!("../../assets/presets/cumulus.clouds.ron")),
    ("Cumulonimbus", include_str!("../../assets/presets/cumulonimbus.clouds.ron")),
    ("FairWeatherCumulus", include_str!("../../assets/presets/fair_weather_cumulus.clouds.ron")),
    ("ToweringCumulus", include_str!("../../assets/presets/towering_cumulus.clouds.ron")),
    ("Broken", include_str!("../../assets/presets/broken.clouds.ron")),
    ("Storm", include_str!("../../assets/presets/storm.clouds.ron")),
    ("WinterStratus", include_str!("../../assets/presets/winter_stratus.clouds.ron")),
    ("MackerelSky", include_str!("../../assets/presets/mackerel_sky.clouds.ron")),
    ("RedSunset", include_str!("../../assets/presets/red_sunset.clouds.ron")),
    ("AfterRain", include_str!("../../assets/presets/after_rain.clouds.ron")),
    ("WeatherSystems", include_str!("../../assets/presets/weather_systems.clouds.ron")),
];

impl CloudPreset {
    /// Names of the presets that come with the crate.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// The preset of this name (upper and lower case and `_` do not count), if there is one.
    pub fn named(name: &str) -> Option<Self> {
        let plain = |s: &str| s.replace(['_', '-', ' '], "").to_lowercase();
        let (name, text) = BUILT_IN.iter().find(|(known, _)| plain(known) == plain(name))?;
        // A test parses every built-in text, so this cannot fail for a user.
        Self::parse(text, name).ok()
    }

    /// Checks every field against its range, and fields against each other.
    ///
    /// # Errors
    /// The first field found wrong, with its path, value and range.
    pub fn validate(&self) -> Result<(), SettingsError> {
        self.model.validate()?;
        self.layers.validate()?;
        self.lighting.validate()?;
        self.textures.validate()?;
        match self.sun_elevation {
            Some(elevation) if !(LOWEST_SUN..=HIGHEST_SUN).contains(&elevation) => Err(SettingsError::OutOfRange {
                field: "sun_elevation".to_owned(),
                value: elevation.to_string(),
                min: LOWEST_SUN.to_string(),
                max: HIGHEST_SUN.to_string(),
            }),
            _ => Ok(()),
        }
    }

    /// Parses and validates the text of a preset; `file` names it in errors.
    ///
    /// # Errors
    /// [`PresetError::Parse`] or [`PresetError::Settings`], with line, column, field and range.
    pub fn parse(text: &str, file: &str) -> Result<Self, PresetError> {
        let options = ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
        let preset: Self = options.from_str(text).map_err(|error| PresetError::parse(text, file, error))?;
        preset.validate().map_err(|error| PresetError::settings(text, file, error))?;
        Ok(preset)
    }

    /// Reads a preset from a file. Whether its layers' map files are there is found out when they are loaded; to know it at
    /// once, see [`read_with`](Self::read_with).
    ///
    /// # Errors
    /// [`PresetError::Io`], or as [`parse`](Self::parse).
    pub fn read(path: &Path) -> Result<Self, PresetError> {
        Self::read_with(path, |_| Ok(()))
    }

    /// Reads a preset from a file, and asks about each map file of a layer that is shown whether it is there. The asset
    /// server does so itself for presets that it loads.
    ///
    /// # Errors
    /// As [`read`](Self::read), or [`PresetError::Map`] with the answer.
    pub fn read_with(
        path: &Path,
        mut is_there: impl FnMut(&AssetPath<'static>) -> Result<(), String>,
    ) -> Result<Self, PresetError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| PresetError::Io { file: file.clone(), source })?;
        let preset = Self::parse(&text, &file)?;
        for (layer, map) in preset.map_files() {
            asset_path(map)
                .and_then(|map| is_there(&map))
                .map_err(|reason| PresetError::map(&text, &file, layer, map, reason))?;
        }
        Ok(preset)
    }

    /// The map files of layers that are shown, with the layers' numbers.
    pub(super) fn map_files(&self) -> impl Iterator<Item = (usize, &str)> {
        let read = |layer: &super::CloudLayer| layer.map_image.is_none() && !layer.map_file.is_empty();
        self.layers.shown().filter(move |(_, layer)| read(layer)).map(|(number, layer)| (number, &*layer.map_file))
    }

    /// The text of this preset, to be read by [`parse`](Self::parse).
    pub fn to_ron(&self) -> String {
        ron::ser::to_string_pretty(self, ron::ser::PrettyConfig::default()).unwrap_or_default()
    }

    /// Puts the preset into the world's settings.
    pub fn apply(&self, world: &mut World) {
        world.insert_resource(self.model.clone());
        world.insert_resource(self.layers.clone());
        world.insert_resource(self.lighting.clone());
        world.insert_resource(self.textures.clone());
    }

    /// As [`apply`](Self::apply), in a system that has the settings. What is so already does not count as changed.
    pub fn apply_to(
        &self,
        model: &mut ResMut<CloudModel>,
        layers: &mut ResMut<CloudLayers>,
        lighting: &mut ResMut<CloudLighting>,
        textures: &mut ResMut<CloudTextures>,
    ) {
        model.set_if_neq(self.model.clone());
        layers.set_if_neq(self.layers.clone());
        lighting.set_if_neq(self.lighting.clone());
        textures.set_if_neq(self.textures.clone());
    }

    /// Whether these settings are this sky. Its sun and what textures are baked from do not count.
    pub fn is_sky(&self, model: &CloudModel, layers: &CloudLayers, lighting: &CloudLighting) -> bool {
        self.model == *model && self.layers == *layers && self.lighting == *lighting
    }
}
