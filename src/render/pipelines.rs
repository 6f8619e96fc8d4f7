//! Layouts and pipelines of all stages. Built on demand: a variant a stage for atmosphere, MSAA and target format.

use std::num::NonZeroU64;

use bevy::{
    asset::load_embedded_asset,
    core_pipeline::{FullscreenShader, core_3d::CORE_3D_DEPTH_FORMAT},
    pbr::{
        GpuAtmosphereSettings,
        resources::{AtmosphereTransform, GpuAtmosphere},
    },
    platform::collections::HashMap,
    prelude::*,
    render::{
        render_resource::{binding_types::*, *},
        renderer::RenderDevice,
    },
};

use super::{frame::FrameUniform, phase_slots::phase_tables_layout, reproject::HeldUniform};
use crate::{model::ModelBindings, reference::path_tracer::PathTracer, settings::DebugShader};

/// What clouds are drawn into.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) enum DrawnInto {
    /// The pass of transparent things, with so many samples and a depth buffer.
    TransparentPass(u32),
    /// The view's colour alone.
    Colour,
}

/// What a stage's pipeline depends on.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Variant {
    pub atmosphere: bool,
    pub multisampled: bool,
    /// Samples of what clouds are drawn into, and whether it has a depth buffer: among transparent things.
    pub drawn_into: DrawnInto,
    pub target: TextureFormat,
    pub debug: DebugShader,
    pub path_traced: bool,
}

impl Variant {
    /// What its shaders are compiled with.
    fn definitions(self, air_marched: bool) -> Vec<bevy::shader::ShaderDefVal> {
        let all = [
            ("ATMOSPHERE", self.atmosphere),
            ("AIR_MARCHED", self.atmosphere && air_marched),
            ("MULTISAMPLED", self.multisampled),
            ("DEBUG_VIEW", self.debug.shows_values()),
            ("DEBUG_MAP", self.debug == DebugShader::Map),
            ("COUNTS", self.debug == DebugShader::Count),
        ];
        all.into_iter().filter(|(_, on)| *on).map(|(name, _)| name.into()).collect()
    }
}

/// Pipelines of one variant.
#[derive(Clone, Copy)]
pub(crate) struct Pipelines {
    pub sky: CachedComputePipelineId,
    pub march: CachedComputePipelineId,
    /// The march of finished clouds, shown while a debug view's own is not compiled.
    pub plain_march: CachedComputePipelineId,
    pub accumulate: CachedComputePipelineId,
    pub blend: CachedComputePipelineId,
    pub composite: CachedComputePipelineId,
    pub draw: CachedRenderPipelineId,
    pub publish: CachedComputePipelineId,
    pub depth: CachedComputePipelineId,
    /// The path tracer and its noise, where they were asked for.
    pub traced: Option<[CachedComputePipelineId; 2]>,
}

/// Layouts, shaders, and the pipelines made so far.
#[derive(Resource)]
pub(crate) struct CloudPipelines {
    pub empty: BindGroupLayoutDescriptor,
    pub air: BindGroupLayoutDescriptor,
    /// Whether the device has textures enough for air to be marched (see air.wesl).
    pub air_marched: bool,
    pub sky: BindGroupLayoutDescriptor,
    pub march: [BindGroupLayoutDescriptor; 2],
    pub accumulate: BindGroupLayoutDescriptor,
    pub blend: [BindGroupLayoutDescriptor; 2],
    pub composite: [BindGroupLayoutDescriptor; 2],
    pub draw: BindGroupLayoutDescriptor,
    pub publish: [BindGroupLayoutDescriptor; 2],
    pub path_tracer: PathTracer,
    shaders: [Handle<Shader>; 8],
    fullscreen: FullscreenShader,
    made: HashMap<Variant, Pipelines>,
}

/// Bytes of `SkyLight` in `sky.wesl`.
pub(crate) const SKY_LIGHT_BYTES: u64 = 32;

/// Textures that the march reads where air is marched: more than WebGPU promises.
const TEXTURES_WITH_AIR: u32 = 18;

pub(crate) fn depth_layout(multisampled: bool) -> BindGroupLayoutEntryBuilder {
    if multisampled { texture_depth_2d_multisampled() } else { texture_depth_2d() }
}

impl FromWorld for CloudPipelines {
    fn from_world(world: &mut World) -> Self {
        let compute = ShaderStages::COMPUTE;
        let unfiltered = TextureSampleType::Float { filterable: false };
        let filtered = TextureSampleType::Float { filterable: true };
        let bytes = NonZeroU64::new(SKY_LIGHT_BYTES);
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
                        write(TextureFormat::Rgba32Float),
                        uniform_buffer::<Mat4>(false),
                        texture_2d(TextureSampleType::Uint),
                        write(TextureFormat::R32Uint),
                        uniform_buffer::<HeldUniform>(false),
                        phase_tables_layout(),
                    ),
                ),
            )
        };
        let blend = |multisampled| {
            BindGroupLayoutDescriptor::new(
                "cloud_blend",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (
                        frame(),
                        texture_2d_array(unfiltered),
                        texture_2d(unfiltered),
                        depth_layout(multisampled),
                        texture_2d_array(TextureSampleType::Uint),
                        uniform_buffer::<HeldUniform>(false),
                        texture_2d(TextureSampleType::Uint),
                        write(TextureFormat::Rgba32Float),
                        write(TextureFormat::R32Uint),
                        write(TextureFormat::Rgba32Float),
                        texture_2d(unfiltered),
                    ),
                ),
            )
        };
        // Three stages at the view's size differ in what they write.
        let full_size = |label, multisampled, format| {
            BindGroupLayoutDescriptor::new(
                label,
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (
                        frame(),
                        texture_2d_array(unfiltered),
                        texture_2d(unfiltered),
                        depth_layout(multisampled),
                        texture_2d_array(TextureSampleType::Uint),
                        uniform_buffer::<HeldUniform>(false),
                        texture_2d(unfiltered),
                        write(format),
                        texture_2d(unfiltered),
                    ),
                ),
            )
        };
        // Binding numbers are Bevy's, so that its atmosphere's own functions can be imported.
        let mut air = BindGroupLayoutEntries::with_indices(
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
        )
        .to_vec();
        let limits = world.resource::<RenderDevice>().limits();
        let air_marched = limits.max_sampled_textures_per_shader_stage >= TEXTURES_WITH_AIR;
        if air_marched {
            air.extend_from_slice(&BindGroupLayoutEntries::with_indices(
                compute,
                (
                    (5, texture_2d(filtered)),
                    (6, texture_2d(filtered)),
                    (7, sampler(SamplerBindingType::Filtering)),
                    (9, texture_2d(filtered)),
                ),
            ));
        }
        let composite = |multisampled| full_size("cloud_composite", multisampled, TextureFormat::Rgba16Float);
        let publish = |multisampled| full_size("cloud_publish", multisampled, TextureFormat::Rgba32Float);
        Self {
            empty: BindGroupLayoutDescriptor::new("cloud_empty", &[]),
            air: BindGroupLayoutDescriptor::new("cloud_air", &air),
            air_marched,
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
                        texture_2d_array(TextureSampleType::Uint),
                        uniform_buffer::<HeldUniform>(false),
                    ),
                ),
            ),
            blend: [blend(false), blend(true)],
            composite: [composite(false), composite(true)],
            draw: BindGroupLayoutDescriptor::new(
                "cloud_draw",
                &BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (frame(), texture_2d(unfiltered))),
            ),
            publish: [publish(false), publish(true)],
            shaders: [
                load_embedded_asset!(world, "sky/sky.wesl"),
                load_embedded_asset!(world, "march/march.wesl"),
                load_embedded_asset!(world, "accumulate/accumulate.wesl"),
                load_embedded_asset!(world, "composite/composite.wesl"),
                load_embedded_asset!(world, "composite/publish.wesl"),
                load_embedded_asset!(world, "accumulate/blend.wesl"),
                load_embedded_asset!(world, "composite/draw.wesl"),
                load_embedded_asset!(world, "composite/depth.wesl"),
            ],
            path_tracer: PathTracer::from_world(world),
            fullscreen: world.resource::<FullscreenShader>().clone(),
            made: HashMap::default(),
        }
    }
}

impl CloudPipelines {
    /// The pipelines of a variant; queued the first time it is asked for.
    pub fn get(&mut self, cache: &PipelineCache, model: &ModelBindings, variant: Variant) -> Pipelines {
        if let Some(made) = self.made.get(&variant) {
            return *made;
        }
        // A debug view shares all but the march with the normal variant, and the path tracer all that comes after it.
        let plain = (variant.debug != DebugShader::None || variant.path_traced)
            .then(|| self.get(cache, model, Variant { debug: DebugShader::None, path_traced: false, ..variant }));
        let defs = variant.definitions(self.air_marched);
        let ms = usize::from(variant.multisampled);
        let air = if variant.atmosphere { &self.air } else { &self.empty };
        let compute_with = |label: &'static str, shader: &Handle<Shader>, layout: [&BindGroupLayoutDescriptor; 3]| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(label.into()),
                layout: layout.into_iter().cloned().collect(),
                shader: shader.clone(),
                shader_defs: defs.clone(),
                entry_point: Some("main".into()),
                ..default()
            })
        };
        let compute = |label, shader: usize, layout| compute_with(label, &self.shaders[shader], layout);
        if let Some(plain) = plain {
            if variant.path_traced {
                let PathTracer { trace, noise, trace_shader, noise_shader } = &self.path_tracer;
                let traced = [
                    compute_with("cloud_path_trace", trace_shader, [air, &model.layout, &trace[ms]]),
                    compute_with("cloud_noise", noise_shader, [&self.empty, &self.empty, noise]),
                ];
                let made = Pipelines { traced: Some(traced), ..plain };
                self.made.insert(variant, made);
                return made;
            }
            let march = compute("cloud_march", 1, [air, &model.layout, &self.march[ms]]);
            let made = Pipelines { march, ..plain };
            self.made.insert(variant, made);
            return made;
        }
        let march = compute("cloud_march", 1, [air, &model.layout, &self.march[ms]]);
        let made = Pipelines {
            sky: compute("cloud_sky", 0, [air, &model.layout, &self.sky]),
            march,
            plain_march: march,
            accumulate: compute("cloud_accumulate", 2, [&self.empty, &self.empty, &self.accumulate]),
            blend: compute("cloud_blend", 5, [&self.empty, &self.empty, &self.blend[ms]]),
            composite: compute("cloud_composite", 3, [&self.empty, &self.empty, &self.composite[ms]]),
            draw: cache.queue_render_pipeline(self.draw_pipeline(variant)),
            publish: compute("cloud_publish", 4, [&self.empty, &self.empty, &self.publish[ms]]),
            depth: compute("cloud_depth", 7, [&self.empty, &self.empty, &self.composite[ms]]),
            traced: None,
        };
        self.made.insert(variant, made);
        made
    }

    pub fn accumulate_shader(&self) -> Handle<Shader> {
        self.shaders[2].clone()
    }

    /// Blends the picture over what is drawn already.
    fn draw_pipeline(&self, variant: Variant) -> RenderPipelineDescriptor {
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
        let (samples, depth_stencil) = match variant.drawn_into {
            DrawnInto::Colour => (1, None),
            // The pass has it attached; the picture knows of it already.
            DrawnInto::TransparentPass(samples) => (
                samples,
                Some(DepthStencilState {
                    format: CORE_3D_DEPTH_FORMAT,
                    depth_write_enabled: Some(false),
                    depth_compare: Some(CompareFunction::Always),
                    stencil: default(),
                    bias: default(),
                }),
            ),
        };
        RenderPipelineDescriptor {
            label: Some("cloud_draw".into()),
            layout: vec![self.empty.clone(), self.empty.clone(), self.draw.clone()],
            vertex: self.fullscreen.to_vertex_state(),
            depth_stencil,
            multisample: MultisampleState { count: samples, ..default() },
            fragment: Some(FragmentState {
                shader: self.shaders[6].clone(),
                entry_point: Some("main".into()),
                targets: vec![Some(ColorTargetState {
                    format: variant.target,
                    blend: Some(premultiplied),
                    write_mask: ColorWrites::ALL,
                })],
                ..default()
            }),
            ..default()
        }
    }
}

impl Pipelines {
    /// The march, or that of finished clouds until it is compiled: without any, the window would fill with nothing.
    pub fn drawable_march(self, cache: &PipelineCache) -> CachedComputePipelineId {
        if cache.get_compute_pipeline(self.march).is_some() { self.march } else { self.plain_march }
    }

    /// Whether a picture can be drawn: every stage is compiled, be the march that of finished clouds.
    pub fn drawable(self, cache: &PipelineCache) -> bool {
        [self.sky, self.drawable_march(cache), self.accumulate, self.blend, self.composite, self.publish, self.depth]
            .iter()
            .chain(self.traced.iter().flatten())
            .all(|id| cache.get_compute_pipeline(*id).is_some())
            && cache.get_render_pipeline(self.draw).is_some()
    }

    /// Whether it is the picture that was asked for.
    pub fn ready(self, cache: &PipelineCache) -> bool {
        self.drawable(cache) && cache.get_compute_pipeline(self.march).is_some()
    }
}
