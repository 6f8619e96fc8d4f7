//! [`CloudLayers`] and zones as the shader reads them.

use std::f64::consts::TAU;

use bevy::{prelude::*, render::render_resource::ShaderType};
use glam::DVec2;

use super::{TangentFrame, places::WAVES, uniform::wrapped};
use crate::{
    settings::{CloudLayer, CloudModel, LayerKind, MAX_LAYERS, OwnPhase},
    weather::SWIRL_SIZE,
};

/// Most places of [`CloudZone`](crate::CloudZone) that are followed.
pub(crate) const MAX_ZONES: usize = 8;

/// Direction in which clouds are renewed: along none of the waves, nor across.
const RENEWS: DVec2 = DVec2::new(0.8, 0.6);

/// Fine fibres of a sheet repeat this much sooner than the coarse, as in `layer.wesl`.
pub(crate) const FINER: f32 = 3.137;

/// Texels along one side of the textures that layers read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LayerSizes {
    pub shape: u32,
    pub detail: u32,
    pub weather: u32,
    /// Which layers have their map.
    pub maps: [bool; MAX_LAYERS],
}

/// `Layer` of `data.wesl`, field for field.
#[derive(ShaderType, Clone, Copy, Debug, Default)]
pub(crate) struct LayerUniform {
    pub kind: u32,
    pub map: u32,
    pub phase: u32,
    pub coverage: f32,
    pub sharpness: f32,
    pub base: f32,
    pub base_rise: f32,
    pub thickness: f32,
    pub bottom: f32,
    pub top: f32,
    pub peak_height: f32,
    pub anvil: f32,
    pub profile_strength: f32,
    pub shape_gain: f32,
    pub shape_strength: f32,
    pub detail_strength: f32,
    pub edge_threshold: f32,
    pub wispiness: f32,
    pub base_to_top: f32,
    pub density: f32,
    pub extinction: f32,
    pub map_rate: f32,
    pub shape_rate: f32,
    pub detail_rate: f32,
    pub swirl_rate: f32,
    pub turbulence: f32,
    pub turbulence_height: f32,
    pub stretch: f32,
    pub far_coverage: f32,
    pub skew: f32,
    pub rain: f32,
    pub rain_extinction: f32,
    pub far: Vec2,
    pub lean: Vec2,
    pub rain_lean: Vec2,
    pub along: Vec2,
    pub map_offset: Vec4,
    pub shape_offset: Vec4,
    pub detail_offset: Vec4,
    pub swirl_offset: Vec4,
    pub waves: Vec4,
    pub texels: Vec4,
    pub albedo: Vec4,
}

/// `Zone` of `data.wesl`.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ZoneUniform {
    pub place: Vec4,
    pub strength: Vec4,
}

impl LayerUniform {
    /// The layer at cloud time `seconds`, seen from a frame; `map` is its place in the texture array.
    pub fn new(
        layer: &CloudLayer,
        map: usize,
        seconds: f64,
        frame: &TangentFrame,
        sizes: &LayerSizes,
        phases: &[OwnPhase],
    ) -> Self {
        let wind = DVec2::new(layer.wind.x.into(), layer.wind.z.into());
        let drift = DVec2::new(layer.drift.x, layer.drift.z);
        let at = frame.map - drift - wind * seconds;
        let rise = layer.drift.y + f64::from(layer.wind.y + layer.evolution) * seconds;
        let downwind = wind.try_normalize().unwrap_or(DVec2::X);
        let along = DVec2::from_angle(f64::from(layer.stretch_angle).to_radians()).rotate(downwind);
        let scale = f64::from(layer.map.scale);
        // Another place for each seed, so that layers with the same noise do not look alike.
        let place = |k: u32| f64::from(layer.map.seed.wrapping_mul(2_654_435_761).rotate_left(k)) / 4_294_967_296.0;
        let own = wrapped(at, scale);
        // Stretched and then repeated: the offset is stretched as the position is.
        let stretched = |p: DVec2| p - along * (p.dot(along) * (1.0 - 1.0 / f64::from(layer.stretch)));
        let volume = |scale: f32, k: u32| {
            let xz = wrapped(stretched(at) + DVec2::new(place(k), place(k + 7)) * f64::from(scale), scale.into());
            let y = (place(k + 13) - rise / f64::from(scale)).rem_euclid(1.0) as f32;
            Vec4::new(xz.x, y, xz.y, 0.0)
        };
        let plane = |scale: f32, at: DVec2| wrapped(at + DVec2::splat(place(3)) * f64::from(scale), scale.into());
        let is_sheet = layer.kind == LayerKind::Sheet;
        let swirl = plane(layer.turbulence_scale, at);
        let fibres = plane(layer.shape_scale, stretched(at) + DVec2::splat(rise));
        let finer = plane(layer.shape_scale / FINER, stretched(at) + DVec2::splat(rise));
        // The same way whatever the wind: one that turns must not sweep what has passed over the map since time zero.
        let renewed = at - RENEWS * (layer.renewal_drift + f64::from(layer.renewal) * seconds);
        let wave = |k: usize| (renewed.dot(WAVES[k]) / scale + place(k as u32) * TAU).rem_euclid(TAU) as f32;
        let own_phase = layer.its_phase().and_then(|own| phases.iter().position(|phase| *phase == own));
        let phase = own_phase.map_or(0, |slot| slot as u32 + 1);
        let texel = |scale: f32, size: u32| (scale / size.max(1) as f32).log2();
        Self {
            kind: u32::from(is_sheet),
            map: map as u32,
            phase,
            coverage: layer.coverage,
            sharpness: layer.sharpness,
            base: layer.base,
            base_rise: layer.base_rise,
            thickness: layer.thickness,
            bottom: layer.bottom(),
            top: layer.top(),
            peak_height: layer.peak_height,
            anvil: layer.anvil,
            profile_strength: layer.profile_strength,
            shape_gain: if is_sheet { 1.0 } else { layer.shape_gain },
            shape_strength: layer.shape_strength,
            detail_strength: layer.detail_strength,
            edge_threshold: layer.edge_threshold,
            wispiness: layer.wispiness,
            base_to_top: layer.base_to_top,
            density: layer.density,
            extinction: layer.extinction,
            map_rate: 1.0 / layer.map.scale,
            shape_rate: 1.0 / layer.shape_scale,
            detail_rate: 1.0 / layer.detail_scale,
            swirl_rate: 1.0 / layer.turbulence_scale,
            turbulence: layer.turbulence,
            turbulence_height: layer.turbulence_height,
            stretch: layer.stretch,
            far_coverage: layer.far_coverage,
            skew: layer.wind_skew.abs() / layer.thickness,
            rain: layer.rain,
            rain_extinction: layer.rain_extinction,
            far: Vec2::new(layer.far_start, layer.far_end),
            lean: downwind.as_vec2() * layer.wind_skew,
            rain_lean: if layer.rain > 0.0 { downwind.as_vec2() * layer.rain_slant } else { Vec2::ZERO },
            along: along.as_vec2(),
            map_offset: Vec4::new(own.x, own.y, 0.0, 0.0),
            shape_offset: if is_sheet { Vec4::new(fibres.x, fibres.y, 0.0, 0.0) } else { volume(layer.shape_scale, 5) },
            detail_offset: if is_sheet { Vec4::new(finer.x, finer.y, 0.0, 0.0) } else { volume(layer.detail_scale, 9) },
            swirl_offset: Vec4::new(swirl.x, swirl.y, 0.0, 0.0),
            waves: Vec4::new(wave(0), wave(1), wave(2), 0.0),
            texels: Vec4::new(
                texel(layer.map.scale, sizes.weather),
                texel(layer.shape_scale, if is_sheet { SWIRL_SIZE } else { sizes.shape }),
                texel(layer.detail_scale, sizes.detail),
                texel(layer.turbulence_scale, SWIRL_SIZE),
            ),
            albedo: layer.albedo.extend(1.0),
        }
    }
}

/// Altitudes that hold cloud, as ranges with empty air between them, lowest first: what `model_deck` gives.
pub(crate) fn decks<'a>(model: &CloudModel, layers: impl Iterator<Item = &'a CloudLayer>) -> Vec<Vec2> {
    let own = model.enabled.then(|| Vec2::new(model.bottom, model.top));
    let mut all: Vec<Vec2> = layers.map(|layer| Vec2::new(layer.bottom(), layer.top())).chain(own).collect();
    all.sort_by(|a, b| a.x.total_cmp(&b.x));
    let mut decks: Vec<Vec2> = Vec::new();
    for range in all {
        match decks.last_mut() {
            // A metre of air between two is none to stop for.
            Some(last) if range.x <= last.y + 1.0 => last.y = last.y.max(range.y),
            _ => decks.push(range),
        }
    }
    decks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decks_merge_what_overlaps_and_keep_gaps() {
        let layer = |base: f32, thickness: f32| CloudLayer { base, base_rise: 0.0, thickness, ..default() };
        let model = CloudModel { bottom: 1000.0, top: 2000.0, ..default() };
        let layers = [layer(7000.0, 500.0), layer(1500.0, 1500.0), layer(7200.0, 1000.0), layer(4000.0, 10.0)];
        let got = decks(&model, layers.iter());
        assert_eq!(got, [Vec2::new(1000.0, 3000.0), Vec2::new(4000.0, 4010.0), Vec2::new(7000.0, 8200.0)]);
        let off = CloudModel { enabled: false, ..model };
        assert_eq!(decks(&off, layers[..1].iter()), [Vec2::new(7000.0, 7500.0)]);
        assert!(decks(&off, [].iter()).is_empty());
    }
}
