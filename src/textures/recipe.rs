//! What is baked how: recipes, the passes they are made of, and what those cost.

use bevy::{
    asset::AssetId,
    prelude::*,
    render::render_resource::{Extent3d, TextureDescriptor, TextureDimension, TextureUsages},
};

use super::{
    pipelines::{BakeParams, Kernel, MAP_FORMAT, VOLUME_FORMAT},
    profile::{CUMULUS_PROFILE, GRADIENT_SIZE, STRATUS_PROFILE},
    slots::CloudTextureSlot,
};
use crate::settings::CloudTextures;

/// Largest side of a map, baked or a user's, in texels.
pub(super) const MAX_MAP_SIZE: u32 = 8192;

/// Everything a texture that we make depends on: equal recipes give equal textures.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Recipe {
    Volume {
        kernel: Kernel,
        seed: u32,
        size: u32,
        cells: u32,
    },
    Map {
        kernel: Kernel,
        seed: u32,
        size: u32,
        cells: u32,
    },
    /// The vertical profile.
    Gradient,
    /// A pyramid over a user's image; the revision counts its changes.
    Pyramid {
        image: AssetId<Image>,
        revision: u32,
    },
}

/// Octaves that each kernel can use.
const fn most_octaves(kernel: Kernel) -> u32 {
    match kernel {
        Kernel::TypeMap => 3,
        _ => 6,
    }
}

/// Octaves whose cells are at least two texels wide, the finest that the texture can hold; one at least.
fn octaves(kernel: Kernel, size: u32, cells: u32) -> u32 {
    (1..most_octaves(kernel)).take_while(|&i| (cells << i) * 2 <= size).count() as u32 + 1
}

/// Work that one texel takes, in units of one octave of 3D Worley noise (27 cells). Upper bounds: an octave in the plane
/// looks at 9 cells, Perlin noise at 8 or 4 corners, a level of a pyramid at 36 texels.
fn texel_cost(kernel: Kernel, octaves: u32) -> u64 {
    match kernel {
        Kernel::Billow | Kernel::Wisp => octaves.into(),
        // Those of both noises.
        Kernel::Shape => (2 * octaves).into(),
        // Up to four octaves of Worley noise, then those of Perlin noise.
        Kernel::Coverage => (octaves.min(4) + octaves).into(),
        Kernel::TypeMap => octaves.into(),
        Kernel::VolumeMip | Kernel::Gradient => 1,
        Kernel::FirstLevel => 1,
        Kernel::NextLevel => 4,
    }
}

impl Recipe {
    /// What `slot` is baked from; `None` for blue noise, which ships as a file.
    pub(super) fn baked(slot: CloudTextureSlot, settings: &CloudTextures) -> Option<Self> {
        let CloudTextures { seed, volume_size, map_size, .. } = *settings;
        let volume = |kernel, cells| Self::Volume { kernel, seed, size: volume_size, cells };
        let map = |kernel, cells| Self::Map { kernel, seed, size: map_size, cells };
        Some(match slot {
            CloudTextureSlot::Billow => volume(Kernel::Billow, settings.billow_cells),
            CloudTextureSlot::Wisp => volume(Kernel::Wisp, settings.wisp_cells),
            CloudTextureSlot::Coverage => map(Kernel::Coverage, settings.coverage_cells),
            CloudTextureSlot::TypeMap => map(Kernel::TypeMap, settings.type_cells),
            CloudTextureSlot::Gradient => Self::Gradient,
            CloudTextureSlot::Shape => volume(Kernel::Shape, settings.shape_cells),
            CloudTextureSlot::Detail => Self::Volume {
                kernel: Kernel::Billow,
                seed: seed.wrapping_add(1),
                size: (volume_size / 4).max(32),
                cells: settings.detail_cells,
            },
            CloudTextureSlot::BlueNoise => return None,
        })
    }

    /// Size of the texture made; `image` is the size of the user's image, where one is the source.
    fn size(&self, image: UVec2) -> UVec3 {
        match *self {
            Self::Volume { size, .. } => UVec3::splat(size),
            Self::Map { size, .. } => UVec3::new(size, size, 1),
            Self::Gradient => UVec3::new(GRADIENT_SIZE, GRADIENT_SIZE, 1),
            Self::Pyramid { .. } => image.extend(1),
        }
    }

    pub(super) fn plan(&self, image: UVec2) -> Plan {
        let size = self.size(image);
        let is_volume = matches!(self, Self::Volume { .. });
        let levels = if matches!(self, Self::Gradient) { 1 } else { size.max_element().ilog2() + 1 };
        let mut params = BakeParams::default();
        let mut passes = Vec::new();
        match *self {
            Self::Volume { kernel, seed, size: side, cells } | Self::Map { kernel, seed, size: side, cells } => {
                params = BakeParams { seed, cells, octaves: octaves(kernel, side, cells), ..params };
                passes.push(Pass::new(kernel, 0, size, params.octaves));
            }
            Self::Gradient => {
                let shape = |p: [f32; 3]| Vec3::from_array(p).extend(0.0);
                params = BakeParams { stratus: shape(STRATUS_PROFILE), cumulus: shape(CUMULUS_PROFILE), ..params };
                passes.push(Pass::new(Kernel::Gradient, 0, size, 1));
            }
            Self::Pyramid { .. } => {}
        }
        if !is_volume && levels > 1 {
            passes.push(Pass::new(Kernel::FirstLevel, 0, size, 1));
        }
        let finer = if is_volume { Kernel::VolumeMip } else { Kernel::NextLevel };
        passes.extend((1..levels).map(|level| Pass::new(finer, level, level_size(size, level, is_volume), 1)));
        Plan { size, levels, is_volume, params, passes }
    }
}

fn level_size(size: UVec3, level: u32, is_volume: bool) -> UVec3 {
    let halved = (size >> level).max(UVec3::ONE);
    if is_volume { halved } else { halved.with_z(1) }
}

/// What it takes to make one texture.
pub(super) struct Plan {
    pub size: UVec3,
    pub levels: u32,
    pub is_volume: bool,
    pub params: BakeParams,
    pub passes: Vec<Pass>,
}

impl Plan {
    pub(super) fn cost(&self) -> u64 {
        self.passes.iter().map(|pass| u64::from(pass.bands) * pass.band_cost).sum()
    }

    /// Whether a map is baked before its pyramid is built, and so needs a place to be baked to.
    pub(super) fn needs_scratch(&self) -> bool {
        matches!(self.passes[0].kernel, Kernel::Coverage | Kernel::TypeMap)
    }

    pub(super) fn texture(&self, levels: u32) -> TextureDescriptor<'static> {
        TextureDescriptor {
            label: Some("cloud_texture"),
            size: Extent3d { width: self.size.x, height: self.size.y, depth_or_array_layers: self.size.z },
            mip_level_count: levels,
            sample_count: 1,
            dimension: if self.is_volume { TextureDimension::D3 } else { TextureDimension::D2 },
            format: if self.is_volume { VOLUME_FORMAT } else { MAP_FORMAT },
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC,
            view_formats: &[],
        }
    }
}

/// Rows of workgroups in a map are this many texels high.
pub(super) const GROUP: u32 = 8;

/// One kernel over one level, in bands that one dispatch may do any number of: slices of a volume, or rows of workgroups of
/// a map.
pub(super) struct Pass {
    pub kernel: Kernel,
    pub level: u32,
    pub size: UVec3,
    pub bands: u32,
    pub band_cost: u64,
}

impl Pass {
    fn new(kernel: Kernel, level: u32, size: UVec3, octaves: u32) -> Self {
        let is_volume = kernel.is_volume();
        let (bands, rows) = if is_volume { (size.z, size.y) } else { (size.y.div_ceil(GROUP), size.y.min(GROUP)) };
        let band_cost = u64::from(size.x) * u64::from(rows) * texel_cost(kernel, octaves);
        Self { kernel, level, size, bands, band_cost }
    }

    /// Workgroups of `bands` bands, and the first slice or row of band `from`.
    pub(super) fn dispatch(&self, from: u32, bands: u32) -> ([u32; 3], u32) {
        let across = self.size.x.div_ceil(GROUP);
        match self.kernel {
            kernel if kernel.is_volume() => ([across, self.size.y.div_ceil(GROUP), bands], from),
            _ => ([across, bands, 1], from * GROUP),
        }
    }
}
