//! When held frames are wrong: counts that change with it.

use super::{view::ExtractedClouds, zones::ExtractedZones};

/// Counts changes of the textures, but for those that come with a transition: nothing jumps by them.
#[derive(Default)]
pub(crate) struct Baked {
    seen: u64,
    version: u64,
}

impl Baked {
    pub fn follow(&mut self, generation: u64, in_transition: bool) {
        if generation != self.seen {
            self.seen = generation;
            self.version += u64::from(!in_transition);
        }
    }
}

/// The counts that a view's history depends on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Versions {
    settings: u64,
    textures: u64,
    zones: u64,
}

impl Versions {
    /// The path tracer adds frames up without end, so any change at all counts for it.
    pub fn of(clouds: &ExtractedClouds, baked: &Baked, zones: &ExtractedZones, path_traced: bool) -> Self {
        if path_traced {
            let settings = clouds.version + clouds.transitions;
            return Self { settings, textures: baked.seen, zones: zones.changes };
        }
        Self { settings: clouds.version, textures: baked.version, zones: zones.version }
    }
}
