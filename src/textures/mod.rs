//! Noise volumes, cloud maps and sampling patterns: baked by compute, or a user's images.
//!
//! | Texture | What it is | Made by |
//! |---|---|---|
//! | billow | volume of inverted Worley fBm, rgba four first octaves | `volumes.wesl` |
//! | wisp | volume of Perlin fBm, likewise | `volumes.wesl` |
//! | coverage | pyramid: r where clouds are, g its bound | `maps.wesl`, `pyramid.wesl` |
//! | type map | pyramid: r how tall they grow, g its bound | `maps.wesl`, `pyramid.wesl` |
//! | gradient | r how much cloud a type has at a height | `maps.wesl` |
//! | blue noise | rgb where a pixel samples | [`blue_noise`], shipped as a file |
//!
//! [`CloudTextures`](crate::settings::CloudTextures) says how they are baked,
//! [`CloudTextureSlots`](crate::settings::CloudTextureSlots) puts a user's images in their place.
//! [`CloudTextureStatus`] says how far baking is, [`CloudTextureError`] what is wrong with an image.

mod bake;
pub mod blue_noise;
#[doc(hidden)]
pub(crate) mod cpu_copies;
mod job;
pub mod n_rooks;
mod pipelines;
mod profile;
mod progress;
pub(crate) mod readback;
mod recipe;
mod slots;
mod texel;
pub(crate) mod weather_maps;

use std::sync::atomic::Ordering::Relaxed;

use bevy::{
    app::SubApp,
    asset::embedded_asset,
    core_pipeline::schedule::camera_driver,
    prelude::*,
    render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderSystems, renderer::RenderGraph},
    shader::load_shader_library,
};

pub(crate) use bake::{Bakery, CloudTextureViews};
pub use bake::{GPU_FRAMES, TEXEL_OCTAVES_PER_FRAME};
pub use profile::{CUMULUS_PROFILE, GRADIENT_SIZE, STRATUS_PROFILE, vertical_profile};
pub use progress::CloudTextureStatus;
pub use slots::{CloudTextureError, CloudTextureFault, CloudTextureSlot};
pub(crate) use texel::decoder;

/// Where textures change hands in `Render`: what reads them comes after.
#[derive(SystemSet, Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct TextureSwaps;

/// The main-world half: shaders, slots, status. The render half is [`build_render`].
pub(crate) struct CloudTexturesPlugin;

impl Plugin for CloudTexturesPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "noise.wesl");
        embedded_asset!(app, "volumes.wesl");
        embedded_asset!(app, "volume_mip.wesl");
        embedded_asset!(app, "maps.wesl");
        embedded_asset!(app, "pyramid.wesl");
        let progress = progress::Progress::default();
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app.insert_resource(progress.clone());
        }
        app.insert_resource(progress)
            .init_resource::<CloudTextureStatus>()
            .init_resource::<slots::SlotStates>()
            .register_type::<CloudTextureStatus>()
            .add_message::<CloudTextureError>()
            .add_systems(PreStartup, slots::load_blue_noise.run_if(resource_exists::<Assets<Image>>))
            .add_systems(First, progress::report.ambiguous_with(bevy::ecs::message::message_update_system))
            .init_resource::<weather_maps::LayerMaps>()
            .add_systems(
                Last,
                weather_maps::follow_layers.after(crate::settings::KeepGood).run_if(resource_exists::<Assets<Image>>),
            )
            .add_systems(Last, slots::check_slots.run_if(resource_exists::<Assets<Image>>));
    }
}

/// The render half, for devices that have compute shaders and can store to `rgba8unorm` and `rgba16float`. Call it once,
/// from `Plugin::finish`; without it nothing is baked and [`CloudTextureStatus::baking`] stays false.
pub(crate) fn build_render(render_app: &mut SubApp) {
    render_app
        .init_resource::<progress::Progress>()
        .init_resource::<bake::Wanted>()
        .init_resource::<weather_maps::WeatherMaps>();
    let progress = render_app.world().resource::<progress::Progress>();
    progress.0.enabled.store(true, Relaxed);
    progress.0.ask();
    render_app
        .init_gpu_resource::<pipelines::BakePipelines>()
        .init_gpu_resource::<bake::Bakery>()
        .init_gpu_resource::<weather_maps::Uploaded>()
        .add_systems(ExtractSchedule, (bake::extract, weather_maps::extract))
        .add_systems(
            Render,
            (bake::plan, weather_maps::upload).chain().in_set(RenderSystems::PrepareResources).in_set(TextureSwaps),
        )
        .add_systems(RenderGraph, bake::bake.before(camera_driver));
}
