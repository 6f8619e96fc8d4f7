//! Maps are repeated without end, and a wind of a day carries dozens of repeats past: no sky may come again with them.

use std::sync::Arc;

use bevy::math::{DVec3, UVec3};

use super::{
    field::LocalModel,
    planet::Planet,
    query::{CloudTextureSet, LayerTextureSet},
    sampler::{Address, Texture},
};
use crate::{
    settings::{CloudLayer, CloudLayers, CloudModel},
    weather::{WeatherMap, WeatherPyramid, WeatherRecipe},
};

const WIND: f64 = 8.0;
/// Points of the line along the wind that is looked at, which is a repeat long.
const POINTS: u32 = 160;
const DAY: f64 = 86_400.0;

/// A sky of one layer, without noise: what is left is the clouds' places.
struct One {
    model: CloudModel,
    layers: CloudLayers,
    textures: CloudTextureSet,
    /// Of one repeat (m).
    scale: f64,
    /// Where the line is (m).
    height: f64,
}

fn map() -> WeatherMap {
    WeatherRecipe { size: 128, scale: 36_000.0, cell_size: 2600.0, ..WeatherRecipe::default() }
        .generate()
        .expect("a good recipe")
}

fn textures() -> CloudTextureSet {
    let one = Arc::new(Texture::uniform(1.0));
    let map = Arc::new(map());
    let size = UVec3::new(map.size().x, map.size().y, 1);
    let red = map.texels().iter().map(|texel| f32::from(texel[0]) / 255.0).collect();
    let coverage = Arc::new(Texture::new(vec![(size, red)], Address::Repeat).expect("texels for the size"));
    let mut maps: [Option<Arc<WeatherPyramid>>; 8] = Default::default();
    maps[0] = Some(Arc::new(WeatherPyramid::new(&map, map.size().x)));
    CloudTextureSet {
        billow: one.clone(),
        wisp: one.clone(),
        coverage,
        coverage_bound: one.clone(),
        type_map: one.clone(),
        gradient: one.clone(),
        layers: Some(LayerTextureSet::new(one.clone(), one.clone(), one)),
    }
    .with_maps(&maps)
}

fn of_layers() -> One {
    let layer = CloudLayer {
        map: WeatherRecipe { scale: 36_000.0, ..WeatherRecipe::default() },
        wind: DVec3::new(WIND, 0.0, 0.0).as_vec3(),
        base: 1000.0,
        base_rise: 0.0,
        thickness: 1000.0,
        peak_height: 0.5,
        ..CloudLayer::default()
    };
    One {
        model: CloudModel { enabled: false, ..CloudModel::default() },
        layers: CloudLayers(vec![layer]),
        textures: textures(),
        scale: 36_000.0,
        height: 1250.0,
    }
}

/// The thesis's.
fn of_model() -> One {
    // The bare profile: noise has a repeat of its own.
    let model = CloudModel { wind: DVec3::new(WIND, 0.0, 0.0).as_vec3(), noise_strength: 0.0, ..CloudModel::default() };
    One {
        scale: model.map_scale.into(),
        height: f64::from(0.5 * (model.bottom + model.top)),
        model,
        layers: CloudLayers::default(),
        textures: textures(),
    }
}

impl One {
    /// Cloud along the line, which begins so far along the wind and aside (m).
    fn line(&self, seconds: f64, along: f64, aside: f64) -> Vec<f64> {
        let planet = Planet::default();
        let eye = DVec3::new(along, 0.0, aside);
        let local =
            LocalModel::new(&self.model, &self.layers, seconds, eye, planet, &self.textures).expect("up is defined");
        let at = |i: u32| {
            let x = self.scale * f64::from(i) / f64::from(POINTS);
            let p = DVec3::new(x, self.height - x * x / (2.0 * planet.radius), 0.0);
            local.sample_medium(p, 0.0).profile
        };
        (0..POINTS).map(at).collect()
    }

    /// Correlation of the lines of a day with others: at each of these times, what is seen then and there.
    fn correlation(&self, other: impl Fn(f64) -> Vec<f64>) -> f64 {
        let (mut n, mut sums) = (0.0, [0.0; 5]);
        for k in 0..16 {
            let t = DAY * f64::from(k) / 16.0;
            for (a, b) in self.line(t, 0.0, 0.0).into_iter().zip(other(t)) {
                n += 1.0;
                for (sum, x) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                    *sum += x;
                }
            }
        }
        let [a, b, aa, bb, ab] = sums.map(|sum| sum / n);
        (ab - a * b) / ((aa - a * a) * (bb - b * b)).sqrt()
    }

    /// With each of the next repeats in time, with one and two repeats away, and with places that have nothing to do with it.
    fn correlations(&self, what: &str) -> (Vec<f64>, Vec<f64>) {
        let repeat = self.scale / WIND;
        let repeats = (DAY / repeat) as u32;
        let mut again: Vec<f64> =
            (1..=repeats).map(|k| self.correlation(|t| self.line(t + f64::from(k) * repeat, 0.0, 0.0))).collect();
        again.extend([1.0, 2.0].map(|k| self.correlation(|t| self.line(t, k * self.scale, 0.0))));
        let unrelated = (0..8).map(|k| {
            let aside = self.scale * (0.31 + 0.11 * f64::from(k));
            self.correlation(|t| self.line(t, 0.37 * self.scale, aside))
        });
        let unrelated: Vec<f64> = unrelated.collect();
        let list = |all: &[f64]| all.iter().map(|c| format!("{c:.2}")).collect::<Vec<_>>().join(" ");
        println!("{what}: {} again; {} elsewhere", list(&again), list(&unrelated));
        (again, unrelated)
    }
}

fn mean(all: &[f64]) -> f64 {
    all.iter().sum::<f64>() / all.len() as f64
}

/// Correlation of one sky with that of a repeat later, in the mean of all repeats of a day, and of any one of them. Skies
/// that have nothing to do with each other have 0, within 0.1; a map that is only repeated has 1.
const MEAN: f64 = 0.2;
const ANY: f64 = 0.35;

fn never_comes_again(what: &str, one: &One) {
    let (again, unrelated) = one.correlations(what);
    assert!(mean(&unrelated).abs() < 0.1, "{what}: places far apart are alike: {unrelated:?}");
    assert!(mean(&again) < MEAN, "{what}: repeats correlate by {} in the mean", mean(&again));
    assert!(again.iter().all(|c| *c < ANY), "{what}: a sky comes again: {again:?}");
    // The measure sees what it is to see: the sky a moment later.
    assert!(one.correlation(|t| one.line(t + 1.0, 0.0, 0.0)) > 0.95, "{what}: a moment changes all");
}

#[test]
fn weather_maps_never_come_again() {
    never_comes_again("layers", &of_layers());
}

#[test]
fn the_thesis_layer_never_comes_again() {
    never_comes_again("thesis", &of_model());
}
