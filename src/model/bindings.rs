//! Bind group 1: the model's uniform, textures and samplers.

use bevy::{
    prelude::*,
    render::{
        render_resource::{binding_types::*, *},
        renderer::RenderDevice,
    },
};

use super::ModelUniform;
use crate::textures::CloudTextureViews;

/// Layout and samplers of bind group 1.
#[derive(Resource)]
pub(crate) struct ModelBindings {
    pub layout: BindGroupLayoutDescriptor,
    tiling: Sampler,
    clamping: Sampler,
}

impl FromWorld for ModelBindings {
    fn from_world(world: &mut World) -> Self {
        let device = world.resource::<RenderDevice>();
        let sampler = |label, mode| {
            device.create_sampler(&SamplerDescriptor {
                label: Some(label),
                address_mode_u: mode,
                address_mode_v: mode,
                address_mode_w: mode,
                mag_filter: FilterMode::Linear,
                min_filter: FilterMode::Linear,
                mipmap_filter: MipmapFilterMode::Linear,
                ..default()
            })
        };
        let float = TextureSampleType::Float { filterable: true };
        Self {
            layout: BindGroupLayoutDescriptor::new(
                "cloud_model",
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::COMPUTE,
                    (
                        uniform_buffer::<ModelUniform>(false),
                        texture_3d(float),
                        texture_3d(float),
                        texture_2d(float),
                        texture_2d(float),
                        texture_2d(float),
                        sampler_layout(),
                        sampler_layout(),
                        texture_3d(float),
                        texture_3d(float),
                        texture_2d_array(float),
                        texture_2d(float),
                    ),
                ),
            ),
            tiling: sampler("cloud_tiling", AddressMode::Repeat),
            clamping: sampler("cloud_clamping", AddressMode::ClampToEdge),
        }
    }
}

fn sampler_layout() -> BindGroupLayoutEntryBuilder {
    sampler(SamplerBindingType::Filtering)
}

impl ModelBindings {
    /// The bind group over these textures; `None` while one is missing.
    pub fn bind_group(
        &self,
        device: &RenderDevice,
        cache: &PipelineCache,
        uniform: &UniformBuffer<ModelUniform>,
        views: &CloudTextureViews,
    ) -> Option<BindGroup> {
        Some(device.create_bind_group(
            "cloud_model",
            &cache.get_bind_group_layout(&self.layout),
            &BindGroupEntries::sequential((
                uniform.binding()?,
                views.billow.as_ref()?,
                views.wisp.as_ref()?,
                views.coverage.as_ref()?,
                views.type_map.as_ref()?,
                views.gradient.as_ref()?,
                &self.tiling,
                &self.clamping,
                // Nothing reads them before there is a layer.
                views.shape.as_ref().or(views.billow.as_ref())?,
                views.detail.as_ref().or(views.billow.as_ref())?,
                views.weather.as_ref()?,
                views.swirl.as_ref()?,
            )),
        ))
    }
}
