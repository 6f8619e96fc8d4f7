//! The command line, and the plan it amounts to.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use bevy::math::Vec3;
use bevy_cumulus::prelude::*;
use clap::Parser;
use serde::Serialize;

use crate::{
    common::{CameraPose, Scene, SunPose, exactly},
    start::{Start, StartOptions},
};

/// Makes a picture of a sky without a window.
///
/// A scene sets defaults, every other option overrides them, and --set comes last.
#[derive(Parser, Debug)]
#[command(name = "headless", version)]
pub struct Options {
    /// Print the names of scenes, presets and settable paths, one a line
    #[arg(long)]
    pub list: bool,
    /// Print every setting that the other options amount to, as JSON, and render nothing
    #[arg(long)]
    pub effective: bool,
    /// Make many pictures in one go: each line of the file holds the options of one, added to those given here. They
    /// share size, textures, sky and what stands on the ground; nothing is quoted, `#` begins a comment
    #[arg(long, value_name = "FILE", conflicts_with_all = ["list", "effective"])]
    pub batch: Option<PathBuf>,
    /// With --batch: begin each picture only when a line comes in on standard input, so that two programs can take turns
    #[arg(long, requires = "batch")]
    pub paced: bool,
    #[command(flatten)]
    pub start: StartOptions,
    /// Show one stage of the clouds instead: coverage_map, type_map, dimensional_profile, eroded_density,
    /// single_scattering, multiple_scattering, no_phase, steps, transmittance, cloud_depth, single_frame, or none;
    /// for programs step_count, sample_count, read_count (see --counts)
    #[arg(long, value_name = "NAME", value_parser = debug_view)]
    pub debug: Option<CloudDebugView>,
    /// No ground, hills or buildings: nothing but sky and clouds
    #[arg(long)]
    pub no_land: bool,
    /// Size of the picture in pixels, each side from 1 to 8192; of each picture, where a scene is a strip of some
    #[arg(long, value_name = "WxH", default_value = "480x270", value_parser = size)]
    pub size: (u32, u32),
    /// Frames rendered; the last one is kept
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: u32,
    /// Added to the camera before every frame but the first, along the world's axes
    #[arg(long = "move", value_name = "DX,DY,DZ,DYAW,DPITCH", allow_hyphen_values = true,
          value_parser = |text: &str| exactly::<5>(text, "dx,dy,dz,dyaw,dpitch"))]
    pub travel: Option<[f32; 5]>,
    /// Added to the sun before every frame but the first
    #[arg(long, value_name = "DELEV,DAZIM", allow_hyphen_values = true,
          value_parser = |text: &str| exactly::<2>(text, "delev,dazim"))]
    pub sun_move: Option<[f32; 2]>,
    /// The cloud clock at the first frame (s)
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = finite)]
    pub time: Option<f64>,
    /// Added to the cloud clock before every frame but the first (s)
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, default_value_t = 0.0, value_parser = finite)]
    pub dt: f64,
    /// Exposure of the camera (EV100); by default it follows the sun's elevation
    #[arg(long, value_name = "EV100", allow_hyphen_values = true, value_parser = ev100)]
    pub ev: Option<f32>,
    /// Samples of multisample anti-aliasing
    #[arg(long, default_value = "1", value_parser = ["1", "4"])]
    pub msaa: String,
    /// Write the picture as shown
    #[arg(long, value_name = "SHOT.png")]
    pub out: Option<PathBuf>,
    /// Write the cloud buffer: radiance (cd/m²) and transmittance, 32-bit float
    #[arg(long, value_name = "CLOUD.exr")]
    pub cloud: Option<PathBuf>,
    /// Write the reference's noise: standard errors of luminance (cd/m²) and of transmittance, samples, share lost
    #[arg(long, value_name = "NOISE.exr")]
    pub noise: Option<PathBuf>,
    /// Write what each pass and the whole frame took (ms)
    #[arg(long, value_name = "T.json")]
    pub timings: Option<PathBuf>,
    /// Write what the rays of the last frame did: their steps, media sampled and textures read, all together, a ray's mean
    /// and the most of one. They repeat from run to run
    #[arg(long, value_name = "C.json")]
    pub counts: Option<PathBuf>,
}

fn debug_view(text: &str) -> Result<CloudDebugView, String> {
    CloudDebugView::named(text).ok_or_else(|| {
        let known = CloudDebugView::ALL.map(CloudDebugView::name).join(", ");
        format!("no such debug view; there are {known}")
    })
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |part: &str| part.parse().ok().filter(|n| (1..=8192).contains(n));
    let sides = text.split_once('x').and_then(|(w, h)| Some((side(w)?, side(h)?)));
    sides.ok_or_else(|| "expected WxH, such as 480x270, with sides from 1 to 8192".to_owned())
}

fn finite(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|n: &f64| n.is_finite());
    number.ok_or_else(|| "expected a finite number".to_owned())
}

fn ev100(text: &str) -> Result<f32, String> {
    let number = finite(text).ok().filter(|n| (-10.0..=30.0).contains(n));
    number.map(|n| n as f32).ok_or_else(|| "expected a number from -10 to 30".to_owned())
}

/// Frames of a history that counts tell apart (see `CloudCounts`).
const MOST_COUNTED: u32 = 2047;

/// What is to be rendered, with every default filled in and every value checked.
pub struct Plan {
    pub scene: Scene,
    /// The scene's name, where one was given.
    named: Option<&'static str>,
    pub preset: String,
    pub settings: CloudSettings,
    /// The settings of each picture of a strip, from left to right; empty where there is one picture.
    pub strip: Vec<CloudSettings>,
    pub debug: CloudDebugView,
    pub size: (u32, u32),
    pub frames: u32,
    pub sky: bool,
    pub land: bool,
    pub msaa: u32,
    pub ev100: f32,
    pub out: Option<PathBuf>,
    pub cloud: Option<PathBuf>,
    pub noise: Option<PathBuf>,
    pub timings: Option<PathBuf>,
    pub counts: Option<PathBuf>,
    camera: CameraPose,
    travel: [f32; 5],
    sun: SunPose,
    sun_move: [f32; 2],
    dt: f64,
}

impl Options {
    /// Fills in the defaults and checks the rest.
    pub fn plan(&self) -> Result<Plan> {
        // Runs must repeat, so real time does not move the clouds.
        let clock = CloudClock { seconds: self.time.unwrap_or(0.0), speed: 0.0 };
        let Start { scene, named, preset, settings, strip, camera, sun, sky, .. } = self.start.start(None, clock)?;
        if !strip.is_empty() {
            let pictures = strip.len() as u32;
            ensure!(
                [&self.cloud, &self.noise, &self.timings, &self.counts].iter().all(|file| file.is_none()),
                "--scene {}: a strip of {pictures} pictures has no single cloud buffer, noise, timings and counts; leave \
                 --cloud, --noise, --timings and --counts out",
                scene.name
            );
            ensure!(
                self.size.0 * pictures <= 65_536,
                "--size: each of the strip's {pictures} pictures may be {} pixels wide",
                65_536 / pictures
            );
        }
        ensure!(
            self.noise.is_none() || settings.quality.method == CloudMethod::PathTrace,
            "--noise: only --quality reference (or quality.method = PathTrace) knows its noise"
        );
        ensure!(
            self.counts.is_none() || (settings.quality.method == CloudMethod::March && !scene.split),
            "--counts: only one camera's march has rays to count, not the path tracer, nor a scene of two cameras"
        );
        ensure!(
            self.counts.is_none() || self.frames <= MOST_COUNTED,
            "--counts: takes at most {MOST_COUNTED} frames (--frames {})",
            self.frames
        );
        Ok(Plan {
            scene,
            named,
            settings,
            strip,
            debug: self.debug.unwrap_or(scene.debug),
            preset,
            sky,
            land: !self.no_land,
            camera,
            sun,
            size: self.size,
            frames: self.frames,
            msaa: if self.msaa == "4" { 4 } else { 1 },
            ev100: self.ev.unwrap_or(sun.ev100() + scene.ev_offset),
            out: self.out.clone(),
            cloud: self.cloud.clone(),
            noise: self.noise.clone(),
            timings: self.timings.clone(),
            counts: self.counts.clone(),
            travel: self.travel.unwrap_or_default(),
            sun_move: self.sun_move.unwrap_or_default(),
            dt: self.dt,
        })
    }
}

impl Plan {
    /// Seconds of virtual time a frame takes.
    pub const FRAME_SECONDS: f64 = 1.0 / 60.0;

    /// The camera of the counted frame `k`, from 0.
    pub fn camera(&self, k: u32) -> CameraPose {
        let [dx, dy, dz, yaw, pitch] = self.travel.map(|d| d * k as f32);
        CameraPose {
            position: self.camera.position + Vec3::new(dx, dy, dz),
            yaw: self.camera.yaw + yaw,
            pitch: self.camera.pitch + pitch,
            fov: self.camera.fov,
        }
    }

    /// The sun of the counted frame `k`, from 0.
    pub fn sun(&self, k: u32) -> SunPose {
        let [elevation, azimuth] = self.sun_move.map(|d| d * k as f32);
        SunPose { elevation: self.sun.elevation + elevation, azimuth: self.sun.azimuth + azimuth }
    }

    /// The cloud clock of the counted frame `k`, from 0 (s).
    pub fn seconds(&self, k: u32) -> f64 {
        let clock = &self.settings.clock;
        clock.seconds + f64::from(k) * (self.dt + f64::from(clock.speed) * Self::FRAME_SECONDS)
    }

    /// Whether the cloud buffer is read back: to be written, or to be looked at for what a picture hides.
    pub fn wants_buffer(&self) -> bool {
        self.out.is_some() || self.cloud.is_some()
    }

    /// The files asked for: option, path and extension.
    pub fn files(&self) -> Vec<(&'static str, &Path, &'static str)> {
        let all = [
            ("--out", &self.out, "png"),
            ("--cloud", &self.cloud, "exr"),
            ("--noise", &self.noise, "exr"),
            ("--timings", &self.timings, "json"),
            ("--counts", &self.counts, "json"),
        ];
        all.into_iter().filter_map(|(option, path, kind)| Some((option, path.as_deref()?, kind))).collect()
    }

    /// What differs from a plan whose engine is to render this one too, if anything does.
    pub fn differs_in_setup(&self, other: &Self) -> Option<&'static str> {
        let same = [
            ("--no-land", self.land == other.land),
            ("a scene's hills", self.scene.hills == other.scene.hills),
            ("a scene's second camera", self.scene.split == other.scene.split),
            ("--size", self.size == other.size),
            ("--no-sky", self.sky == other.sky),
            ("--msaa", self.msaa == other.msaa),
            ("a setting of textures", self.settings.textures == other.settings.textures),
        ];
        same.into_iter().find_map(|(what, same)| (!same).then_some(what))
    }

    /// Everything that decides the picture, for the timings file.
    pub fn effective(&self) -> Effective<'_> {
        Effective {
            model: &self.settings.model,
            layers: &self.settings.layers,
            lighting: &self.settings.lighting,
            quality: &self.settings.quality,
            textures: &self.settings.textures,
            clock: &self.settings.clock,
            camera: self.camera,
            travel: self.travel,
            sun: self.sun,
            sun_move: self.sun_move,
            dt: self.dt,
            frames: self.frames,
            sky: self.sky,
            land: self.land,
            msaa: self.msaa,
            ev100: self.ev100,
            debug: self.debug.name(),
            scene: self.named,
            preset: &self.preset,
        }
    }
}

/// What was rendered; camera, sun and clock are those of the first frame.
#[derive(Serialize)]
pub struct Effective<'a> {
    model: &'a CloudModel,
    layers: &'a CloudLayers,
    lighting: &'a CloudLighting,
    quality: &'a CloudQuality,
    textures: &'a CloudTextures,
    clock: &'a CloudClock,
    camera: CameraPose,
    #[serde(rename = "move")]
    travel: [f32; 5],
    sun: SunPose,
    sun_move: [f32; 2],
    dt: f64,
    frames: u32,
    sky: bool,
    land: bool,
    msaa: u32,
    ev100: f32,
    debug: String,
    scene: Option<&'static str>,
    preset: &'a str,
}
