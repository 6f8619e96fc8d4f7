//! A zone at its place on the planet.

use bevy::{math::DVec3, prelude::*};

use super::{TangentFrame, ZoneUniform};
use crate::{reference::planet::map_position, settings::CloudZone};

/// A [`CloudZone`] where its entity is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct ZoneAt {
    entity: Entity,
    /// World space plus offset (m).
    centre: DVec3,
    radius: f32,
    edge: f32,
    strength: f32,
}

impl ZoneAt {
    /// `None` where the place is not a number.
    pub fn new(entity: Entity, zone: &CloudZone, at: Vec3, offset: DVec3) -> Option<Self> {
        let CloudZone { radius, edge, strength } = *zone;
        // A step would be undefined in the shader.
        let edge = edge.max(1e-3 * radius);
        at.is_finite().then_some(Self { entity, centre: at.as_dvec3() + offset, radius, edge, strength })
    }

    /// Whether frames held of `before` are still of use: it is the same zone, and has moved or changed by no more than
    /// clouds that form and dissolve do.
    pub fn follows(&self, before: &Self) -> bool {
        let least = 100_f32.max(0.1 * self.edge);
        self.entity == before.entity
            && (self.centre - before.centre).length() as f32 <= least
            && (self.radius - before.radius).abs() <= least
            && (self.edge - before.edge).abs() <= least
            && (self.strength - before.strength).abs() <= 0.05
    }

    /// How far its rim is from a camera at `position`, over the ground (m), and the zone in the frame below that.
    pub fn seen_from(&self, position: DVec3, frame: &TangentFrame) -> (f64, ZoneUniform) {
        let local = frame.local_from_world * (self.centre - position) + DVec3::Y * frame.altitude;
        let map = frame.map_at(local);
        let place = map.as_vec2();
        let zone = ZoneUniform {
            place: Vec4::new(place.x, place.y, self.radius, self.edge),
            // At full strength more than map and coverage together, whatever they are.
            strength: Vec4::new(self.strength * (1.0 + self.strength * self.strength), 0.0, 0.0, 0.0),
        };
        (map_position(local, frame.radius).length() - f64::from(self.radius), zone)
    }
}
