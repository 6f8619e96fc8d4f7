//! What the baked textures are made from, and the slots that take a user's images instead.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Parameters of the textures baked on the GPU. Changing one bakes the textures it concerns again, spread
/// over frames; until they are done the old ones stay.
#[derive(Resource, Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Resource, Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct CloudTextures {
    /// Seed of every noise. Default 1.
    #[reflect(@0..=4_294_967_295_u32)]
    pub seed: u32,
    /// Side of the noise volumes in texels: 32, 64, 128 or 256. Memory is about 9.6 MB a volume at 128, which is
    /// the default.
    #[reflect(@32..=256_u32)]
    pub volume_size: u32,
    /// Side of the coverage and type maps in texels: a power of two. Default 1024 (thesis 4.2.1).
    #[reflect(@64..=4096_u32)]
    pub map_size: u32,
    /// Cells along one side of the billowy volume's first octave. Default 4.
    #[reflect(@1..=32_u32)]
    pub billow_cells: u32,
    /// Lattice cells along one side of the wispy volume's first octave. Default 4.
    #[reflect(@1..=32_u32)]
    pub wisp_cells: u32,
    /// Cells along one side of the coverage map's first octave. Default 7.
    #[reflect(@1..=64_u32)]
    pub coverage_cells: u32,
    /// Cells along one side of the type map's first octave. Default 6.
    #[reflect(@1..=64_u32)]
    pub type_cells: u32,
    /// Cells along one side of the first octave of the shape volume that weather-map layers read. Default 4. The volume is
    /// baked once there is such a layer.
    #[reflect(@1..=32_u32)]
    pub shape_cells: u32,
    /// Cells along one side of the first octave of those layers' detail volume, whose side is a quarter of `volume_size`
    /// (32 at least). Default 4.
    #[reflect(@1..=32_u32)]
    pub detail_cells: u32,
}

impl Default for CloudTextures {
    fn default() -> Self {
        Self {
            seed: 1,
            volume_size: 128,
            map_size: 1024,
            billow_cells: 4,
            wisp_cells: 4,
            coverage_cells: 7,
            type_cells: 6,
            shape_cells: 4,
            detail_cells: 4,
        }
    }
}

/// A user's own images in place of baked textures. `None` (the default) takes the baked one.
///
/// A slot may be set, changed or cleared at any time. An image of the wrong dimension or format, or a file
/// that does not load, is reported by name and the last good texture stays.
#[derive(Resource, Reflect, Clone, PartialEq, Debug, Default)]
#[reflect(Resource, Default, PartialEq)]
pub struct CloudTextureSlots {
    /// Billowy noise: a tiling 3D image, RGBA, four octaves of rising frequency (R lowest).
    pub billow: Option<Handle<Image>>,
    /// Wispy noise: a tiling 3D image, RGBA, as above.
    pub wisp: Option<Handle<Image>>,
    /// Coverage map: a tiling 2D image, R, linear.
    pub coverage: Option<Handle<Image>>,
    /// Type map: a tiling 2D image, R, linear.
    pub type_map: Option<Handle<Image>>,
    /// Vertical profile: a 2D image, R; x is the type (stratus to cumulus), y the height (top row is height 0).
    pub gradient: Option<Handle<Image>>,
    /// Blue noise: a tiling 2D image, RGB, three independent channels.
    pub blue_noise: Option<Handle<Image>>,
    /// Shape of weather-map layers: a tiling 3D image; R Perlin-Worley, GBA Worley octaves of rising frequency.
    pub shape: Option<Handle<Image>>,
    /// Detail of weather-map layers: a tiling 3D image; RGB Worley octaves of rising frequency.
    pub detail: Option<Handle<Image>>,
}
