//! How cloud is seen: sky, march, accumulate, composite. One folder a stage, shader inside.

mod bind_groups;
mod buffer;
mod counts;
mod frame;
pub(crate) mod history;
mod order;
mod passes;
pub(crate) mod phase_slots;
mod pipelines;
mod reproject;
mod status;
mod versions;
mod view;
mod winds;
mod zones;

use bevy::{
    asset::embedded_asset,
    core_pipeline::{
        core_3d::{Transparent3d, main_opaque_pass_3d, main_transparent_pass_3d, prepare_core_3d_depth_textures},
        schedule::{Core3d, Core3dSystems},
    },
    pbr::main_transmissive_pass_3d,
    prelude::*,
    render::{
        GpuResourceAppExt, Render, RenderStartup, RenderSystems,
        render_phase::{AddRenderCommand, DrawFunctions, sort_phase_system},
    },
    shader::load_shader_library,
};

use crate::model::ModelBindings;

pub use buffer::{CloudBuffer, CloudDepth, CloudFrame, CloudNoise};
pub use counts::CloudCounts;
pub(crate) use frame::FrameUniform;
pub(crate) use phase_slots::{PHASE_SLOTS, phase_tables_layout};
pub(crate) use pipelines::{CloudPipelines, depth_layout};
pub(crate) use reproject::HeldUniform;
pub use status::CloudStatus;
pub(crate) use status::StatusFlags;

/// Shaders, and the systems of the render world.
pub(crate) struct CloudRenderPlugin;

impl Plugin for CloudRenderPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "frame.wesl");
        load_shader_library!(app, "march/phase.wesl");
        load_shader_library!(app, "march/table.wesl");
        load_shader_library!(app, "march/integrate.wesl");
        load_shader_library!(app, "march/sources.wesl");
        load_shader_library!(app, "march/shade.wesl");
        load_shader_library!(app, "march/lighting.wesl");
        load_shader_library!(app, "march/aerial.wesl");
        load_shader_library!(app, "march/debug.wesl");
        load_shader_library!(app, "march/count.wesl");
        load_shader_library!(app, "march/past.wesl");
        load_shader_library!(app, "march/limit.wesl");
        load_shader_library!(app, "march/far.wesl");
        load_shader_library!(app, "accumulate/held.wesl");
        load_shader_library!(app, "accumulate/around.wesl");
        load_shader_library!(app, "accumulate/reproject.wesl");
        load_shader_library!(app, "composite/fade.wesl");
        load_shader_library!(app, "composite/upsample.wesl");
        load_shader_library!(app, "composite/fine.wesl");
        load_shader_library!(app, "composite/pixel.wesl");
        load_shader_library!(app, "sky/sky.wesl");
        load_shader_library!(app, "sky/air.wesl");
        load_shader_library!(app, "sky/over.wesl");
        load_shader_library!(app, "sky/sun.wesl");
        embedded_asset!(app, "march/march.wesl");
        embedded_asset!(app, "accumulate/accumulate.wesl");
        embedded_asset!(app, "accumulate/blend.wesl");
        embedded_asset!(app, "composite/composite.wesl");
        embedded_asset!(app, "composite/draw.wesl");
        embedded_asset!(app, "composite/publish.wesl");
        embedded_asset!(app, "composite/depth.wesl");
        crate::reference::path_tracer::add_shaders(app);
        app.init_resource::<CloudStatus>()
            .register_type::<CloudBuffer>()
            .register_type::<CloudDepth>()
            .register_type::<CloudFrame>()
            .register_type::<CloudNoise>();
    }
}

/// Adds the render world's systems; called once the device is known to be able.
pub(crate) fn build_render(render_app: &mut SubApp) {
    render_app
        .init_resource::<view::ExtractedClouds>()
        .init_resource::<zones::ExtractedZones>()
        .init_resource::<DrawFunctions<Transparent3d>>()
        .add_render_command::<Transparent3d, order::DrawClouds>()
        .init_gpu_resource::<ModelBindings>()
        .init_gpu_resource::<pipelines::CloudPipelines>()
        .init_gpu_resource::<phase_slots::PhaseTableBuffer>()
        .add_systems(RenderStartup, view::forget_lost_device)
        .add_systems(ExtractSchedule, (view::extract_settings, view::extract_views, zones::extract_zones))
        .add_systems(
            Render,
            (
                view::request_depth
                    .in_set(RenderSystems::Prepare)
                    .before(prepare_core_3d_depth_textures)
                    // Others set flags of the same field, in any order; the system above alone reads it.
                    .ambiguous_with_all(),
                (buffer::refuse_unfit_images, view::prepare_views)
                    .chain()
                    .after(crate::textures::TextureSwaps)
                    .in_set(RenderSystems::PrepareResources),
                phase_slots::write_phase_tables.in_set(RenderSystems::PrepareResources),
                bind_groups::prepare_bind_groups.in_set(RenderSystems::PrepareBindGroups),
                order::sort_in.after(sort_phase_system::<Transparent3d>).in_set(RenderSystems::PhaseSort),
            ),
        )
        .add_systems(
            Core3d,
            (
                // All that is opaque is in the depth buffer: refracting things too, which Bevy takes for opaque.
                (passes::cloud_sky, passes::cloud_light, passes::cloud_accumulate, passes::cloud_composite)
                    .chain()
                    .after(main_opaque_pass_3d)
                    .after(main_transmissive_pass_3d)
                    .before(main_transparent_pass_3d)
                    .in_set(Core3dSystems::MainPass),
                // The other orders are drawn by the transparent pass itself.
                passes::cloud_draw_over::<false>.after(Core3dSystems::MainPass).before(Core3dSystems::EarlyPostProcess),
                passes::cloud_draw_over::<true>
                    .after(Core3dSystems::EarlyPostProcess)
                    .before(Core3dSystems::PostProcess),
            ),
        );
}
