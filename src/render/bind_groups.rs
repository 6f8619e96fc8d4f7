//! Each view's bind groups, made anew every frame as Bevy does.

use bevy::{
    pbr::{
        ExtractedAtmosphere, GpuAtmosphereSettings, GpuScatteringMedium, ScatteringMediumSampler,
        resources::{
            AtmosphereSampler, AtmosphereTextures, AtmosphereTransforms, AtmosphereTransformsOffset, GpuAtmosphere,
        },
    },
    prelude::*,
    render::{
        extract_component::{ComponentUniforms, DynamicUniformIndex},
        render_asset::RenderAssets,
        render_resource::*,
        renderer::RenderDevice,
        texture::GpuImage,
        view::{ExtractedView, Msaa, ViewDepthStencilTexture},
    },
};

use super::{
    StatusFlags,
    history::CloudHistory,
    phase_slots::PhaseTableBuffer,
    pipelines::{CloudPipelines, SKY_LIGHT_BYTES, Variant},
    view::{CloudUniforms, ExtractedCloudView},
};
use crate::{model::ModelBindings, textures::CloudTextureViews};

/// One view's bind groups and pipelines for this frame.
#[derive(Component)]
pub(crate) struct CloudBindGroups {
    /// Whether it is the picture that was asked for that they draw.
    pub ready: bool,
    /// Group 0 and its dynamic offsets: Bevy's atmosphere, or nothing.
    pub air: BindGroup,
    pub air_offsets: Vec<u32>,
    pub empty: BindGroup,
    pub model: BindGroup,
    pub sky: (CachedComputePipelineId, BindGroup),
    pub light: Light,
    pub composite: (CachedComputePipelineId, BindGroup),
    pub draw: (CachedRenderPipelineId, BindGroup),
    /// For the app: the picture, and where the clouds are.
    pub publish: Option<(CachedComputePipelineId, BindGroup)>,
    pub depth: Option<(CachedComputePipelineId, BindGroup)>,
}

/// How the cloud's light is found.
pub(crate) enum Light {
    March { march: (CachedComputePipelineId, BindGroup), accumulate: (CachedComputePipelineId, BindGroup) },
    PathTrace { trace: (CachedComputePipelineId, BindGroup), noise: Option<(CachedComputePipelineId, BindGroup)> },
}

/// A view's ambient light, written by the sky stage.
#[derive(Component)]
pub(crate) struct SkyLightBuffer(Buffer);

/// Bevy's atmosphere on a view.
type Air = (
    &'static ExtractedAtmosphere,
    &'static AtmosphereTextures,
    &'static DynamicUniformIndex<GpuAtmosphere>,
    &'static DynamicUniformIndex<GpuAtmosphereSettings>,
    &'static AtmosphereTransformsOffset,
);

#[derive(bevy::ecs::query::QueryData)]
pub(crate) struct BoundView {
    entity: Entity,
    cloud: &'static ExtractedCloudView,
    view: &'static ExtractedView,
    msaa: &'static Msaa,
    depth: &'static ViewDepthStencilTexture,
    history: &'static CloudHistory,
    uniforms: &'static CloudUniforms,
    sky_light: Option<&'static SkyLightBuffer>,
    air: Option<Air>,
}

/// Resources of Bevy's atmosphere; absent where its plugin could not load.
#[derive(bevy::ecs::system::SystemParam)]
pub(crate) struct AirResources<'w> {
    sampler: Option<Res<'w, AtmosphereSampler>>,
    atmospheres: Option<Res<'w, ComponentUniforms<GpuAtmosphere>>>,
    settings: Option<Res<'w, ComponentUniforms<GpuAtmosphereSettings>>>,
    transforms: Option<Res<'w, AtmosphereTransforms>>,
    media: Option<Res<'w, RenderAssets<GpuScatteringMedium>>>,
    medium_sampler: Option<Res<'w, ScatteringMediumSampler>>,
}

impl AirResources<'_> {
    fn bind_group(
        &self,
        device: &RenderDevice,
        layout: &BindGroupLayout,
        air_marched: bool,
        atmosphere: &ExtractedAtmosphere,
        textures: &AtmosphereTextures,
    ) -> Option<BindGroup> {
        let mut entries = BindGroupEntries::with_indices((
            (0, self.atmospheres.as_ref()?.binding()?),
            (1, self.settings.as_ref()?.binding()?),
            (2, self.transforms.as_ref()?.uniforms().binding()?),
            (8, &textures.transmittance_lut.default_view),
            (10, &textures.sky_view_lut.default_view),
            (11, &textures.aerial_view_lut.default_view),
            (12, &***self.sampler.as_ref()?),
        ))
        .to_vec();
        if air_marched {
            let medium = self.media.as_ref()?.get(atmosphere.medium)?;
            entries.extend_from_slice(&BindGroupEntries::with_indices((
                (5, &medium.density_lut_view),
                (6, &medium.scattering_lut_view),
                (7, self.medium_sampler.as_ref()?.sampler()),
                (9, &textures.multiscattering_lut.default_view),
            )));
        }
        Some(device.create_bind_group("cloud_air", layout, &entries))
    }
}

pub(crate) fn prepare_bind_groups(
    mut commands: Commands,
    views: Query<BoundView>,
    air_resources: AirResources,
    textures: Res<CloudTextureViews>,
    images: Res<RenderAssets<GpuImage>>,
    model: Res<ModelBindings>,
    phase_tables: Res<PhaseTableBuffer>,
    mut pipelines: ResMut<CloudPipelines>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    status: Res<StatusFlags>,
) {
    let mut ready = !views.is_empty();
    for item in &views {
        let own;
        let sky_light = match item.sky_light {
            Some(buffer) => &buffer.0,
            None => {
                own = device.create_buffer(&BufferDescriptor {
                    label: Some("cloud_sky_light"),
                    size: SKY_LIGHT_BYTES,
                    usage: BufferUsages::STORAGE,
                    mapped_at_creation: false,
                });
                commands.entity(item.entity).insert(SkyLightBuffer(own.clone()));
                &own
            }
        };
        let groups = view_bind_groups(
            &item,
            sky_light,
            &air_resources,
            &textures,
            &images,
            &model,
            &phase_tables.buffer,
            &mut pipelines,
            &cache,
            &device,
        );
        match groups {
            Some(groups) => {
                ready &= groups.ready;
                commands.entity(item.entity).insert(groups);
            }
            None => {
                ready = false;
                commands.entity(item.entity).remove::<CloudBindGroups>();
            }
        }
    }
    // What layers read comes after what the thesis's layer does.
    let layers_wait =
        textures.maps_pending || textures.bake_pending && textures.layers_wanted && textures.shape.is_none();
    status.set_ready(ready && !layers_wait);
}

fn view_bind_groups(
    item: &BoundViewItem,
    sky_light: &Buffer,
    air_resources: &AirResources,
    textures: &CloudTextureViews,
    images: &RenderAssets<GpuImage>,
    model: &ModelBindings,
    phase_tables: &Buffer,
    pipelines: &mut CloudPipelines,
    cache: &PipelineCache,
    device: &RenderDevice,
) -> Option<CloudBindGroups> {
    let depth = item.depth.attachment.depth_stencil_views().depth_only_view()?;
    let layout = |d: &BindGroupLayoutDescriptor| cache.get_bind_group_layout(d);
    let air = item.air.as_ref().and_then(|(atmosphere, textures, index, settings, transform)| {
        let group =
            air_resources.bind_group(device, &layout(&pipelines.air), pipelines.air_marched, atmosphere, textures)?;
        Some((group, vec![index.index(), settings.index(), transform.index()]))
    });
    let multisampled = *item.msaa != Msaa::Off;
    let ms = usize::from(multisampled);
    let variant = Variant {
        atmosphere: air.is_some(),
        multisampled,
        drawn_into: item.cloud.drawn_into(*item.msaa),
        target: item.view.target_format,
        debug: item.cloud.debug.shader(),
        path_traced: item.cloud.is_path_traced(),
    };
    let ids = pipelines.get(cache, model, variant);
    // All stages or none: a composite without a march would blend what nobody has written.
    if !ids.drawable(cache) {
        return None;
    }
    let empty = device.create_bind_group("cloud_empty", &layout(&pipelines.empty), &[]);
    let (air, air_offsets) = air.unwrap_or_else(|| (empty.clone(), Vec::new()));
    let frame = item.uniforms.frame.binding()?;
    let world_from_local = item.uniforms.world_from_local.binding()?;
    let held = item.uniforms.held.binding()?;
    let blue_noise = textures.blue_noise.as_ref()?;
    let history = item.history;
    let group = |label: &'static str, descriptor: &BindGroupLayoutDescriptor, entries: &[BindGroupEntry]| {
        device.create_bind_group(label, &layout(descriptor), entries)
    };
    // One of two ways to make a picture of the frames.
    let picture_group = || match history.marched_after() {
        Some(marched_after) => {
            let entries = BindGroupEntries::sequential((
                frame.clone(),
                &history.frames_view,
                history.sum_before(),
                depth,
                &history.marched_view,
                held.clone(),
                history.marched_before(),
                history.sum_after(),
                marched_after,
                &history.distances,
                history.marched_distances(),
            ));
            (ids.blend, group("cloud_blend", &pipelines.blend[ms], &entries))
        }
        None => {
            let entries = BindGroupEntries::sequential((
                frame.clone(),
                &history.frames_view,
                history.sum_before(),
                history.sum_after(),
                &history.marched_view,
                held.clone(),
            ));
            (ids.accumulate, group("cloud_accumulate", &pipelines.accumulate, &entries))
        }
    };
    let light = match ids.traced {
        None => Light::March {
            march: (
                ids.drawable_march(cache),
                group(
                    "cloud_march",
                    &pipelines.march[ms],
                    &BindGroupEntries::sequential((
                        frame.clone(),
                        sky_light.as_entire_binding(),
                        blue_noise,
                        depth,
                        history.newest(),
                        history.marched_distances(),
                        world_from_local.clone(),
                        history.marched_before(),
                        history.marched_now(),
                        held.clone(),
                        phase_tables.as_entire_binding(),
                    )),
                ),
            ),
            accumulate: picture_group(),
        },
        Some([trace, noise]) => {
            let [before, after] = history.moments()?;
            let entries = BindGroupEntries::with_indices((
                (0, frame.clone()),
                (1, history.sum_before()),
                (2, before),
                (3, depth),
                (4, history.sum_after()),
                (5, &history.distances),
                (6, world_from_local.clone()),
                (7, after),
                (10, phase_tables.as_entire_binding()),
            ));
            let image = item.cloud.noise.and_then(|id| images.get(id));
            Light::PathTrace {
                trace: (trace, group("cloud_path_trace", &pipelines.path_tracer.trace[ms], &entries)),
                noise: image.map(|image| {
                    let entries =
                        BindGroupEntries::sequential((frame.clone(), history.sum_after(), after, &image.texture_view));
                    (noise, group("cloud_noise", &pipelines.path_tracer.noise, &entries))
                }),
            }
        }
    };
    let full_size = |id, label, layout: &[BindGroupLayoutDescriptor; 2], written: &TextureView| {
        let entries = BindGroupEntries::sequential((
            frame.clone(),
            &history.frames_view,
            history.sum_after(),
            depth,
            &history.marched_view,
            held.clone(),
            &history.distances,
            written,
            blue_noise,
        ));
        (id, group(label, &layout[ms], &entries))
    };
    let handed_out = |image: Option<AssetId<Image>>| image.and_then(|id| images.get(id));
    let draw = BindGroupEntries::sequential((frame.clone(), &history.resolved));
    Some(CloudBindGroups {
        ready: ids.ready(cache),
        model: model.bind_group(device, cache, &item.uniforms.model, textures)?,
        sky: (
            ids.sky,
            group(
                "cloud_sky",
                &pipelines.sky,
                &BindGroupEntries::sequential((frame.clone(), sky_light.as_entire_binding(), world_from_local)),
            ),
        ),
        light,
        composite: full_size(ids.composite, "cloud_composite", &pipelines.composite, &history.resolved),
        draw: (ids.draw, group("cloud_draw", &pipelines.draw, &draw)),
        publish: handed_out(item.cloud.buffer)
            .map(|image| full_size(ids.publish, "cloud_publish", &pipelines.publish, &image.texture_view)),
        depth: handed_out(item.cloud.depth)
            .map(|image| full_size(ids.depth, "cloud_depth", &pipelines.composite, &image.texture_view)),
        air,
        air_offsets,
        empty,
    })
}
