//! Whether clouds can be and are being drawn: told to the main world by the render world.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, Ordering},
};

use bevy::prelude::*;

#[derive(Default, Debug)]
pub(crate) struct SharedStatus {
    views_ready: AtomicBool,
    unsupported: OnceLock<String>,
}

/// Whether clouds are being drawn. A resource of the main world.
#[derive(Resource, Clone, Default, Debug)]
pub struct CloudStatus(pub(crate) Arc<SharedStatus>);

impl CloudStatus {
    /// Whether the textures are baked, the maps of all layers made and the pipelines of every view with clouds compiled.
    /// At first nothing is drawn until then; later what is there goes on being drawn. False while no camera shows clouds.
    pub fn is_ready(&self) -> bool {
        self.0.views_ready.load(Ordering::Acquire)
    }

    /// Why this device cannot draw clouds, if it cannot: names the missing limit and the adapter.
    pub fn unsupported(&self) -> Option<&str> {
        self.0.unsupported.get().map(String::as_str)
    }

    pub(crate) fn set_unsupported(&self, reason: String) {
        // Decided once, when the device is known.
        let _ = self.0.unsupported.set(reason);
    }
}

/// The same, in the render world.
#[derive(Resource, Clone)]
pub(crate) struct StatusFlags(pub Arc<SharedStatus>);

impl StatusFlags {
    /// Whether all views are drawn with all that they are to show.
    pub fn set_ready(&self, ready: bool) {
        self.0.views_ready.store(ready, Ordering::Release);
    }
}
