//! Ten thousand frames through the accumulation stage itself: the sliding window does not drift, and heals.

use bevy::{
    prelude::*,
    render::{
        RenderApp,
        render_resource::{
            BindGroup, BindGroupEntries, Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages,
            CachedPipelineState, CommandEncoderDescriptor, ComputePassDescriptor, ComputePipeline, Extent3d, Origin3d,
            Pipeline, PipelineCache, TexelCopyBufferInfo, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture,
            TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureViewDescriptor,
            TextureViewDimension,
        },
        renderer::{RenderDevice, RenderQueue},
    },
};
use bevy_cumulus::testing::Accumulation;
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::support::{
    app::clouds_app,
    gpu::{read_mapped, run_until, run_updates, wait_for_gpu},
    half::{from_half, worst_relative},
};

const SIZE: UVec2 = UVec2::new(16, 9);
const TEXELS: usize = 16 * 9;
const WINDOW: usize = 16;
const LAYERS: u32 = WINDOW as u32 + 1;
const CHANNELS: usize = 4 * TEXELS;
/// As `pack_marched` of `held.wesl` puts it: nothing has changed for 255 frames.
const UNCHANGED: u32 = 255 << 24;
/// The stage with its textures, outside the renderer.
struct Window {
    pipeline: ComputePipeline,
    uniform: Buffer,
    frames: Texture,
    sums: [Texture; 2],
    groups: [BindGroup; 2],
    empty: BindGroup,
    index: u32,
    held: u32,
}

fn compile(app: &mut App, stage: &Accumulation) -> ComputePipeline {
    let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
    let id = cache.queue_compute_pipeline(stage.pipeline.clone());
    let mut pipeline = None;
    run_until(app, "the accumulation stage compiles", 100, |app| {
        let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
        if let CachedPipelineState::Ok(Pipeline::ComputePipeline(made)) = cache.get_compute_pipeline_state(id) {
            pipeline = Some(made.clone());
        }
        pipeline.is_some()
    });
    pipeline.expect("it was waited for")
}

impl Window {
    fn new(app: &mut App) -> Self {
        let stage = Accumulation::new(app).expect("clouds can be drawn");
        let pipeline = compile(app, &stage);
        let world = app.sub_app(RenderApp).world();
        let (device, cache) = (world.resource::<RenderDevice>(), world.resource::<PipelineCache>());
        let texture = |format, layers| {
            device.create_texture(&TextureDescriptor {
                label: Some("test frames"),
                size: Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::TEXTURE_BINDING
                    | TextureUsages::COPY_DST
                    | TextureUsages::COPY_SRC
                    | if layers == 1 { TextureUsages::STORAGE_BINDING } else { TextureUsages::empty() },
                view_formats: &[],
            })
        };
        let uniform = |contents: &[u8]| {
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            device.create_buffer_with_data(&BufferInitDescriptor { label: Some("test uniform"), contents, usage })
        };
        let history = uniform(&Accumulation::still_history_uniform());
        let uniform = uniform(&Accumulation::frame_uniform(SIZE, 0, [0; 4]));
        let frames = texture(TextureFormat::Rgba16Float, LAYERS);
        let sums = [0, 1].map(|_| texture(TextureFormat::Rgba32Float, 1));
        let marched = texture(TextureFormat::R32Uint, LAYERS);
        for z in 0..LAYERS {
            let layer = TexelCopyTextureInfo { origin: Origin3d { z, ..Origin3d::ZERO }, ..marched.as_image_copy() };
            write(world.resource::<RenderQueue>(), layer, 4, bytemuck::cast_slice(&[UNCHANGED; TEXELS]));
        }
        let array = TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() };
        let (all, marched) = (frames.create_view(&array), marched.create_view(&array));
        let views = sums.each_ref().map(|t| t.create_view(&TextureViewDescriptor::default()));
        let [empty, own] = [&stage.empty, &stage.layout].map(|layout| cache.get_bind_group_layout(layout));
        let groups = [0, 1].map(|parity| {
            let entries = BindGroupEntries::sequential((
                uniform.as_entire_binding(),
                &all,
                &views[parity],
                &views[1 - parity],
                &marched,
                history.as_entire_binding(),
            ));
            device.create_bind_group("test accumulation", &own, &entries)
        });
        let empty = device.create_bind_group("test nothing", &empty, &[]);
        Self { pipeline, uniform, frames, sums, groups, empty, index: 0, held: 0 }
    }

    /// Adds one frame, as the renderer would.
    fn add(&mut self, app: &App, frame: &[u16]) {
        let world = app.sub_app(RenderApp).world();
        let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
        let layer = self.index % LAYERS;
        let texels =
            TexelCopyTextureInfo { origin: Origin3d { z: layer, ..Origin3d::ZERO }, ..self.frames.as_image_copy() };
        write(queue, texels, 8, bytemuck::cast_slice(frame));
        let layers = [layer, (self.index + 1) % LAYERS, LAYERS, self.held];
        queue.write_buffer(&self.uniform, 0, &Accumulation::frame_uniform(SIZE, self.index, layers));
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &*self.empty, &[]);
            pass.set_bind_group(1, &*self.empty, &[]);
            pass.set_bind_group(2, &*self.groups[(self.index & 1) as usize], &[]);
            pass.dispatch_workgroups(SIZE.x.div_ceil(8), SIZE.y.div_ceil(8), 1);
        }
        queue.submit([encoder.finish()]);
        self.index += 1;
        self.held = (self.held + 1).min(WINDOW as u32);
    }

    /// The sum as it is now.
    fn sum(&self, app: &App) -> Vec<f64> {
        let world = app.sub_app(RenderApp).world();
        let device = world.resource::<RenderDevice>();
        let buffer = device.create_buffer(&BufferDescriptor {
            label: Some("test sum"),
            size: u64::from(16 * SIZE.x * SIZE.y),
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            self.sums[(self.index & 1) as usize].as_image_copy(),
            TexelCopyBufferInfo { buffer: &buffer, layout: rows(16) },
            Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 },
        );
        world.resource::<RenderQueue>().submit([encoder.finish()]);
        read_mapped::<f32>(app, &buffer).into_iter().map(f64::from).collect()
    }
}

/// Rows of 16 texels; in f32 exactly the 256 bytes that a copy must have.
fn rows(texel: u32) -> TexelCopyBufferLayout {
    TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(texel * SIZE.x), rows_per_image: None }
}

fn write(queue: &RenderQueue, to: TexelCopyTextureInfo, texel: u32, bytes: &[u8]) {
    let size = Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 };
    queue.write_texture(to, bytes, rows(texel), size);
}

/// 20 as a half: radiance that shows far beyond white.
const TWENTY: u16 = 0x4d00;
/// 6e4 as a half: the march's cap.
const CAP: u16 = 0x7b53;

fn frame(rng: &mut StdRng, values: std::ops::RangeInclusive<u16>) -> Vec<u16> {
    (0..CHANNELS).map(|_| rng.random_range(values.clone())).collect()
}

/// Frames made one after the other, and the latest ones as numbers.
struct Film {
    stage: Window,
    recent: Vec<Vec<f64>>,
}

impl Film {
    fn add(&mut self, app: &App, frame: &[u16]) {
        self.stage.add(app, frame);
        self.recent.push(frame.iter().map(|bits| from_half(*bits)).collect());
        if self.recent.len() > 2 * RECENT {
            self.recent.drain(..RECENT);
        }
        if self.stage.index.is_multiple_of(100) {
            // Frees what the queue holds.
            wait_for_gpu(app);
        }
    }

    /// The largest error of a sum, relative to it or to `floor`.
    fn error(&self, app: &App, floor: f64) -> f64 {
        let held = &self.recent[self.recent.len() - WINDOW..];
        let exact: Vec<f64> = (0..CHANNELS).map(|i| held.iter().map(|f| f[i]).sum()).collect();
        worst_relative(&self.stage.sum(app), &exact, floor)
    }

    /// The largest value that a sum may still carry rounding of: each row is summed anew once in 256 frames.
    fn largest(&self) -> f64 {
        let latest = &self.recent[self.recent.len().saturating_sub(RECENT)..];
        latest.iter().flatten().fold(0.0, |a, b| b.max(a))
    }
}

const RECENT: usize = 256 + WINDOW;

#[test]
fn ten_thousand_frames_do_not_drift() {
    let mut app = clouds_app();
    let stage = Window::new(&mut app);
    let mut film = Film { stage, recent: Vec::new() };
    let mut rng = StdRng::seed_from_u64(70);
    let (mut steady, mut wild) = (0.0_f64, 0.0_f64);
    for k in 0..10_000 {
        // First radiance as clouds have it; then anything at all: dark, or a few texels or all at the cap.
        let values = match k {
            ..6000 => 0x2000..=TWENTY,
            _ if k / 7 % 3 == 0 => 0..=0x1000,
            _ if k / 5 % 2 == 0 => 0x7000..=CAP,
            _ => 0..=CAP,
        };
        film.add(&app, &frame(&mut rng, values));
        if k % 397 == 396 || k == 9999 {
            if k < 6000 {
                steady = steady.max(film.error(&app, 0.0));
            } else {
                wild = wild.max(film.error(&app, film.largest() * WINDOW as f64));
            }
        }
    }
    // Errors of the commands above come out here.
    run_updates(&mut app, 1);
    println!("after 10 000 frames: {steady:.1e} of the value; with wild changes {wild:.1e} of the brightest sum");
    assert!(steady < 1e-4, "{steady:e}");
    assert!(wild < 1e-5, "{wild:e}");
}

#[test]
fn a_spoilt_sum_is_whole_again_after_256_frames() {
    let mut app = clouds_app();
    let stage = Window::new(&mut app);
    let mut film = Film { stage, recent: Vec::new() };
    let mut rng = StdRng::seed_from_u64(71);
    for _ in 0..100 {
        film.add(&app, &frame(&mut rng, 0x3800..=TWENTY));
    }
    assert!(film.error(&app, 0.0) < 1e-5);
    let spoilt = [1e5_f32; CHANNELS];
    let stage = &film.stage;
    let before = stage.sums[(stage.index & 1) as usize].as_image_copy();
    let queue = app.sub_app(RenderApp).world().resource::<RenderQueue>();
    write(queue, before, 16, bytemuck::cast_slice(&spoilt));
    film.add(&app, &frame(&mut rng, 0x3800..=TWENTY));
    assert!(film.error(&app, 0.0) > 1.0, "the spoilt sum is not read");
    for _ in 0..256 {
        film.add(&app, &frame(&mut rng, 0x3800..=TWENTY));
    }
    let error = film.error(&app, 0.0);
    run_updates(&mut app, 1);
    assert!(error < 1e-5, "{error:e}");
}
