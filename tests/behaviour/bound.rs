//! The model's promises to the renderer, asked of the GPU with the real textures.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::{ModelShader, prelude::*, textures::CloudTextureStatus};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::{
    gpu::{run_until, run_updates},
    twins::on_gpu_with,
    view::clouds_app,
};

/// One question: p and lod for the bound, q and its lod for the medium.
pub type Question = [f32; 8];
/// Bound, density, extinction, profile, bound of the extinction.
pub type Answer = [f32; 5];

const IMPORTS: &str = "import bevy_cumulus::model::model::{density_bound, extinction_bound, sample_medium};";
const ASK: &str = "
    let p = vec3<f32>(values[i], values[i + 1u], values[i + 2u]);
    let q = vec3<f32>(values[i + 4u], values[i + 5u], values[i + 6u]);
    let medium = sample_medium(q, values[i + 7u]);
    results[o] = density_bound(p, values[i + 3u]);
    results[o + 1u] = medium.density;
    results[o + 2u] = medium.extinction;
    results[o + 3u] = medium.profile;
    results[o + 4u] = extinction_bound(p, values[i + 3u]);";

/// An app whose textures are baked. No camera: the model does without.
pub fn model_app() -> App {
    let mut app = clouds_app();
    run_until(&mut app, "the textures are baked", 600, |app| {
        !app.world().resource::<CloudTextureStatus>().baking && ModelShader::bindings(app, DVec3::ZERO).is_ok()
    });
    // So that the baking that the small sizes ask for has begun, and ended.
    run_updates(&mut app, 3);
    run_until(&mut app, "the textures are baked", 600, |app| !app.world().resource::<CloudTextureStatus>().baking);
    app
}

pub fn ask(app: &mut App, model: &CloudModel, questions: &[Question]) -> Vec<Answer> {
    app.insert_resource(model.clone());
    let camera = DVec3::new(12_345.0, 10.0, -6789.0);
    let group = ModelShader::bindings(app, camera).expect("the model can be bound");
    on_gpu_with(app, Some(&group), IMPORTS, ASK, questions)
}

/// A point in the layer or around it, within 60 km.
pub fn point(rng: &mut StdRng, model: &CloudModel) -> Vec3 {
    let away = 10_f32.powf(rng.random_range(1.0..4.8));
    let angle: f32 = rng.random_range(0.0..std::f32::consts::TAU);
    // What the surface falls away by: d²/2R.
    let drop = away * away / (2.0 * 6.36e6);
    let thickness = model.top - model.bottom;
    let height = rng.random_range(model.bottom - 0.3 * thickness..model.top + 0.3 * thickness);
    Vec3::new(away * angle.cos(), height - drop, away * angle.sin())
}

/// A question whose q lies within 2^lod metres of p, as often near as far, and asks at most as coarsely.
pub fn question(rng: &mut StdRng, model: &CloudModel) -> Question {
    let p = point(rng, model);
    let lod: f32 = rng.random_range(-1.0..13.0);
    let direction = loop {
        let d = Vec3::from_array([(); 3].map(|()| rng.random_range(-1.0_f32..1.0)));
        if (0.01..1.0).contains(&d.length()) {
            break d.normalize();
        }
    };
    // A share of f32's own error less than the whole reach.
    let reach = (0.9999 * lod.exp2() - 0.01).max(0.0);
    let q = p + direction * reach * rng.random_range(0.0_f32..1.0).sqrt();
    let finer = if rng.random_bool(0.3) { 0.0 } else { rng.random_range(0.0..8.0) };
    [p.x, p.y, p.z, lod, q.x, q.y, q.z, lod - finer]
}

fn models() -> Vec<CloudModel> {
    let plain = CloudModel::default();
    vec![
        plain.clone(),
        // No noise: the density is the profile, the most there can be.
        CloudModel { noise_strength: 0.0, type_variation: 0.0, cloud_type: 1.0, ..plain.clone() },
        CloudModel { erosion: Erosion::Subtract, coverage: -0.05, wind_skew: 3000.0, ..plain.clone() },
        CloudModel { map_scale: 3000.0, coverage: 0.15, noise_strength: 0.3, wind_skew: 0.0, ..plain.clone() },
        CloudModel { bottom: 500.0, top: 9000.0, density: 3.0, map_variation: 1.0, coverage: -0.1, ..plain },
    ]
}

#[test]
fn nothing_is_denser_than_the_bound_around_it() {
    let mut app = model_app();
    for (k, model) in (0..).zip(models()) {
        let mut rng = StdRng::seed_from_u64(40 + k);
        let questions: Vec<Question> = (0..60_000).map(|_| question(&mut rng, &model)).collect();
        let answers = ask(&mut app, &model, &questions);
        let (mut empty, mut cloud, mut close) = (0, 0, 0.0_f32);
        for (question, answer) in questions.iter().zip(&answers) {
            let [bound, density, extinction, profile, extinction_bound] = *answer;
            assert!(answer.iter().all(|v| v.is_finite() && *v >= 0.0), "model {k}: {question:?}: {answer:?}");
            assert!(bound > 0.0 || density == 0.0, "model {k}: {question:?}: {density} where the bound is 0");
            // Of rounding: both are sums of a few products.
            let allowed = bound + model.density * 1e-5;
            assert!(density <= allowed, "model {k}: {question:?}: {density} > {bound}");
            // The path tracer's majorant.
            assert!(extinction <= extinction_bound + model.extinction * allowed * 1e-5, "model {k}: {question:?}");
            assert!((extinction - density * model.extinction).abs() <= 1e-6 * extinction);
            assert!(density == 0.0 || profile > 0.0, "model {k}: {question:?}: {answer:?}");
            empty += u32::from(bound == 0.0);
            cloud += u32::from(density > 0.0);
            if bound > 0.0 {
                close = close.max(density / bound);
            }
        }
        println!("model {k}: {empty} certainly empty, {cloud} in cloud, density up to {close} of the bound");
        // A bound that is never 0 would be true and of no use.
        assert!(empty > 3000 && cloud > 150, "model {k}: {empty} certainly empty, {cloud} in cloud");
    }
}

/// Points only: p and q are one.
pub fn at(p: Vec3, lod: f32) -> Question {
    [p.x, p.y, p.z, lod, p.x, p.y, p.z, lod]
}

#[test]
fn outside_the_shells_there_is_nothing() {
    let mut app = model_app();
    let model = CloudModel { coverage: 1.0, ..default() };
    let mut rng = StdRng::seed_from_u64(50);
    let questions: Vec<Question> = (0..20_000)
        .map(|k| {
            let away = rng.random_range(0.0_f32..40_000.0);
            let drop = away * away / (2.0 * 6.36e6);
            // A metre from a shell and up to far from it.
            let beyond = 10_f32.powf(rng.random_range(0.0..4.0));
            let height = if k % 2 == 0 { model.bottom - beyond } else { model.top + beyond };
            at(Vec3::new(away, height - drop, 0.0), -1.0)
        })
        .collect();
    for (question, [bound, density, ..]) in questions.iter().zip(ask(&mut app, &model, &questions)) {
        assert_eq!((bound, density), (0.0, 0.0), "{question:?}");
    }
}

#[test]
fn coverage_goes_from_clear_to_overcast() {
    let mut app = model_app();
    let mut rng = StdRng::seed_from_u64(51);
    let model = CloudModel { type_variation: 0.0, cloud_type: 1.0, ..default() };
    let questions: Vec<Question> = (0..20_000)
        .map(|_| {
            let mut p = point(&mut rng, &model);
            let drop = (p.x * p.x + p.z * p.z) / (2.0 * 6.36e6);
            p.y = 0.5 * (model.bottom + model.top) - drop;
            at(p, 3.0)
        })
        .collect();
    let mut share = |coverage| {
        let model = CloudModel { coverage, ..model.clone() };
        let answers = ask(&mut app, &model, &questions);
        answers.iter().filter(|a| a[1] > 0.0).count() as f64 / questions.len() as f64
    };
    let shares = [-1.0, -0.3, 0.0, 0.3, 1.0].map(&mut share);
    println!("cloudy at mid height, for coverage -1, -0.3, 0, 0.3, 1: {shares:?}");
    assert_eq!(shares[0], 0.0);
    assert!(shares.is_sorted_by(|a, b| a < b), "{shares:?}");
    assert!((0.003..0.8).contains(&shares[2]), "{shares:?}");
    assert!(shares[4] > 0.95, "{shares:?}");
    // Clear is clear at any height, and its bound says so.
    let clear = CloudModel { coverage: -1.0, ..default() };
    let questions: Vec<Question> = (0..20_000).map(|_| question(&mut rng, &clear)).collect();
    for (question, answer) in questions.iter().zip(ask(&mut app, &clear, &questions)) {
        assert_eq!(answer[..2], [0.0, 0.0], "{question:?}");
    }
}

/// Each range's ends, for everything that has one.
fn extreme_models() -> Vec<CloudModel> {
    let all = |high: bool| {
        let pick = |a: f32, b: f32| if high { b } else { a };
        CloudModel {
            bottom: pick(-400.0, 30_000.0),
            top: pick(-300.0, 40_000.0),
            coverage: 1.0,
            cloud_type: pick(0.0, 1.0),
            type_variation: pick(0.0, 1.0),
            map_scale: pick(500.0, 1e6),
            type_scale: pick(500.0, 1e6),
            map_variation: pick(0.0, 1.0),
            density: 10.0,
            extinction: 1.0,
            noise_strength: pick(0.0, 1.0),
            billow_scale: pick(50.0, 1e5),
            detail_scale: pick(20.0, 5e4),
            detail_strength: pick(0.0, 1.0),
            wisp_scale: pick(20.0, 1e5),
            wisp_height: pick(0.01, 1.0),
            wind: Vec3::splat(pick(-300.0, 300.0)),
            wind_skew: pick(0.0, 20_000.0),
            evolution: pick(-50.0, 50.0),
            world_offset: DVec3::splat(if high { 1e6 } else { -1e6 }),
            ..default()
        }
    };
    let (low, high) = (all(false), all(true));
    vec![
        CloudModel { erosion: Erosion::Subtract, ..low.clone() },
        // A sliver of a layer, skewed as far as can be.
        CloudModel { bottom: 1000.0, top: 1000.5, wind_skew: 20_000.0, ..high.clone() },
        CloudModel { extinction: 0.0, density: 0.0, ..high.clone() },
        CloudModel { wisp_height: 0.01, noise_strength: 1.0, map_scale: 500.0, ..high.clone() },
        low,
        high,
    ]
}

#[test]
fn density_is_finite_for_every_setting_that_is_allowed() {
    let mut app = model_app();
    for (k, model) in (0..).zip(extreme_models()) {
        // A year of the fastest wind.
        app.insert_resource(CloudClock { seconds: 3.2e7, speed: 0.0 });
        let mut rng = StdRng::seed_from_u64(60 + k);
        let mut questions: Vec<Question> = (0..8000).map(|_| question(&mut rng, &model)).collect();
        // Far away, at the planet's centre and behind it; absurdly coarse and fine.
        for p in [Vec3::ZERO, Vec3::NEG_Y * 6.36e6, Vec3::NEG_Y * 1.3e7, Vec3::new(4e6, -2e6, 1e6), Vec3::splat(1e7)] {
            questions.extend([-20.0, 0.0, 30.0].map(|lod| at(p, lod)));
        }
        for (question, answer) in questions.iter().zip(ask(&mut app, &model, &questions)) {
            let [bound, density, extinction, ..] = answer;
            assert!(answer.iter().all(|v| v.is_finite() && *v >= 0.0), "model {k}: {question:?}: {answer:?}");
            assert!(density <= model.density && bound <= model.density, "model {k}: {question:?}: {answer:?}");
            assert!(extinction <= model.density * model.extinction, "model {k}: {question:?}: {answer:?}");
        }
    }
}
