//! One texture being baked, a few bands a frame.

use bevy::{
    prelude::*,
    render::{
        render_resource::{
            BindGroup, BindGroupEntries, CachedPipelineState, CommandEncoder, ComputePassDescriptor, PipelineCache,
            Texture, TextureView, TextureViewDescriptor, UniformBuffer,
        },
        renderer::{RenderDevice, RenderQueue},
    },
};

use super::{
    pipelines::{BakeParams, BakePipelines, Kernel},
    recipe::{Pass, Plan, Recipe},
    slots::CloudTextureSlot,
};

/// A texture under construction.
pub(super) struct Job {
    pub slot: CloudTextureSlot,
    pub recipe: Recipe,
    pub texture: Texture,
    plan: Plan,
    /// What the pyramid is built over: a user's image, or the map baked by the first pass.
    source: Option<TextureView>,
    pass: usize,
    band: u32,
    done: u64,
}

/// The handles that recording needs.
pub(super) struct Tools<'a> {
    pub device: &'a RenderDevice,
    pub queue: &'a RenderQueue,
    pub cache: &'a PipelineCache,
    pub pipelines: &'a BakePipelines,
}

impl Job {
    /// Makes the texture; nothing is baked yet. `image` is the user's image, if one is the source, and its size.
    pub(super) fn start(
        slot: CloudTextureSlot,
        recipe: Recipe,
        image: Option<(TextureView, UVec2)>,
        device: &RenderDevice,
    ) -> Self {
        let (source, size) = image.map_or((None, UVec2::ONE), |(view, size)| (Some(view), size));
        let plan = recipe.plan(size);
        let source = if plan.needs_scratch() {
            Some(device.create_texture(&plan.texture(1)).create_view(&TextureViewDescriptor::default()))
        } else {
            source
        };
        let texture = device.create_texture(&plan.texture(plan.levels));
        Self { slot, recipe, texture, plan, source, pass: 0, band: 0, done: 0 }
    }

    pub(super) fn is_complete(&self) -> bool {
        self.pass == self.plan.passes.len()
    }

    /// Work left, in texel-octaves.
    pub(super) fn remaining(&self) -> u64 {
        self.plan.cost() - self.done
    }

    /// Whether every pipeline that it needs has been compiled.
    pub(super) fn is_ready(&self, tools: &Tools) -> bool {
        self.plan.passes.iter().all(|pass| {
            let (_, id) = tools.pipelines.get(pass.kernel);
            matches!(tools.cache.get_compute_pipeline_state(*id), CachedPipelineState::Ok(_))
        })
    }

    /// Records as much as `budget` allows and returns what it cost.
    pub(super) fn record(&mut self, budget: u64, tools: &Tools, encoder: &mut CommandEncoder) -> u64 {
        let mut spent = 0;
        while let Some(pass) = self.plan.passes.get(self.pass) {
            let bands = ((budget - spent) / pass.band_cost).min((pass.bands - self.band).into()) as u32;
            if bands == 0 {
                break;
            }
            self.dispatch(pass, bands, tools, encoder);
            spent += u64::from(bands) * pass.band_cost;
            self.band += bands;
            if self.band == pass.bands {
                (self.pass, self.band) = (self.pass + 1, 0);
            }
        }
        self.done += spent;
        spent
    }

    fn dispatch(&self, pass: &Pass, bands: u32, tools: &Tools, encoder: &mut CommandEncoder) {
        let (layout, id) = tools.pipelines.get(pass.kernel);
        let Some(pipeline) = tools.cache.get_compute_pipeline(*id) else {
            return;
        };
        let (groups, first) = pass.dispatch(self.band, bands);
        let mut params = UniformBuffer::from(BakeParams { first, ..self.plan.params });
        params.write_buffer(tools.device, tools.queue);
        let layout = tools.cache.get_bind_group_layout(layout);
        let Some(bind_group) = self.bind(pass, |read, written| match (read, params.binding()) {
            (Some(read), Some(params)) => Some(tools.device.create_bind_group(
                "cloud_bake",
                &layout,
                &BindGroupEntries::sequential((params, read, written)),
            )),
            (None, Some(params)) => Some(tools.device.create_bind_group(
                "cloud_bake",
                &layout,
                &BindGroupEntries::sequential((params, written)),
            )),
            (_, None) => None,
        }) else {
            return;
        };
        let mut compute =
            encoder.begin_compute_pass(&ComputePassDescriptor { label: Some("cloud_bake"), timestamp_writes: None });
        compute.set_pipeline(pipeline);
        compute.set_bind_group(0, &bind_group, &[]);
        compute.dispatch_workgroups(groups[0], groups[1], groups[2]);
    }

    /// Calls `make` with the texture that a pass reads, if any, and the one that it writes.
    fn bind(
        &self,
        pass: &Pass,
        make: impl FnOnce(Option<&TextureView>, &TextureView) -> Option<BindGroup>,
    ) -> Option<BindGroup> {
        let level = |level| {
            self.texture.create_view(&TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..default()
            })
        };
        match pass.kernel {
            Kernel::Billow | Kernel::Wisp | Kernel::Shape | Kernel::Gradient => make(None, &level(0)),
            Kernel::Coverage | Kernel::TypeMap => make(None, self.source.as_ref()?),
            Kernel::FirstLevel => make(Some(self.source.as_ref()?), &level(0)),
            Kernel::VolumeMip | Kernel::NextLevel => make(Some(&level(pass.level - 1)), &level(pass.level)),
        }
    }
}
