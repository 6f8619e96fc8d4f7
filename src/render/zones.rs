//! From [`CloudZone`]s in the scene to those that one view shows.

use bevy::{ecs::entity::EntityHashSet, math::DVec3, prelude::*, render::Extract};

use crate::{
    model::{MAX_ZONES, TangentFrame, ZoneAt, ZoneUniform},
    settings::{CloudZone, GoodSettings, Validate},
};

/// The scene's zones in this frame.
#[derive(Resource, Default)]
pub(crate) struct ExtractedZones {
    pub zones: Vec<ZoneAt>,
    /// Counts changes that make held frames wrong.
    pub version: u64,
    /// Counts all changes.
    pub changes: u64,
}

pub(crate) fn extract_zones(
    zones: Extract<Query<(Entity, &CloudZone, &GlobalTransform)>>,
    good: Extract<Res<GoodSettings>>,
    mut out: ResMut<ExtractedZones>,
    mut told: Local<EntityHashSet>,
) {
    let offset = good.0.model.world_offset;
    let mut now = Vec::new();
    for (entity, zone, at) in &zones {
        match zone.validate() {
            Ok(()) => {
                told.remove(&entity);
                now.extend(ZoneAt::new(entity, zone, at.translation(), offset));
            }
            Err(error) if told.insert(entity) => error!("clouds: {error}; the zone of entity {entity} is left out"),
            Err(_) => {}
        }
    }
    if now == out.zones {
        return;
    }
    let followed = now.len() == out.zones.len() && now.iter().zip(&out.zones).all(|(now, before)| now.follows(before));
    out.zones = now;
    out.changes += 1;
    if !followed {
        out.version += 1;
    }
}

/// The zones that a camera at `position` (world space plus offset, m) sees within `reach` metres: the nearest, and whether
/// some had to be left out.
pub(super) fn zones_around(
    zones: &[ZoneAt],
    position: DVec3,
    frame: &TangentFrame,
    reach: f64,
) -> (Vec<ZoneUniform>, bool) {
    let mut near: Vec<(f64, ZoneUniform)> =
        zones.iter().map(|zone| zone.seen_from(position, frame)).filter(|(away, _)| *away < reach).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let too_many = near.len() > MAX_ZONES;
    near.truncate(MAX_ZONES);
    (near.into_iter().map(|(_, zone)| zone).collect(), too_many)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::planet::PLANET_RADIUS;

    const CENTRE: DVec3 = DVec3::new(0.0, -PLANET_RADIUS, 0.0);

    fn zone(x: f32, radius: f32) -> ZoneAt {
        let zone = CloudZone { radius, edge: 0.0, strength: 1.0 };
        ZoneAt::new(Entity::PLACEHOLDER, &zone, Vec3::new(x, 0.0, 0.0), DVec3::ZERO).unwrap()
    }

    fn around(zones: &[ZoneAt], camera: DVec3) -> (Vec<ZoneUniform>, bool) {
        let frame = TangentFrame::below(camera, CENTRE, PLANET_RADIUS).unwrap();
        zones_around(zones, camera, &frame, 100_000.0)
    }

    #[test]
    fn the_nearest_eight_are_followed_and_what_is_far_is_none() {
        assert_eq!(around(&[], DVec3::ZERO), (vec![], false));
        assert_eq!(around(&[zone(150_000.0, 20_000.0)], DVec3::ZERO), (vec![], false));
        // Its rim is near enough.
        assert_eq!(around(&[zone(150_000.0, 60_000.0)], DVec3::ZERO).0.len(), 1);
        let many: Vec<ZoneAt> = (0..12).map(|k| zone(60_000.0 - 5000.0 * k as f32, 100.0)).collect();
        let (seen, too_many) = around(&many, DVec3::ZERO);
        assert!(too_many && seen.len() == MAX_ZONES);
        assert!(seen.iter().all(|zone| zone.place.x < 41_000.0), "{seen:?}");
    }

    #[test]
    fn a_zone_stays_over_its_place_wherever_the_camera_is() {
        let zones = [zone(30_000.0, 500.0)];
        // Below the horizon's curve the place on the map is an arc's length.
        let arc = (30_000.0 / PLANET_RADIUS).atan() * PLANET_RADIUS;
        for camera in [DVec3::ZERO, DVec3::new(28_000.0, 3000.0, 900.0), DVec3::new(30_000.0, 10.0, 0.0)] {
            let frame = TangentFrame::below(camera, CENTRE, PLANET_RADIUS).unwrap();
            let (seen, _) = around(&zones, camera);
            let on_map = frame.map + seen[0].place.truncate().truncate().as_dvec2();
            assert!((on_map - bevy::math::DVec2::new(arc, 0.0)).length() < 1.0, "{camera}: {on_map}");
            assert_eq!((seen[0].place.z, seen[0].strength.x), (500.0, 2.0));
        }
    }

    #[test]
    fn a_zone_that_moves_is_followed_and_one_that_leaps_is_not() {
        let at = |x: f32| zone(x, 5000.0);
        assert!(at(50.0).follows(&at(0.0)));
        assert!(!at(2000.0).follows(&at(0.0)));
        assert!(!zone(0.0, 9000.0).follows(&at(0.0)));
        let weaker = CloudZone { radius: 5000.0, edge: 0.0, strength: 0.5 };
        let weaker = ZoneAt::new(Entity::PLACEHOLDER, &weaker, Vec3::ZERO, DVec3::ZERO).unwrap();
        assert!(!weaker.follows(&at(0.0)));
    }
}
