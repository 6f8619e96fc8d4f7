//! Where cloud is. Knows no camera, pass or history.
//!
//! The renderer sees a model through one shader module, `bevy_cumulus::model::model`, with the three functions
//! that `medium.wesl` documents. The built-in one is the thesis's profile maps; [`ModelShader`] replaces it.

mod bindings;
mod probe;
mod space;
mod uniform;

use bevy::{asset::embedded_asset, prelude::*, shader::load_shader_library};

pub(crate) use bindings::ModelBindings;
pub(crate) use space::TangentFrame;
pub(crate) use uniform::{ModelUniform, TexelSizes};

/// Path whose module path is the model's: a shader registered under it takes the built-in one's place.
const MODEL_PATH: &str = "embedded://bevy_cumulus/model/model.wesl";

/// A model of your own, as WESL source, in place of the built-in one.
///
/// Insert it before adding [`CloudsPlugin`](crate::CloudsPlugin), or at any time later; bind group 1 stays as the
/// built-in model declares it, and a model need not use any of it. The source must define the three functions of
/// `bevy_cumulus::model::medium`'s comment. A compile error is logged with its line and no clouds are drawn.
#[derive(Resource, Clone, Debug)]
pub struct ModelShader(pub String);

#[derive(Resource, Default)]
struct ModelShaderHandle(Option<Handle<Shader>>);

pub(crate) struct CloudModelPlugin;

impl Plugin for CloudModelPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "medium.wesl");
        load_shader_library!(app, "planet.wesl");
        if app.world().contains_resource::<ModelShader>() {
            // The built-in module must not be registered after the user's, or it would take its place back.
            embedded_asset!(app, "model.wesl");
        } else {
            load_shader_library!(app, "model.wesl");
        }
        app.init_resource::<ModelShaderHandle>().add_systems(
            PreUpdate,
            register_model_shader.run_if(resource_exists_and_changed::<ModelShader>),
        );
    }
}

fn register_model_shader(
    source: Res<ModelShader>,
    mut held: ResMut<ModelShaderHandle>,
    mut shaders: ResMut<Assets<Shader>>,
) {
    let shader = Shader::from_wesl(source.0.clone(), MODEL_PATH);
    // The same asset again: the pipelines that use it are then built anew.
    let replaced = held.0.as_ref().is_some_and(|handle| shaders.insert(handle.id(), shader.clone()).is_ok());
    if !replaced {
        held.0 = Some(shaders.add(shader));
    }
}
