//! The built-in model, "what is at p?". Twin of `model/model.wesl` and `model/profile.wesl`, function for function,
//! except that the shader ends early where what it has read leaves nothing. Weather-map layers are in `layer.rs`.
//!
//! Offsets and rates are those that the shader is given (`model/uniform.rs`); positions are f64. What is read from
//! textures comes through [`ModelTextures`]. A [`ModelShader`](crate::ModelShader) has no twin.

use bevy::math::{DVec2, DVec3, DVec4, Vec4Swizzles};

pub use super::texture_set::{DETAIL_SHARES, LayerSides, ModelTextures, SHAPE_SHARES};
use super::{
    layer::Layer,
    places::{bound_at, read_at, steepest, waves_at},
    planet::{Interval, Planet, altitude},
    profile,
    zones::Zones,
};
use crate::{
    model::{LayerSizes, ModelSettings, ModelUniform, TangentFrame, TexelSizes},
    settings::{CloudLayers, CloudModel},
};

/// What is at a point: `Medium` of `medium.wesl`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Medium {
    /// Density, the sum of all layers', each up to its factor ([`CloudModel::density`]); 0 means empty air.
    pub density: f64,
    /// Extinction coefficient σt·ρ (1/m).
    pub extinction: f64,
    /// Single-scattering albedo σs/σt, linear RGB.
    pub albedo: DVec3,
    /// Dimensional profile: 0 at the cloud's envelope and outside, 1 deep inside.
    pub profile: f64,
    /// Way straight down and up to the ends of the layer it lies in (m); the mean by extinction where layers overlap.
    pub span: DVec2,
    /// Shares of the four phase functions in what is scattered here: the light's own and up to three of layers. Their sum
    /// is 1.
    pub phase: DVec4,
}

impl Medium {
    /// Clear air.
    pub const EMPTY: Self =
        Self { density: 0.0, extinction: 0.0, albedo: DVec3::ONE, profile: 0.0, span: DVec2::ZERO, phase: DVec4::X };
}

/// The model at one time, in the tangent frame below one point: what a camera at that point is shown.
///
/// Points are in that frame (origin on the surface straight below, y up, m), as in the shader; [`local`](Self::local)
/// takes them there. `lod` is log2 of the width (m) that a reading is filtered over.
pub struct LocalModel<'a, T> {
    model: ModelUniform,
    frame: TangentFrame,
    eye: DVec3,
    textures: &'a T,
}

impl<'a, T: ModelTextures> LocalModel<'a, T> {
    /// The model at cloud time `seconds` as seen from `eye` (world space, m). `None` where up is undefined: at the
    /// planet's centre, or where a number is not finite.
    pub fn new(
        model: &CloudModel,
        layers: &CloudLayers,
        seconds: f64,
        eye: DVec3,
        planet: Planet,
        textures: &'a T,
    ) -> Option<Self> {
        let settings = ModelSettings { model, layers, zones: &[] };
        Self::of_settings(&settings, seconds, eye, planet, textures)
    }

    /// As [`new`](Self::new), with zones.
    pub(crate) fn of_settings(
        settings: &ModelSettings,
        seconds: f64,
        eye: DVec3,
        planet: Planet,
        textures: &'a T,
    ) -> Option<Self> {
        let frame = TangentFrame::below(eye + settings.model.world_offset, planet.centre, planet.radius)?;
        let [billow, wisp, coverage, type_map] = textures.sides();
        let layers = textures.layer_sides().map(|LayerSides { shape, detail, weather, maps }| LayerSizes {
            shape,
            detail,
            weather,
            maps,
        });
        let sizes = TexelSizes { billow, wisp, coverage, type_map, layers };
        Some(Self { model: ModelUniform::new(settings, seconds, &frame, sizes), frame, eye, textures })
    }

    /// A point of the world (m) in the frame.
    pub fn local(&self, p: DVec3) -> DVec3 {
        self.local_direction(p - self.eye) + DVec3::Y * self.frame.altitude
    }

    /// A direction of the world in the frame.
    pub fn local_direction(&self, direction: DVec3) -> DVec3 {
        self.frame.local_from_world * direction
    }

    /// Radius of the planet (m).
    pub fn radius(&self) -> f64 {
        self.frame.radius
    }

    /// Altitude of the point that the frame is below (m).
    pub fn eye_altitude(&self) -> f64 {
        self.frame.altitude
    }

    /// Lowest and highest altitude that may hold cloud (m); the first is the larger where there is none at all.
    pub fn bounds(&self) -> [f64; 2] {
        [self.model.bounds.x.into(), self.model.bounds.y.into()]
    }

    /// Altitudes that may hold cloud (m): ranges with empty air between them, lowest first.
    pub fn decks(&self) -> impl Iterator<Item = Interval> + '_ {
        let halves = self.model.decks.iter().flat_map(|pair| [pair.xy(), pair.zw()]);
        halves.take(self.model.counts.z as usize).map(|deck| deck.to_array().map(f64::from))
    }

    /// The finest detail there is to see (m): a texel of the finest noise, and no more than 1/64 of any layer.
    pub fn finest(&self) -> f64 {
        let texels = self.model.texels;
        let detail = if self.model.detail_strength > 0.0 { texels.y } else { texels.x };
        let own = f64::from(texels.x.min(detail).min(texels.z).exp2()).min(self.thickness() / 64.0);
        let own = if self.has_profile() { own } else { f64::INFINITY };
        self.layers().map(|layer| layer.finest()).fold(own, f64::min)
    }

    /// Upper bound of the density within `reach` metres of `p`.
    pub fn density_bound(&self, p: DVec3, reach: f64) -> f64 {
        let h = altitude(p, self.frame.radius);
        let own = if self.has_profile() { self.profile_bound(p, h, reach) } else { 0.0 };
        own + self.layers().map(|layer| layer.density_bound(p, h, reach)).sum::<f64>()
    }

    /// As [`density_bound`](Self::density_bound), of the extinction (1/m).
    pub fn extinction_bound(&self, p: DVec3, reach: f64) -> f64 {
        let h = altitude(p, self.frame.radius);
        let own = if self.has_profile() { self.profile_bound(p, h, reach) } else { 0.0 };
        own * f64::from(self.model.extinction)
            + self.layers().map(|layer| layer.extinction_bound(p, h, reach)).sum::<f64>()
    }

    /// The medium at `p`, filtered over 2^`lod` metres.
    pub fn sample_medium(&self, p: DVec3, lod: f64) -> Medium {
        let h = altitude(p, self.frame.radius);
        let mut sum = Medium::EMPTY;
        let own = [self.model.bottom, self.model.top].map(f64::from);
        if self.has_profile() && h > own[0] && h < own[1] {
            let one = self.sample_profile(p, h, lod);
            if one.extinction > 0.0 {
                sum = Medium { span: DVec2::new(h - own[0], own[1] - h), ..one };
            }
        }
        for layer in self.layers() {
            let [bottom, top] = [layer.layer.bottom, layer.layer.top].map(f64::from);
            if h <= bottom || h >= top {
                continue;
            }
            let one = layer.sample(p, h, lod);
            if one.extinction <= 0.0 {
                continue;
            }
            // Extinctions add up; what is scattered is each one's share of it.
            let both = sum.extinction + one.extinction;
            let share = one.extinction / both;
            sum.albedo = sum.albedo.lerp(one.albedo, share);
            sum.phase = sum.phase.lerp(one.phase, share);
            sum.span = sum.span.lerp(DVec2::new(h - bottom, top - h), share);
            sum.density += one.density;
            sum.profile = sum.profile.max(one.profile);
            sum.extinction = both;
        }
        sum
    }

    fn has_profile(&self) -> bool {
        self.model.counts.x != 0
    }

    fn layers(&self) -> impl Iterator<Item = Layer<'_, T>> {
        let layers = &self.model.layers[..self.model.counts.y as usize];
        layers.iter().map(|layer| Layer { layer, zones: self.zones(), frame: &self.frame, textures: self.textures })
    }

    fn zones(&self) -> Zones<'_> {
        Zones { all: &self.model.zones[..self.model.counts.w as usize], shrink: self.frame.shrink() }
    }

    /// As [`density_bound`](Self::density_bound), of the thesis's layer; `h` is the altitude of `p`.
    fn profile_bound(&self, p: DVec3, h: f64, reach: f64) -> f64 {
        let model = &self.model;
        let height = self.layer_height(h);
        let away = reach / self.thickness();
        if height + away < 0.0 || height - away > 1.0 {
            return 0.0;
        }
        let m = self.leaning_position(p, height);
        // The lean moves the map by up to skew metres per metre of height; a level's maximum covers half a texel.
        let wide = (reach * (self.frame.longest() + f64::from(model.skew))).log2() + 1.0;
        let level = |texel: f32| (wide - f64::from(texel)).ceil().max(0.0);
        let change =
            steepest(model.places.truncate().to_array().map(f64::from)) * f64::from(model.map_rate) * wide.exp2();
        let read = |place: DVec2| self.textures.coverage_bound(self.own_map(m) + place, level(model.texels.w));
        let whole = || self.textures.coverage_bound(self.own_map(m), MEAN_LEVEL);
        let mut own = bound_at(self.place_number(m), change, read, whole);
        let mut group = self.textures.coverage_bound(self.group_map(m), level(model.map_texels.x));
        if m.length() + wide.exp2() > FADE[0] {
            own = own.max(self.textures.coverage(self.own_map(DVec2::ZERO), MEAN_LEVEL));
            group = group.max(self.textures.coverage(self.group_map(m), MEAN_LEVEL));
        }
        let zones = self.zones().bound(m, wide.exp2());
        self.combine_coverage(own, group, zones) * f64::from(model.density)
    }

    fn sample_profile(&self, p: DVec3, h: f64, lod: f64) -> Medium {
        let model = &self.model;
        let height = self.layer_height(h);
        let m = self.leaning_position(p, height);
        let profile = self.dimensional_profile(m, height, lod);
        if profile <= 0.0 {
            return Medium::EMPTY;
        }
        let density = self.erode(profile, self.cloud_noise(m, h, height, lod)) * f64::from(model.density);
        if density <= 0.0 {
            return Medium::EMPTY;
        }
        Medium {
            density,
            extinction: density * f64::from(model.extinction),
            albedo: model.albedo.xyz().as_dvec3(),
            profile,
            ..Medium::EMPTY
        }
    }

    fn thickness(&self) -> f64 {
        f64::from(self.model.top) - f64::from(self.model.bottom)
    }

    fn layer_height(&self, h: f64) -> f64 {
        (h - f64::from(self.model.bottom)) / self.thickness()
    }

    /// Map position with the lean of tops taken out (m).
    fn leaning_position(&self, p: DVec3, height: f64) -> DVec2 {
        self.frame.map_at(p) - self.model.lean.xy().as_dvec2() * height
    }

    fn own_map(&self, m: DVec2) -> DVec2 {
        m * f64::from(self.model.map_rate) + self.model.map_offset.xy().as_dvec2()
    }

    /// Number of the place that the coverage map is read at.
    fn place_number(&self, m: DVec2) -> f64 {
        let waves = waves_at(m * f64::from(self.model.map_rate));
        let [phases, amplitudes] = [self.model.waves, self.model.places].map(|v| v.to_array().map(f64::from));
        amplitudes[3] + (0..3).map(|k| amplitudes[k] * (waves[k] + phases[k]).cos()).sum::<f64>()
    }

    fn group_map(&self, m: DVec2) -> DVec2 {
        let turned = DVec2::new(0.8 * m.x - 0.6 * m.y, 0.6 * m.x + 0.8 * m.y);
        turned * f64::from(self.model.group_rate) + self.model.map_offset.zw().as_dvec2()
    }

    /// Coverage from the two readings of the map.
    fn combine_coverage(&self, own: f64, group: f64, zones: f64) -> f64 {
        let gathered = own * mix(1.0, smoothstep(0.0, 0.5, group), self.model.map_variation.into());
        (gathered + f64::from(self.model.coverage) + zones).clamp(0.0, 1.0)
    }

    fn coverage_at(&self, m: DVec2, lod: f64) -> f64 {
        let fade = smoothstep(FADE[0], FADE[1], m.length());
        let level_of = |rate: f32, texel: f32| {
            let coarsest = (-f64::from(rate).log2() - 7.0 - f64::from(texel)).max(0.0);
            level(lod, texel).min(coarsest)
        };
        let faded = |near: f64| {
            if fade > 0.0 {
                mix(near, self.textures.coverage(self.own_map(DVec2::ZERO), MEAN_LEVEL), fade)
            } else {
                near
            }
        };
        let model = &self.model;
        let own_level = level_of(model.map_rate, model.texels.w);
        let read = |place: DVec2| self.textures.coverage(self.own_map(m) + place, own_level);
        let own = faded(read_at(self.place_number(m), read, mix));
        let group_level = level_of(model.group_rate, model.map_texels.x);
        let group = faded(self.textures.coverage(self.group_map(m), group_level));
        self.combine_coverage(own, group, self.zones().at(m))
    }

    /// 0 stratus to 1 cumulus.
    fn type_at(&self, m: DVec2, lod: f64) -> f64 {
        let model = &self.model;
        let at = m * f64::from(model.type_rate) + model.type_offset.xy().as_dvec2();
        let bulge = self.textures.type_map(at, level(lod, model.map_texels.y));
        f64::from(model.cloud_type) * mix(1.0, bulge, model.type_variation.into())
    }

    /// `d = coverage · vertical profile` (Ford 3.1).
    fn dimensional_profile(&self, m: DVec2, height: f64, lod: f64) -> f64 {
        if height <= 0.0 || height >= 1.0 {
            return 0.0;
        }
        let coverage = self.coverage_at(m, lod);
        if coverage <= 0.0 {
            return 0.0;
        }
        profile::dimensional_profile(coverage, self.textures.gradient(self.type_at(m, lod), height))
    }

    /// Wispy noise near the base gives way to billowy noise above; fine billows fade out with lod (Ford 4.2.2).
    fn cloud_noise(&self, m: DVec2, h: f64, height: f64, lod: f64) -> f64 {
        let model = &self.model;
        let q = DVec3::new(m.x, h, m.y);
        let at = |rate: f32, offset: DVec4| q * f64::from(rate) + offset.truncate();
        let wispiness = 1.0 - smoothstep(0.0, model.wisp_height.into(), height);
        let mut noise = 0.0;
        if wispiness < 1.0 {
            let billow = at(model.billow_rate, model.billow_offset.as_dvec4());
            noise = self.textures.billow(billow, level(lod, model.texels.x));
            let detail_lod = lod - f64::from(model.texels.y);
            let share = f64::from(model.detail_strength) * (5.0 - detail_lod).clamp(0.0, 1.0);
            if share > 0.0 {
                let detail = at(model.detail_rate, model.detail_offset.as_dvec4());
                noise = mix(noise, self.textures.billow(detail, detail_lod.max(0.0)), share);
            }
        }
        if wispiness > 0.0 {
            let wisp = at(model.wisp_rate, model.wisp_offset.as_dvec4());
            noise = mix(noise, self.textures.wisp(wisp, level(lod, model.texels.z)), wispiness);
        }
        noise
    }

    fn erode(&self, profile: f64, noise: f64) -> f64 {
        let n = 1.0 - f64::from(self.model.noise_strength) * (1.0 - noise);
        profile::erode(profile, n, self.model.erosion())
    }
}

/// Past every map's last mip level, which holds its mean; and where coverage fades to that (m).
pub(super) const MEAN_LEVEL: f64 = 16.0;
pub(super) const FADE: [f64; 2] = [1e6, 4e6];

/// Mip level for a filter width, given log2 of a texel's size.
pub(super) fn level(lod: f64, texel: f32) -> f64 {
    (lod - f64::from(texel)).max(0.0)
}

pub(super) fn mix(a: f64, b: f64, share: f64) -> f64 {
    a * (1.0 - share) + b * share
}

pub(super) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_agree_on_the_map() {
        // A point seen from elsewhere against the point seen from itself, both as far away as this from each other and
        // from the map's origin.
        for (far, allowed) in [(5e3, 2e-3), (5e4, 2.0), (3e5, 250.0)] {
            let planet = Planet::default();
            let mut worst = 0.0_f64;
            for k in 0..24 {
                let angle = f64::from(k) * 0.2618;
                let from = DVec3::new(far, 2000.0, 0.0);
                let p = from + far * DVec3::new(angle.cos(), 0.0, angle.sin());
                let frame = |eye| TangentFrame::below(eye, planet.centre, planet.radius).unwrap();
                let seen = frame(from);
                let local = seen.local_from_world * (p - from) + DVec3::Y * seen.altitude;
                worst = worst.max((seen.map + seen.map_at(local) - frame(p).map).length());
            }
            println!("{far} m: {worst} m aside");
            assert!(worst < allowed, "{far} m: {worst} m aside");
        }
    }
}
