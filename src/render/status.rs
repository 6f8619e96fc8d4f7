//! Whether clouds can be and are being drawn: told to the main world by the render world.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, Ordering},
};

use bevy::prelude::*;

#[derive(Default, Debug)]
pub(crate) struct SharedStatus {
    views_ready: AtomicBool,
    views_drawn: AtomicBool,
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
    /// Whether views are drawn, and whether all that they are to show is there.
    pub fn set_views(&self, drawn: bool, complete: bool) {
        self.0.views_drawn.store(drawn, Ordering::Release);
        self.0.views_ready.store(drawn && complete, Ordering::Release);
    }

    /// Whether the last frame was drawn: only then does it count towards a window.
    pub fn views_were_drawn(&self) -> bool {
        self.0.views_drawn.load(Ordering::Acquire)
    }
}
