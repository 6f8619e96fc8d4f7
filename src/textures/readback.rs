//! Reads the model's textures back after each change, a piece a frame, without waiting for the GPU.

use std::{
    collections::VecDeque,
    sync::{
        Arc,
        atomic::{AtomicU8, Ordering},
    },
};

use bevy::{
    core_pipeline::schedule::camera_driver,
    prelude::*,
    render::{
        GpuResourceAppExt, Render, RenderSystems,
        render_resource::{
            Buffer, BufferDescriptor, BufferUsages, Extent3d, MapMode, Origin3d, TexelCopyBufferInfo,
            TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect, TextureUsages,
        },
        renderer::{RenderContext, RenderDevice, RenderGraph},
    },
};

use super::{
    CloudTextureSlot,
    bake::{self, Bakery, Content},
    cpu_copies::{Channels, CpuCopies, Request, level_size},
};

/// Most that one frame copies and one frame decodes, unless one slice or row is more (bytes).
const PIECE: u32 = 1 << 20;
/// Pieces on their way at once: a map is granted two or three frames after the copy.
const MOST_IN_FLIGHT: usize = 3;

/// Slices of a level of a volume, or rows of one of a map.
struct Piece {
    level: u32,
    size: UVec3,
    origin: Origin3d,
    extent: Extent3d,
}

/// The pieces of a texture, in order.
fn pieces(texture: &Texture, texel_bytes: u32) -> VecDeque<Piece> {
    let mut pieces = VecDeque::new();
    for level in 0..texture.mip_level_count() {
        let size = level_size(texture.size(), texture.dimension(), level);
        let row = row_bytes(size.x, texel_bytes);
        let (bands, band) = if size.z > 1 { (size.z, row * size.y) } else { (size.y, row) };
        let most = (PIECE / band).max(1);
        for from in (0..bands).step_by(most as usize) {
            let count = most.min(bands - from);
            let whole = Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z };
            let (origin, extent) = if size.z > 1 {
                (Origin3d { x: 0, y: 0, z: from }, Extent3d { depth_or_array_layers: count, ..whole })
            } else {
                (Origin3d { x: 0, y: from, z: 0 }, Extent3d { height: count, ..whole })
            };
            pieces.push_back(Piece { level, size, origin, extent });
        }
    }
    pieces
}

fn row_bytes(width: u32, texel_bytes: u32) -> u32 {
    RenderDevice::align_copy_bytes_per_row((width * texel_bytes) as usize) as u32
}

/// A copy that the GPU makes.
struct Flight {
    piece: Piece,
    buffer: Buffer,
    state: Arc<AtomicU8>,
}

const UNDER_WAY: u8 = 0;
const MAPPED: u8 = 1;
const FAILED: u8 = 2;

/// A texture being read.
struct Reading {
    content: Content,
    texture: Texture,
    channels: Channels,
    pieces: VecDeque<Piece>,
    flights: VecDeque<Flight>,
}

enum Landed {
    Failed,
    All,
    NotAll,
}

impl Reading {
    /// Decodes the next piece, if it is here.
    fn land(&mut self) -> Landed {
        let Some(flight) = self.flights.front() else {
            return if self.pieces.is_empty() { Landed::All } else { Landed::NotAll };
        };
        match flight.state.load(Ordering::Acquire) {
            UNDER_WAY => return Landed::NotAll,
            MAPPED => {}
            _ => return Landed::Failed,
        }
        let Ok(bytes) = flight.buffer.slice(..).get_mapped_range() else { return Landed::Failed };
        let Piece { level, size, .. } = flight.piece;
        let row = row_bytes(size.x, self.channels.texel_bytes as u32) as usize;
        self.channels.add(level as usize, size, &bytes, row);
        drop(bytes);
        self.flights.pop_front();
        if self.flights.is_empty() && self.pieces.is_empty() { Landed::All } else { Landed::NotAll }
    }
}

/// Made anew with each device, so that all is read again from a new one.
#[derive(Resource)]
struct Reader {
    seen: [Option<Content>; CloudTextureSlot::COUNT],
    reading: Option<Reading>,
}

impl FromWorld for Reader {
    fn from_world(_: &mut World) -> Self {
        Self { seen: default(), reading: None }
    }
}

/// The render half.
pub(crate) fn build_render(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<Reader>()
        .add_systems(Render, advance.in_set(RenderSystems::PrepareResources).after(super::TextureSwaps))
        .add_systems(RenderGraph, copy.after(bake::bake).before(camera_driver));
}

/// Takes in what has come, and looks for what has changed.
fn advance(bakery: Option<Res<Bakery>>, copies: Res<CpuCopies>, mut reader: ResMut<Reader>) {
    let Some(bakery) = bakery else { return };
    let reader = &mut *reader;
    if let Some(mut reading) = reader.reading.take() {
        let slot = reading.channels.slot;
        // What another texture has replaced meanwhile is dropped, and so is what failed: it is begun again.
        if bakery.shown(slot).is_some_and(|(content, _)| *content == reading.content) {
            match reading.land() {
                Landed::Failed => {}
                Landed::NotAll => reader.reading = Some(reading),
                Landed::All => {
                    reader.seen[slot as usize] = Some(reading.content);
                    if let Some(read) = reading.channels.finish() {
                        copies.lock().deliver(slot, read);
                    }
                }
            }
        }
    }
    if reader.reading.is_none() {
        reader.begin(&bakery, &copies);
    }
    copies.lock().delivered =
        reader.reading.is_none() && CloudTextureSlot::OF_MODEL.into_iter().all(|slot| bakery.shown(slot).is_some());
}

impl Reader {
    /// Begins with the first slot that shows something new.
    fn begin(&mut self, bakery: &Bakery, copies: &CpuCopies) {
        // Layers' volumes are shown from the first layer on.
        for slot in CloudTextureSlot::OF_MODEL.into_iter().chain(CloudTextureSlot::OF_LAYERS) {
            let Some((content, texture)) = bakery.shown(slot) else { continue };
            if self.seen[slot as usize].as_ref() == Some(content) {
                continue;
            }
            let revision = copies.lock().expect(slot);
            let copyable = texture.usage().contains(TextureUsages::COPY_SRC);
            if let Some(channels) = Channels::new(slot, texture.format()).filter(|_| copyable) {
                let pieces = pieces(texture, channels.texel_bytes as u32);
                let (content, texture) = (content.clone(), texture.clone());
                self.reading = Some(Reading { content, texture, channels, pieces, flights: VecDeque::new() });
                return;
            }
            if let Content::Image { image, .. } = *content {
                copies.lock().requests.push(Request { slot, image, revision });
            }
            self.seen[slot as usize] = Some(content.clone());
        }
    }
}

/// Records the copy of the next piece.
fn copy(mut reader: ResMut<Reader>, device: Res<RenderDevice>, mut context: RenderContext) {
    let Some(reading) = reader.reading.as_mut().filter(|reading| reading.flights.len() < MOST_IN_FLIGHT) else {
        return;
    };
    let Some(piece) = reading.pieces.pop_front() else { return };
    let Extent3d { height, depth_or_array_layers, .. } = piece.extent;
    let row = row_bytes(piece.size.x, reading.channels.texel_bytes as u32);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("cloud_readback"),
        size: u64::from(row) * u64::from(height * depth_or_array_layers),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let encoder = context.command_encoder();
    encoder.copy_texture_to_buffer(
        TexelCopyTextureInfo {
            texture: &reading.texture,
            mip_level: piece.level,
            origin: piece.origin,
            aspect: TextureAspect::All,
        },
        TexelCopyBufferInfo {
            buffer: &buffer,
            layout: TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(height) },
        },
        piece.extent,
    );
    let state = Arc::new(AtomicU8::new(UNDER_WAY));
    let told = state.clone();
    encoder.map_buffer_on_submit(&buffer, MapMode::Read, .., move |result| {
        told.store(if result.is_ok() { MAPPED } else { FAILED }, Ordering::Release);
    });
    reading.flights.push_back(Flight { piece, buffer, state });
}
