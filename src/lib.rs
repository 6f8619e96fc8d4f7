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
//! presets, weather maps, METAR reports
//!          |  transition: one sky turns into another
//!          v
//! settings (resources)  ->  textures (baked on the GPU or loaded)  ->  model: "what is at p?"  ->  query (on the CPU)
//!          |                                                              |  one shader interface
//!          +------------->  phases (tables of phase functions)  ------+   |
//!                                                                     v   v
//!    per camera:      sky light -> march (or path tracer) -> accumulate -> composite
//!                     (after the opaque scene) -> drawn among transparent things, or over them
//! ```
//!
//! | part | what it is |
//! |---|---|
//! | [`settings`] | [`CloudModel`], [`CloudLayers`], [`CloudLighting`], [`CloudQuality`] and others; checks; presets |
//! | transition | [`CloudWeather`] turns one sky into another |
//! | [`weather`] | maps that say where a layer's cloud is: made from a recipe, painted, or read from a METAR report |
//! | [`textures`] | noise volumes, cloud maps, blue noise; slots for your own |
//! | [`phases`] | phase functions that are tables: computed, or your own |
//! | model | the shader module that says where cloud is; [`ModelShader`] replaces it |
//! | render | the passes of each camera with a [`CloudView`] |
//! | query | [`CloudField`] answers on the CPU: density, visibility, sunlight |
//! | [`mod@reference`] | the renderer's maths on the CPU, and what the path tracer is tested against |
//!
//! The plugin spawns nothing: the sun is the scene's brightest `DirectionalLight`, the sky its `Atmosphere`.
//!
//! Shaders of yours import from `bevy_cumulus`: [`cloud_fade`](CloudDepth) for materials, and what a
//! [`ModelShader`] is made of. What other modules hold may move in any version.
#![warn(missing_docs)]

mod capability;
#[cfg(feature = "inspector")]
pub mod inspector;
mod model;
pub mod phases;
pub mod reference;
mod render;
pub mod settings;
#[doc(hidden)]
pub mod testing;
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

/// What users' shaders import from `bevy_cumulus`: a module at the crate's root, whose names stay when modules move.
pub(crate) const PUBLIC_SHADER: &str = include_str!("lib.wesl");
/// Path whose module path is the crate's name alone. `embedded_asset!` has none for a file at the root.
pub(crate) const PUBLIC_SHADER_PATH: &str = "embedded://bevy_cumulus.wesl";

/// Keeps [`PUBLIC_SHADER`] loaded.
#[derive(Resource)]
struct PublicShader {
    _shader: Handle<Shader>,
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
        let shader = Shader::from_wesl(PUBLIC_SHADER, PUBLIC_SHADER_PATH);
        let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(shader);
        app.insert_resource(PublicShader { _shader: shader });
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

/// Compiles the Rust in README.md and docs/.
#[cfg(doctest)]
mod pages {
    macro_rules! pages {
        ($($(#[$when:meta])? $name:ident: $file:literal),* $(,)?) => {
            $($(#[$when])? #[doc = include_str!($file)] struct $name;)*
        };
    }
    pages! {
        Readme: "../README.md",
        HowItWorks: "../docs/how-it-works.md",
        Queries: "../docs/queries.md",
        Shaders: "../docs/shaders.md",
        Transparency: "../docs/transparency.md",
        #[cfg(feature = "metar")]
        Weather: "../docs/weather.md",
    }
}
