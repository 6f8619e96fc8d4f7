//! What a camera carries, and the clock clouds move by.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{CloudDebugView, CloudQuality, Validate};

/// Where clouds stand among transparent things: glass, particles, water. Opaque things need no such choice: at each of
/// their pixels the clouds end where they begin.
#[derive(Reflect, Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
pub enum CloudOrder {
    /// As one sorted surface, the default. What lies beyond the layer of clouds, seen from the camera, is drawn first
    /// and seen through them; what lies before it or in it is drawn over them, and may fade itself with
    /// [`CloudDepth`](crate::CloudDepth). A thing's place is its centre, as for sorting among themselves.
    #[default]
    Sorted,
    /// Before all of them: nothing transparent is ever covered by a cloud.
    BeforeTransparent,
    /// Over all of them, as Bevy draws its fog, and after its TAA, which reprojects clouds like the sky they cover and
    /// so softens them a little while the camera turns.
    AfterTransparent,
}

/// Draws clouds in this camera's view. Opt-in, like `Bloom`; the camera needs a perspective projection.
///
/// Each camera has its own buffers and history. Removing it, or `enabled: false`, costs the GPU nothing.
#[derive(Component, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Component, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
#[require(bevy::camera::Hdr)]
pub struct CloudView {
    /// Whether clouds are drawn. Default true.
    pub enabled: bool,
    /// Quality of this view alone; `None` (the default) takes the [`CloudQuality`] resource.
    pub quality: Option<CloudQuality>,
    /// Change it (add 1) to drop the view's history, as on a camera cut. Default 0.
    pub reset: u32,
    /// A stage to look at alone. Default [`CloudDebugView::None`], which costs nothing.
    pub debug: CloudDebugView,
    /// Where clouds stand among transparent things. Default [`CloudOrder::Sorted`]; all cost the same.
    pub order: CloudOrder,
}

impl Default for CloudView {
    fn default() -> Self {
        Self { enabled: true, quality: None, reset: 0, debug: CloudDebugView::None, order: CloudOrder::Sorted }
    }
}

/// The clock that wind and evolution follow. The same time gives the same sky.
#[derive(Resource, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Resource, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudClock {
    /// Cloud time (s, f64). Default 0.
    #[reflect(@-1.0e12..=1.0e12_f32)]
    pub seconds: f64,
    /// Cloud seconds per second of the app's virtual time; 0 pauses. Default 1.
    #[reflect(@-1.0e4..=1.0e4_f32)]
    pub speed: f32,
}

impl Default for CloudClock {
    fn default() -> Self {
        Self { seconds: 0.0, speed: 1.0 }
    }
}

/// Advances [`CloudClock`] by the app's time.
pub(crate) fn advance_clock(mut clock: ResMut<CloudClock>, time: Res<Time>) {
    let step = time.delta_secs_f64() * f64::from(clock.speed);
    if step != 0.0 && clock.validate().is_ok() {
        clock.seconds += step;
    }
}
