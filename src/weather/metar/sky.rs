//! The report as plain data.

use bevy::math::Vec3;
use metar::{
    CloudDensity, CloudLayer, CloudType, Data, Metar, VerticalVisibility, Visibility, Weather, WeatherCondition,
    WeatherIntensity, Wind, WindDirection, WindSpeed,
};

use super::{MetarError, report};
use crate::weather::steering::{LclFormula, lifting_condensation_level};

const FOOT: f32 = 0.3048;
const KNOT: f32 = 1852.0 / 3600.0;
const MILE: f32 = 1609.344;
/// Base of a group that gives none, where temperatures are missing, too (m above the station).
const USUAL_BASE: f32 = 1000.0;

/// The sky that a METAR report tells of. Plain data; altitudes in metres above sea level.
#[derive(Clone, PartialEq, Debug)]
pub struct MetarSky {
    /// The station's four letters.
    pub station: String,
    /// Cloud groups from low to high as reported; none where the sky is clear or nothing significant was seen.
    pub groups: Vec<CloudGroup>,
    /// Wind at 10 m; `None` where it is not reported.
    pub wind: Option<MetarWind>,
    /// Visibility (m); 10 000 and more means "10 km or more". `None` where it is not reported.
    pub visibility: Option<f32>,
    /// What falls at the station, if anything.
    pub precipitation: Option<Precipitation>,
    /// Whether there is thunder at the station or near it.
    pub thunderstorm: bool,
    /// Whether there is fog (visibility below 1 km).
    pub fog: bool,
    /// Air temperature at 2 m (°C).
    pub temperature: Option<f32>,
    /// Dew point at 2 m (°C).
    pub dew_point: Option<f32>,
    /// The station's altitude, as it was given (m above sea level).
    pub elevation: f32,
}

/// One cloud group.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CloudGroup {
    /// Cover in eighths, the middle of what the group means: FEW 1.5, SCT 3.5, BKN 6, OVC and VV 8.
    pub oktas: f32,
    /// Altitude of the base (m above sea level).
    pub base: f32,
    /// Whether the report gave the base. If not, it is the lifting condensation level of the station's air.
    pub base_is_known: bool,
    /// Whether this is no base but how far one sees upward into fog or snow (VV).
    pub is_obscured: bool,
    /// Clouds that reach high, where the report says so.
    pub kind: Option<CloudKind>,
}

/// Clouds that METAR names.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CloudKind {
    /// TCU: cumulus congestus of great height.
    ToweringCumulus,
    /// CB: cumulonimbus.
    Cumulonimbus,
}

/// Wind at the station.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MetarWind {
    /// Speed (m/s).
    pub speed: f32,
    /// Greatest gust (m/s).
    pub gust: Option<f32>,
    /// Where it blows from: degrees clockwise from north; `None` where it varies.
    pub from: Option<f32>,
}

impl MetarWind {
    /// Velocity (m/s) in the world's axes, with +x to the east and −z to the north. Zero where the direction varies.
    pub fn velocity(&self) -> Vec3 {
        self.from.map_or(Vec3::ZERO, |from| {
            let (sin, cos) = from.to_radians().sin_cos();
            Vec3::new(-sin, 0.0, cos) * self.speed
        })
    }

    /// The direction that it blows in, as recipes have it: degrees, 0 along +x (east), 90 along +z (south), −180 to 180.
    pub fn map_direction(&self) -> Option<f32> {
        self.from.map(|from| (from + 90.0 + 180.0).rem_euclid(360.0) - 180.0)
    }
}

/// What falls.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Precipitation {
    /// The kind that matters most to the look.
    pub kind: PrecipitationKind,
    /// Rate in mm of water an hour, a value within what WMO-No. 8 calls light, moderate or heavy.
    pub rate: f32,
    /// Whether it comes in showers, from single clouds, or with thunder.
    pub is_showery: bool,
}

/// Kinds of precipitation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "they say what they are")]
pub enum PrecipitationKind {
    Drizzle,
    Rain,
    Snow,
    /// Ice pellets and crystals.
    Ice,
    Hail,
}

impl MetarSky {
    /// Reads one report, such as `EGLL 231150Z 24012KT 9999 FEW022 SCT035 BKN048 12/07 Q1013`, of a station at this
    /// `elevation` (m above sea level). METAR and SPECI, with or without remarks and trends, which are not used.
    ///
    /// # Errors
    /// The group that cannot be read and its place.
    pub fn parse(line: &str, elevation: f32) -> Result<Self, MetarError> {
        let report = report::parse(line)?;
        let temperature = known(report.temperature).map(|t| t as f32);
        let dew_point = known(report.dewpoint).map(|t| t as f32);
        let usual_base = match (temperature, dew_point) {
            (Some(t), Some(d)) => lifting_condensation_level(t, d, LclFormula::default()),
            _ => USUAL_BASE,
        };
        let mut groups: Vec<CloudGroup> =
            report.cloud_layers.iter().filter_map(|layer| group(layer, elevation, usual_base)).collect();
        groups.extend(report.vert_visibility.as_ref().map(|up| obscured(up, elevation)));
        let weather = match &report.weather {
            Data::Known(all) => all.as_slice(),
            Data::Unknown => &[],
        };
        let any = |condition| weather.iter().any(|w| w.conditions.contains(&condition) && here(w));
        let thunderstorm = weather.iter().any(|w| w.conditions.contains(&WeatherCondition::Thunderstorm));
        Ok(Self {
            station: report.station.clone(),
            groups,
            wind: wind(&report),
            visibility: visibility(&report),
            precipitation: weather.iter().filter_map(precipitation).max_by(|a, b| a.rate.total_cmp(&b.rate)),
            thunderstorm,
            fog: any(WeatherCondition::Fog),
            temperature,
            dew_point,
            elevation,
        })
    }
}

fn known<T>(data: Data<T>) -> Option<T> {
    match data {
        Data::Known(value) => Some(value),
        Data::Unknown => None,
    }
}

/// A group of unknown cover is left out, unless it names a cloud that must be there.
fn group(layer: &CloudLayer, elevation: f32, usual_base: f32) -> Option<CloudGroup> {
    let kind = match known(layer.kind) {
        Some(CloudType::Cumulonimbus) => Some(CloudKind::Cumulonimbus),
        Some(CloudType::ToweringCumulus) => Some(CloudKind::ToweringCumulus),
        _ => None,
    };
    let oktas = match known(layer.density) {
        Some(CloudDensity::Few) => 1.5,
        Some(CloudDensity::Scattered) => 3.5,
        Some(CloudDensity::Broken) => 6.0,
        Some(CloudDensity::Overcast) => 8.0,
        None => kind.map(|_| 1.5)?,
    };
    let height = known(layer.height).map(|hundreds| hundreds as f32 * 100.0 * FOOT);
    let base = elevation + height.unwrap_or(usual_base);
    Some(CloudGroup { oktas, base, base_is_known: height.is_some(), is_obscured: false, kind })
}

fn obscured(up: &VerticalVisibility, elevation: f32) -> CloudGroup {
    let height = match up {
        VerticalVisibility::Distance(hundreds) => Some(*hundreds as f32 * 100.0 * FOOT),
        VerticalVisibility::ReducedByUnknownAmount => None,
    };
    let base = elevation + height.unwrap_or(0.0);
    CloudGroup { oktas: 8.0, base, base_is_known: height.is_some(), is_obscured: true, kind: None }
}

fn wind(report: &Metar) -> Option<MetarWind> {
    let Wind::Present { dir, speed, .. } = &report.wind else {
        return Some(MetarWind { speed: 0.0, gust: None, from: None });
    };
    let (speed, gust, unit) = match *speed {
        WindSpeed::Knots { speed, gusting } => (known(speed)?, gusting.and_then(known), KNOT),
        WindSpeed::MetresPerSecond { speed, gusting } => (known(speed)?, gusting.and_then(known), 1.0),
        WindSpeed::KilometresPerHour { speed, gusting } => (known(speed)?, gusting.and_then(known), 1.0 / 3.6),
        // The least that "more than 99 knots" can be.
        WindSpeed::Greater => (100, None, KNOT),
    };
    let from = match *dir {
        WindDirection::Heading(heading) => known(heading).filter(|_| speed > 0).map(|degrees| degrees as f32),
        WindDirection::Variable => None,
    };
    Some(MetarWind { speed: speed as f32 * unit, gust: gust.map(|gust| gust as f32 * unit), from })
}

fn visibility(report: &Metar) -> Option<f32> {
    Some(match known(report.visibility)? {
        Visibility::CAVOK => 10_000.0,
        Visibility::Metres(9999) => 10_000.0,
        Visibility::Metres(metres) => metres.into(),
        Visibility::StatuteMiles(miles) => miles * MILE,
    })
}

fn here(weather: &Weather) -> bool {
    !matches!(weather.intensity, WeatherIntensity::InVicinity | WeatherIntensity::Recent)
}

/// Rates within the bounds of WMO-No. 8 (Guide to Instruments and Methods of Observation), criteria for light, moderate and
/// heavy precipitation: drizzle 0.1 and 0.5 mm/h, rain 2.5 and 10 mm/h, snow 1 and 5 mm/h of water.
fn precipitation(weather: &Weather) -> Option<Precipitation> {
    use PrecipitationKind as Kind;
    use WeatherCondition as W;
    if !here(weather) {
        return None;
    }
    let has = |condition| weather.conditions.contains(&condition);
    let showery = has(W::Showers) || has(W::Thunderstorm);
    let (kind, rates) = if has(W::Hail) || has(W::SnowPelletsOrSmallHail) {
        (Kind::Hail, [2.0, 8.0, 30.0])
    } else if has(W::Rain) || has(W::UnknownPrecipitation) {
        (Kind::Rain, [1.2, 5.0, 20.0])
    } else if has(W::Snow) || has(W::SnowGrains) {
        (Kind::Snow, [0.5, 2.5, 7.0])
    } else if has(W::IcePellets) || has(W::IceCrystals) {
        (Kind::Ice, [0.3, 1.0, 3.0])
    } else if has(W::Drizzle) {
        (Kind::Drizzle, [0.05, 0.3, 0.7])
    } else {
        return None;
    };
    // Blowing and drifting snow comes from the ground.
    if has(W::Blowing) || has(W::LowDrifting) {
        return None;
    }
    let rate = match weather.intensity {
        WeatherIntensity::Light => rates[0],
        WeatherIntensity::Heavy => rates[2],
        _ => rates[1],
    };
    Some(Precipitation { kind, rate, is_showery: showery })
}
