//! The built-in presets, one after the other.

use bevy_cumulus::prelude::*;

/// The built-in presets, parsed once, and the one chosen last.
pub struct Presets {
    all: Vec<(&'static str, CloudPreset)>,
    last: usize,
}

impl Presets {
    /// All presets; the last of them counts as chosen, so that the first is next.
    pub fn new() -> Self {
        let all: Vec<_> = CloudPreset::names().filter_map(|name| Some((name, CloudPreset::named(name)?))).collect();
        Self { last: all.len().saturating_sub(1), all }
    }

    /// The one chosen last if it is in use, else the first that is.
    fn index(&self, model: &CloudModel, layers: &CloudLayers, lighting: &CloudLighting) -> Option<usize> {
        let in_use = |i: &usize| self.all.get(*i).is_some_and(|(_, preset)| preset.is_sky(model, layers, lighting));
        std::iter::once(self.last).chain(0..self.all.len()).find(in_use)
    }

    /// The preset in use, unless something has been changed since.
    pub fn name(&self, model: &CloudModel, layers: &CloudLayers, lighting: &CloudLighting) -> Option<&'static str> {
        Some(self.all[self.index(model, layers, lighting)?].0)
    }

    /// The preset after the one in use, or after the one chosen last.
    pub fn next(&mut self, model: &CloudModel, layers: &CloudLayers, lighting: &CloudLighting) -> Option<CloudPreset> {
        let current = self.index(model, layers, lighting).unwrap_or(self.last);
        self.last = (current + 1).checked_rem(self.all.len())?;
        Some(self.all[self.last].1.clone())
    }
}
