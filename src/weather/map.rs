//! A weather map as texels.

use bevy::{
    asset::RenderAssetUsages,
    image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor},
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};

/// Where cloud is, how tall, and how high its base: four bytes a texel, repeated without end.
///
/// | channel | meaning, 0 to 255 |
/// |---|---|
/// | red | coverage: 0 is clear sky, then a ramp from a cloud's edge to its dense middle |
/// | green | height of the cloud, as a share of its layer's greatest |
/// | blue | rise of its base, as a share of its layer's greatest |
/// | alpha | free; 255 |
///
/// Green and blue are given where the sky is clear, too, so that filtering at an edge finds sensible values.
#[derive(Clone, PartialEq, Eq)]
pub struct WeatherMap {
    size: UVec2,
    texels: Vec<[u8; 4]>,
}

impl std::fmt::Debug for WeatherMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "WeatherMap({} × {}, cover {:.3})", self.size.x, self.size.y, self.cover())
    }
}

impl WeatherMap {
    /// `texels` are `size.x · size.y` many, row by row.
    pub(super) fn from_texels(size: UVec2, texels: Vec<[u8; 4]>) -> Self {
        debug_assert_eq!(texels.len(), size.x as usize * size.y as usize);
        Self { size, texels }
    }

    /// A clear sky: no coverage, full height, base at the bottom. Sides are kept within 1 to 8192.
    pub fn clear(size: UVec2) -> Self {
        let size = size.clamp(UVec2::ONE, UVec2::splat(super::convert::MAX_SIDE));
        Self { size, texels: vec![[0, 255, 0, 255]; (size.x * size.y) as usize] }
    }

    /// Texels a side.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// All texels, row by row: coverage, height, base, free.
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }

    /// All texels, to paint on.
    pub fn texels_mut(&mut self) -> &mut [[u8; 4]] {
        &mut self.texels
    }

    /// Share of the map that has cloud: of texels whose coverage is above 0.
    pub fn cover(&self) -> f32 {
        self.cover_above(0.0)
    }

    /// Share of texels whose coverage (0..1) is above `threshold`. A layer that adds `c` to the coverage shows about
    /// `cover_above(-c)`.
    pub fn cover_above(&self, threshold: f32) -> f32 {
        let above = self.texels.iter().filter(|texel| f32::from(texel[0]) > threshold * 255.0).count();
        above as f32 / self.texels.len().max(1) as f32
    }

    /// Coverage, height and base (0..1) at a place in repeats of the map, filtered as a GPU does.
    pub fn sample(&self, place: Vec2) -> Vec3 {
        let size = self.size.as_vec2();
        // Wrapped first, so that far places keep their precision.
        let at = (place - place.floor()) * size - 0.5;
        let low = at.floor();
        let t = at - low;
        let texel = |dx: i32, dy: i32| {
            let place = (low.as_ivec2() + IVec2::new(dx, dy)).rem_euclid(self.size.as_ivec2());
            let [r, g, b, _] = self.texels[(place.y * self.size.x as i32 + place.x) as usize];
            Vec3::new(r.into(), g.into(), b.into()) / 255.0
        };
        texel(0, 0).lerp(texel(1, 0), t.x).lerp(texel(0, 1).lerp(texel(1, 1), t.x), t.y)
    }

    /// The map at another size, each side within 1 to 8192. Layers that share a texture array need equal sizes.
    pub fn resized(&self, size: UVec2) -> Self {
        let mut map = Self::clear(size);
        let size = map.size.as_vec2();
        // As many samples in a texel as it covers texels of ours.
        let samples = (self.size.as_vec2() / size).ceil().as_uvec2().max(UVec2::ONE);
        let width = map.size.x as usize;
        for (n, texel) in map.texels.iter_mut().enumerate() {
            let corner = Vec2::new((n % width) as f32, (n / width) as f32);
            let mut sum = Vec3::ZERO;
            for i in 0..samples.x * samples.y {
                let inside = (UVec2::new(i % samples.x, i / samples.x).as_vec2() + 0.5) / samples.as_vec2();
                sum += self.sample((corner + inside) / size);
            }
            let mean = sum / (samples.x * samples.y) as f32 * 255.0 + 0.5;
            *texel = [mean.x as u8, mean.y as u8, mean.z as u8, 255];
        }
        map
    }

    /// The map as a texture asset: `Rgba8Unorm`, linear, repeating and filtered; kept on the CPU as well.
    pub fn to_image(&self) -> Image {
        let mut image = Image::new(
            Extent3d { width: self.size.x, height: self.size.y, depth_or_array_layers: 1 },
            TextureDimension::D2,
            self.texels.as_flattened().to_vec(),
            TextureFormat::Rgba8Unorm,
            RenderAssetUsages::default(),
        );
        image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
            label: Some("weather_map".to_owned()),
            address_mode_u: ImageAddressMode::Repeat,
            address_mode_v: ImageAddressMode::Repeat,
            mag_filter: ImageFilterMode::Linear,
            min_filter: ImageFilterMode::Linear,
            ..default()
        });
        image
    }
}
