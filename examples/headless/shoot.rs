//! Renders the plan's frames in lock-step, without a window, and reads the last one back.

mod counts;

use std::time::{Duration, Instant};

use anyhow::{Result, anyhow, bail, ensure};
use bevy::{
    camera::{RenderTarget, Viewport},
    diagnostic::DiagnosticsStore,
    log::{Level, LogPlugin},
    pbr::AtmosphereSettings,
    prelude::*,
    render::{
        RenderApp, RenderPlugin,
        diagnostic::RenderDiagnosticsPlugin,
        gpu_readback::{Readback, ReadbackComplete},
        pipelined_rendering::PipelinedRenderingPlugin,
        render_resource::{CachedPipelineState, PipelineCache, PollType, TextureFormat},
        renderer::{RenderAdapterInfo, RenderDevice},
        settings::{WgpuFeatures, WgpuSettings},
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
    time::TimeUpdateStrategy,
    window::ExitCondition,
    winit::WinitPlugin,
};
use bevy_cumulus::{CloudBuffer, CloudNoise, CloudPhaseStatus, CloudStatus, prelude::*, textures::CloudTextureStatus};
use image::{RgbImage, Rgba32FImage};

use crate::{
    common,
    finite::flaw,
    options::Plan,
    status::Stage,
    timings::{LAG, Timings},
};

pub use counts::Counts;

/// How long the first usable frame may take to come, and the last one to come back.
const READY_WITHIN: Duration = Duration::from_secs(300);
const BACK_WITHIN: Duration = Duration::from_secs(120);
/// Frames rendered after everything is ready and before the first that counts.
const SETTLING_FRAMES: u32 = 4;
/// The same for a later picture of a batch, whose sky and textures are there.
const SETTLED_FRAMES: u32 = 3;

/// What came out.
pub struct Shot {
    pub picture: Option<RgbImage>,
    pub cloud: Option<Rgba32FImage>,
    pub noise: Option<Rgba32FImage>,
    /// Which of the floats behind the picture are none, in words.
    pub flaw: Option<String>,
    pub timings: Timings,
    pub counts: Option<Counts>,
    pub adapter: String,
}

/// What came back from the GPU so far.
#[derive(Resource, Default)]
struct Caught {
    picture: Option<Image>,
    cloud: Option<Vec<u8>>,
    second_cloud: Option<Vec<u8>>,
    noise: Option<Vec<u8>>,
    frame: Option<Vec<u8>>,
}

/// Renders the plan.
pub fn shoot(plan: &Plan) -> Result<Shot> {
    let mut studio = Studio::build(std::slice::from_ref(plan))?;
    if plan.strip.is_empty() { studio.picture(plan) } else { studio.strip(plan) }
}

/// Renders plans that share a set-up, one after another, and hands each picture on; `wait` comes before each.
pub fn shoot_many(
    plans: &[Plan],
    mut wait: impl FnMut() -> Result<()>,
    mut done: impl FnMut(&Plan, &Shot) -> Result<()>,
) -> Result<()> {
    let Some(first) = plans.first() else { return Ok(()) };
    let mut studio = Studio::build(plans)?;
    studio.make_ready(first, SETTLING_FRAMES)?;
    for plan in plans {
        wait()?;
        set(studio.app.world_mut(), &plan.settings);
        studio.expose(plan);
        studio.pose(plan, 0);
        studio.make_ready(plan, SETTLED_FRAMES)?;
        let timings = studio.count_frames(plan)?;
        done(plan, &studio.shot(plan, timings)?)?;
    }
    Ok(())
}

struct Studio {
    app: App,
    camera: Entity,
    /// The one whose half of the picture is on the right.
    second: Option<Entity>,
    sun: Entity,
    target: Handle<Image>,
    /// Absent where only timings are wanted, so that it costs them nothing.
    buffer: Option<Handle<Image>>,
    /// The second camera's, which is only looked at.
    second_buffer: Option<Handle<Image>>,
    noise: Option<Handle<Image>>,
}

fn engine(plan: &Plan) -> App {
    let mut gpu = WgpuSettings::default();
    if plan.sky {
        // Bevy's atmosphere filters Rgba32Float, which `WGPU_SETTINGS_PRIO=webgpu` would not ask for.
        gpu.features |= WgpuFeatures::FLOAT32_FILTERABLE;
    }
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(LogPlugin {
                level: Level::WARN,
                // That rendering in software is slow goes without saying here.
                filter: "wgpu=error,naga=error,bevy_render::renderer=error".into(),
                ..default()
            })
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(RenderPlugin { render_creation: gpu.into(), synchronous_pipeline_compilation: true, ..default() })
            .disable::<bevy::app::PanicHandlerPlugin>()
            .disable::<WinitPlugin>()
            .disable::<PipelinedRenderingPlugin>(),
    )
    .add_plugins((RenderDiagnosticsPlugin, CloudsPlugin))
    .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(Plan::FRAME_SECONDS)))
    .init_resource::<Caught>();
    app.finish();
    app.cleanup();
    app
}

impl Studio {
    fn build(plans: &[Plan]) -> Result<Self> {
        let plan = plans.first().ok_or_else(|| anyhow!("there is nothing to render"))?;
        let wants = |what: fn(&Plan) -> bool| plans.iter().any(what);
        let mut app = engine(plan);
        let world = app.world_mut();
        set(world, plan.strip.first().unwrap_or(&plan.settings));

        let (width, height) = plan.size;
        let limit = world.resource::<RenderDevice>().limits().max_texture_dimension_2d;
        ensure!(width.max(height) <= limit, "--size {width}x{height}: this device makes at most {limit} pixels a side");
        let hills = plan.scene.hills;
        if plan.land {
            common::spawn_land(world, hills);
        }
        let sun = common::spawn_sky(world, plan.sun(0), plan.sky, hills);

        let mut images = world.resource_mut::<Assets<Image>>();
        let target = images.add(Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None));
        let mut make_buffer = || wants(Plan::wants_buffer).then(|| images.add(CloudBuffer::image(width, height)));
        let buffer = make_buffer();
        let second_buffer = plan.scene.split.then(make_buffer).flatten();
        let noise = wants(|plan| plan.noise.is_some()).then(|| images.add(CloudNoise::image(width, height)));
        let camera = world
            .spawn((
                common::camera(plan.ev100),
                CloudView { debug: plan.debug, ..default() },
                RenderTarget::from(target.clone()),
            ))
            .insert(if plan.msaa == 4 { Msaa::Sample4 } else { Msaa::Off })
            .id();
        if plan.sky {
            world.entity_mut(camera).insert(common::sky_camera(plan.camera(0).position.y));
        }
        if let Some(buffer) = &buffer {
            world.entity_mut(camera).insert(CloudBuffer(buffer.clone()));
        }
        if let Some(noise) = &noise {
            world.entity_mut(camera).insert(CloudNoise(noise.clone()));
        }
        let second = plan.scene.split.then(|| Self::split(world, camera, plan, second_buffer.as_ref()));
        let mut studio = Self { app, camera, second, sun, target, buffer, second_buffer, noise };
        studio.pose(plan, 0);
        Ok(studio)
    }

    /// Leaves the left half to the camera, and gives the right one to another at a quarter of the resolution.
    fn split(world: &mut World, camera: Entity, plan: &Plan, buffer: Option<&Handle<Image>>) -> Entity {
        let left = UVec2::new((plan.size.0 / 2).max(1), plan.size.1);
        let right = UVec2::new((plan.size.0 - left.x).max(1), plan.size.1);
        let half = |x, physical_size| Camera {
            order: x as isize,
            clear_color: if x == 0 { ClearColorConfig::Default } else { ClearColorConfig::None },
            viewport: Some(Viewport { physical_position: UVec2::new(x, 0), physical_size, ..default() }),
            ..default()
        };
        let second = world.entity_mut(camera).insert(half(0, left)).clone_and_spawn();
        let quality = CloudQuality { resolution: MarchResolution::Quarter, ..plan.settings.quality.clone() };
        world.entity_mut(second).remove::<CloudBuffer>().insert((
            half(plan.size.0 - right.x, right),
            CloudView { quality: Some(quality), debug: plan.debug, ..default() },
        ));
        if let Some(buffer) = buffer {
            world.entity_mut(second).insert(CloudBuffer(buffer.clone()));
        }
        second
    }

    /// All that draw into the picture.
    fn cameras(&self) -> impl Iterator<Item = Entity> + use<> {
        [Some(self.camera), self.second].into_iter().flatten()
    }

    /// Puts camera, sun and clock where they are in the counted frame `k`.
    fn pose(&mut self, plan: &Plan, k: u32) {
        let (pose, sun) = (plan.camera(k), plan.sun(k).transform());
        let aspect = plan.size.0 as f32 / plan.size.1 as f32;
        let world = self.app.world_mut();
        world.entity_mut(self.camera).insert((pose.transform(), pose.projection(aspect)));
        if let Some(second) = self.second {
            let back = common::CameraPose { yaw: pose.yaw + 180.0, ..pose };
            world.entity_mut(second).insert((back.transform(), back.projection(aspect)));
        }
        world.entity_mut(self.sun).insert(sun);
        world.resource_mut::<CloudClock>().seconds = plan.seconds(k);
    }

    /// Renders one frame and waits until the GPU is done with it.
    fn update(&mut self) -> Result<()> {
        self.app.update();
        if self.app.should_exit().is_some() {
            bail!("the engine stopped rendering; the lines above say why");
        }
        let device = self.app.world().resource::<RenderDevice>().wgpu_device();
        let wait = PollType::Wait { submission_index: None, timeout: None };
        device.poll(wait).map_err(|error| anyhow!("waiting for the GPU: {error}"))?;
        Ok(())
    }

    /// Renders until textures are baked and pipelines are there, then a few frames more.
    fn make_ready(&mut self, plan: &Plan, settling: u32) -> Result<()> {
        let started = Instant::now();
        let stage = Stage::begin("baking textures", 100);
        // Thrown away: it has the screenshot's own pipeline made before frames are timed.
        if plan.out.is_some() {
            self.app.world_mut().spawn(Screenshot::image(self.target.clone()));
        }
        let mut settled = 0;
        while settled < settling {
            ensure!(
                started.elapsed() < READY_WITHIN,
                "textures and pipelines were not ready within {} s",
                READY_WITHIN.as_secs()
            );
            self.update()?;
            let world = self.app.world();
            let status = world.resource::<CloudStatus>();
            if let Some(reason) = status.unsupported() {
                bail!("clouds cannot be drawn on this device: {reason}");
            }
            let drawn = status.is_ready() && !world.resource::<CloudPhaseStatus>().computing;
            stage.at((world.resource::<CloudTextureStatus>().progress * 100.0) as u64);
            let made = self.pipelines_made()?;
            settled = if drawn && made { settled + 1 } else { 0 };
        }
        Ok(())
    }

    /// Whether no pipeline is waiting.
    ///
    /// # Errors
    /// A pipeline failed: its shader does not compile or the device refused it.
    fn pipelines_made(&self) -> Result<bool> {
        let Some(render) = self.app.get_sub_app(RenderApp) else { bail!("the renderer did not start") };
        let cache = render.world().resource::<PipelineCache>();
        let waiting: Vec<_> = cache.waiting_pipelines().collect();
        for (id, pipeline) in cache.pipelines().enumerate() {
            if let CachedPipelineState::Err(error) = &pipeline.state
                && !waiting.contains(&id)
            {
                bail!("a pipeline failed: {error}");
            }
        }
        Ok(waiting.is_empty())
    }

    /// Renders the frames that count, asks for the last one, and waits until it is back.
    fn count_frames(&mut self, plan: &Plan) -> Result<Timings> {
        let mut timings = Timings::default();
        for camera in self.cameras() {
            if let Some(mut view) = self.app.world_mut().get_mut::<CloudView>(camera) {
                view.reset += 1;
            }
        }
        let stage = Stage::begin("rendering frames", plan.frames.into());
        let mut readback = Vec::new();
        let (mut update, mut waiting_since) = (0, Instant::now());
        loop {
            let counted = update < plan.frames;
            if counted {
                self.pose(plan, update);
                waiting_since = Instant::now();
            }
            if update + 1 == plan.frames {
                readback = self.request(plan);
            }
            let began = Instant::now();
            self.update()?;
            if counted {
                timings.add_frame(began.elapsed().as_secs_f64() * 1e3);
            }
            for entity in std::mem::take(&mut readback) {
                self.app.world_mut().entity_mut(entity).remove::<Readback>();
            }
            let of_counted = (LAG..plan.frames + LAG).contains(&update);
            timings.take_passes(self.app.world().resource::<DiagnosticsStore>(), of_counted);
            update += 1;
            stage.at(u64::from(update.min(plan.frames)));
            if update >= plan.frames + LAG && self.is_back(plan) {
                return Ok(timings);
            }
            ensure!(
                update < plan.frames || waiting_since.elapsed() < BACK_WITHIN,
                "the picture did not come back from the GPU within {} s",
                BACK_WITHIN.as_secs()
            );
        }
    }

    /// Exposes as the plan says, and shows the stage that it asks for.
    fn expose(&mut self, plan: &Plan) {
        for camera in self.cameras() {
            if let Some(mut view) = self.app.world_mut().get_mut::<CloudView>(camera) {
                view.debug = plan.debug;
            }
            if let Some(mut exposure) = self.app.world_mut().get_mut::<bevy::camera::Exposure>(camera) {
                exposure.ev100 = plan.ev100;
            }
            if let Some(mut air) = self.app.world_mut().get_mut::<AtmosphereSettings>(camera) {
                *air = common::air(plan.camera(0).position.y);
            }
        }
    }

    /// Asks for what the next update renders.
    fn request(&mut self, plan: &Plan) -> Vec<Entity> {
        let world = self.app.world_mut();
        if plan.out.is_some() {
            world.spawn(Screenshot::image(self.target.clone())).observe(
                |shot: On<ScreenshotCaptured>, mut caught: ResMut<Caught>| {
                    caught.picture.get_or_insert_with(|| shot.image.clone());
                },
            );
        }
        type Slot = fn(&mut Caught) -> &mut Option<Vec<u8>>;
        let slots: [(_, _, Slot); 3] = [
            (plan.wants_buffer(), &self.buffer, |caught| &mut caught.cloud),
            (plan.wants_buffer(), &self.second_buffer, |caught| &mut caught.second_cloud),
            (plan.noise.is_some(), &self.noise, |caught| &mut caught.noise),
        ];
        let asked = slots.into_iter().filter_map(|(wanted, image, slot)| {
            let mut entity = world.spawn(Readback::texture(image.clone().filter(|_| wanted)?));
            entity.observe(move |read: On<ReadbackComplete>, mut caught: ResMut<Caught>| {
                slot(&mut caught).get_or_insert_with(|| read.data.clone());
            });
            Some(entity.id())
        });
        asked.collect()
    }

    fn is_back(&self, plan: &Plan) -> bool {
        let caught = self.app.world().resource::<Caught>();
        (plan.out.is_none() || caught.picture.is_some())
            && (!plan.wants_buffer() || caught.cloud.is_some())
            && (!plan.wants_buffer() || self.second_buffer.is_none() || caught.second_cloud.is_some())
            && (plan.noise.is_none() || caught.noise.is_some())
    }

    fn picture(&mut self, plan: &Plan) -> Result<Shot> {
        self.make_ready(plan, SETTLING_FRAMES)?;
        let timings = self.count_frames(plan)?;
        self.shot(plan, timings)
    }

    /// The pictures of a strip side by side.
    fn strip(&mut self, plan: &Plan) -> Result<Shot> {
        let (width, height) = plan.size;
        let mut strip = RgbImage::new(width * plan.strip.len() as u32, height);
        let (mut last, mut flaw) = (None, None);
        for (x, settings) in (0..).step_by(width as usize).zip(&plan.strip) {
            set(self.app.world_mut(), settings);
            let mut shot = self.picture(plan)?;
            let picture = shot.picture.take().ok_or_else(|| anyhow!("--out: no picture came back"))?;
            image::imageops::replace(&mut strip, &picture, x, 0);
            flaw = flaw.or(shot.flaw.take());
            last = Some(shot);
        }
        let last = last.ok_or_else(|| anyhow!("the strip has no picture"))?;
        Ok(Shot { picture: Some(strip), flaw, ..last })
    }

    fn shot(&mut self, plan: &Plan, timings: Timings) -> Result<Shot> {
        let world = self.app.world_mut();
        let caught = std::mem::take(&mut *world.resource_mut::<Caught>());
        let picture = caught.picture.map(Image::try_into_dynamic).transpose();
        let picture = picture.map_err(|error| anyhow!("the picture: {error}"))?;
        let image = |bytes: Option<Vec<u8>>| bytes.map(|bytes| float_image(plan.size, &bytes)).transpose();
        let (cloud, second, noise) = (image(caught.cloud)?, image(caught.second_cloud)?, image(caught.noise)?);
        let floats =
            [("the cloud buffer", &cloud), ("the second camera's cloud buffer", &second), ("the noise", &noise)];
        let flaw = floats.into_iter().find_map(|(what, image)| flaw(what, image.as_ref()?));
        let info = world.resource::<RenderAdapterInfo>();
        let adapter = format!("{} ({:?})", info.name, info.backend);
        let picture = picture.map(|picture| picture.to_rgb8());
        let counts = plan.counts.is_some().then(|| self.counts(plan)).transpose()?;
        Ok(Shot { picture, cloud, noise, flaw, timings, counts, adapter })
    }
}

/// Puts the settings in place.
fn set(world: &mut World, settings: &CloudSettings) {
    let settings = settings.clone();
    world.insert_resource(settings.model);
    world.insert_resource(settings.layers);
    world.insert_resource(settings.lighting);
    world.insert_resource(settings.quality);
    world.insert_resource(settings.textures);
    // The clock is set before every frame instead, so it has no speed of its own.
    world.insert_resource(CloudClock { speed: 0.0, ..settings.clock });
}

/// The image in a texture's bytes, whose rows are padded to a multiple of 256.
fn float_image((width, height): (u32, u32), bytes: &[u8]) -> Result<Rgba32FImage> {
    let row = width as usize * 16;
    let stride = RenderDevice::align_copy_bytes_per_row(row);
    let values = bytes
        .chunks(stride)
        .flat_map(|line| &line[..row.min(line.len())])
        .copied()
        .collect::<Vec<u8>>()
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    Rgba32FImage::from_raw(width, height, values)
        .ok_or_else(|| anyhow!("an image came back with {} bytes, too few for {width}x{height}", bytes.len()))
}
