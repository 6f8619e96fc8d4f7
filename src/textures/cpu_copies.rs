//! CPU copies of the model's textures: what both worlds know of them, and how bytes become [`Texture`]s.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy::{
    asset::AssetId,
    prelude::*,
    render::render_resource::{Extent3d, TextureDescriptor, TextureDimension, TextureFormat},
};

use super::{CloudTextureSlot, texel::decoder};
use crate::reference::{
    keeper::CloudFieldError,
    query::{CloudTextureSet, LayerTextureSet},
    sampler::{Address, Texture},
    texture_set::{DETAIL_SHARES, OCTAVES, SHAPE_SHARES},
};

/// What both worlds share.
#[derive(Resource, Clone, Default)]
pub(crate) struct CpuCopies(Arc<Mutex<Copies>>);

#[derive(Default)]
pub(super) struct Copies {
    /// One texture for each channel that is kept.
    channels: [Vec<Arc<Texture>>; CloudTextureSlot::COUNT],
    set: Option<CloudTextureSet>,
    /// Counts what each slot has been told to show, so that what comes late is dropped.
    revision: [u32; CloudTextureSlot::COUNT],
    unreadable: [bool; CloudTextureSlot::COUNT],
    pub requests: Vec<Request>,
    /// Requests taken and not answered.
    reading_images: u32,
    /// Whether the render world has delivered all there is.
    pub delivered: bool,
}

/// An image that the GPU cannot give back.
#[derive(Clone, Copy)]
pub(crate) struct Request {
    pub(super) slot: CloudTextureSlot,
    pub image: AssetId<Image>,
    pub(super) revision: u32,
}

impl CpuCopies {
    pub(super) fn lock(&self) -> MutexGuard<'_, Copies> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All textures, once they are there. What `layers` read may be missing still.
    pub(crate) fn get(&self, layers: bool) -> Result<CloudTextureSet, CloudFieldError> {
        let copies = self.lock();
        let of_layers: &[_] = if layers { &CloudTextureSlot::OF_LAYERS } else { &[] };
        match CloudTextureSlot::OF_MODEL.iter().chain(of_layers).find(|slot| copies.unreadable[**slot as usize]) {
            Some(slot) => Err(CloudFieldError::Unreadable { slot: *slot }),
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

    /// A slot shows something new, which is to come.
    pub fn expect(&mut self, slot: CloudTextureSlot) -> u32 {
        self.unreadable[slot as usize] = false;
        self.revision[slot as usize] += 1;
        self.revision[slot as usize]
    }

    pub fn deliver(&mut self, slot: CloudTextureSlot, read: Vec<Texture>) {
        use CloudTextureSlot::{Billow, Coverage, Detail, Gradient, Shape, TypeMap, Wisp};
        self.channels[slot as usize] = read.into_iter().map(Arc::new).collect();
        let channel = |slot: CloudTextureSlot, i: usize| self.channels[slot as usize].get(i).cloned();
        let layers = (|| Some(LayerTextureSet::new(channel(Shape, 0)?, channel(Shape, 1)?, channel(Detail, 0)?)))();
        self.set = (|| {
            Some(CloudTextureSet {
                billow: channel(Billow, 0)?,
                wisp: channel(Wisp, 0)?,
                coverage: channel(Coverage, 0)?,
                coverage_bound: channel(Coverage, 1)?,
                type_map: channel(TypeMap, 0)?,
                gradient: channel(Gradient, 0)?,
                layers,
            })
        })();
    }
}

/// The channels that are kept of a texel.
fn kept(slot: CloudTextureSlot, texel: [f32; 4]) -> [f32; 2] {
    let sum =
        |channels: &[f32], shares: &[f32]| channels.iter().zip(shares).map(|(channel, share)| channel * share).sum();
    match slot {
        CloudTextureSlot::Billow | CloudTextureSlot::Wisp => [sum(&texel, &OCTAVES), 0.0],
        CloudTextureSlot::Shape => [texel[0], sum(&texel[1..], &SHAPE_SHARES)],
        CloudTextureSlot::Detail => [sum(&texel[..3], &DETAIL_SHARES), 0.0],
        _ => [texel[0], texel[1]],
    }
}

/// Whether two channels are kept.
fn keeps_two(slot: CloudTextureSlot) -> bool {
    matches!(slot, CloudTextureSlot::Coverage | CloudTextureSlot::Shape)
}

/// Channels kept of a slot, with the levels read so far.
pub(super) struct Channels {
    pub slot: CloudTextureSlot,
    decode: fn(&[u8]) -> [f32; 4],
    pub texel_bytes: usize,
    levels: Vec<[(UVec3, Vec<f32>); 2]>,
}

impl Channels {
    /// `None` for a format that no slot takes.
    pub fn new(slot: CloudTextureSlot, format: TextureFormat) -> Option<Self> {
        let texel_bytes = format.block_copy_size(None)? as usize;
        Some(Self { slot, decode: decoder(format)?, texel_bytes, levels: Vec::new() })
    }

    /// Adds rows of texels, each `row_bytes` long, to a level: levels and rows come in order.
    pub fn add(&mut self, level: usize, size: UVec3, bytes: &[u8], row_bytes: usize) {
        if self.levels.len() == level {
            self.levels.push([(size, Vec::new()), (size, Vec::new())]);
        }
        let Some([(_, first), (_, second)]) = self.levels.get_mut(level) else { return };
        for row in bytes.chunks_exact(row_bytes) {
            for texel in row[..size.x as usize * self.texel_bytes].chunks_exact(self.texel_bytes) {
                let [a, b] = kept(self.slot, (self.decode)(texel));
                first.push(a);
                if keeps_two(self.slot) {
                    second.push(b);
                }
            }
        }
    }

    pub fn finish(self) -> Option<Vec<Texture>> {
        let address = if self.slot == CloudTextureSlot::Gradient { Address::Clamp } else { Address::Repeat };
        let (first, second): (Vec<_>, Vec<_>) = self.levels.into_iter().map(|[a, b]| (a, b)).unzip();
        let mut channels = vec![Texture::new(first, address)?];
        if keeps_two(self.slot) {
            channels.push(Texture::new(second, address)?);
        }
        Some(channels)
    }
}

pub(super) fn level_size(whole: Extent3d, dimension: TextureDimension, level: u32) -> UVec3 {
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
