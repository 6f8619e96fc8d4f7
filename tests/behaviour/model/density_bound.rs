//! The model's promises to the renderer, asked of the GPU with the real textures.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::prelude::*;
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::support::density::{Question, ask, at, model_app, point, question};

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
