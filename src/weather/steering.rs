//! Weather from the state of the air: temperature, humidity, wind, time of day.
//!
//! What the thesis names as future work: "Additional parameters such as temperature, humidity, time of day, wind conditions,
//! and the terrain" (chapter 6 \[Ford\]). Terrain is [`orographic`](super::orographic).

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::recipe::WeatherRecipe;
use crate::settings::{SettingsError, Validate};

/// Gravity over the heat capacity of dry air: how fast rising dry air cools (K/m).
const DRY_LAPSE: f32 = 9.81 / 1005.0;
/// Air density times heat capacity near the ground (J/(m³ K)).
const HEAT_CAPACITY: f32 = 1.2 * 1005.0;
/// Von Kármán's constant.
const KARMAN: f32 = 0.4;

/// The state of the air and the day: what a meteorologist would be told. [`Steering::steer`] makes a recipe of it.
#[derive(Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Steering {
    /// Air temperature at 2 m (°C). Default 22.
    #[reflect(@-60.0..=60.0_f32)]
    pub temperature: f32,
    /// Dew point at 2 m (°C); the air is saturated where it reaches the temperature. Default 12.
    #[reflect(@-70.0..=40.0_f32)]
    pub dew_point: f32,
    /// Mean relative humidity at the clouds' level (0..1). From `critical_humidity` on, it brings a layer of stratiform
    /// cloud. Default 0.6.
    #[reflect(@0.0..=1.0_f32)]
    pub humidity_aloft: f32,
    /// Humidity above which some of the air at that level is saturated (0..1). Default 0.75.
    #[reflect(@0.0..=0.99_f32)]
    pub critical_humidity: f32,
    /// Wind speed at 10 m (m/s). Default 4.
    #[reflect(@0.0..=100.0_f32)]
    pub wind_speed: f32,
    /// Direction that the wind blows in: degrees, 0 along the map's u (+x), 90 along its v (+z). Default 0.
    #[reflect(@-360.0..=360.0_f32)]
    pub wind_direction: f32,
    /// Local solar time (h); the sun is highest at 12. Default 14.
    #[reflect(@0.0..=24.0_f32)]
    pub hour: f32,
    /// Hours from sunrise to sunset. Default 14.
    #[reflect(@0.0..=24.0_f32)]
    pub day_length: f32,
    /// Heat that the ground gives to the air at noon (W/m²): some 50 over moist forest, 400 over dry land in summer, 10 over
    /// sea. Default 220.
    #[reflect(@0.0..=1000.0_f32)]
    pub noon_heat_flux: f32,
    /// How fast potential temperature rises with height in the morning (K/m); the more, the shallower convection stays.
    /// Default 0.005.
    #[reflect(@0.0005..=0.05_f32)]
    pub stability: f32,
    /// Height of the lid above which nothing rises, an inversion (m above ground). Default 4000.
    #[reflect(@100.0..=20_000.0_f32)]
    pub lid: f32,
    /// Roughness length of the ground (m): 0.0002 sea, 0.03 grass, 1 forest or town. Default 0.1.
    #[reflect(@0.00001..=5.0_f32)]
    pub roughness: f32,
}

impl Default for Steering {
    fn default() -> Self {
        Self {
            temperature: 22.0,
            dew_point: 12.0,
            humidity_aloft: 0.6,
            critical_humidity: 0.75,
            wind_speed: 4.0,
            wind_direction: 0.0,
            hour: 14.0,
            day_length: 14.0,
            noon_heat_flux: 220.0,
            stability: 0.005,
            lid: 4000.0,
            roughness: 0.1,
        }
    }
}

impl Validate for Steering {
    const ROOT: &'static str = "steering";
}

/// How the height is computed at which rising air gets saturated.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum LclFormula {
    /// 125 m for each kelvin between temperature and dew point (Espy's rule of 1836; Lawrence 2005, equation 24).
    Espy,
    /// From the temperature at which it is saturated (Bolton 1980, equation 15), reached at the dry lapse rate. The default.
    #[default]
    Bolton,
    /// (20 + T/5)(100 − RH) m, with RH in percent (Lawrence 2005, equation 25). Good above RH 50 %.
    Lawrence,
}

/// Height above ground (m) at which air rising from 2 m gets saturated, and cumulus has its base. `temperature` and
/// `dew_point` in °C; never below 0.
pub fn lifting_condensation_level(temperature: f32, dew_point: f32, formula: LclFormula) -> f32 {
    let dew_point = dew_point.min(temperature);
    let height = match formula {
        LclFormula::Espy => 125.0 * (temperature - dew_point),
        LclFormula::Bolton => {
            let (t, d) = (temperature + 273.15, dew_point + 273.15);
            let saturated_at = 1.0 / (1.0 / (d - 56.0) + (t / d).ln() / 800.0) + 56.0;
            (t - saturated_at) / DRY_LAPSE
        }
        LclFormula::Lawrence => (20.0 + temperature / 5.0) * 100.0 * (1.0 - relative_humidity(temperature, dew_point)),
    };
    height.max(0.0)
}

/// Relative humidity (0..1) of air with this temperature and dew point (°C): the quotient of vapour pressures by Bolton
/// 1980, equation 10.
pub fn relative_humidity(temperature: f32, dew_point: f32) -> f32 {
    let pressure = |celsius: f32| (17.67 * celsius / (celsius + 243.5)).exp();
    (pressure(dew_point) / pressure(temperature)).clamp(0.0, 1.0)
}

/// Share of the sky (0..1) covered by stratiform cloud at a mean relative `humidity`: 1 − √((1 − RH)/(1 − RHc)) above the
/// critical humidity (Sundqvist, Berge and Kristjánsson 1989, Monthly Weather Review 117, 1641–1657).
pub fn stratiform_cover(humidity: f32, critical: f32) -> f32 {
    if humidity <= critical {
        return 0.0;
    }
    1.0 - ((1.0 - humidity.min(1.0)) / (1.0 - critical.min(0.99))).sqrt()
}

/// Where a layer made by [`Steering::steer`] lies and what it is made of.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LayerHints {
    /// Base (m above ground): the lifting condensation level.
    pub base: f32,
    /// Greatest height that tops reach (m above ground).
    pub top: f32,
    /// Cover by cumulus (oktas).
    pub convective: f32,
    /// Cover by a stratiform layer (oktas).
    pub stratiform: f32,
    /// Depth of the layer that the ground's heat has mixed (m).
    pub mixed_layer: f32,
    /// The day's heat flux at this hour (W/m²).
    pub heat_flux: f32,
}

impl Steering {
    /// Changes what the weather sets in a recipe, and says where the layer lies. Seed, size, scale and what is not weather
    /// (clearings, front, softness and others) stay as they are in `recipe`.
    ///
    /// # Errors
    /// The first field found out of range.
    pub fn steer(&self, recipe: &WeatherRecipe) -> Result<(WeatherRecipe, LayerHints), SettingsError> {
        self.validate()?;
        let hints = self.hints();
        let depth = hints.mixed_layer.max(300.0);
        // Where both are, they overlap at random.
        let share = 1.0 - (1.0 - hints.convective / 8.0) * (1.0 - hints.stratiform / 8.0);
        let total = (hints.convective + hints.stratiform).max(1e-3);
        let layered = hints.stratiform / total;
        let steered = WeatherRecipe {
            cover: 8.0 * share,
            // Thermals stand 1.5 depths of the mixed layer apart (Caughey and Palmer 1979); cells of a closed layer are
            // wider.
            cell_size: 1.5 * depth * (1.0 + 0.6 * layered),
            regularity: 0.2 + 0.65 * layered,
            streets: self.streets() * (1.0 - 0.5 * layered),
            street_direction: self.wind_direction,
            // Rolls are 2 to 4 times as wide as deep, 2.8 in the mean (Kuettner 1971).
            street_spacing: (2.8 * depth).clamp(100.0, 200_000.0),
            clumping: 0.45 - 0.25 * layered,
            height_variation: 0.7 - 0.45 * layered,
            ..recipe.clone()
        };
        Ok((steered, hints))
    }

    /// What the air does at this hour.
    fn hints(&self) -> LayerHints {
        let base = lifting_condensation_level(self.temperature, self.dew_point, LclFormula::default());
        let (heat_flux, mixed_layer) = (self.heat_flux(), self.mixed_layer());
        let convective = 8.0 * self.convective_cover(base, mixed_layer);
        let stratiform = 8.0 * stratiform_cover(self.humidity_aloft, self.critical_humidity);
        // A cloud is about as deep as the mixed layer that feeds it, unless the lid stops it.
        let top = (base + 0.8 * mixed_layer.max(300.0)).min(self.lid.max(base + 150.0));
        LayerHints { base, top, convective, stratiform, mixed_layer, heat_flux }
    }

    /// Hours since sunrise, 0 before it, and at most the day's length.
    fn daylight(&self) -> f32 {
        (self.hour - (12.0 - 0.5 * self.day_length)).clamp(0.0, self.day_length)
    }

    /// Half a sine from sunrise to sunset (W/m²).
    pub fn heat_flux(&self) -> f32 {
        if self.day_length <= 0.0 {
            return 0.0;
        }
        self.noon_heat_flux * (std::f32::consts::PI * self.daylight() / self.day_length).sin().max(0.0)
    }

    /// Depth of the mixed layer (m): the heat given off since sunrise has warmed a triangle of the morning's stable air, with
    /// a fifth of it brought down from above by entrainment: h² = 2 (1 + 2·0.2)/γ ∫ H/(ρ cp) dt (Tennekes 1973; Stull 1988,
    /// section 11.2). At least 150 m, stirred by wind; at most up to the lid.
    pub fn mixed_layer(&self) -> f32 {
        let day = self.day_length.max(1e-3);
        let turned = std::f32::consts::PI * self.daylight() / day;
        let seconds = day * 3600.0 / std::f32::consts::PI * (1.0 - turned.cos());
        let heat = self.noon_heat_flux / HEAT_CAPACITY * seconds;
        (2.0 * 1.4 / self.stability * heat).sqrt().max(150.0).min(self.lid)
    }

    /// Share of the sky with cumulus (0..1): of the places where the mixed layer's uneven top lies above the uneven
    /// condensation level (Wilde, Stull and Eloranta 1985, "The LCL zone and cumulus onset"), which spread by a fifth of its
    /// depth. Never above a half: cumulus itself keeps the mixed layer's top near its base (Neggers, Stevens and Neelin 2006).
    /// It dies away as the heat fails towards evening.
    fn convective_cover(&self, base: f32, mixed_layer: f32) -> f32 {
        let above = ((mixed_layer - base) / (0.2 * mixed_layer)).clamp(-2.0, 0.0);
        // A cumulative distribution, by a smooth step of the same width.
        let t = 0.5 * above + 1.0;
        let reached = 0.5 * t * t * (3.0 - 2.0 * t);
        let lively = (4.0 * self.heat_flux() / self.noon_heat_flux.max(1e-3)).min(1.0);
        reached * lively
    }

    /// Strength of streets (0..1): rolls form where −h/L, the mixed layer's depth over Obukhov's length, is below about 25,
    /// and wind is above some 5.5 m/s (Weckwerth and others 1997). With no heat there are none.
    fn streets(&self) -> f32 {
        let flux = self.heat_flux() / HEAT_CAPACITY;
        if flux <= 0.0 {
            return 0.0;
        }
        let friction = KARMAN * self.wind_speed / (10.0 / self.roughness).max(2.0).ln();
        let kelvin = self.temperature + 273.15;
        let obukhov = friction.powi(3) * kelvin / (KARMAN * 9.81 * flux);
        let instability = self.mixed_layer() / obukhov.max(1e-3);
        let fall = |from: f32, to: f32, x: f32| ((to - x) / (to - from)).clamp(0.0, 1.0);
        fall(10.0, 40.0, instability) * (1.0 - fall(4.0, 7.0, self.wind_speed))
    }
}
