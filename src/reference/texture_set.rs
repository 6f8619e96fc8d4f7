//! What the model reads, and CPU copies of that: [`CloudTextureSet`].

use std::sync::Arc;

use bevy::math::{DVec2, DVec3, DVec4};

use super::sampler::{Texture, sample_bytes};
use crate::{
    settings::MAX_LAYERS,
    weather::{Swirl, WeatherPyramid},
};

/// Shares of the four octaves of a noise volume, as in the shader.
pub(crate) const OCTAVES: [f32; 4] = [0.5, 0.25, 0.15, 0.1];

/// Shares of the green, blue and alpha of a layer's shape noise, as in `layer.wesl`.
pub const SHAPE_SHARES: [f32; 3] = [0.625, 0.25, 0.125];

/// Shares of the red, green and blue of a layer's detail noise, as in `layer.wesl`.
pub const DETAIL_SHARES: [f32; 3] = [0.5 / 0.875, 0.25 / 0.875, 0.125 / 0.875];

/// What the model reads. `at` is in repeats of the texture, `level` the mip level; results are 0..=1.
pub trait ModelTextures {
    /// Sides of billow volume, wisp volume, coverage map and type map (texels).
    fn sides(&self) -> [u32; 4];
    /// Billowy noise: the volume's four octaves summed with their shares.
    fn billow(&self, at: DVec3, level: f64) -> f64;
    /// Wispy noise, likewise.
    fn wisp(&self, at: DVec3, level: f64) -> f64;
    /// Coverage map.
    fn coverage(&self, at: DVec2, level: f64) -> f64;
    /// Bound of the coverage map.
    fn coverage_bound(&self, at: DVec2, level: f64) -> f64;
    /// Type map.
    fn type_map(&self, at: DVec2, level: f64) -> f64;
    /// Vertical profile of a type at a height, both 0..=1.
    fn gradient(&self, cloud_type: f64, height: f64) -> f64;
    /// Sides of what weather-map layers read; `None` while it is not there, and then no layer is.
    fn layer_sides(&self) -> Option<LayerSides>;
    /// Layers' shape noise: red, and the sum of the others with their [shares](SHAPE_SHARES).
    fn shape(&self, at: DVec3, level: f64) -> [f64; 2];
    /// Layers' detail noise: red, green and blue summed with their [shares](DETAIL_SHARES).
    fn detail(&self, at: DVec3, level: f64) -> f64;
    /// Weather map of the layer at this place in [`CloudLayers`](crate::CloudLayers): coverage, height, base, and a bound of the coverage.
    fn weather(&self, layer: usize, at: DVec2, level: f64) -> DVec4;
    /// Curl field in x and y, fibres, cells.
    fn swirl(&self, at: DVec2, level: f64) -> DVec4;
}

/// Sides of the textures that weather-map layers read (texels), and which layers have their map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LayerSides {
    /// Shape volume.
    pub shape: u32,
    /// Detail volume.
    pub detail: u32,
    /// Weather maps.
    pub weather: u32,
    /// By the layer's place in [`CloudLayers`](crate::CloudLayers).
    pub maps: [bool; MAX_LAYERS],
}

/// CPU copies of the textures that the built-in model reads, as the GPU has them. Cheap to clone.
#[derive(Clone, Debug)]
pub struct CloudTextureSet {
    /// Billowy noise: the four channels summed with their shares.
    pub billow: Arc<Texture>,
    /// Wispy noise, likewise.
    pub wisp: Arc<Texture>,
    /// Coverage map.
    pub coverage: Arc<Texture>,
    /// Bound of the coverage map.
    pub coverage_bound: Arc<Texture>,
    /// Type map.
    pub type_map: Arc<Texture>,
    /// Vertical profile: x the type, y the height.
    pub gradient: Arc<Texture>,
    /// What weather-map layers read, once one has been there.
    pub layers: Option<LayerTextureSet>,
}

/// CPU copies of what weather-map layers read. Their maps and the plane of noise are made on the CPU, and shared.
#[derive(Clone)]
pub struct LayerTextureSet {
    /// Shape noise: red.
    pub shape: Arc<Texture>,
    /// Shape noise: the others summed with their shares.
    pub shape_octaves: Arc<Texture>,
    /// Detail noise: red, green and blue summed with their shares.
    pub detail: Arc<Texture>,
    maps: [Option<Arc<WeatherPyramid>>; MAX_LAYERS],
    swirl: &'static [Vec<[u8; 4]>],
}

impl std::fmt::Debug for LayerTextureSet {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let maps = self.maps.iter().flatten().count();
        write!(f, "LayerTextureSet {{ shape: {:?}, detail: {:?}, maps: {maps} }}", self.shape, self.detail)
    }
}

impl LayerTextureSet {
    /// Without maps.
    pub(crate) fn new(shape: Arc<Texture>, shape_octaves: Arc<Texture>, detail: Arc<Texture>) -> Self {
        Self { shape, shape_octaves, detail, maps: Default::default(), swirl: Swirl::shared() }
    }

    fn all(&self) -> [&Arc<Texture>; 3] {
        [&self.shape, &self.shape_octaves, &self.detail]
    }

    fn is(&self, other: &Self) -> bool {
        let same_map = |pair: (&Option<Arc<WeatherPyramid>>, &Option<Arc<WeatherPyramid>>)| match pair {
            (Some(mine), Some(other)) => Arc::ptr_eq(mine, other),
            (mine, other) => mine.is_none() && other.is_none(),
        };
        self.all().iter().zip(other.all()).all(|(mine, other)| Arc::ptr_eq(mine, other))
            && self.maps.iter().zip(&other.maps).all(same_map)
    }
}

impl CloudTextureSet {
    /// Memory that they take (bytes), without layers' maps, which the renderer keeps in any case.
    pub fn bytes(&self) -> usize {
        let of_layers = self.layers.iter().flat_map(LayerTextureSet::all);
        self.all().into_iter().chain(of_layers).map(|texture| texture.bytes()).sum()
    }

    /// With the layers' maps.
    pub(crate) fn with_maps(mut self, maps: &[Option<Arc<WeatherPyramid>>; MAX_LAYERS]) -> Self {
        if let Some(layers) = &mut self.layers {
            layers.maps = maps.clone();
        }
        self
    }

    /// Whether both are clones of one.
    pub(crate) fn is(&self, other: &Self) -> bool {
        let same_layers = match (&self.layers, &other.layers) {
            (Some(mine), Some(other)) => mine.is(other),
            (mine, other) => mine.is_none() && other.is_none(),
        };
        same_layers && self.all().iter().zip(other.all()).all(|(mine, other)| Arc::ptr_eq(mine, other))
    }

    fn all(&self) -> [&Arc<Texture>; 6] {
        [&self.billow, &self.wisp, &self.coverage, &self.coverage_bound, &self.type_map, &self.gradient]
    }
}

impl ModelTextures for CloudTextureSet {
    fn sides(&self) -> [u32; 4] {
        [&self.billow, &self.wisp, &self.coverage, &self.type_map].map(|texture| texture.size().x)
    }
    fn billow(&self, at: DVec3, level: f64) -> f64 {
        self.billow.sample(at, level)
    }
    fn wisp(&self, at: DVec3, level: f64) -> f64 {
        self.wisp.sample(at, level)
    }
    fn coverage(&self, at: DVec2, level: f64) -> f64 {
        self.coverage.sample(at.extend(0.0), level)
    }
    fn coverage_bound(&self, at: DVec2, level: f64) -> f64 {
        self.coverage_bound.sample(at.extend(0.0), level)
    }
    fn type_map(&self, at: DVec2, level: f64) -> f64 {
        self.type_map.sample(at.extend(0.0), level)
    }
    fn gradient(&self, cloud_type: f64, height: f64) -> f64 {
        self.gradient.sample(DVec3::new(cloud_type, height, 0.0), 0.0)
    }
    fn layer_sides(&self) -> Option<LayerSides> {
        let layers = self.layers.as_ref()?;
        Some(LayerSides {
            shape: layers.shape.size().x,
            detail: layers.detail.size().x,
            weather: layers.maps.iter().flatten().map(|map| map.size).max().unwrap_or(1),
            maps: std::array::from_fn(|i| layers.maps[i].is_some()),
        })
    }
    fn shape(&self, at: DVec3, level: f64) -> [f64; 2] {
        let read = |layers: &LayerTextureSet| [&layers.shape, &layers.shape_octaves].map(|t| t.sample(at, level));
        self.layers.as_ref().map_or([0.0; 2], read)
    }
    fn detail(&self, at: DVec3, level: f64) -> f64 {
        self.layers.as_ref().map_or(0.0, |layers| layers.detail.sample(at, level))
    }
    fn weather(&self, layer: usize, at: DVec2, level: f64) -> DVec4 {
        let map = self.layers.as_ref().and_then(|layers| layers.maps.get(layer)?.as_ref());
        map.map_or(DVec4::ZERO, |map| sample_bytes(&map.levels, at, level))
    }
    fn swirl(&self, at: DVec2, level: f64) -> DVec4 {
        self.layers.as_ref().map_or(DVec4::ZERO, |layers| sample_bytes(layers.swirl, at, level))
    }
}
