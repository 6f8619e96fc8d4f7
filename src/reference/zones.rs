//! Places where a scene adds or takes away coverage. Twin of `model/zones.wesl`.

use bevy::math::{DMat2, DVec2, Vec4Swizzles};

use super::field::smoothstep;
use crate::model::ZoneUniform;

/// The zones that a view shows, and what takes lengths on the map to those on the ground.
#[derive(Clone, Copy)]
pub(super) struct Zones<'a> {
    pub all: &'a [ZoneUniform],
    pub shrink: DMat2,
}

fn added(zone: &ZoneUniform, away: f64) -> f64 {
    let [radius, edge] = [zone.place.z, zone.place.w].map(f64::from);
    f64::from(zone.strength.x) * (1.0 - smoothstep(radius - edge, radius, away))
}

impl Zones<'_> {
    fn away(&self, zone: &ZoneUniform, m: DVec2) -> f64 {
        (self.shrink * (m - zone.place.xy().as_dvec2())).length()
    }

    /// What is added to coverage at `m`.
    pub fn at(&self, m: DVec2) -> f64 {
        self.all.iter().map(|zone| added(zone, self.away(zone, m))).sum()
    }

    /// The most that is added within `reach` metres of `m`.
    pub fn bound(&self, m: DVec2, reach: f64) -> f64 {
        let most = |zone: &ZoneUniform| {
            let away = self.away(zone, m);
            added(zone, if zone.strength.x < 0.0 { away + reach } else { (away - reach).max(0.0) })
        };
        self.all.iter().map(most).sum()
    }
}
