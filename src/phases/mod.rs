//! Phase functions that are tables: computed in the background, or a user's own.
//!
//! [`PhaseFunction::Mie`] and [`PhaseFunction::Ice`] are computed when they are first asked for;
//! [`PhaseFunction::Table`] reads a layer's file, or [`CloudPhaseTables`]. Until a table is there, the one of the same kind
//! before it stays, or else what [`Phase::of`](crate::reference::phase::Phase::of) gives.

mod asset;
mod files;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready},
};

pub use asset::{CloudPhaseTable, PhaseTableError};

use self::files::TableFiles;
use crate::{
    reference::{ice, mie, phase_table::PhaseTable},
    render::PHASE_SLOTS,
    settings::{CloudPhase, CloudWeather, GoodPhases, GoodSettings, KeepGood, PhaseFunction},
};

/// A user's tables for phase functions, by slot: the first for [`CloudLighting`](crate::CloudLighting)'s own, the others for
/// [`ModelPhases`](crate::ModelPhases)', or layers' different ones in the order of the list. Read where the slot's function is
/// [`PhaseFunction::Table`]. Default none. A layer's own file, [`CloudLayer::phase_file`](crate::CloudLayer::phase_file), goes
/// before its slot's table, and stays with the layer wherever it is in the list.
///
/// Load them as assets (`*.phase.csv`, see [`CloudPhaseTable`]) or add them in code. One that does not load is reported
/// with file and line, and the last good one stays.
#[derive(Resource, Reflect, Clone, PartialEq, Debug, Default)]
#[reflect(Resource, Default, PartialEq)]
pub struct CloudPhaseTables {
    /// One a slot.
    pub tables: [Option<Handle<CloudPhaseTable>>; PHASE_SLOTS],
}

/// Whether phase functions are being computed. Read it to wait for them; writing to it does nothing.
#[derive(Resource, Reflect, Clone, Copy, PartialEq, Debug, Default)]
#[reflect(Resource, Default, PartialEq)]
pub struct CloudPhaseStatus {
    /// Whether a table of [`PhaseFunction::Mie`] that is in use is still to come.
    pub computing: bool,
}

/// What a table was made from.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Source {
    /// Bits of the droplets' diameter.
    Mie(u32),
    /// Bits of the halo's strength.
    Ice(u32),
    Asset(AssetId<CloudPhaseTable>),
}

impl Source {
    fn of(phase: &CloudPhase, own: Option<&Handle<CloudPhaseTable>>) -> Option<Self> {
        match phase.function {
            PhaseFunction::Mie => Some(Self::Mie(phase.droplet_diameter.to_bits())),
            PhaseFunction::Ice => Some(Self::Ice(phase.halo.to_bits())),
            PhaseFunction::Table => own.map(|handle| Self::Asset(handle.id())),
            _ => None,
        }
    }

    fn function(self) -> PhaseFunction {
        match self {
            Self::Mie(_) => PhaseFunction::Mie,
            Self::Ice(_) => PhaseFunction::Ice,
            Self::Asset(_) => PhaseFunction::Table,
        }
    }
}

/// The tables there are, by slot.
#[derive(Resource, Clone, Default)]
pub(crate) struct ReadyTables {
    slots: [Option<(Source, Arc<PhaseTable>)>; PHASE_SLOTS],
    /// Counts changes.
    pub generation: u64,
}

impl ReadyTables {
    /// The slot's table, if it is one of this function.
    pub fn get(&self, slot: usize, function: PhaseFunction) -> Option<&Arc<PhaseTable>> {
        let (source, table) = self.slots[slot].as_ref()?;
        (source.function() == function).then_some(table)
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &PhaseTable)> {
        self.slots.iter().enumerate().filter_map(|(slot, table)| Some((slot, &*table.as_ref()?.1)))
    }

    fn put(&mut self, slot: usize, table: Option<(Source, Arc<PhaseTable>)>) {
        self.slots[slot] = table;
        self.generation += 1;
    }
}

/// Tables of droplets: one is computed at a time, and the last few are kept.
#[derive(Resource, Default)]
struct MieTables {
    made: Vec<(u32, Arc<PhaseTable>)>,
    task: Option<(u32, Task<PhaseTable>)>,
}

impl MieTables {
    const KEPT: usize = 8;

    fn get(&self, diameter: u32) -> Option<Arc<PhaseTable>> {
        self.made.iter().find(|(of, _)| *of == diameter).map(|(_, table)| table.clone())
    }

    /// Takes in what is done, and starts on the first that is wanted.
    fn work(&mut self, wanted: Option<u32>) {
        if let Some((diameter, task)) = &mut self.task
            && let Some(table) = check_ready(task)
        {
            self.made.truncate(Self::KEPT - 1);
            self.made.insert(0, (*diameter, Arc::new(table)));
            self.task = None;
        }
        if let Some(diameter) = wanted
            && self.task.is_none()
            && self.get(diameter).is_none()
        {
            let compute = async move { mie::droplets(f32::from_bits(diameter).into()) };
            self.task = Some((diameter, AsyncComputeTaskPool::get_or_init(TaskPool::new).spawn(compute)));
        }
    }
}

/// Tables of phase functions, main world's half.
pub(crate) struct CloudPhasesPlugin;

impl Plugin for CloudPhasesPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<CloudPhaseTables>()
            .init_resource::<CloudPhaseStatus>()
            .init_resource::<ReadyTables>()
            .init_resource::<MieTables>()
            .init_resource::<TableFiles>()
            .register_type::<CloudPhaseTables>()
            .register_type::<CloudPhaseStatus>()
            .init_asset::<CloudPhaseTable>()
            .init_asset_loader::<asset::CloudPhaseTableLoader>()
            .add_systems(Last, update_tables.after(KeepGood));
    }
}

fn update_tables(
    good: Res<GoodSettings>,
    layers: Res<GoodPhases>,
    weather: Option<Res<CloudWeather>>,
    own: Option<Res<CloudPhaseTables>>,
    assets: Res<Assets<CloudPhaseTable>>,
    mut changes: MessageReader<AssetEvent<CloudPhaseTable>>,
    mut files: ResMut<TableFiles>,
    server: Option<Res<AssetServer>>,
    mut mie: ResMut<MieTables>,
    mut ready: ResMut<ReadyTables>,
    mut status: ResMut<CloudPhaseStatus>,
) {
    let changed: Vec<AssetId<CloudPhaseTable>> = changes
        .read()
        .filter_map(|change| match change {
            AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    let lighting = CloudPhase::from(&good.0.lighting);
    // What the light is mixed of while it changes: in the slots that are left.
    let light = weather.as_ref().and_then(|weather| weather.light());
    let others: Vec<CloudPhase> =
        light.into_iter().flat_map(|light| light.others(&good.0.lighting)).map(|(phase, _)| phase).collect();
    let phases: Vec<&CloudPhase> =
        std::iter::once(&lighting).chain(&layers.0).chain(&others).take(PHASE_SLOTS).collect();
    mie.work(None);
    let mut wanted = None;
    files.follow(&good.0.layers, server.as_deref(), &assets);
    for slot in 0..PHASE_SLOTS {
        let table = if slot > layers.0.len() { 0 } else { slot };
        let handle = files.of_slot(slot).or_else(|| own.as_ref().and_then(|own| own.tables[table].as_ref()));
        let source = phases.get(slot).and_then(|phase| Source::of(phase, handle));
        let has = ready.slots[slot].as_ref().map(|(source, _)| *source);
        let stale = matches!(source, Some(Source::Asset(id)) if changed.contains(&id));
        if source == has && !stale {
            continue;
        }
        let table = match source {
            None => {
                ready.put(slot, None);
                continue;
            }
            Some(Source::Mie(diameter)) => {
                let table = mie.get(diameter);
                if table.is_none() {
                    wanted = wanted.or(Some(diameter));
                }
                table
            }
            Some(Source::Ice(halo)) => Some(Arc::new(ice::table(f32::from_bits(halo).into()))),
            Some(Source::Asset(id)) => assets.get(id).map(|asset| asset.0.clone()),
        };
        if let Some((source, table)) = source.zip(table) {
            ready.put(slot, Some((source, table)));
        }
    }
    mie.work(wanted);
    status.set_if_neq(CloudPhaseStatus { computing: wanted.is_some() });
}
