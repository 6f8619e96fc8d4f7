//! Places where a scene adds clouds or takes them away.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{SettingsError, Validate};

/// More cloud, or none, around an entity: a storm cell, the clear eye of a storm, free sight over an airfield.
///
/// The entity's `GlobalTransform` is the centre (its height, rotation and scale do not count); it may move, and clouds form
/// and dissolve as it passes. It counts in all layers, over all altitudes. Each camera has the eight that are nearest to it; one
/// beyond `quality.max_distance` costs nothing, the others one distance for each sample. Values out of range are reported, and
/// the zone is left out.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_cumulus::prelude::*;
///
/// fn clear_airfield(mut commands: Commands) {
///     let zone = CloudZone { radius: 8000.0, edge: 3000.0, strength: -1.0 };
///     commands.spawn((zone, Transform::from_xyz(12_000.0, 0.0, -4000.0)));
/// }
/// ```
#[derive(Component, Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
#[reflect(Component, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
#[require(Transform)]
pub struct CloudZone {
    /// Radius over the ground (m). Default 5000.
    #[reflect(@1.0..=1_000_000.0_f32)]
    pub radius: f32,
    /// Width of the edge, inside the radius, in which its strength falls to nothing (m); at most the radius. Default 2000.
    #[reflect(@0.0..=1_000_000.0_f32)]
    pub edge: f32,
    /// How much cloud: −1 clears the sky whatever its coverage, 1 closes it; s adds s + s³ to coverage. Default −1.
    #[reflect(@-1.0..=1.0_f32)]
    pub strength: f32,
}

impl Default for CloudZone {
    fn default() -> Self {
        Self { radius: 5000.0, edge: 2000.0, strength: -1.0 }
    }
}

impl Validate for CloudZone {
    const ROOT: &'static str = "zone";

    fn validate_relations(&self) -> Result<(), SettingsError> {
        if self.edge > self.radius {
            return Err(SettingsError::OutOfRange {
                field: "zone.edge".to_owned(),
                value: self.edge.to_string(),
                min: "0".to_owned(),
                max: format!("zone.radius = {}", self.radius),
            });
        }
        Ok(())
    }
}
