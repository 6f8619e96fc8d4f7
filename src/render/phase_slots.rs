//! The phase functions in use: slot 0 is [`CloudLighting`]'s own, the others are layers'.

use std::sync::Arc;

use bevy::{
    prelude::*,
    render::{
        render_resource::{
            BindGroupLayoutEntryBuilder, Buffer, BufferDescriptor, BufferUsages,
            binding_types::storage_buffer_read_only_sized,
        },
        renderer::{RenderDevice, RenderQueue},
    },
};

use super::view::ExtractedClouds;
use crate::{
    phases::ReadyTables,
    reference::{
        phase::{HgDraine, Phase},
        phase_table::{GPU_LENGTH, PhaseTable},
    },
    settings::{CloudLighting, CloudPhase, LightMix, PhaseFunction},
};

/// Slots that a medium can mix: `Medium::phase` has a share for each.
pub(crate) const PHASE_SLOTS: usize = 4;

/// `PHASE_TABLE` of `phase.wesl`.
const TABLE: u32 = 7;

struct Slot {
    /// The phase function, or what stands in for a table in late octaves.
    phase: Phase,
    table: Option<Arc<PhaseTable>>,
}

impl Slot {
    fn new(settings: &CloudPhase, table: Option<&Arc<PhaseTable>>) -> Self {
        // Settings are validated before they get here, so the fallback is never seen.
        let phase = match (settings.function, table) {
            // Henyey and Greenstein's, as the shader has it for tables.
            (PhaseFunction::Table, Some(table)) => {
                let g = table.mean_cosine().element_sum() / 3.0;
                Phase::HgDraine(HgDraine { g_hg: 0.0, g_d: g, alpha: 0.0, w: 1.0 })
            }
            _ => Phase::of(settings).unwrap_or(Phase::Isotropic),
        };
        Self { phase, table: table.cloned() }
    }

    fn mean_cosine(&self) -> f64 {
        self.table.as_ref().map_or_else(|| self.phase.mean_cosine(), |table| table.mean_cosine().element_sum() / 3.0)
    }

    fn peak_share(&self) -> f64 {
        self.table.as_ref().map_or_else(|| self.phase.peak_share(), |table| table.narrow_share().element_sum() / 3.0)
    }

    fn peak_asymmetry(&self) -> f64 {
        self.table.as_ref().map_or_else(|| self.phase.peak_asymmetry(), |table| table.narrow_mean_cosine())
    }
}

/// The phase functions of a view.
pub(crate) struct PhaseSlots {
    slots: Vec<Slot>,
    /// Of slot 0, in use by others.
    shift: Vec4,
}

impl PhaseSlots {
    /// Slot 0 from the lighting, then one for each of up to three `layers`, then what else the light is mixed of; more are
    /// ignored.
    pub fn new(lighting: &CloudLighting, layers: &[CloudPhase], light: &LightMix, tables: &ReadyTables) -> Self {
        let own = CloudPhase::from(lighting);
        let others: Vec<(CloudPhase, f32)> = light.others(lighting).collect();
        let mut shift = Vec4::ZERO;
        for (slot, (_, share)) in (1 + layers.len()..PHASE_SLOTS).zip(&others) {
            shift[slot] = *share;
            shift.x -= share;
        }
        let all = std::iter::once(&own).chain(layers).chain(others.iter().map(|(phase, _)| phase));
        let slots = all.take(PHASE_SLOTS).enumerate();
        Self { slots: slots.map(|(slot, phase)| Slot::new(phase, tables.get(slot, phase.function))).collect(), shift }
    }

    /// How many are in use, 1 to 4.
    pub fn count(&self) -> u32 {
        self.slots.len() as u32
    }

    /// What is added to a medium's shares for all of slot 0's.
    pub fn shift(&self) -> Vec4 {
        self.shift
    }

    /// Whether any is a table, and light may be turned differently by colour.
    pub fn is_coloured(&self) -> bool {
        self.slots.iter().any(|slot| slot.table.is_some())
    }

    fn each<T: Copy>(&self, unused: T, of: impl Fn(&Slot) -> T) -> [T; PHASE_SLOTS] {
        std::array::from_fn(|slot| self.slots.get(slot).map_or(unused, &of))
    }

    /// Kinds of `phase.wesl`.
    pub fn kinds(&self) -> UVec4 {
        self.each(0, |slot| if slot.table.is_some() { TABLE } else { slot.phase.shader_parameters().0 }).into()
    }

    /// Parameters of `phase.wesl`.
    pub fn params(&self) -> [Vec4; PHASE_SLOTS] {
        self.each(Vec4::ZERO, |slot| slot.phase.shader_parameters().1.into())
    }

    /// How diffuse light falls with optical depth: ¾(1 − ⟨cosθ⟩).
    pub fn fall(&self) -> Vec4 {
        self.each(0.0, |slot| 0.75 * (1.0 - slot.mean_cosine() as f32)).into()
    }

    /// The narrow forward peak, by slot: its share of the light, and its asymmetry.
    ///
    /// Light in a diffraction peak hardly turns, so it is followed apart: it goes on as if nothing had been in its way, a
    /// little wider each time. Single scattering alone (one octave), or the octaves alone (no diffusion), are the
    /// thesis's, which knows of no peak: then all shares are 0.
    pub fn peaks(&self, lighting: &CloudLighting, octaves: f32) -> [Vec4; 2] {
        let share = Vec4::from(self.each(0.0, |slot| slot.peak_share() as f32));
        [diffuses(lighting, octaves) * share, self.each(0.0, |slot| slot.peak_asymmetry() as f32).into()]
    }
}

/// How much of the second octave there is, 0 to 1: without one no sunlight diffuses.
pub(crate) fn past_the_first(octaves: f32) -> f32 {
    (octaves - 1.0).clamp(0.0, 1.0)
}

/// Whether sunlight diffuses (1) or not (0); in between only where there is next to none of it, so that it may set in.
pub(crate) fn diffuses(lighting: &CloudLighting, octaves: f32) -> f32 {
    lighting.diffusion.min(1.0) * past_the_first(octaves)
}

/// The tables, as `table.wesl` reads them.
#[derive(Resource)]
pub(crate) struct PhaseTableBuffer {
    pub buffer: Buffer,
    generation: u64,
}

pub(crate) fn phase_tables_layout() -> BindGroupLayoutEntryBuilder {
    storage_buffer_read_only_sized(false, None)
}

/// Bytes of one slot's table.
const TABLE_BYTES: u64 = (GPU_LENGTH * 16) as u64;

impl FromWorld for PhaseTableBuffer {
    fn from_world(world: &mut World) -> Self {
        let buffer = world.resource::<RenderDevice>().create_buffer(&BufferDescriptor {
            label: Some("cloud_phase_tables"),
            size: TABLE_BYTES * PHASE_SLOTS as u64,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { buffer, generation: 0 }
    }
}

pub(crate) fn write_phase_tables(
    clouds: Res<ExtractedClouds>,
    mut tables: ResMut<PhaseTableBuffer>,
    queue: Res<RenderQueue>,
) {
    if tables.generation == clouds.tables.generation {
        return;
    }
    tables.generation = clouds.tables.generation;
    for (slot, table) in clouds.tables.iter() {
        let bytes: Vec<u8> = table.on_gpu().as_flattened().iter().flat_map(|x| x.to_ne_bytes()).collect();
        queue.write_buffer(&tables.buffer, slot as u64 * TABLE_BYTES, &bytes);
    }
}
