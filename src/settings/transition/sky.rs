//! One sky turned into another, as a function of cloud time alone.

use bevy::math::{DVec2, DVec3, Vec3};

use super::{
    light::LightMix,
    mix::{Span, between32, ease, mix},
};
use crate::settings::{CloudLayer, CloudLayers, CloudLighting, CloudModel, CloudPreset, MAX_LAYERS};

/// What a transition changes.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Sky {
    pub model: CloudModel,
    pub layers: CloudLayers,
    pub lighting: CloudLighting,
    /// What of the lighting its own fields cannot say while it changes.
    pub light: LightMix,
}

impl From<&CloudPreset> for Sky {
    fn from(preset: &CloudPreset) -> Self {
        Self::new(&preset.model, &preset.layers, &preset.lighting)
    }
}

impl Sky {
    /// One that does not change.
    pub fn new(model: &CloudModel, layers: &CloudLayers, lighting: &CloudLighting) -> Self {
        Self {
            model: model.clone(),
            layers: layers.clone(),
            lighting: lighting.clone(),
            light: LightMix::from(lighting),
        }
    }

    /// Whether both are the same but for where the origin is.
    pub fn is(&self, model: &CloudModel, layers: &CloudLayers, lighting: &CloudLighting) -> bool {
        let moved = CloudModel { world_offset: model.world_offset, ..self.model.clone() };
        moved == *model && self.layers == *layers && self.lighting == *lighting
    }
}

/// A change from one sky to another.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Leg {
    pub start: Sky,
    pub target: Sky,
    pub span: Span,
}

/// How long the old layers go on while new ones come: shares of the transition where they may overlap.
const OVERLAP: f64 = 0.7;
/// From here on density itself fades, in case zones or the map's own coverage outweigh the least coverage.
const THIN: f64 = 0.7;

impl Leg {
    /// The sky at cloud time `t`.
    pub fn at(&self, t: f64) -> Sky {
        if t < self.span.begin || (self.span.seconds > 0.0 && t == self.span.begin) {
            return self.start.clone();
        }
        let u = self.span.progress(t);
        let (lighting, light) = self.lighting(ease(u));
        Sky { model: self.model(u, t), layers: self.layers(u, t), lighting, light }
    }

    fn model(&self, u: f64, t: f64) -> CloudModel {
        let (a, b) = (&self.start.model, &self.target.model);
        match (a.enabled, b.enabled) {
            (true, true) if matches_model(a, b) => self.moved_model(u, t),
            (true, true) if u < 0.5 => dissolved_model(a, ease(2.0 * u)),
            (true, true) => dissolved_model(b, 1.0 - ease(2.0 * u - 1.0)),
            (true, false) if u < 1.0 => dissolved_model(a, ease(u)),
            (false, true) => dissolved_model(b, 1.0 - ease(u)),
            _ => b.clone(),
        }
    }

    fn moved_model(&self, u: f64, t: f64) -> CloudModel {
        let (a, b) = (&self.start.model, &self.target.model);
        let mut now = a.clone();
        mix(&mut now, b, ease(u));
        let speeds = [a, b, &now].map(|m| speed(m.wind, m.evolution));
        now.drift = self.span.drift3(a.drift, speeds, t);
        now
    }

    fn layers(&self, u: f64, t: f64) -> CloudLayers {
        let old: Vec<&CloudLayer> = self.start.layers.shown().map(|(_, layer)| layer).collect();
        let new: Vec<&CloudLayer> = self.target.layers.0.iter().filter(|layer| layer.enabled || u >= 1.0).collect();
        let mut left: Vec<Option<&CloudLayer>> = old.iter().copied().map(Some).collect();
        let partners: Vec<Option<&CloudLayer>> = new
            .iter()
            .map(|b| {
                let slot = left.iter_mut().find(|a| b.enabled && a.is_some_and(|a| matches_layer(a, b)))?;
                slot.take()
            })
            .collect();
        let going: Vec<&CloudLayer> = left.into_iter().flatten().collect();
        let together = fit_together(new.iter().copied().chain(going.iter().copied()));
        // Each takes its share of the time, at either end of it.
        let share = if together { OVERLAP } else { 0.5 };
        let coming = (u - if together { 0.0 } else { 1.0 - share }) / share;
        let gone = (u - if together { 1.0 - share } else { 0.0 }) / share;
        let mut all = Vec::new();
        for (b, partner) in new.into_iter().zip(partners) {
            match partner {
                Some(a) => all.push(self.moved_layer(a, b, u, t)),
                None if u >= 1.0 => all.push(b.clone()),
                None if coming > 0.0 => all.push(dissolved_layer(b, 1.0 - ease(coming))),
                None => {}
            }
        }
        if gone < 1.0 {
            all.extend(going.into_iter().map(|a| dissolved_layer(a, ease(gone))));
        }
        CloudLayers(all)
    }

    fn moved_layer(&self, a: &CloudLayer, b: &CloudLayer, u: f64, t: f64) -> CloudLayer {
        // Both read one map. Of an image's recipe only what is equal counts; a size half way would be none.
        let mut now = CloudLayer { map: b.map.clone(), ..a.clone() };
        mix(&mut now, b, ease(u));
        let speeds = [a, b, &now].map(|l| speed(l.wind, l.evolution));
        now.drift = self.span.drift3(a.drift, speeds, t);
        let [from, to, renewal] = [a.renewal, b.renewal, now.renewal].map(f64::from);
        now.renewal_drift = self.span.drift(a.renewal_drift, from, to, renewal, t);
        now
    }

    fn lighting(&self, s: f64) -> (CloudLighting, LightMix) {
        let (a, b) = (&self.start, &self.target);
        let mut now = a.lighting.clone();
        mix(&mut now, &b.lighting, s);
        if a.light.becomes(&b.light) {
            let light = LightMix { octaves: a.light.octaves_to(&b.light, s), ..LightMix::from(&now) };
            return (now, light);
        }
        let of = if s < 0.5 { &a.lighting } else { &b.lighting };
        now.phase = of.phase;
        (now.g, now.g_back, now.lobe_mix) = (of.g, of.g_back, of.lobe_mix);
        (now.droplet_diameter, now.halo) = (of.droplet_diameter, of.halo);
        let light = a.light.crossed(&b.light, s, of);
        (now, light)
    }
}

/// Velocity of shapes (m/s); the sum as the renderer rounds it.
fn speed(wind: Vec3, evolution: f32) -> DVec3 {
    DVec3::new(wind.x.into(), (wind.y + evolution).into(), wind.z.into())
}

/// Whether so many layers, with as many phase functions, can be shown at once.
fn fit_together<'a>(layers: impl Iterator<Item = &'a CloudLayer>) -> bool {
    let all = CloudLayers(layers.cloned().collect());
    all.0.len() <= MAX_LAYERS && all.without_slot().is_none()
}

/// Direction of the wind over the map; none where it is calm.
fn downwind(wind: Vec3) -> Option<DVec2> {
    DVec2::new(wind.x.into(), wind.z.into()).try_normalize()
}

/// Whether the wind can turn from one to the other without passing through calm, where tops would lean over at once.
fn winds_match(a: Vec3, b: Vec3) -> bool {
    match (downwind(a), downwind(b)) {
        (Some(a), Some(b)) => a.dot(b) >= 0.0,
        (None, None) => true,
        _ => false,
    }
}

/// Whether one can become the other in place. Scales cannot change: all that is not near the map's origin would race.
fn matches_model(a: &CloudModel, b: &CloudModel) -> bool {
    let reads = |m: &CloudModel| [m.map_scale, m.type_scale, m.billow_scale, m.detail_scale, m.wisp_scale];
    a.erosion == b.erosion && reads(a) == reads(b) && winds_match(a.wind, b.wind)
}

/// Whether both have one name, map and noise, so that one can become the other in place.
fn matches_layer(a: &CloudLayer, b: &CloudLayer) -> bool {
    let image = |l: &CloudLayer| (l.map_image.clone(), l.map_file.clone(), l.map_channels);
    let same_map = if a.map_image.is_some() || !a.map_file.is_empty() {
        image(a) == image(b) && a.map.scale == b.map.scale && a.map.seed == b.map.seed
    } else {
        b.map_image.is_none() && b.map_file.is_empty() && a.map == b.map
    };
    let noise = |l: &CloudLayer| [l.shape_scale, l.detail_scale, l.turbulence_scale, l.stretch];
    let along = |l: &CloudLayer| {
        DVec2::from_angle(f64::from(l.stretch_angle).to_radians()).rotate(downwind(l.wind).unwrap_or(DVec2::X))
    };
    let same_along = a.stretch == 1.0 || along(a).distance(along(b)) < 1e-6;
    a.name == b.name
        && a.kind == b.kind
        && same_map
        && noise(a) == noise(b)
        && same_along
        && a.its_phase() == b.its_phase()
        && winds_match(a.wind, b.wind)
}

/// Factor on what is left of a layer that is gone by this share.
fn thinned(share: f64) -> f32 {
    1.0 - ease((share - THIN) / (1.0 - THIN)) as f32
}

fn dissolved_layer(layer: &CloudLayer, share: f64) -> CloudLayer {
    if share <= 0.0 {
        return layer.clone();
    }
    CloudLayer {
        coverage: between32(layer.coverage, -1.0, share),
        far_coverage: between32(layer.far_coverage, layer.far_coverage.min(0.0), share),
        rain: between32(layer.rain, 0.0, share),
        density: layer.density * thinned(share),
        ..layer.clone()
    }
}

fn dissolved_model(model: &CloudModel, share: f64) -> CloudModel {
    if share <= 0.0 {
        return model.clone();
    }
    CloudModel {
        coverage: between32(model.coverage, -1.0, share),
        density: model.density * thinned(share),
        ..model.clone()
    }
}
