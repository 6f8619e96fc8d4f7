//! What map fits a reported cloud group.

use super::{CloudGroup, CloudKind, MetarSky};
use crate::weather::WeatherRecipe;

/// The levels at which clouds change their kind in temperate regions (WMO International Cloud Atlas: low up to 2 km, middle
/// up to 7 km; where they overlap, the middle), as heights above ground (m).
const MIDDLE: f32 = 2000.0;
const HIGH: f32 = 6000.0;

impl MetarSky {
    /// The recipe of a map for one of the report's groups: the pattern of the kind of cloud that is most likely at its height
    /// with its cover, along the reported wind. METAR does not say the kind, but for TCU and CB.
    pub fn recipe(&self, group: &CloudGroup) -> WeatherRecipe {
        let pattern = WeatherRecipe::pattern(self.pattern(group)).unwrap_or_default();
        let along = self.wind.and_then(|wind| wind.map_direction()).unwrap_or(0.0);
        let speed = self.wind.map_or(0.0, |wind| wind.speed);
        let is_convective = group.kind.is_some() || (group.oktas < 5.0 && self.height(group) < MIDDLE);
        WeatherRecipe {
            cover: group.oktas,
            // Rolls need wind; `Steering` knows more of it.
            streets: if is_convective { ((speed - 5.0) / 5.0).clamp(0.0, 0.7) } else { 0.0 },
            street_direction: along,
            street_spacing: (2.8 * self.height(group)).clamp(1500.0, 10_000.0),
            ripple_direction: along,
            streak_direction: along,
            ..pattern
        }
    }

    /// The name of that recipe's pattern: see [`WeatherRecipe::pattern`].
    pub fn pattern(&self, group: &CloudGroup) -> &'static str {
        let height = self.height(group);
        match group.kind {
            Some(CloudKind::ToweringCumulus | CloudKind::Cumulonimbus) => "congestus",
            None if group.is_obscured => "overcast",
            None if height < MIDDLE => match group.oktas {
                ..2.0 => "humilis",
                ..5.0 => "cumulus",
                ..7.0 => "stratocumulus",
                // A low, closed deck, raining or not.
                _ => "overcast",
            },
            None if height < HIGH => match group.oktas {
                ..7.0 => "altocumulus",
                _ => "altostratus",
            },
            None => match group.oktas {
                ..7.0 => "cirrus",
                _ => "altostratus",
            },
        }
    }

    /// Height of a group's base above the station (m).
    fn height(&self, group: &CloudGroup) -> f32 {
        group.base - self.elevation
    }
}
