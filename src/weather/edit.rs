//! Local changes to a map: a clear zone, a storm.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    lattice::sin_cos,
    map::WeatherMap,
    noise::{Octaves, smoothstep},
};

/// A mature cumulonimbus, as [`WeatherMap::stamp_storm`] stamps it: a tower, its anvil blown ahead, and a line of smaller
/// towers that grow behind it.
///
/// Shares (0..1) are of the layer's greatest height and greatest rise of the base; an anvil needs a layer whose base may rise.
#[derive(Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct StormCell {
    /// Another seed gives another outline. Default 1.
    pub seed: u32,
    /// Height of the tower (0..1). Default 1.
    #[reflect(@0.0..=1.0_f32)]
    pub height: f32,
    /// Rise of the tower's base (0..1). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub base: f32,
    /// How far the anvil reaches ahead, in radii of the tower; 0 is no anvil. Default 3.5.
    #[reflect(@0.0..=10.0_f32)]
    pub anvil: f32,
    /// Direction that the anvil is blown in: degrees, 0 along the map's u (+x), 90 along its v (+z). Default 0.
    #[reflect(@-360.0..=360.0_f32)]
    pub anvil_direction: f32,
    /// Rise of the anvil's underside (0..1). Default 0.75.
    #[reflect(@0.0..=1.0_f32)]
    pub anvil_base: f32,
    /// Thickness of the anvil (0..1). Default 0.25.
    #[reflect(@0.0..=1.0_f32)]
    pub anvil_height: f32,
    /// How strong the line of smaller towers is (0..1). Default 0.7.
    #[reflect(@0.0..=1.0_f32)]
    pub flank: f32,
}

impl Default for StormCell {
    fn default() -> Self {
        Self {
            seed: 1,
            height: 1.0,
            base: 0.0,
            anvil: 3.5,
            anvil_direction: 0.0,
            anvil_base: 0.75,
            anvil_height: 0.25,
            flank: 0.7,
        }
    }
}

impl WeatherMap {
    /// Clears the sky around `centre` out to `radius`, both in repeats of the map (metres divided by its scale); reaches
    /// across its seams. From `1 − softness` of the radius outwards cloud comes back: 0 is a sharp edge, 1 fades from the
    /// centre on. Numbers that are not finite change nothing.
    pub fn clear_zone(&mut self, centre: Vec2, radius: f32, softness: f32) {
        let soft = softness.clamp(0.0, 1.0);
        self.edit(centre, radius, |texel, offset| {
            let distance = offset.length() / radius;
            // A step of almost no width, so that a sharp edge divides by something.
            let keep = smoothstep((1.0 - soft).min(0.9999), 1.0, distance);
            texel.x *= keep;
        });
    }

    /// Stamps a storm whose tower has this `radius` around `centre`, both in repeats of the map (metres divided by its
    /// scale); reaches across its seams. Where the storm is, it replaces the clouds that were there. Numbers that are not
    /// finite change nothing.
    pub fn stamp_storm(&mut self, centre: Vec2, radius: f32, storm: &StormCell) {
        let cells = 2.0 / f64::from(radius.max(1e-4));
        let noise = |seed, cells| Octaves::new(seed, cells, 23.0, self.size().max_element(), 4);
        // Small towers need a finer outline.
        let (outline, fine) = (noise(storm.seed, cells), noise(!storm.seed, 3.0 * cells));
        let (mut outline, mut fine) = (outline.reader(), fine.reader());
        let (sin, cos) = sin_cos(f64::from(storm.anvil_direction));
        let ahead = Vec2::new(cos as f32, sin as f32);
        let reach = radius * (storm.anvil + 2.0).max(4.0);
        self.edit(centre, reach, |texel, offset| {
            let place = (centre + offset).to_array();
            let ragged = outline.at(place);
            let at = Vec2::new(offset.dot(ahead), offset.dot(ahead.perp())) / radius;
            storm.anvil_at(texel, at, ragged);
            storm.flank_at(texel, at, 0.4 * ragged + fine.at(place));
            storm.tower_at(texel, at, ragged, 1.0, storm.height);
        });
    }

    /// Calls `change` with coverage, height and base of every texel within `reach` of `centre`, and where it lies from there.
    fn edit(&mut self, centre: Vec2, reach: f32, mut change: impl FnMut(&mut Vec3, Vec2)) {
        if !centre.is_finite() || !reach.is_finite() || reach <= 0.0 {
            return;
        }
        let size = self.size();
        let width = size.x as usize;
        for (n, texel) in self.texels_mut().iter_mut().enumerate() {
            let place = (UVec2::new((n % width) as u32, (n / width) as u32).as_vec2() + 0.5) / size.as_vec2();
            let offset = place - centre;
            // The nearest of the centre's repeats.
            let offset = offset - offset.round();
            if offset.length() > reach {
                continue;
            }
            let [r, g, b, a] = *texel;
            let before = Vec3::new(r.into(), g.into(), b.into()) / 255.0;
            let mut after = before;
            change(&mut after, offset);
            if after != before {
                let [r, g, b] = (after.clamp(Vec3::ZERO, Vec3::ONE) * 255.0 + 0.5).to_array().map(|x| x as u8);
                *texel = [r, g, b, a];
            }
        }
    }
}

impl StormCell {
    /// One tower, `radius` wide; `at` is in radii of the main one, from its centre.
    fn tower_at(&self, texel: &mut Vec3, at: Vec2, ragged: f32, radius: f32, height: f32) {
        // Small towers are as ragged as the large one.
        let distance = at.length() / radius + 0.16 * ragged / radius.sqrt();
        let body = smoothstep(1.0, 0.7, distance);
        if body <= 0.0 {
            return;
        }
        // A dome with a shoulder.
        let dome = smoothstep(1.1, 0.3, distance);
        let tall = height * (0.3 + 0.7 * dome);
        *texel =
            Vec3::new(texel.x.max(body), texel.y + (tall - texel.y) * body, texel.z + (self.base - texel.z) * body);
    }

    /// Smaller towers behind and to the right of the way the anvil goes, each lower than the one before.
    fn flank_at(&self, texel: &mut Vec3, at: Vec2, ragged: f32) {
        if self.flank <= 0.0 {
            return;
        }
        // Place, radius and height; the farthest first, as nearer ones stand before them.
        let towers = [
            (Vec2::new(-2.0, 1.95), 0.24, 0.22),
            (Vec2::new(-1.75, 1.45), 0.34, 0.34),
            (Vec2::new(-1.45, 0.95), 0.42, 0.48),
            (Vec2::new(-1.0, 0.7), 0.5, 0.6),
            (Vec2::new(-0.65, 0.35), 0.6, 0.78),
        ];
        for (place, radius, height) in towers {
            self.tower_at(texel, at - place, ragged, radius * self.flank.sqrt(), self.height * height * self.flank);
        }
    }

    /// A fan that thins out ahead, its edge frayed.
    fn anvil_at(&self, texel: &mut Vec3, at: Vec2, ragged: f32) {
        if self.anvil <= 0.0 {
            return;
        }
        // An egg, its narrow end a little behind the tower: 0 there, 1 at the tip.
        let along = (at.x + 1.5) / (self.anvil + 1.5);
        let half_width = (0.9 + 0.4 * self.anvil) * (0.55 + 0.6 * along);
        let from_middle = Vec2::new(2.0 * along - 1.0, at.y / half_width).length();
        let spread = smoothstep(1.0, 0.8 - 0.35 * along.clamp(0.0, 1.0), from_middle + 0.18 * ragged);
        if spread <= 0.0 {
            return;
        }
        let coverage = spread * (0.9 - 0.4 * along);
        *texel = Vec3::new(
            texel.x + (coverage - texel.x) * spread,
            texel.y + (self.anvil_height - texel.y) * spread,
            texel.z + (self.anvil_base - texel.z) * spread,
        );
    }
}
