//! [`CloudModel`] as the shader reads it.

use bevy::{
    prelude::*,
    render::render_resource::{ShaderType, TextureView},
};
use glam::{DMat2, DVec2, DVec4};

use super::{
    TangentFrame,
    layers::{LayerSizes, LayerUniform, MAX_ZONES, ZoneUniform, decks},
    places::places,
};
use crate::{
    settings::{CloudLayers, CloudModel, Erosion, MAX_LAYERS},
    textures::CloudTextureViews,
};

/// The group map is this many times larger than the coverage map: irrational, so the pair never repeats.
const GROUP_SCALE: f64 = 2.618_033_988_75;

/// Texels along one side of each texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TexelSizes {
    pub billow: u32,
    pub wisp: u32,
    pub coverage: u32,
    pub type_map: u32,
    /// Of what weather-map layers read, once it is there.
    pub layers: Option<LayerSizes>,
}

impl TexelSizes {
    /// Sizes of the bound textures; `None` while one is missing.
    pub fn of(views: &CloudTextureViews) -> Option<Self> {
        let width = |view: &Option<TextureView>| Some(view.as_ref()?.texture().width());
        Some(Self {
            billow: width(&views.billow)?,
            wisp: width(&views.wisp)?,
            coverage: width(&views.coverage)?,
            type_map: width(&views.type_map)?,
            layers: (|| {
                Some(LayerSizes {
                    shape: width(&views.shape)?,
                    detail: width(&views.detail)?,
                    weather: views.weather_size,
                    maps: views.weather_layers,
                })
            })(),
        })
    }
}

/// What the uniform is made from.
#[derive(Clone, Copy)]
pub(crate) struct ModelSettings<'a> {
    pub model: &'a CloudModel,
    pub layers: &'a CloudLayers,
    pub zones: &'a [ZoneUniform],
}

/// `Model` of `data.wesl`, field for field. The CPU twin (`reference/field.rs`) reads the same numbers.
#[derive(ShaderType, Clone, Copy, Debug, Default)]
pub(crate) struct ModelUniform {
    pub radius: f32,
    pub bottom: f32,
    pub top: f32,
    pub coverage: f32,
    pub cloud_type: f32,
    pub type_variation: f32,
    pub map_variation: f32,
    pub density: f32,
    pub extinction: f32,
    pub erosion: u32,
    pub noise_strength: f32,
    pub detail_strength: f32,
    pub wisp_height: f32,
    pub billow_rate: f32,
    pub detail_rate: f32,
    pub wisp_rate: f32,
    pub map_rate: f32,
    pub group_rate: f32,
    pub type_rate: f32,
    pub skew: f32,
    pub lean: Vec4,
    pub map_offset: Vec4,
    pub waves: Vec4,
    pub places: Vec4,
    pub type_offset: Vec4,
    pub billow_offset: Vec4,
    pub detail_offset: Vec4,
    pub wisp_offset: Vec4,
    pub texels: Vec4,
    pub map_texels: Vec4,
    pub albedo: Vec4,
    pub stretch: Vec4,
    pub shrink: Vec4,
    pub counts: UVec4,
    pub decks: [Vec4; 5],
    pub bounds: Vec4,
    pub layers: [LayerUniform; MAX_LAYERS],
    pub zones: [ZoneUniform; MAX_ZONES],
}

impl ModelUniform {
    /// The thesis's layer and the weather-map layers whose maps are there, at cloud time `seconds`, seen from a frame.
    pub fn new(settings: &ModelSettings, seconds: f64, frame: &TangentFrame, sizes: TexelSizes) -> Self {
        let own = Self::of_profile(settings.model, seconds, frame, sizes);
        let maps = sizes.layers.map_or([false; MAX_LAYERS], |sizes| sizes.maps);
        let shown = || settings.layers.shown().filter(|(i, _)| maps[*i]);
        let phases = settings.layers.phases();
        let mut layers = [LayerUniform::default(); MAX_LAYERS];
        if let Some(sizes) = &sizes.layers {
            for (slot, (i, layer)) in layers.iter_mut().zip(shown()) {
                *slot = LayerUniform::new(layer, i, seconds, frame, sizes, &phases);
            }
        }
        let ranges = decks(settings.model, shown().map(|(_, layer)| layer));
        let mut packed = [Vec4::ZERO; 5];
        for (i, range) in ranges.iter().enumerate() {
            let half = if i % 2 == 0 { [0, 1] } else { [2, 3] };
            packed[i / 2][half[0]] = range.x;
            packed[i / 2][half[1]] = range.y;
        }
        let bounds = match (ranges.first(), ranges.last()) {
            (Some(low), Some(high)) => Vec4::new(low.x, high.y, 0.0, 0.0),
            _ => Vec4::new(1.0, 0.0, 0.0, 0.0),
        };
        let mut zones = [ZoneUniform::default(); MAX_ZONES];
        for (slot, zone) in zones.iter_mut().zip(settings.zones) {
            *slot = *zone;
        }
        Self {
            counts: UVec4::new(
                settings.model.enabled.into(),
                shown().count() as u32,
                ranges.len() as u32,
                settings.zones.len().min(MAX_ZONES) as u32,
            ),
            decks: packed,
            bounds,
            layers,
            zones,
            ..own
        }
    }

    fn of_profile(model: &CloudModel, seconds: f64, frame: &TangentFrame, sizes: TexelSizes) -> Self {
        let wind = DVec2::new(model.wind.x.into(), model.wind.z.into());
        let rise = model.drift.y + f64::from(model.wind.y + model.evolution) * seconds;
        let gone = DVec2::new(model.drift.x, model.drift.z) + wind * seconds;
        let map = frame.map - gone;
        let turned = DVec2::new(0.8 * map.x - 0.6 * map.y, 0.6 * map.x + 0.8 * map.y);
        let group_scale = f64::from(model.map_scale) * GROUP_SCALE;
        let scale = f64::from(model.map_scale);
        let (waves, places, from) = places(map, gone, scale);
        let own = wrapped(map + from * scale, scale);
        let group = wrapped(turned, group_scale);
        let kind = wrapped(map, model.type_scale.into());
        let volume = |scale: f32| {
            let xz = wrapped(map, scale.into());
            let y = (-rise / f64::from(scale)).rem_euclid(1.0) as f32;
            Vec4::new(xz.x, y, xz.y, 0.0)
        };
        let texel = |scale: f64, size: u32| (scale / f64::from(size.max(1))).log2() as f32;
        let thickness = model.top - model.bottom;
        let lean = wind.normalize_or_zero().as_vec2() * model.wind_skew;
        Self {
            radius: frame.radius as f32,
            bottom: model.bottom,
            top: model.top,
            coverage: model.coverage,
            cloud_type: model.cloud_type,
            type_variation: model.type_variation,
            map_variation: model.map_variation,
            density: model.density,
            extinction: model.extinction,
            erosion: match model.erosion {
                Erosion::Subtract => 0,
                Erosion::Remap => 1,
            },
            noise_strength: model.noise_strength,
            detail_strength: model.detail_strength,
            wisp_height: model.wisp_height,
            billow_rate: 1.0 / model.billow_scale,
            detail_rate: 1.0 / model.detail_scale,
            wisp_rate: 1.0 / model.wisp_scale,
            map_rate: 1.0 / model.map_scale,
            group_rate: (1.0 / group_scale) as f32,
            type_rate: 1.0 / model.type_scale,
            skew: model.wind_skew / thickness,
            lean: lean.extend(0.0).extend(0.0),
            map_offset: Vec4::new(own.x, own.y, group.x, group.y),
            waves,
            places,
            type_offset: kind.extend(0.0).extend(0.0),
            billow_offset: volume(model.billow_scale),
            detail_offset: volume(model.detail_scale),
            wisp_offset: volume(model.wisp_scale),
            texels: Vec4::new(
                texel(model.billow_scale.into(), sizes.billow),
                texel(model.detail_scale.into(), sizes.billow),
                texel(model.wisp_scale.into(), sizes.wisp),
                texel(model.map_scale.into(), sizes.coverage),
            ),
            map_texels: Vec4::new(
                texel(group_scale, sizes.coverage),
                texel(model.type_scale.into(), sizes.type_map),
                0.0,
                0.0,
            ),
            albedo: model.albedo.extend(1.0),
            stretch: packed(frame.stretch, frame.longest()),
            shrink: packed(frame.shrink(), 1.0),
            ..default()
        }
    }
}

impl ModelUniform {
    /// The erosion that `erosion` stands for.
    pub fn erosion(&self) -> Erosion {
        if self.erosion == 0 { Erosion::Subtract } else { Erosion::Remap }
    }
}

/// A symmetric matrix, and the most that it lengthens.
fn packed(m: DMat2, longest: f64) -> Vec4 {
    DVec4::new(m.x_axis.x, m.x_axis.y, m.y_axis.y, longest).as_vec4()
}

/// Position in repeats of `scale`, wrapped to 0..1 in f64: exact after hours of wind, far from the origin.
pub(super) fn wrapped(metres: DVec2, scale: f64) -> Vec2 {
    let repeats = metres / scale;
    Vec2::new(repeats.x.rem_euclid(1.0) as f32, repeats.y.rem_euclid(1.0) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hours_of_wind_lose_nothing() {
        // A week at 30 m/s: the fraction must still be right to a texel's ten-thousandth.
        let metres = DVec2::new(30.0 * 7.0 * 86_400.0, -12.34);
        let at = wrapped(metres, 26_000.0);
        let exact = (18_144_000.0_f64 / 26_000.0).fract();
        assert!((f64::from(at.x) - exact).abs() < 1e-6);
        assert!((0.0..1.0).contains(&at.y));
    }
}
