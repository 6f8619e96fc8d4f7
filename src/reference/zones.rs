//! Places where a scene adds or takes away coverage. Twin of `model/zones.wesl`.

use bevy::math::{DVec2, Vec4Swizzles};

use super::field::smoothstep;
use crate::model::ZoneUniform;

fn added(zone: &ZoneUniform, away: f64) -> f64 {
    let [radius, edge] = [zone.place.z, zone.place.w].map(f64::from);
    f64::from(zone.strength.x) * (1.0 - smoothstep(radius - edge, radius, away))
}

/// What is added to coverage at `m`.
pub(super) fn zones_at(zones: &[ZoneUniform], m: DVec2) -> f64 {
    zones.iter().map(|zone| added(zone, m.distance(zone.place.xy().as_dvec2()))).sum()
}

/// The most that is added within `reach` metres of `m`.
pub(super) fn zones_bound(zones: &[ZoneUniform], m: DVec2, reach: f64) -> f64 {
    zones
        .iter()
        .map(|zone| {
            let away = m.distance(zone.place.xy().as_dvec2());
            added(zone, if zone.strength.x < 0.0 { away + reach } else { (away - reach).max(0.0) })
        })
        .sum()
}
