//! The path tracer's stage: the march's and the window's place is taken by one pass that adds a sample to each pixel.

use bevy::{
    asset::{embedded_asset, load_embedded_asset},
    prelude::*,
    render::render_resource::{binding_types::*, *},
    shader::load_shader_library,
};

use crate::render::{FrameUniform, depth_layout, phase_tables_layout};

pub(crate) fn add_shaders(app: &mut App) {
    load_shader_library!(app, "luminance.wesl");
    load_shader_library!(app, "rng.wesl");
    load_shader_library!(app, "scatter.wesl");
    load_shader_library!(app, "events.wesl");
    load_shader_library!(app, "tracking.wesl");
    load_shader_library!(app, "paths.wesl");
    embedded_asset!(app, "path_trace.wesl");
    embedded_asset!(app, "noise.wesl");
}

/// Layouts, one without and one with multisampling, and shaders.
pub(crate) struct PathTracer {
    pub trace: [BindGroupLayoutDescriptor; 2],
    pub noise: BindGroupLayoutDescriptor,
    pub trace_shader: Handle<Shader>,
    pub noise_shader: Handle<Shader>,
}

impl FromWorld for PathTracer {
    fn from_world(world: &mut World) -> Self {
        let unfiltered = || texture_2d(TextureSampleType::Float { filterable: false });
        let write = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
        let trace = |multisampled| {
            BindGroupLayoutDescriptor::new(
                "cloud_path_trace",
                &BindGroupLayoutEntries::with_indices(
                    ShaderStages::COMPUTE,
                    (
                        (0, uniform_buffer::<FrameUniform>(false)),
                        (1, unfiltered()),
                        (2, unfiltered()),
                        (3, depth_layout(multisampled)),
                        (4, write(TextureFormat::Rgba32Float)),
                        (5, write(TextureFormat::Rgba32Float)),
                        (6, uniform_buffer::<Mat4>(false)),
                        (7, write(TextureFormat::Rgba32Float)),
                        // The march's number: they share the shader module.
                        (10, phase_tables_layout()),
                    ),
                ),
            )
        };
        Self {
            trace: [trace(false), trace(true)],
            noise: BindGroupLayoutDescriptor::new(
                "cloud_noise",
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::COMPUTE,
                    (
                        uniform_buffer::<FrameUniform>(false),
                        unfiltered(),
                        unfiltered(),
                        write(TextureFormat::Rgba32Float),
                    ),
                ),
            ),
            trace_shader: load_embedded_asset!(world, "path_trace.wesl"),
            noise_shader: load_embedded_asset!(world, "noise.wesl"),
        }
    }
}
