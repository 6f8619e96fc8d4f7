//! Tables that layers name by file.

use bevy::{asset::LoadState, prelude::*};

use super::CloudPhaseTable;
use crate::{settings::CloudLayers, textures::weather_maps::asset_path};

/// Files of tables in use.
#[derive(Resource, Default)]
pub(super) struct TableFiles {
    pub(super) loaded: Vec<(String, Handle<CloudPhaseTable>)>,
    /// Slots 1 to 3: the place of the slot's file among the loaded.
    slots: Vec<Option<usize>>,
    /// Files that something is wrong with, told once.
    told: Vec<String>,
}

impl TableFiles {
    /// Loads the files that the layers' slots name, and forgets those that none does.
    pub fn follow(&mut self, layers: &CloudLayers, server: Option<&AssetServer>, tables: &Assets<CloudPhaseTable>) {
        self.slots.clear();
        let Some(server) = server else { return };
        let slots = layers.phases();
        self.loaded.retain(|(file, _)| slots.iter().any(|slot| slot.file == file));
        self.told.retain(|file| slots.iter().any(|slot| slot.file == file));
        for slot in &slots {
            let (place, wrong) = self.find(slot.file, server, tables);
            self.slots.push(place);
            let Some(reason) = wrong else {
                self.told.retain(|file| file != slot.file);
                continue;
            };
            if !self.told.iter().any(|file| file == slot.file) {
                self.told.push(slot.file.to_owned());
                let layer = layers.shown().find(|(_, layer)| layer.its_phase() == Some(*slot));
                error!("clouds: layers.{}.phase_file{reason}", layer.map_or(0, |(i, _)| i));
            }
        }
    }

    /// The file's place, and what is wrong with it. One that is spoilt later keeps what it had.
    fn find(
        &mut self,
        file: &str,
        server: &AssetServer,
        tables: &Assets<CloudPhaseTable>,
    ) -> (Option<usize>, Option<String>) {
        if file.is_empty() {
            return (None, None);
        }
        let place = match self.loaded.iter().position(|(known, _)| known == file) {
            Some(place) => place,
            None => match asset_path(file) {
                Ok(path) => {
                    self.loaded.push((file.to_owned(), server.load(path)));
                    self.loaded.len() - 1
                }
                Err(reason) => return (None, Some(format!(": {reason}"))),
            },
        };
        let id = self.loaded[place].1.id();
        match server.get_load_state(id) {
            Some(LoadState::Failed(error)) => {
                (tables.contains(id).then_some(place), Some(format!(" did not load: {error}")))
            }
            _ => (Some(place), None),
        }
    }

    /// The table that a layer's file is to give this slot.
    pub fn of_slot(&self, slot: usize) -> Option<&Handle<CloudPhaseTable>> {
        let place = (*self.slots.get(slot.checked_sub(1)?)?)?;
        self.loaded.get(place).map(|(_, handle)| handle)
    }
}
