//! The sliding window's accumulation stage, for tests that feed it frames of their own.

use bevy::{
    prelude::*,
    render::{
        RenderApp,
        render_resource::{BindGroupLayoutDescriptor, ComputePipelineDescriptor, ShaderType, encase},
    },
};

use crate::render::{CloudPipelines, FrameUniform, HeldUniform};

/// The stage's pipeline, and how it is bound: group 2 holds the frame uniform, the frames' array, the sum before, the sum
/// after, the frames' surfaces and the history uniform; groups 0 and 1 are empty.
pub struct Accumulation {
    /// What to queue in the pipeline cache.
    pub pipeline: ComputePipelineDescriptor,
    /// Layout of groups 0 and 1.
    pub empty: BindGroupLayoutDescriptor,
    /// Layout of group 2.
    pub layout: BindGroupLayoutDescriptor,
}

impl Accumulation {
    /// # Errors
    /// Says what is missing: a renderer, or clouds that can run on this device.
    pub fn new(app: &App) -> Result<Self, String> {
        let world = app.get_sub_app(RenderApp).ok_or("no render app")?.world();
        let pipelines = world.get_resource::<CloudPipelines>().ok_or("clouds are off on this device")?;
        let (empty, layout) = (pipelines.empty.clone(), pipelines.accumulate.clone());
        let pipeline = ComputePipelineDescriptor {
            label: Some("test accumulation".into()),
            layout: vec![empty.clone(), empty.clone(), layout.clone()],
            shader: pipelines.accumulate_shader(),
            entry_point: Some("main".into()),
            ..default()
        };
        Ok(Self { pipeline, empty, layout })
    }

    /// The frame uniform of a frame of this size: the `index`th since the start, stored in layer `newest` of `layers`,
    /// after `held` frames of the window; layer `leaving` holds the one that drops out of it.
    pub fn frame_uniform(size: UVec2, index: u32, [newest, leaving, layers, held]: [u32; 4]) -> Vec<u8> {
        bytes(&FrameUniform::of_window(size, index, UVec4::new(newest, leaving, layers, held)))
    }

    /// The history uniform of a camera that stands still, at one exposure.
    pub fn still_history_uniform() -> Vec<u8> {
        bytes(&HeldUniform::still())
    }
}

fn bytes<T: ShaderType + encase::internal::WriteInto>(uniform: &T) -> Vec<u8> {
    let mut buffer = encase::UniformBuffer::new(Vec::new());
    buffer.write(uniform).expect("a vector takes any number of bytes");
    buffer.into_inner()
}
