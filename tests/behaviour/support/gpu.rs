//! Headless apps on the real GPU path, and test shaders run over buffers.

use std::{
    collections::BTreeSet,
    io::Write,
    path::Path,
    sync::{
        Mutex, Once, PoisonError,
        atomic::{AtomicU32, Ordering},
    },
    time::{Duration, Instant},
};

use bevy::{
    app::{PluginGroupBuilder, Plugins},
    log::{
        Level, LogPlugin,
        tracing_subscriber::{Registry, fmt},
    },
    prelude::*,
    render::{
        RenderApp, RenderPlugin,
        error_handler::{RenderErrorHandler, RenderErrorPolicy},
        pipelined_rendering::PipelinedRenderingPlugin,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, Buffer, BufferDescriptor,
            BufferInitDescriptor, BufferUsages, CachedComputePipelineId, CachedPipelineState, CommandEncoderDescriptor,
            ComputePassDescriptor, ComputePipeline, ComputePipelineDescriptor, MapMode, Pipeline, PipelineCache,
            PollType, ShaderStages,
            binding_types::{storage_buffer_read_only_sized, storage_buffer_sized},
        },
        renderer::{RenderDevice, RenderQueue},
    },
    shader::{Shader, ShaderCacheError},
    window::ExitCondition,
    winit::WinitPlugin,
};

/// How long something may take that waits for files, which other threads load while frames are counted.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long a test's own shader may wait for a module that it imports.
const COMPILE_PATIENCE: Duration = Duration::from_secs(5);

/// Whether the tests run under WebGPU's limits, where Bevy's own `Atmosphere` fails validation.
pub fn webgpu_limits() -> bool {
    std::env::var("WGPU_SETTINGS_PRIO").is_ok_and(|priority| priority.eq_ignore_ascii_case("webgpu"))
}

/// For tests that need Bevy's `Atmosphere`: they are not among those that run under WebGPU's limits (`webgpu.txt`).
///
/// # Panics
/// Under those limits.
pub fn needs_atmosphere() {
    assert!(!webgpu_limits(), "this test needs Bevy's Atmosphere, which fails validation under WebGPU's limits");
}

/// Bevy's plugins without a window, in lock step: one update is one whole frame.
pub fn headless_plugins() -> PluginGroupBuilder {
    let plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
        .disable::<WinitPlugin>()
        .disable::<PipelinedRenderingPlugin>();
    // The logger is the process's, not the app's.
    static FIRST: Once = Once::new();
    let mut first = false;
    FIRST.call_once(|| first = true);
    if first {
        plugins.set(LogPlugin {
            level: Level::WARN,
            // Software rendering is slow: no news here.
            filter: "bevy_render::renderer=error".to_owned(),
            custom_layer: |_| Some(Box::new(fmt::layer::<Registry>().with_ansi(false).with_writer(|| LogCopy))),
            ..default()
        })
    } else {
        plugins.disable::<LogPlugin>()
    }
}

/// Warnings and errors of all apps of this process.
static LOG: Mutex<String> = Mutex::new(String::new());

struct LogCopy;

impl Write for LogCopy {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        LOG.lock().unwrap_or_else(PoisonError::into_inner).push_str(&String::from_utf8_lossy(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// How often a warning or error with this text came. Tests run side by side: take a text that no other test causes.
pub fn times_logged(text: &str) -> usize {
    LOG.lock().unwrap_or_else(PoisonError::into_inner).matches(text).count()
}

/// A running app with a renderer, these plugins, and no clouds of its own accord.
///
/// # Panics
/// Where there is no Vulkan device: a GPU test never passes for want of a GPU. Later, on any error that the device reports.
pub fn app_with<M>(plugins: impl Plugins<M>) -> App {
    app_of(headless_plugins(), plugins)
}

/// As [`app_with`], with these plugins of Bevy's.
///
/// # Panics
/// As [`app_with`].
pub fn app_of<M>(bevy: PluginGroupBuilder, plugins: impl Plugins<M>) -> App {
    let mut app = App::new();
    app.add_plugins(bevy).add_plugins(plugins);
    app.insert_resource(RenderErrorHandler(|error, _, _| -> RenderErrorPolicy {
        panic!("the GPU reported {:?}: {}", error.ty, error.description)
    }));
    app.finish();
    app.cleanup();
    assert!(
        app.get_sub_app(RenderApp).is_some() && app.world().contains_resource::<RenderDevice>(),
        "no Vulkan device: GPU tests need one (Mesa's software driver will do)"
    );
    app
}

/// A running app whose only shaders beside Bevy's are this crate's, taken from its sources as they stand.
///
/// Any module can be imported by a test shader (`import bevy_cumulus::model::planet::altitude;`).
pub fn shader_app() -> App {
    let mut app = app_with(());
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = BTreeSet::new();
    wesl_files(&source, &mut files);
    let mut shaders = app.world_mut().resource_mut::<Assets<Shader>>();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let module = file.strip_prefix(&source).unwrap().to_string_lossy().replace('\\', "/");
        let shader = Shader::from_wesl(text, format!("embedded://bevy_cumulus/{module}"));
        // Kept for the app's life, as `load_shader_library!` does.
        std::mem::forget(shaders.add(shader));
    }
    app
}

fn wesl_files(folder: &Path, found: &mut BTreeSet<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            wesl_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "wesl") {
            found.insert(path);
        }
    }
}

/// Runs `count` whole frames, the GPU's part included.
pub fn run_updates(app: &mut App, count: u32) {
    for _ in 0..count {
        app.update();
        wait_for_gpu(app);
    }
}

/// Runs frames until `done`; fails after `limit` of them, naming `what` was awaited, but never before [`PATIENCE`] is
/// over: on a busy machine many frames pass while a file loads.
pub fn run_until(app: &mut App, what: &str, limit: u32, mut done: impl FnMut(&mut App) -> bool) {
    let (start, mut frames) = (Instant::now(), 0);
    while !done(app) {
        assert!(frames < limit || start.elapsed() < PATIENCE, "{what}: not after {frames} frames");
        run_updates(app, 1);
        frames += 1;
    }
}

/// Whether every pipeline that was asked for is there (or has failed): none waits for a shader's file.
pub fn pipelines_are_there(app: &App) -> bool {
    app.sub_app(RenderApp).world().resource::<PipelineCache>().waiting_pipelines().next().is_none()
}

/// Fails with the compiler's text where a shader of the app does not compile.
pub fn assert_shaders_compile(app: &App) {
    for pipeline in app.sub_app(RenderApp).world().resource::<PipelineCache>().pipelines() {
        if let CachedPipelineState::Err(
            error @ (ShaderCacheError::ProcessShaderError(_) | ShaderCacheError::CreateShaderModule(_)),
        ) = &pipeline.state
        {
            panic!("a shader does not compile: {error}");
        }
    }
}

/// Waits until the GPU has done all that was submitted.
pub fn wait_for_gpu(app: &App) {
    let device = app.world().resource::<RenderDevice>();
    device.wgpu_device().poll(PollType::wait_indefinitely()).expect("the GPU stopped answering");
}

/// Runs a WESL module's `main` (`@compute @workgroup_size(64)`) in one dispatch of at least `invocations` and returns
/// what it wrote.
///
/// Group 0 holds `input` at binding 0 (`var<storage, read>`) and `output_len` zeros at binding 1
/// (`var<storage, read_write>`), both `array<f32>`. Bevy turns bounds checks off: the shader must not index past the ends.
///
/// # Panics
/// With the compiler's text where the shader does not compile, and on any error that the device reports.
pub fn run_compute(app: &mut App, wesl: &str, input: &[f32], output_len: usize, invocations: u32) -> Vec<f32> {
    run_compute_with(app, wesl, None, input, output_len, invocations)
}

/// As [`run_compute`], with a bind group 1 of the caller's.
pub fn run_compute_with(
    app: &mut App,
    wesl: &str,
    group_1: Option<&(BindGroupLayoutDescriptor, BindGroup)>,
    input: &[f32],
    output_len: usize,
    invocations: u32,
) -> Vec<f32> {
    run_compute_with_groups(app, wesl, group_1.map_or(&[], std::slice::from_ref), input, output_len, invocations)
}

/// As [`run_compute`], with bind groups of the caller's from group 1 on.
pub fn run_compute_with_groups(
    app: &mut App,
    wesl: &str,
    others: &[(BindGroupLayoutDescriptor, BindGroup)],
    input: &[f32],
    output_len: usize,
    invocations: u32,
) -> Vec<f32> {
    let own = BindGroupLayoutDescriptor::new(
        "test compute",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (storage_buffer_read_only_sized(false, None), storage_buffer_sized(false, None)),
        ),
    );
    let mut layouts = vec![own];
    layouts.extend(others.iter().map(|(layout, _)| layout.clone()));
    let pipeline = compile(app, wesl, &layouts);
    let groups: Vec<&BindGroup> = others.iter().map(|(_, group)| group).collect();
    let result = dispatch(app, &pipeline, &layouts[0], &groups, input, output_len, invocations);
    // Errors of the commands above come out here.
    app.update();
    result
}

/// Pipelines of test shaders that an app has made, by text and layouts: a software driver takes seconds for each that
/// imports the model.
#[derive(Resource, Default)]
struct TestPipelines(Vec<(String, Vec<BindGroupLayoutDescriptor>, CachedComputePipelineId)>);

/// The pipeline of this shader; asked for only the first time.
fn queue(app: &mut App, wesl: &str, layouts: &[BindGroupLayoutDescriptor]) -> CachedComputePipelineId {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let made = app.world_mut().get_resource_or_init::<TestPipelines>();
    if let Some((.., id)) = made.0.iter().find(|(text, with, _)| text == wesl && with == layouts) {
        return *id;
    }
    let path = format!("embedded://behaviour/compute_{}.wesl", NEXT.fetch_add(1, Ordering::Relaxed));
    let shader = Shader::from_wesl(wesl.to_owned(), path);
    let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(shader);
    let descriptor = ComputePipelineDescriptor {
        label: Some("test compute".into()),
        layout: layouts.to_vec(),
        shader,
        entry_point: Some("main".into()),
        ..default()
    };
    let id = app.sub_app(RenderApp).world().resource::<PipelineCache>().queue_compute_pipeline(descriptor);
    app.world_mut().resource_mut::<TestPipelines>().0.push((wesl.to_owned(), layouts.to_vec(), id));
    id
}

fn compile(app: &mut App, wesl: &str, layouts: &[BindGroupLayoutDescriptor]) -> ComputePipeline {
    let id = queue(app, wesl, layouts);
    let (start, mut waiting_for) = (Instant::now(), String::new());
    while start.elapsed() < COMPILE_PATIENCE {
        app.update();
        let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
        match cache.get_compute_pipeline_state(id) {
            CachedPipelineState::Ok(Pipeline::ComputePipeline(pipeline)) => {
                let pipeline = pipeline.clone();
                // Errors of the pipeline's creation come out here.
                app.update();
                return pipeline;
            }
            CachedPipelineState::Err(
                error @ (ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable),
            ) => {
                waiting_for = error.to_string();
                std::thread::sleep(Duration::from_millis(5));
            }
            CachedPipelineState::Err(error) => {
                panic!("the shader does not compile: {error}\n{wesl}")
            }
            _ => {}
        }
    }
    panic!("the shader is not ready after {COMPILE_PATIENCE:?}: {waiting_for}\n{wesl}");
}

fn dispatch(
    app: &App,
    pipeline: &ComputePipeline,
    layout: &BindGroupLayoutDescriptor,
    others: &[&BindGroup],
    input: &[f32],
    output_len: usize,
    invocations: u32,
) -> Vec<f32> {
    let world = app.sub_app(RenderApp).world();
    let device = world.resource::<RenderDevice>();
    let size = (output_len.max(1) * size_of::<f32>()) as u64;
    let input = device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("test input"),
        contents: bytemuck::cast_slice(if input.is_empty() { &[0.0] } else { input }),
        usage: BufferUsages::STORAGE,
    });
    let buffer = |usage| {
        device.create_buffer(&BufferDescriptor { label: Some("test output"), size, usage, mapped_at_creation: false })
    };
    let output = buffer(BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let readable = buffer(BufferUsages::MAP_READ | BufferUsages::COPY_DST);
    let group = device.create_bind_group(
        "test compute",
        &world.resource::<PipelineCache>().get_bind_group_layout(layout),
        &BindGroupEntries::sequential((input.as_entire_binding(), output.as_entire_binding())),
    );
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &*group, &[]);
        for (i, other) in others.iter().enumerate() {
            pass.set_bind_group(i as u32 + 1, &***other, &[]);
        }
        pass.dispatch_workgroups(invocations.div_ceil(64), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&output, 0, &readable, 0, size);
    world.resource::<RenderQueue>().submit([encoder.finish()]);
    let mut values = read_mapped(app, &readable);
    values.truncate(output_len);
    values
}

/// The contents of a buffer with usage `MAP_READ`, once the GPU has done all that was submitted.
pub fn read_mapped<T: bytemuck::Pod>(app: &App, buffer: &Buffer) -> Vec<T> {
    let slice = buffer.slice(..);
    slice.map_async(MapMode::Read, |result| result.expect("the buffer cannot be mapped"));
    wait_for_gpu(app);
    let mapped = slice.get_mapped_range().expect("the buffer is not mapped");
    let values = bytemuck::pod_collect_to_vec(&mapped);
    drop(mapped);
    buffer.unmap();
    values
}

const DOUBLE: &str = "
@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&results) {
        results[id.x] = 2.0 * values[id.x];
    }
}
";

#[test]
fn a_test_shader_runs_over_its_buffers() {
    let input: Vec<f32> = (0..1000).map(|k| k as f32).collect();
    let doubled: Vec<f32> = input.iter().map(|x| 2.0 * x).collect();
    let mut app = shader_app();
    assert_eq!(run_compute(&mut app, DOUBLE, &input, 1000, 1000), doubled);
    // Once more in the same app: nothing of the first run sticks.
    assert_eq!(run_compute(&mut app, DOUBLE, &[5.0; 3], 3, 3), [10.0; 3]);
}

#[test]
#[should_panic(expected = "does not compile")]
fn a_test_shader_with_a_wrong_type_fails() {
    run_compute(&mut shader_app(), &DOUBLE.replace("2.0 *", "true *"), &[1.0], 1, 1);
}

#[test]
#[should_panic(expected = "is not ready")]
fn a_test_shader_that_imports_what_is_not_there_fails() {
    let shader = format!("import bevy_cumulus::model::nowhere::nothing;\n{}", DOUBLE.replace("2.0", "nothing()"));
    run_compute(&mut shader_app(), &shader, &[1.0], 1, 1);
}

#[test]
#[should_panic(expected = "the GPU reported")]
fn a_pipeline_that_does_not_fit_its_layout_fails() {
    let shader = DOUBLE.replace("var<storage, read> values", "var<storage, read_write> values");
    run_compute(&mut shader_app(), &shader, &[1.0], 1, 1);
}
