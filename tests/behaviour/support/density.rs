//! The built-in model asked for densities and their bounds, without a camera.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::prelude::*;
use bevy_cumulus::testing::model_bindings;
use rand::{Rng, rngs::StdRng};

use super::{
    app::{clouds_app, until_baked},
    evaluate::on_gpu_with,
    shared::SharedApp,
};

/// One question: p and lod for the bound, q and its lod for the medium.
pub type Question = [f32; 8];

/// Bound, density, extinction, profile, bound of the extinction.
pub type Answer = [f32; 5];

pub const IMPORTS: &str = "import bevy_cumulus::model::model::{density_bound, extinction_bound, sample_medium};";

pub const ASK: &str = "
    let p = vec3<f32>(values[i], values[i + 1u], values[i + 2u]);
    let q = vec3<f32>(values[i + 4u], values[i + 5u], values[i + 6u]);
    let medium = sample_medium(q, values[i + 7u]);
    results[o] = density_bound(p, values[i + 3u]);
    results[o + 1u] = medium.density;
    results[o + 2u] = medium.extinction;
    results[o + 3u] = medium.profile;
    results[o + 4u] = extinction_bound(p, values[i + 3u]);";

/// An app whose textures are baked. No camera: the model does without.
pub fn model_app() -> SharedApp {
    let mut app = clouds_app();
    until_baked(&mut app);
    app
}

pub fn ask(app: &mut App, model: &CloudModel, questions: &[Question]) -> Vec<Answer> {
    app.insert_resource(model.clone());
    let camera = DVec3::new(12_345.0, 10.0, -6789.0);
    let group = model_bindings(app, camera).expect("the model can be bound");
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

/// Points only: p and q are one.
pub fn at(p: Vec3, lod: f32) -> Question {
    [p.x, p.y, p.z, lod, p.x, p.y, p.z, lod]
}
