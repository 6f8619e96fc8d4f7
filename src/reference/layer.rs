//! A weather-map layer. Twin of `model/layer.wesl`, function for function.

use bevy::math::{DVec2, DVec3, DVec4, Vec4Swizzles};

use super::{
    field::{FADE, MEAN_LEVEL, Medium, ModelTextures, level, mix, smoothstep},
    places::{bound_at, read_at, steepest, waves_at},
    zones::Zones,
};
use crate::model::{FINER, LayerUniform, TangentFrame};

/// How many places the waves' sum steps over where it changes by 1.
const PLACES: f64 = 2.0;
const RAIN_THICKENS: f64 = 3.0;
/// Of light scattered by rain.
const RAIN_ALBEDO: f64 = 0.999;
const SHEET: u32 = 1;

/// A layer with what it reads.
pub(super) struct Layer<'a, T> {
    pub layer: &'a LayerUniform,
    pub zones: Zones<'a>,
    pub frame: &'a TangentFrame,
    pub textures: &'a T,
}

impl<T: ModelTextures> Layer<'_, T> {
    /// Upper bound of the density within `reach` metres of `p`, whose altitude is `h`. Rain counts as density too.
    pub fn density_bound(&self, p: DVec3, h: f64, reach: f64) -> f64 {
        let coverage = self.coverage_bound(p, h, reach);
        self.cloud_bound(coverage).max(self.rain_bound(coverage))
    }

    /// As [`density_bound`](Self::density_bound), of the extinction (1/m).
    pub fn extinction_bound(&self, p: DVec3, h: f64, reach: f64) -> f64 {
        let layer = self.layer;
        let coverage = self.coverage_bound(p, h, reach);
        let rain = self.rain_bound(coverage);
        let cloud = self.cloud_bound(coverage) * f64::from(layer.extinction);
        (cloud * (1.0 + RAIN_THICKENS * rain)).max(rain * f64::from(layer.rain_extinction))
    }

    /// Most cloud where there is no more coverage than this.
    fn cloud_bound(&self, coverage: f64) -> f64 {
        let layer = self.layer;
        (coverage * f64::from(layer.profile_strength) * f64::from(layer.shape_gain)).clamp(0.0, 1.0)
            * f64::from(layer.density)
    }

    fn rain_bound(&self, coverage: f64) -> f64 {
        f64::from(self.layer.rain) * smoothstep(0.35, 0.9, coverage)
    }

    /// Largest coverage within `reach` metres.
    fn coverage_bound(&self, p: DVec3, h: f64, reach: f64) -> f64 {
        let layer = self.layer;
        if h + reach <= f64::from(layer.bottom) || h - reach >= f64::from(layer.top) {
            return 0.0;
        }
        let m = self.leaned(p, h);
        let mut skew = f64::from(layer.skew);
        // Above the base shafts slant nothing.
        if h - reach < f64::from(layer.base) {
            skew = skew.max(layer.rain_lean.as_dvec2().length());
        }
        let wide = reach * (self.frame.longest() + skew);
        let mut most = self.map_bound(m, wide);
        let away = m.length();
        if away + wide > FADE[0] {
            most = most.max(self.read_map(layer.map_offset.xy().as_dvec2(), MEAN_LEVEL).w);
        }
        let far = self.far_coverage(away + wide).max(self.far_coverage((away - wide).max(0.0)));
        let added = f64::from(layer.coverage) + far + self.zones.bound(m, wide);
        ((most + added) * f64::from(layer.sharpness)).clamp(0.0, 1.0)
    }

    /// Largest coverage of the map within `wide` metres, at whichever places it is read.
    fn map_bound(&self, m: DVec2, wide: f64) -> f64 {
        let at = self.map_place(m);
        let change = steepest([PLACES; 3]) * f64::from(self.layer.map_rate) * wide;
        let coarse = (wide.log2() + 1.0 - f64::from(self.layer.texels.x)).ceil().max(0.0);
        let read = |place: DVec2| self.read_map(at + place, coarse).w;
        bound_at(self.place_number(m), change, read, || self.read_map(at, MEAN_LEVEL).w)
    }

    /// The medium at `p`, whose altitude is `h`, filtered over 2^`lod` metres.
    pub fn sample(&self, p: DVec3, h: f64, lod: f64) -> Medium {
        let layer = self.layer;
        let m = self.leaned(p, h);
        let w = self.weather_at(m, lod);
        if w.x <= 0.0 {
            return Medium::EMPTY;
        }
        let base = f64::from(layer.base) + f64::from(layer.base_rise) * w.z;
        let x = (h - base) / (f64::from(layer.thickness) * w.y).max(1.0);
        if x >= 1.0 {
            return Medium::EMPTY;
        }
        let coverage = self.within_tower(w.x, x);
        if x <= 0.0 {
            let fall = self.rain_at(m, h, base, coverage, lod);
            return Medium {
                density: fall,
                extinction: fall * f64::from(layer.rain_extinction),
                albedo: DVec3::splat(RAIN_ALBEDO),
                phase: self.phase(),
                ..Medium::EMPTY
            };
        }
        let spread = f64::from(layer.anvil) * smoothstep(0.68, 0.76, x) * (1.0 - smoothstep(0.9, 1.0, x));
        let signal = height_signal(x, layer.peak_height.into()).max(spread);
        let profile = (coverage * signal * f64::from(layer.profile_strength)).clamp(0.0, 1.0);
        let density = self.cloud_density(m, h, x, profile, lod) * f64::from(layer.density);
        if density <= 0.0 {
            return Medium::EMPTY;
        }
        let rain = self.rain_bound(coverage) * (1.0 - x);
        Medium {
            density,
            extinction: density * f64::from(layer.extinction) * (1.0 + RAIN_THICKENS * rain),
            albedo: layer.albedo.xyz().as_dvec3(),
            profile,
            phase: self.phase(),
            ..Medium::EMPTY
        }
    }

    /// The finest detail there is to see (m).
    pub fn finest(&self) -> f64 {
        let layer = self.layer;
        let texels = layer.texels.to_array().map(|texel| f64::from(texel).exp2());
        let mut finest = texels[0].min(f64::from(layer.thickness) / 64.0);
        if layer.kind == SHEET {
            finest = finest.min(texels[1] / f64::from(FINER));
        } else {
            finest = finest.min(texels[1]);
            if layer.detail_strength > 0.0 {
                finest = finest.min(texels[2]);
            }
        }
        if layer.rain > 0.0 || layer.turbulence > 0.0 { finest.min(texels[3]) } else { finest }
    }

    /// Below its anvil a cloud keeps to where coverage is high, and so does its rain.
    fn within_tower(&self, coverage: f64, x: f64) -> f64 {
        let narrow = f64::from(self.layer.anvil) * mix(0.55, 0.0, smoothstep(0.6, 0.8, x));
        ((coverage - narrow) / (1.0 - narrow)).clamp(0.0, 1.0)
    }

    fn phase(&self) -> DVec4 {
        DVec4::from_array([0, 1, 2, 3].map(|slot| f64::from(u8::from(slot == self.layer.phase))))
    }

    fn map_place(&self, m: DVec2) -> DVec2 {
        m * f64::from(self.layer.map_rate) + self.layer.map_offset.xy().as_dvec2()
    }

    fn read_map(&self, at: DVec2, level: f64) -> DVec4 {
        self.textures.weather(self.layer.map as usize, at, level)
    }

    fn far_coverage(&self, away: f64) -> f64 {
        let [start, end] = self.layer.far.to_array().map(f64::from);
        f64::from(self.layer.far_coverage) * smoothstep(start, end, away)
    }

    /// Number of the place that the map is read at, in between where two are.
    fn place_number(&self, m: DVec2) -> f64 {
        let waves = waves_at(m * f64::from(self.layer.map_rate));
        let sum: f64 =
            waves.iter().zip(self.layer.waves.to_array()).map(|(at, from)| (at + f64::from(from)).sin()).sum();
        PLACES * sum
    }

    /// Coverage, height and base of the map at `m`; w is not used.
    fn weather_at(&self, m: DVec2, lod: f64) -> DVec4 {
        let layer = self.layer;
        let at = self.map_place(m);
        let coarsest = (-f64::from(layer.map_rate).log2() - 7.0 - f64::from(layer.texels.x)).max(0.0);
        let level = level(lod, layer.texels.x).min(coarsest);
        let read = |place: DVec2| self.read_map(at + place, level);
        let mut w = read_at(self.place_number(m), read, DVec4::lerp);
        let away = m.length();
        let fade = smoothstep(FADE[0], FADE[1], away);
        if fade > 0.0 {
            w = w.lerp(self.read_map(at, MEAN_LEVEL), fade);
        }
        w.x += f64::from(layer.coverage) + self.far_coverage(away) + self.zones.at(m);
        w.x = (w.x * f64::from(layer.sharpness)).clamp(0.0, 1.0);
        w
    }

    /// Map position with the lean of tops taken out, and below the lowest base, where only rain is, the slant of its shafts
    /// (m).
    fn leaned(&self, p: DVec3, h: f64) -> DVec2 {
        let layer = self.layer;
        let above = h - f64::from(layer.base);
        let slant = if above < 0.0 {
            layer.rain_lean.as_dvec2() * -above
        } else {
            layer.lean.as_dvec2() * (-above / f64::from(layer.thickness))
        };
        self.frame.map_at(p) + slant
    }

    /// Displacement by the curl field, most at the base (m).
    fn turbulence(&self, m: DVec2, x: f64, lod: f64) -> DVec2 {
        let layer = self.layer;
        let amount = f64::from(layer.turbulence) * (1.0 - smoothstep(0.0, layer.turbulence_height.into(), x));
        if amount <= 0.0 {
            return DVec2::ZERO;
        }
        (self.swirl(m, lod).xy() - 0.5) * (2.0 * amount)
    }

    fn swirl(&self, m: DVec2, lod: f64) -> DVec4 {
        let layer = self.layer;
        let at = m * f64::from(layer.swirl_rate) + layer.swirl_offset.xy().as_dvec2();
        self.textures.swirl(at, level(lod, layer.texels.w))
    }

    /// Lengths along the stretch are divided by it.
    fn stretched(&self, m: DVec2) -> DVec2 {
        let direction = self.layer.along.as_dvec2();
        let along = m.dot(direction);
        m - direction * (along - along / f64::from(self.layer.stretch))
    }

    /// Perlin-Worley noise eroded by Worley octaves: 0 to 1.
    fn shape_noise(&self, q: DVec3, lod: f64) -> f64 {
        let layer = self.layer;
        let at = q * f64::from(layer.shape_rate) + layer.shape_offset.truncate().as_dvec3();
        let [perlin, worley] = self.textures.shape(at, level(lod, layer.texels.y));
        let taken = 0.5 * (1.0 - worley);
        ((perlin - taken) / (1.0 - taken)).clamp(0.0, 1.0)
    }

    /// Detail takes from what is thinner than the threshold; billows above, wisps at the base.
    fn detailed(&self, d: f64, q: DVec3, x: f64, lod: f64) -> f64 {
        let layer = self.layer;
        let level = lod - f64::from(layer.texels.z);
        let share = f64::from(layer.detail_strength) * (5.0 - level).clamp(0.0, 1.0);
        let threshold = f64::from(layer.edge_threshold);
        if d <= 0.0 || d >= threshold || share <= 0.0 {
            return d;
        }
        let at = q * f64::from(layer.detail_rate) + layer.detail_offset.truncate().as_dvec3();
        let billow = self.textures.detail(at, level.max(0.0));
        let wisps = f64::from(layer.wispiness) * (1.0 - smoothstep(0.0, 0.35, x));
        (d - share * (1.0 - d / threshold) * mix(1.0 - billow, billow, wisps)).clamp(0.0, 1.0)
    }

    fn cloud_density(&self, m: DVec2, h: f64, x: f64, profile: f64, lod: f64) -> f64 {
        let layer = self.layer;
        let s = self.stretched(m + self.turbulence(m, x, lod));
        let strength = f64::from(layer.shape_strength);
        if layer.kind == SHEET {
            let noise = self.fibres(s, lod);
            // The remap leaves a core whole; filaments show in it too.
            let filaments = mix(1.0, smoothstep(0.15, 0.85, noise), strength);
            return eroded(profile, noise, strength) * filaments;
        }
        let q = DVec3::new(s.x, h, s.y);
        let gained = (profile * f64::from(layer.shape_gain)).clamp(0.0, 1.0);
        let d = self.detailed(eroded(gained, self.shape_noise(q, lod), strength), q, x, lod);
        d * mix(1.0, x, layer.base_to_top.into())
    }

    /// What erodes thin high cloud: fibres and cells in the plane at two sizes.
    fn fibres(&self, s: DVec2, lod: f64) -> f64 {
        let layer = self.layer;
        let rate = f64::from(layer.shape_rate);
        let coarse = self.textures.swirl(s * rate + layer.shape_offset.xy().as_dvec2(), level(lod, layer.texels.y));
        let fine_at = s * (rate * f64::from(FINER)) + layer.detail_offset.xy().as_dvec2() + coarse.xy() * 0.15;
        let fine_level = (lod - f64::from(layer.texels.y) + f64::from(FINER).log2()).max(0.0);
        let fine = self.textures.swirl(fine_at, fine_level);
        let (fibres, cells) = (mix(coarse.z, fine.z, 0.4), mix(coarse.w, fine.w, 0.3));
        mix(fibres, cells, layer.wispiness.into())
    }

    /// Shafts that hang from the base, from its place `m`.
    fn rain_at(&self, m: DVec2, h: f64, base: f64, coverage: f64, lod: f64) -> f64 {
        let layer = self.layer;
        if layer.rain <= 0.0 || h >= base || coverage <= 0.0 {
            return 0.0;
        }
        let streaks = self.swirl(m, lod).z;
        let bottom = f64::from(layer.bottom);
        let left = ((h - bottom) / (base - bottom).max(1.0)).clamp(0.0, 1.0);
        self.rain_bound(coverage) * smoothstep(0.15, 0.75, streaks) * smoothstep(0.0, 0.3, left)
    }
}

/// Högfeldt 5.1, a parabola with roots at base and top, or two halves of parabolas that meet at `peak`.
fn height_signal(x: f64, peak: f64) -> f64 {
    let away = if x < peak { (peak - x) / peak } else { (x - peak) / (1.0 - peak) };
    1.0 - away * away
}

/// What noise leaves of a profile d, by remap: n = 1 leaves it whole.
fn eroded(d: f64, noise: f64, strength: f64) -> f64 {
    let n = 1.0 - strength * (1.0 - noise);
    ((d - (1.0 - n)) / n.max(1e-4)).clamp(0.0, 1.0)
}
