//! Layouts, pipelines and bind groups of all stages. Built on demand: a variant a stage for atmosphere and MSAA.

use bevy::{
    asset::load_embedded_asset,
    core_pipeline::FullscreenShader,
    pbr::{
        GpuAtmosphereSettings,
        resources::{
            AtmosphereSampler, AtmosphereTextures, AtmosphereTransform, AtmosphereTransforms,
            AtmosphereTransformsOffset, GpuAtmosphere,
        },
    },
    platform::collections::HashMap,
    prelude::*,
    render::{
        extract_component::{ComponentUniforms, DynamicUniformIndex},
        render_asset::RenderAssets,
        render_resource::{binding_types::*, *},
        renderer::RenderDevice,
        texture::GpuImage,
        view::{ExtractedView, Msaa, ViewDepthStencilTexture},
    },
};

use super::{
    StatusFlags,
    frame::FrameUniform,
    history::CloudHistory,
    view::{CloudUniforms, ExtractedCloudView},
};
use crate::{model::ModelBindings, textures::CloudTextureViews};

/// What a stage's pipeline depends on.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Variant {
    atmosphere: bool,
    multisampled: bool,
    target: TextureFormat,
}

/// Pipelines of one variant.
#[derive(Clone, Copy)]
struct Pipelines {
    sky: CachedComputePipelineId,
    march: CachedComputePipelineId,
    accumulate: CachedComputePipelineId,
    composite: CachedRenderPipelineId,
    publish: CachedComputePipelineId,
}

/// Layouts, shaders, and the pipelines made so far.
#[derive(Resource)]
pub(crate) struct CloudPipelines {
    empty: BindGroupLayoutDescriptor,
    air: BindGroupLayoutDescriptor,
    sky: BindGroupLayoutDescriptor,
    march: [BindGroupLayoutDescriptor; 2],
    accumulate: BindGroupLayoutDescriptor,
    composite: [BindGroupLayoutDescriptor; 2],
    publish: [BindGroupLayoutDescriptor; 2],
    shaders: [Handle<Shader>; 5],
    fullscreen: FullscreenShader,
    made: HashMap<Variant, Pipelines>,
}

/// One view's bind groups and pipelines for this frame.
#[derive(Component)]
pub(crate) struct CloudBindGroups {
    /// Group 0 and its dynamic offsets: Bevy's atmosphere, or nothing.
    pub air: BindGroup,
    pub air_offsets: Vec<u32>,
    pub empty: BindGroup,
    pub model: BindGroup,
    pub sky: (CachedComputePipelineId, BindGroup),
    pub march: (CachedComputePipelineId, BindGroup),
    pub accumulate: (CachedComputePipelineId, BindGroup),
    pub composite: (CachedRenderPipelineId, BindGroup),
    pub publish: Option<(CachedComputePipelineId, BindGroup)>,
}

/// A view's ambient light, written by the sky stage.
#[derive(Component)]
pub(crate) struct SkyLightBuffer(Buffer);

const SKY_LIGHT_BYTES: u64 = 32;

fn depth_layout(multisampled: bool) -> BindGroupLayoutEntryBuilder {
    if multisampled { texture_depth_2d_multisampled() } else { texture_depth_2d() }
}

impl FromWorld for CloudPipelines {
    fn from_world(world: &mut World) -> Self {
        let compute = ShaderStages::COMPUTE;
        let unfiltered = TextureSampleType::Float { filterable: false };
        let filtered = TextureSampleType::Float { filterable: true };
        let bytes = std::num::NonZeroU64::new(SKY_LIGHT_BYTES);
        let frame = || uniform_buffer::<FrameUniform>(false);
        let write = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
        let march = |multisampled| {
            BindGroupLayoutDescriptor::new(
                "cloud_march",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (
                        frame(),
                        storage_buffer_read_only_sized(false, bytes),
                        texture_2d(unfiltered),
                        depth_layout(multisampled),
                        write(TextureFormat::Rgba16Float),
                        write(TextureFormat::Rg32Float),
                        uniform_buffer::<Mat4>(false),
                    ),
                ),
            )
        };
        let composite = |multisampled| {
            BindGroupLayoutDescriptor::new(
                "cloud_composite",
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::FRAGMENT,
                    (
                        frame(),
                        texture_2d(unfiltered),
                        texture_2d(unfiltered),
                        depth_layout(multisampled),
                    ),
                ),
            )
        };
        let publish = |multisampled| {
            BindGroupLayoutDescriptor::new(
                "cloud_publish",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (
                        frame(),
                        texture_2d(unfiltered),
                        texture_2d(unfiltered),
                        depth_layout(multisampled),
                        write(TextureFormat::Rgba32Float),
                    ),
                ),
            )
        };
        Self {
            empty: BindGroupLayoutDescriptor::new("cloud_empty", &[]),
            // Binding numbers are Bevy's, so that its atmosphere's own functions can be imported.
            air: BindGroupLayoutDescriptor::new(
                "cloud_air",
                &BindGroupLayoutEntries::with_indices(
                    compute,
                    (
                        (0, uniform_buffer::<GpuAtmosphere>(true)),
                        (1, uniform_buffer::<GpuAtmosphereSettings>(true)),
                        (2, uniform_buffer::<AtmosphereTransform>(true)),
                        (8, texture_2d(filtered)),
                        (10, texture_2d(filtered)),
                        (11, texture_3d(filtered)),
                        (12, sampler(SamplerBindingType::Filtering)),
                    ),
                ),
            ),
            sky: BindGroupLayoutDescriptor::new(
                "cloud_sky",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (frame(), storage_buffer_sized(false, bytes), uniform_buffer::<Mat4>(false)),
                ),
            ),
            march: [march(false), march(true)],
            accumulate: BindGroupLayoutDescriptor::new(
                "cloud_accumulate",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (
                        frame(),
                        texture_2d_array(unfiltered),
                        texture_2d(unfiltered),
                        write(TextureFormat::Rgba32Float),
                    ),
                ),
            ),
            composite: [composite(false), composite(true)],
            publish: [publish(false), publish(true)],
            shaders: [
                load_embedded_asset!(world, "sky/sky.wesl"),
                load_embedded_asset!(world, "march/march.wesl"),
                load_embedded_asset!(world, "accumulate/accumulate.wesl"),
                load_embedded_asset!(world, "composite/composite.wesl"),
                load_embedded_asset!(world, "composite/publish.wesl"),
            ],
            fullscreen: world.resource::<FullscreenShader>().clone(),
            made: HashMap::default(),
        }
    }
}

impl CloudPipelines {
    fn get(&mut self, cache: &PipelineCache, model: &ModelBindings, variant: Variant) -> Pipelines {
        if let Some(made) = self.made.get(&variant) {
            return *made;
        }
        let mut defs: Vec<bevy::shader::ShaderDefVal> = Vec::new();
        if variant.atmosphere {
            defs.push("ATMOSPHERE".into());
        }
        if variant.multisampled {
            defs.push("MULTISAMPLED".into());
        }
        let ms = usize::from(variant.multisampled);
        let air = if variant.atmosphere { &self.air } else { &self.empty };
        let compute = |label: &'static str, shader: usize, layout: [&BindGroupLayoutDescriptor; 3]| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(label.into()),
                layout: layout.into_iter().cloned().collect(),
                shader: self.shaders[shader].clone(),
                shader_defs: defs.clone(),
                entry_point: Some("main".into()),
                ..default()
            })
        };
        let premultiplied = BlendState {
            color: BlendComponent {
                src_factor: BlendFactor::One,
                dst_factor: BlendFactor::SrcAlpha,
                operation: BlendOperation::Add,
            },
            alpha: BlendComponent {
                src_factor: BlendFactor::Zero,
                dst_factor: BlendFactor::One,
                operation: BlendOperation::Add,
            },
        };
        let composite = cache.queue_render_pipeline(RenderPipelineDescriptor {
            label: Some("cloud_composite".into()),
            layout: vec![self.empty.clone(), self.empty.clone(), self.composite[ms].clone()],
            vertex: self.fullscreen.to_vertex_state(),
            fragment: Some(FragmentState {
                shader: self.shaders[3].clone(),
                shader_defs: defs.clone(),
                entry_point: Some("main".into()),
                targets: vec![Some(ColorTargetState {
                    format: variant.target,
                    blend: Some(premultiplied),
                    write_mask: ColorWrites::ALL,
                })],
                ..default()
            }),
            ..default()
        });
        let made = Pipelines {
            sky: compute("cloud_sky", 0, [air, &self.empty, &self.sky]),
            march: compute("cloud_march", 1, [air, &model.layout, &self.march[ms]]),
            accumulate: compute("cloud_accumulate", 2, [&self.empty, &self.empty, &self.accumulate]),
            composite,
            publish: compute("cloud_publish", 4, [&self.empty, &self.empty, &self.publish[ms]]),
        };
        self.made.insert(variant, made);
        made
    }
}

impl Pipelines {
    fn ready(self, cache: &PipelineCache) -> bool {
        [self.sky, self.march, self.accumulate, self.publish]
            .iter()
            .all(|id| cache.get_compute_pipeline(*id).is_some())
            && cache.get_render_pipeline(self.composite).is_some()
    }
}

/// Bevy's atmosphere on a view.
type Air = (
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
}

impl AirResources<'_> {
    fn bind_group(
        &self,
        device: &RenderDevice,
        layout: &BindGroupLayout,
        textures: &AtmosphereTextures,
    ) -> Option<BindGroup> {
        Some(device.create_bind_group(
            "cloud_air",
            layout,
            &BindGroupEntries::with_indices((
                (0, self.atmospheres.as_ref()?.binding()?),
                (1, self.settings.as_ref()?.binding()?),
                (2, self.transforms.as_ref()?.uniforms().binding()?),
                (8, &textures.transmittance_lut.default_view),
                (10, &textures.sky_view_lut.default_view),
                (11, &textures.aerial_view_lut.default_view),
                (12, &***self.sampler.as_ref()?),
            )),
        ))
    }
}

pub(crate) fn prepare_bind_groups(
    mut commands: Commands,
    views: Query<BoundView>,
    air_resources: AirResources,
    textures: Res<CloudTextureViews>,
    images: Res<RenderAssets<GpuImage>>,
    model: Res<ModelBindings>,
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
            &item, sky_light, &air_resources, &textures, &images, &model, &mut pipelines, &cache, &device,
        );
        match groups {
            Some((groups, view_ready)) => {
                ready &= view_ready;
                commands.entity(item.entity).insert(groups);
            }
            None => {
                ready = false;
                commands.entity(item.entity).remove::<CloudBindGroups>();
            }
        }
    }
    status.set_views_ready(ready);
}

#[expect(clippy::too_many_arguments, reason = "one call, of what the system was given")]
fn view_bind_groups(
    item: &BoundViewItem,
    sky_light: &Buffer,
    air_resources: &AirResources,
    textures: &CloudTextureViews,
    images: &RenderAssets<GpuImage>,
    model: &ModelBindings,
    pipelines: &mut CloudPipelines,
    cache: &PipelineCache,
    device: &RenderDevice,
) -> Option<(CloudBindGroups, bool)> {
    let depth = item.depth.attachment.depth_stencil_views().depth_only_view()?;
    let layout = |d: &BindGroupLayoutDescriptor| cache.get_bind_group_layout(d);
    let air = item.air.as_ref().and_then(|(textures, atmosphere, settings, transform)| {
        let group = air_resources.bind_group(device, &layout(&pipelines.air), textures)?;
        Some((group, vec![atmosphere.index(), settings.index(), transform.index()]))
    });
    let multisampled = *item.msaa != Msaa::Off;
    let ms = usize::from(multisampled);
    let variant =
        Variant { atmosphere: air.is_some(), multisampled, target: item.view.target_format };
    let ids = pipelines.get(cache, model, variant);
    let empty = device.create_bind_group("cloud_empty", &layout(&pipelines.empty), &[]);
    let (air, air_offsets) = air.unwrap_or_else(|| (empty.clone(), Vec::new()));
    let frame = item.uniforms.frame.binding()?;
    let world_from_local = item.uniforms.world_from_local.binding()?;
    let history = item.history;
    let group = |label: &'static str, descriptor: &BindGroupLayoutDescriptor, entries: &[BindGroupEntry]| {
        device.create_bind_group(label, &layout(descriptor), entries)
    };
    let march = group(
        "cloud_march",
        &pipelines.march[ms],
        &BindGroupEntries::sequential((
            frame.clone(),
            sky_light.as_entire_binding(),
            textures.blue_noise.as_ref()?,
            depth,
            history.newest(),
            &history.distances,
            world_from_local.clone(),
        )),
    );
    let resolved = BindGroupEntries::sequential((
        frame.clone(),
        history.sum_after(),
        &history.distances,
        depth,
    ));
    let publish = item.cloud.buffer.and_then(|id| images.get(id)).map(|image| {
        let entries = BindGroupEntries::sequential((
            frame.clone(),
            history.sum_after(),
            &history.distances,
            depth,
            &image.texture_view,
        ));
        (ids.publish, group("cloud_publish", &pipelines.publish[ms], &entries))
    });
    let groups = CloudBindGroups {
        model: model.bind_group(device, cache, &item.uniforms.model, textures)?,
        sky: (
            ids.sky,
            group(
                "cloud_sky",
                &pipelines.sky,
                &BindGroupEntries::sequential((
                    frame.clone(),
                    sky_light.as_entire_binding(),
                    world_from_local,
                )),
            ),
        ),
        march: (ids.march, march),
        accumulate: (
            ids.accumulate,
            group(
                "cloud_accumulate",
                &pipelines.accumulate,
                &BindGroupEntries::sequential((
                    frame,
                    &history.frames_view,
                    history.sum_before(),
                    history.sum_after(),
                )),
            ),
        ),
        composite: (ids.composite, group("cloud_composite", &pipelines.composite[ms], &resolved)),
        publish,
        air,
        air_offsets,
        empty,
    };
    Some((groups, ids.ready(cache)))
}
