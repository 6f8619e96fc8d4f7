//! A model of one uniform slab between two altitudes. All that tells one slab from another comes from [`CloudModel`], so
//! that all of them share one shader, and with it every pipeline.

use bevy::prelude::*;
use bevy_cumulus::{CloudsPlugin, ModelShader, prelude::*};

use super::{app::new_clouds_app_with, shared::SharedApp};

const SHADER: &str = "
import package::model::{data::model, medium::{Medium, empty_medium}, planet::altitude};

fn model_bounds() -> vec2<f32> {
    return vec2(model.bottom, model.top);
}

// Whether p is in the cloud, or within `reach` of it.
fn is_near(p: vec3<f32>, reach: f32) -> bool {
    let h = altitude(p, model.radius);
    let aside = length(p.xz - vec2(model.skew * (model.top - model.bottom), 0.0));
    let is_within = model.coverage == 0.0 || aside <= 1.0 / model.billow_rate + reach;
    return is_within && h + reach >= model.bottom && h - reach <= model.top;
}

fn density_bound(p: vec3<f32>, lod: f32) -> f32 {
    return select(0.0, 1.0, is_near(p, exp2(lod)));
}

fn extinction_bound(p: vec3<f32>, lod: f32) -> f32 {
    return select(0.0, model.density * model.density * model.extinction, is_near(p, exp2(lod)));
}

fn sample_medium(p: vec3<f32>, lod: f32) -> Medium {
    if !is_near(p, 0.0) {
        return empty_medium();
    }
    let h = altitude(p, model.radius);
    let density = select(model.wisp_height, model.detail_strength, h < 0.5 * (model.bottom + model.top));
    return Medium(density, model.extinction, model.albedo.rgb, 0.5, vec2(h - model.bottom, model.top - h),
        vec4(model.cloud_type, model.type_variation, model.map_variation, model.noise_strength));
}
";

/// One slab.
#[derive(Clone, Copy)]
pub struct UniformSlab {
    pub bottom: f32,
    pub top: f32,
    /// 1/m.
    pub extinction: f32,
    pub albedo: Vec3,
    /// Shares of the four phase functions.
    pub phase: [f32; 4],
    /// Densities of the lower and of the upper half. The extinction does not follow them.
    pub densities: [f32; 2],
    /// Where it does not reach everywhere: the radius of the disc that it fills, and how far along +x from the camera's
    /// axis its middle is (m).
    pub disc: Option<[f32; 2]>,
    /// The path tracer's majorant, in the extinction: over 1, so that null collisions happen.
    pub majorant: f32,
}

impl UniformSlab {
    /// White droplets of the first phase function.
    pub fn new(bottom: f32, top: f32, extinction: f32) -> Self {
        Self {
            bottom,
            top,
            extinction,
            albedo: Vec3::splat(0.99),
            phase: [1.0, 0.0, 0.0, 0.0],
            densities: [1.0; 2],
            disc: None,
            majorant: 2.0,
        }
    }

    /// The settings that its shader reads.
    pub fn settings(&self) -> CloudModel {
        let [cloud_type, type_variation, map_variation, noise_strength] = self.phase;
        let [detail_strength, wisp_height] = self.densities;
        let [billow_scale, wind_skew] = self.disc.unwrap_or([1000.0, 0.0]);
        let Self { bottom, top, extinction, albedo, .. } = *self;
        CloudModel {
            bottom,
            top,
            extinction,
            albedo,
            cloud_type,
            type_variation,
            map_variation,
            noise_strength,
            detail_strength,
            wisp_height,
            billow_scale,
            wind_skew,
            coverage: if self.disc.is_some() { 1.0 } else { 0.0 },
            density: self.majorant.sqrt(),
            ..default()
        }
    }

    /// An app whose only cloud is this slab.
    pub fn app(&self) -> SharedApp {
        self.shown_in(SharedApp::of_kind("slab", Self::new_app))
    }

    /// The same, of those that have compiled the path tracer, which takes a software driver a minute.
    pub fn traced_app(&self) -> SharedApp {
        self.shown_in(SharedApp::only_one("path-traced slab", Self::new_app))
    }

    /// The same, started now and for this test alone.
    pub fn alone(&self) -> App {
        let mut app = Self::new_app();
        app.insert_resource(self.settings());
        app
    }

    fn shown_in(&self, mut app: SharedApp) -> SharedApp {
        app.insert_resource(self.settings());
        app
    }

    fn new_app() -> App {
        // In place before the built-in model is registered.
        let insert = |app: &mut App| {
            app.insert_resource(ModelShader(SHADER.to_owned()));
        };
        new_clouds_app_with((insert, CloudsPlugin))
    }
}

/// The text of a model such as a user may write: extinction `extinction` (1/m) everywhere between two altitudes (m).
pub fn slab_text(bottom: f32, top: f32, extinction: f32) -> ModelShader {
    ModelShader(format!(
        "import package::model::{{medium::{{Medium, empty_medium}}, planet::altitude}};
        fn model_bounds() -> vec2<f32> {{ return vec2({bottom:?}, {top:?}); }}
        fn density_bound(p: vec3<f32>, lod: f32) -> f32 {{ return 1.0; }}
        fn sample_medium(p: vec3<f32>, lod: f32) -> Medium {{
            let height = (altitude(p, 6360000.0) - {bottom:?}) / {:?};
            if height < 0.0 || height > 1.0 {{ return empty_medium(); }}
            return Medium(1.0, {extinction:?}, vec3(0.99), 0.5, vec2(height, 1.0 - height) * {:?},
                vec4(1.0, 0.0, 0.0, 0.0));
        }}",
        top - bottom,
        top - bottom
    ))
}
