//! The CPU twin of the model: the same answers as the GPU's, kept up to date, and only if asked for.

mod cpu_copies;
mod layers;
mod light;

use bevy::{
    math::{DVec2, DVec3, DVec4},
    prelude::*,
};
use bevy_cumulus::testing::model_bindings;
use bevy_cumulus::{
    CloudsPlugin,
    prelude::*,
    reference::{
        field::{LayerSides, LocalModel, ModelTextures},
        planet::Planet,
        query::CloudTextureSet,
        sampler::Texture,
    },
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::support::{
    app::new_clouds_app_with,
    evaluate::{U, on_gpu_with},
    gpu::{run_until, run_updates},
    shared::SharedApp,
};

/// An app without a camera whose sky the CPU has.
pub fn field_app(textures: CloudTextures) -> SharedApp {
    let kind = if textures == small(1) { "queries" } else { "queries of other textures" };
    let mut app = SharedApp::with_textures(kind, textures, || new_clouds_app_with((CloudFieldPlugin, CloudsPlugin)));
    until_current(&mut app);
    app
}

/// Runs until the CPU has what the GPU has, changes made just now included.
pub fn until_current(app: &mut App) {
    run_updates(app, 3);
    run_until(app, "the textures are on the CPU", 900, |app| app.world().resource::<CloudField>().is_current());
}

pub fn sky(app: &App) -> CloudSky {
    app.world().resource::<CloudField>().get().expect("the sky is there").clone()
}

pub fn small(seed: u32) -> CloudTextures {
    CloudTextures { seed, volume_size: 32, map_size: 128, ..default() }
}

const IMPORTS: &str = "import bevy_cumulus::model::model::{density_bound, sample_medium};";
const ASK: &str = "
    let p = vec3<f32>(values[i], values[i + 1u], values[i + 2u]);
    let medium = sample_medium(p, values[i + 3u]);
    results[o] = medium.density;
    results[o + 1u] = medium.extinction;
    results[o + 2u] = medium.profile;
    results[o + 3u] = density_bound(p, values[i + 3u]);";

/// The twin's textures, each reading as much too high (`sign` 1) or too low (−1) as a GPU's filter may get it.
///
/// A filter's weights have 8 bits, so what it returns is the texture within 1/256 of a texel, in each axis and between
/// levels; coordinates are f32. Texels of 8 bits may be filtered in 8 bits, as Mesa's software driver does. The density
/// rises with each reading but the type, so what these two twins say brackets what any such GPU may.
struct Perturbed<'a> {
    exact: &'a CloudTextureSet,
    sign: f64,
}

/// Part of a texel, and of a level, that a weight may be wrong by.
const WEIGHT: f64 = 1.0 / 256.0;
/// What filtering in 8 bits may lose: half a step where it is rounded, and half for the roundings on the way.
const BYTES: f64 = 1.0 / 255.0;

impl Perturbed<'_> {
    fn read(&self, texture: &Texture, at: DVec3, level: f64, rounding: f64) -> f64 {
        let exact = texture.sample(at, level);
        let off = |at: DVec3, level: f64| (texture.sample(at, level) - exact).abs();
        let mut error = rounding + off(at, level + WEIGHT).max(off(at, level - WEIGHT));
        let texels = texture.size().as_dvec3() / level.clamp(0.0, 30.0).ceil().exp2();
        for axis in DVec3::AXES {
            // The coordinate itself: a position, a product and a sum.
            let coordinate = 4.0 * U * (at.dot(axis).abs() + 1.0);
            let step = axis * (WEIGHT / texels.dot(axis).max(1.0) + coordinate);
            error += off(at + step, level).max(off(at - step, level));
        }
        exact + self.sign * error
    }
}

impl ModelTextures for Perturbed<'_> {
    fn sides(&self) -> [u32; 4] {
        self.exact.sides()
    }
    fn billow(&self, at: DVec3, level: f64) -> f64 {
        self.read(&self.exact.billow, at, level, BYTES)
    }
    fn wisp(&self, at: DVec3, level: f64) -> f64 {
        self.read(&self.exact.wisp, at, level, BYTES)
    }
    fn coverage(&self, at: DVec2, level: f64) -> f64 {
        self.read(&self.exact.coverage, at.extend(0.0), level, 0.0)
    }
    fn coverage_bound(&self, at: DVec2, level: f64) -> f64 {
        self.read(&self.exact.coverage_bound, at.extend(0.0), level, 0.0)
    }
    fn type_map(&self, at: DVec2, level: f64) -> f64 {
        self.exact.type_map(at, level)
    }
    fn gradient(&self, cloud_type: f64, height: f64) -> f64 {
        // Not monotone in the type, whose own error (at most a 128th, of 256 texels) is allowed for here.
        let read = |t: f64, h: f64| self.exact.gradient(t, h);
        let exact = read(cloud_type, height);
        let of_type = TYPE_ERROR + WEIGHT / 256.0;
        let of_height = HEIGHT_ERROR + WEIGHT / 256.0;
        let mut error = 0.0_f64;
        for (t, h) in
            [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)]
        {
            error = error.max((read(cloud_type + t * of_type, height + h * of_height) - exact).abs());
        }
        exact + self.sign * error
    }
    // There are no layers here; those are in `layers`.
    fn layer_sides(&self) -> Option<LayerSides> {
        None
    }
    fn shape(&self, at: DVec3, level: f64) -> [f64; 2] {
        self.exact.shape(at, level)
    }
    fn detail(&self, at: DVec3, level: f64) -> f64 {
        self.exact.detail(at, level)
    }
    fn weather(&self, layer: usize, at: DVec2, level: f64) -> DVec4 {
        self.exact.weather(layer, at, level)
    }
    fn swirl(&self, at: DVec2, level: f64) -> DVec4 {
        self.exact.swirl(at, level)
    }
}

/// Error of the type that the map's filter and f32 leave: the steepest the type map gets between two texels, over 256.
const TYPE_ERROR: f64 = 1e-3;
/// Error of the height in the layer: two centimetres (see `twins`) of a thin layer.
const HEIGHT_ERROR: f64 = 2e-5;

struct Case {
    model: CloudModel,
    seconds: f64,
    camera: DVec3,
    seed: u32,
}

fn cases() -> Vec<Case> {
    let plain = CloudModel::default();
    let case = |model, seconds, camera: [f64; 3], seed| Case { model, seconds, camera: camera.into(), seed };
    vec![
        case(plain.clone(), 0.0, [0.0, 2.0, 0.0], 1),
        case(CloudModel { coverage: 0.7, ..plain.clone() }, 86_400.0, [12_345.0, 10.0, -6789.0], 1),
        case(
            CloudModel {
                erosion: Erosion::Subtract,
                coverage: 0.6,
                wind: Vec3::new(-40.0, 2.0, 90.0),
                ..plain.clone()
            },
            3.2e6,
            [-30_000.0, 1500.0, 4000.0],
            2,
        ),
        case(
            CloudModel {
                world_offset: DVec3::new(3e5, 0.0, -2e5),
                wind_skew: 3000.0,
                evolution: -5.0,
                map_variation: 1.0,
                coverage: 0.5,
                density: 2.0,
                ..plain.clone()
            },
            -7200.0,
            [100.0, 3000.0, 200.0],
            3,
        ),
        case(
            CloudModel {
                bottom: 500.0,
                top: 9000.0,
                map_scale: 9000.0,
                detail_strength: 0.8,
                wisp_height: 0.7,
                noise_strength: 0.6,
                coverage: 0.3,
                type_variation: 1.0,
                ..plain
            },
            1234.5,
            [0.0, 12_000.0, 0.0],
            3,
        ),
    ]
}

/// A point in the layer or a little outside, within 60 km, and a filter width: half of them at full detail.
fn point(rng: &mut StdRng, model: &CloudModel) -> [f32; 4] {
    let away = 10_f32.powf(rng.random_range(1.0..4.8));
    let angle: f32 = rng.random_range(0.0..std::f32::consts::TAU);
    let drop = away * away / (2.0 * 6.36e6);
    let margin = 0.05 * (model.top - model.bottom);
    let height = rng.random_range(model.bottom - margin..model.top + margin);
    let lod = if rng.random_bool(0.5) { 0.0 } else { rng.random_range(-2.0..12.0) };
    [away * angle.cos(), height - drop, away * angle.sin(), lod]
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn gpu_and_cpu_agree_on_100_000_points_to_the_texture_filters_precision() {
    let mut app = field_app(small(1));
    let mut rng = StdRng::seed_from_u64(70);
    let (mut errors, mut bias) = (Vec::new(), 0.0);
    for (k, Case { model, seconds, camera, seed }) in cases().into_iter().enumerate() {
        if app.world().resource::<CloudTextures>().seed != seed {
            app.insert_resource(small(seed));
            until_current(&mut app);
        }
        app.insert_resource(model.clone()).insert_resource(CloudClock { seconds, speed: 0.0 });
        let points: Vec<[f32; 4]> = (0..40_000).map(|_| point(&mut rng, &model)).collect();
        let group = model_bindings(&app, camera).expect("the model can be bound");
        let found: Vec<[f32; 4]> = on_gpu_with(&mut app, Some(&group), IMPORTS, ASK, &points);
        let sky = sky(&app);
        assert_eq!((sky.model(), sky.seconds()), (&model, seconds));
        let textures = sky.textures();
        let [low, high] = [-1.0, 1.0].map(|sign| Perturbed { exact: textures, sign });
        let (planet, none) = (Planet::default(), CloudLayers::default());
        let twin = LocalModel::new(&model, &none, seconds, camera, planet, textures).unwrap();
        let low = LocalModel::new(&model, &none, seconds, camera, planet, &low).unwrap();
        let high = LocalModel::new(&model, &none, seconds, camera, planet, &high).unwrap();
        let (mut own, mut widths) = (Vec::new(), Vec::new());
        for (point, gpu) in points.iter().zip(&found) {
            let [density, extinction, profile, bound] = gpu.map(f64::from);
            let p = Vec3::from_slice(point).as_dvec3();
            let lod = f64::from(point[3]);
            let cpu = twin.sample_medium(p, lod);
            let most = f64::from(model.density);
            let [low, high] = [&low, &high].map(|twin| twin.sample_medium(p, lod).density);
            assert!(
                (low - F32 * most..=high + F32 * most).contains(&density),
                "case {k}: {point:?}: density {density}, not {} ({low} to {high})",
                cpu.density
            );
            if cpu.density > 0.0 || density > 0.0 {
                own.push((density - cpu.density).abs() / most);
                widths.push(0.5 * (high - low) / most);
                bias += (density - cpu.density) / most;
            }
            assert!((extinction - density * f64::from(model.extinction)).abs() <= 1e-6 * extinction);
            // Next to nothing on one side may be nothing on the other, and nothing has no profile.
            assert!(
                (density > 0.0) != (cpu.density > 0.0) || (profile - cpu.profile).abs() < 0.01,
                "case {k}: {point:?}: profile {profile}, not {}",
                cpu.profile
            );
            let twins = twin.density_bound(p, lod.exp2());
            assert!((bound - twins).abs() < 0.01 * most, "case {k}: {point:?}: bound {bound}, not {twins}");
        }
        println!("case {k}: {} in cloud, error {}, tolerance {}", own.len(), summary(&mut own), summary(&mut widths));
        assert!(own.len() > 1000, "case {k}: {} points in cloud", own.len());
        errors.extend(own);
    }
    let mean = bias / errors.len() as f64;
    println!("{} in cloud, error {}, mean {mean:+.6}", errors.len(), summary(&mut errors));
    // In whole steps of an 8-bit texel, 0.0039: half a step is usual, one and a half the most; none is lost on average.
    assert!(percentile(&errors, 0.5) < 0.002 && percentile(&errors, 0.999) < 0.006, "{}", summary(&mut errors));
    assert!(percentile(&errors, 1.0) < 0.01 && mean.abs() < 3e-4, "{} mean {mean}", summary(&mut errors));
}

/// What f32 arithmetic may lose of a density.
const F32: f64 = 1e-4;

fn summary(values: &mut [f64]) -> String {
    values.sort_by(f64::total_cmp);
    let [half, most, all] = [0.5, 0.999, 1.0].map(|share| percentile(values, share));
    format!("{half:.5} (50 %) {most:.5} (99.9 %) {all:.5} (most)")
}
