//! CPU copies of the model's textures: read back after each change, a piece a frame, without waiting for the GPU.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU8, Ordering},
    },
};

use bevy::{
    asset::AssetId,
    core_pipeline::schedule::camera_driver,
    prelude::*,
    render::{
        GpuResourceAppExt, Render, RenderSystems,
        render_resource::{
            Buffer, BufferDescriptor, BufferUsages, Extent3d, MapMode, Origin3d, TexelCopyBufferInfo,
            TexelCopyBufferLayout, TexelCopyTextureInfo, Texture as GpuTexture, TextureAspect, TextureDescriptor,
            TextureDimension, TextureFormat, TextureUsages,
        },
        renderer::{RenderContext, RenderDevice, RenderGraph},
    },
};

use super::{
    CloudTextureSlot,
    bake::{self, Bakery, Content},
    texel::decoder,
};
use crate::reference::{
    field::OCTAVES,
    keeper::CloudFieldError,
    query::CloudTextureSet,
    sampler::{Address, Texture},
};

/// Most that one frame copies and one frame decodes, unless one slice or row is more (bytes).
const PIECE: u32 = 1 << 20;
/// Pieces on their way at once: a map is granted two or three frames after the copy.
const MOST_IN_FLIGHT: usize = 3;

/// What both worlds share.
#[derive(Resource, Clone, Default)]
pub(crate) struct CpuCopies(Arc<Mutex<Copies>>);

#[derive(Default)]
struct Copies {
    /// One texture for each channel that is kept.
    channels: [Vec<Arc<Texture>>; CloudTextureSlot::COUNT],
    set: Option<CloudTextureSet>,
    /// Counts what each slot has been told to show, so that what comes late is dropped.
    revision: [u32; CloudTextureSlot::COUNT],
    unreadable: [bool; CloudTextureSlot::COUNT],
    requests: Vec<Request>,
    /// Requests taken and not answered.
    reading_images: u32,
    /// Whether the render world has delivered all there is.
    delivered: bool,
}

/// An image that the GPU cannot give back.
#[derive(Clone, Copy)]
pub(crate) struct Request {
    slot: CloudTextureSlot,
    pub image: AssetId<Image>,
    revision: u32,
}

impl CpuCopies {
    fn lock(&self) -> MutexGuard<'_, Copies> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All textures, once they are there.
    pub(crate) fn get(&self) -> Result<CloudTextureSet, CloudFieldError> {
        let copies = self.lock();
        match CloudTextureSlot::OF_MODEL.into_iter().find(|slot| copies.unreadable[*slot as usize]) {
            Some(slot) => Err(CloudFieldError::Unreadable { slot }),
            None => copies.set.clone().ok_or(CloudFieldError::NotReady),
        }
    }

    pub(crate) fn are_current(&self) -> bool {
        let copies = self.lock();
        copies.delivered && copies.requests.is_empty() && copies.reading_images == 0
    }

    pub(crate) fn take_requests(&self) -> Vec<Request> {
        let mut copies = self.lock();
        copies.reading_images += copies.requests.len() as u32;
        std::mem::take(&mut copies.requests)
    }

    /// Answers a request: there is no such data.
    pub(crate) fn refuse(&self, request: &Request) {
        self.lock().answer(request, None);
    }

    /// Answers a request from the image's own data.
    pub(crate) fn read_image(&self, request: &Request, image: &Image) {
        let read = image.data.as_ref().and_then(|data| from_bytes(request.slot, &image.texture_descriptor, data));
        self.lock().answer(request, read);
    }
}

impl Copies {
    fn answer(&mut self, request: &Request, read: Option<Vec<Texture>>) {
        self.reading_images -= 1;
        if self.revision[request.slot as usize] != request.revision {
            return;
        }
        match read {
            Some(read) => self.deliver(request.slot, read),
            None => self.unreadable[request.slot as usize] = true,
        }
    }

    fn expect(&mut self, slot: CloudTextureSlot) -> u32 {
        self.unreadable[slot as usize] = false;
        self.revision[slot as usize] += 1;
        self.revision[slot as usize]
    }

    fn deliver(&mut self, slot: CloudTextureSlot, read: Vec<Texture>) {
        use CloudTextureSlot::{Billow, Coverage, Gradient, TypeMap, Wisp};
        self.channels[slot as usize] = read.into_iter().map(Arc::new).collect();
        let channel = |slot: CloudTextureSlot, i: usize| self.channels[slot as usize].get(i).cloned();
        self.set = (|| {
            Some(CloudTextureSet {
                billow: channel(Billow, 0)?,
                wisp: channel(Wisp, 0)?,
                coverage: channel(Coverage, 0)?,
                coverage_bound: channel(Coverage, 1)?,
                type_map: channel(TypeMap, 0)?,
                gradient: channel(Gradient, 0)?,
            })
        })();
    }
}

/// The channels that are kept of a texel.
fn kept(slot: CloudTextureSlot, texel: [f32; 4]) -> [f32; 2] {
    match slot {
        CloudTextureSlot::Billow | CloudTextureSlot::Wisp => {
            [texel.iter().zip(OCTAVES).map(|(channel, share)| channel * share).sum(), 0.0]
        }
        _ => [texel[0], texel[1]],
    }
}

/// Channels kept of a slot, with the levels read so far.
struct Channels {
    slot: CloudTextureSlot,
    decode: fn(&[u8]) -> [f32; 4],
    texel_bytes: usize,
    levels: Vec<[(UVec3, Vec<f32>); 2]>,
}

impl Channels {
    /// `None` for a format that no slot takes.
    fn new(slot: CloudTextureSlot, format: TextureFormat) -> Option<Self> {
        let texel_bytes = format.block_copy_size(None)? as usize;
        Some(Self { slot, decode: decoder(format)?, texel_bytes, levels: Vec::new() })
    }

    /// Adds rows of texels, each `row_bytes` long, to a level: levels and rows come in order.
    fn add(&mut self, level: usize, size: UVec3, bytes: &[u8], row_bytes: usize) {
        if self.levels.len() == level {
            self.levels.push([(size, Vec::new()), (size, Vec::new())]);
        }
        let Some([(_, first), (_, second)]) = self.levels.get_mut(level) else { return };
        for row in bytes.chunks_exact(row_bytes) {
            for texel in row[..size.x as usize * self.texel_bytes].chunks_exact(self.texel_bytes) {
                let [a, b] = kept(self.slot, (self.decode)(texel));
                first.push(a);
                if self.slot == CloudTextureSlot::Coverage {
                    second.push(b);
                }
            }
        }
    }

    fn finish(self) -> Option<Vec<Texture>> {
        let address = if self.slot == CloudTextureSlot::Gradient { Address::Clamp } else { Address::Repeat };
        let (first, second): (Vec<_>, Vec<_>) = self.levels.into_iter().map(|[a, b]| (a, b)).unzip();
        let mut channels = vec![Texture::new(first, address)?];
        if self.slot == CloudTextureSlot::Coverage {
            channels.push(Texture::new(second, address)?);
        }
        Some(channels)
    }
}

fn level_size(whole: Extent3d, dimension: TextureDimension, level: u32) -> UVec3 {
    let depth = if dimension == TextureDimension::D3 { whole.depth_or_array_layers >> level } else { 1 };
    UVec3::new(whole.width >> level, whole.height >> level, depth).max(UVec3::ONE)
}

/// An image's data, level by level, rows tightly packed. `None` where there is too little of it.
fn from_bytes(slot: CloudTextureSlot, descriptor: &TextureDescriptor, data: &[u8]) -> Option<Vec<Texture>> {
    let mut channels = Channels::new(slot, descriptor.format)?;
    let mut rest = data;
    for level in 0..descriptor.mip_level_count {
        let size = level_size(descriptor.size, descriptor.dimension, level);
        let (bytes, after) = rest.split_at_checked(size.element_product() as usize * channels.texel_bytes)?;
        channels.add(level as usize, size, bytes, size.x as usize * channels.texel_bytes);
        rest = after;
    }
    channels.finish()
}

/// Slices of a level of a volume, or rows of one of a map.
struct Piece {
    level: u32,
    size: UVec3,
    origin: Origin3d,
    extent: Extent3d,
}

/// The pieces of a texture, in order.
fn pieces(texture: &GpuTexture, texel_bytes: u32) -> VecDeque<Piece> {
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
    texture: GpuTexture,
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
        for slot in CloudTextureSlot::OF_MODEL {
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
