//! Volumetric clouds for Bevy: one plugin, one component on a camera.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_cumulus::prelude::*;
//!
//! fn main() {
//!     App::new().add_plugins((DefaultPlugins, CloudsPlugin)).add_systems(Startup, setup).run();
//! }
//!
//! fn setup(mut commands: Commands) {
//!     commands.spawn((Camera3d::default(), CloudView::default()));
//!     commands.spawn(DirectionalLight::default());
//! }
//! ```
//!
//! # A frame, top to bottom
//! ```text
//! settings (resources)  ->  textures (baked on the GPU or loaded as assets)  ->  model: "what is at p?"
//!                                                                                  |  one shader interface
//!    per camera:      sky light -> march -> accumulate -> composite   <------------+
//!                     (after the opaque scene) -> drawn among transparent things, or over them
//! ```
//!
//! | plugin | what it adds |
//! |---|---|
//! | settings | [`CloudModel`], [`CloudLighting`], [`CloudQuality`], [`CloudTextures`], [`CloudClock`]; checks; presets |
//! | textures | noise volumes, cloud maps, blue noise; slots for your own |
//! | phases | phase functions that are tables: computed, or your own |
//! | model | the shader module that says where cloud is; [`ModelShader`] replaces it |
//! | render | the passes of each camera with a [`CloudView`] |
//!
//! The plugin spawns nothing: the sun is the scene's brightest `DirectionalLight`, the sky its `Atmosphere`.
#![warn(missing_docs)]

mod capability;
#[cfg(feature = "inspector")]
pub mod inspector;
mod model;
pub mod phases;
pub mod reference;
mod render;
pub mod settings;
pub mod textures;
pub mod weather;

use bevy::{
    prelude::*,
    render::RenderApp,
    shader::{ShaderLoader, load_shader_library},
};

pub use model::{ModelShader, ModelShaderError};
pub use phases::{CloudPhaseStatus, CloudPhaseTable, CloudPhaseTables};
pub use reference::{
    keeper::{CloudField, CloudFieldError, CloudFieldPlugin},
    query::CloudSky,
};
pub use render::{CloudBuffer, CloudCounts, CloudDepth, CloudFrame, CloudNoise, CloudStatus};
pub use settings::{
    CloudClock, CloudDebugView, CloudLayer, CloudLayers, CloudLighting, CloudModel, CloudOrder, CloudPhase,
    CloudPreset, CloudPresetFile, CloudQuality, CloudSettings, CloudTextureSlots, CloudTextures, CloudView,
    CloudWeather, CloudZone, ModelPhases,
};

/// What most users need.
pub mod prelude {
    pub use crate::{
        CloudBuffer, CloudDepth, CloudField, CloudFieldPlugin, CloudSky, CloudStatus, CloudsPlugin,
        settings::{
            CloudClock, CloudDebugView, CloudLayer, CloudLayers, CloudLighting, CloudMethod, CloudModel, CloudOrder,
            CloudPhase, CloudPreset, CloudPresetFile, CloudQuality, CloudSettings, CloudTextureSlots, CloudTextures,
            CloudView, CloudWeather, CloudZone, Erosion, Integration, MarchResolution, PhaseFunction, TemporalMode,
            UpscaleBlock,
        },
        weather::{WeatherMap, WeatherRecipe},
    };
}

/// Adds volumetric clouds to every camera with a [`CloudView`].
///
/// Add it after `DefaultPlugins`. On a device that cannot run compute shaders it warns once and draws nothing.
pub struct CloudsPlugin;

impl Plugin for CloudsPlugin {
    fn build(&self, app: &mut App) {
        // Without Bevy's renderer, as on a server, nobody else has made room for these.
        if !app.world().contains_resource::<Assets<Shader>>() {
            app.init_asset::<Shader>().init_asset_loader::<ShaderLoader>();
        }
        if !app.world().contains_resource::<Assets<Image>>() {
            app.init_asset::<Image>();
        }
        load_shader_library!(app, "counts.wesl");
        app.add_plugins((
            settings::CloudSettingsPlugin,
            textures::CloudTexturesPlugin,
            model::CloudModelPlugin,
            phases::CloudPhasesPlugin,
            render::CloudRenderPlugin,
        ));
    }

    fn finish(&self, app: &mut App) {
        let status = app.world().resource::<CloudStatus>().clone();
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            status.set_unsupported("there is no renderer (no RenderPlugin)".to_owned());
            return;
        };
        if let Some(reason) = capability::missing_capability(render_app.world()) {
            warn!("clouds are off: {reason}");
            status.set_unsupported(reason);
            return;
        }
        render_app.insert_resource(render::StatusFlags(status.0.clone()));
        textures::build_render(render_app);
        render::build_render(render_app);
    }
}

/// Compiles the README's quick start.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
