//! Where cloud is. Knows no camera, pass or history.
//!
//! The renderer sees a model through one shader module, `bevy_cumulus::model::model`, with the three functions
//! that `medium.wesl` documents. The built-in one is the thesis's layer and weather-map layers; [`ModelShader`] replaces it.

mod bindings;
mod check;
mod layers;
mod lines;
mod places;
mod space;
mod uniform;
mod zone_at;

use bevy::{prelude::*, shader::load_shader_library};

pub(crate) use bindings::ModelBindings;
pub(crate) use layers::{FINER, LayerSizes, LayerUniform, MAX_ZONES, ZoneUniform, decks};
pub(crate) use places::{NEXT, WAVES};
pub(crate) use space::TangentFrame;
pub(crate) use uniform::{ModelSettings, ModelUniform, TexelSizes};
pub(crate) use zone_at::ZoneAt;

/// Path whose module path is the model's: a shader registered under it takes the built-in one's place.
const MODEL_PATH: &str = "embedded://bevy_cumulus/model/model.wesl";

/// A model of your own, as WESL source, in place of the built-in one (example `custom_model`).
///
/// Insert it before adding [`CloudsPlugin`](crate::CloudsPlugin), or at any time later. The source imports what it needs
/// from `bevy_cumulus` and must define three functions:
/// ```wgsl
/// import bevy_cumulus::{Medium, ONE_PHASE, empty_medium, altitude, planet_radius};
///
/// // Lowest and highest altitude that may hold cloud (m).
/// fn model_bounds() -> vec2<f32> { return vec2(1000.0, 1500.0); }
///
/// // Upper bound of the density within 2^lod metres of p.
/// fn density_bound(p: vec3<f32>, lod: f32) -> f32 { return 1.0; }
///
/// // The medium at p, filtered over 2^lod metres.
/// fn sample_medium(p: vec3<f32>, lod: f32) -> Medium {
///     let h = altitude(p, planet_radius());
///     if h < 1000.0 || h > 1500.0 { return empty_medium(); }
///     return Medium(1.0, 0.002, vec3(0.999), 1.0, vec2(h - 1000.0, 1500.0 - h), ONE_PHASE);
/// }
/// ```
/// `docs/shaders.md` has the optional ones and all that may be imported. The module is compiled on the CPU before it is
/// shown: one that does not compile is logged with its line and told as [`ModelShaderError`], and the last good model
/// stays, which is the built-in one at first. Remove the resource, and the built-in model is back.
#[derive(Resource, Clone, Debug)]
pub struct ModelShader(pub String);

/// A [`ModelShader`] that does not compile. The last good model stays.
#[derive(Message, Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the model does not compile{}: {reason}", .line.map(|line| format!(", line {line}")).unwrap_or_default())]
pub struct ModelShaderError {
    /// Line of the source, from 1, where one is to blame.
    pub line: Option<usize>,
    /// What the compiler says.
    pub reason: String,
}

/// The model's module: one asset for as long as the app lives, so that whatever it holds, pipelines follow.
#[derive(Resource)]
pub(crate) struct ModelModule {
    shader: Handle<Shader>,
    /// Whether it holds a user's model.
    pub is_custom: bool,
}

fn built_in() -> Shader {
    Shader::from_wesl(include_str!("model.wesl"), MODEL_PATH)
}

pub(crate) struct CloudModelPlugin;

impl Plugin for CloudModelPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "medium.wesl");
        load_shader_library!(app, "planet.wesl");
        load_shader_library!(app, "data.wesl");
        load_shader_library!(app, "zones.wesl");
        load_shader_library!(app, "map.wesl");
        load_shader_library!(app, "places.wesl");
        load_shader_library!(app, "profile.wesl");
        load_shader_library!(app, "layer.wesl");
        // Not loaded as an embedded asset: that would come later, and could take the place of a user's module.
        let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(built_in());
        app.insert_resource(ModelModule { shader, is_custom: false })
            .add_message::<ModelShaderError>()
            .add_systems(PreUpdate, replace_model);
    }
}

/// What a model is given that does not have it: one deck, of which all is one part.
const GIVEN: [(&str, &str); 3] = [
    (
        "model_deck",
        "
fn model_deck(i: u32) -> vec2<f32> {
    if i > 0u { return vec2<f32>(1.0, 0.0); }
    return model_bounds();
}
",
    ),
    ("model_part", "fn model_part(i: u32) -> vec2<f32> { return model_deck(i); }\n"),
    ("sample_part", "fn sample_part(i: u32, p: vec3<f32>, lod: f32) -> Medium { return sample_medium(p, lod); }\n"),
];

fn replace_model(
    source: Option<Res<ModelShader>>,
    mut module: ResMut<ModelModule>,
    mut shaders: ResMut<Assets<Shader>>,
    mut loaded: MessageReader<AssetEvent<Shader>>,
    mut errors: MessageWriter<ModelShaderError>,
    mut waits: Local<bool>,
) {
    let more = loaded.read().any(|event| matches!(event, AssetEvent::Added { .. } | AssetEvent::Modified { .. }));
    let Some(source) = source else {
        *waits = false;
        if module.is_custom {
            put(&mut module, &mut shaders, built_in(), false);
        }
        return;
    };
    let asked = source.is_changed() || *waits && more;
    if !asked {
        return;
    }
    let mut text = source.0.clone();
    for (name, given) in GIVEN {
        if !text.contains(&format!("fn {name}")) {
            text.push('\n');
            text.push_str(given);
        }
    }
    let verdict = check::check(&text, shaders.iter());
    *waits = verdict == check::Verdict::Waits;
    match verdict {
        // What it imports is still loading; Bevy has logged what that is.
        check::Verdict::Waits => {}
        check::Verdict::Bad(error) => {
            error!("clouds: {error}; the last good model stays");
            errors.write(error);
        }
        check::Verdict::Good => put(&mut module, &mut shaders, Shader::from_wesl(text, MODEL_PATH), true),
    }
}

fn put(module: &mut ModelModule, shaders: &mut Assets<Shader>, shader: Shader, is_custom: bool) {
    module.is_custom = is_custom;
    if shaders.insert(module.shader.id(), shader).is_err() {
        error!("clouds: the model's shader asset is gone; the model was not replaced");
    }
}
