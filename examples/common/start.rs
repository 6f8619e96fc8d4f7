//! The command line of examples that show a scene: what is in it, from where, and with which settings.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, bail};
use bevy::asset::{
    AssetPath,
    io::{AssetSourceId, file::FileAssetReader},
};
use bevy_cumulus::prelude::*;
#[cfg(feature = "metar")]
use bevy_cumulus::weather::metar::MetarSky;
use clap::Args;

use crate::common::{CameraPose, PLAIN, Scene, Setting, SunPose};

/// A scene sets defaults, every other option overrides them, and --set comes last.
#[derive(Args, Debug)]
pub struct StartOptions {
    /// What is in the picture, and from where it is seen
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,
    /// The sky: a built-in preset or a file
    #[arg(long, value_name = "NAME|FILE.ron")]
    pub preset: Option<String>,
    /// The sky of an airport's report, such as "EGLL 231150Z 24012KT 9999 FEW022 BKN048 12/07 Q1013", in a preset's place
    #[cfg(feature = "metar")]
    #[arg(long, value_name = "REPORT", conflicts_with = "preset")]
    pub metar: Option<String>,
    /// Altitude of that airport (m)
    #[cfg(feature = "metar")]
    #[arg(long, value_name = "METRES", default_value_t = 0.0, allow_hyphen_values = true, requires = "metar",
          value_parser = elevation)]
    pub elevation: f32,
    /// What the sky may cost
    #[arg(long, value_parser = ["low", "medium", "high", "ultra", "reference"])]
    pub quality: Option<String>,
    /// Metres and degrees; y is the altitude, yaw 0 looks along −Z and turns right, fov is vertical (60)
    #[arg(long, value_name = "X,Y,Z,YAW,PITCH[,FOV]", allow_hyphen_values = true)]
    pub camera: Option<CameraPose>,
    /// Degrees; the azimuth is counted as yaw is
    #[arg(long, value_name = "ELEVATION,AZIMUTH", allow_hyphen_values = true)]
    pub sun: Option<SunPose>,
    /// Any setting by its path, such as model.coverage=0.2; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub sets: Vec<String>,
    /// No atmosphere: black behind the clouds
    #[arg(long)]
    pub no_sky: bool,
}

/// What to start with, with every default filled in and every value checked.
#[derive(Clone)]
pub struct Start {
    pub scene: Scene,
    /// The scene's name, where one was given.
    pub named: Option<&'static str>,
    pub preset: String,
    /// The file it was read from, if it was.
    #[allow(dead_code, reason = "a window reads it again")]
    pub preset_file: Option<PathBuf>,
    pub settings: CloudSettings,
    /// The settings of each picture of a strip; empty where there is one picture.
    #[allow(dead_code, reason = "a window shows one picture")]
    pub strip: Vec<CloudSettings>,
    pub camera: CameraPose,
    pub sun: SunPose,
    pub sky: bool,
}

impl StartOptions {
    /// Fills in the defaults, from this scene where none is named (else the plain one) and this clock, and checks the
    /// rest.
    pub fn start(&self, unnamed: Option<&str>, clock: CloudClock) -> Result<Start> {
        let named = self.scene.as_deref().map(find_scene).transpose()?;
        let scene = named.or_else(|| Scene::named(unnamed?)).unwrap_or(PLAIN);
        let preset_name = self.preset.as_deref().unwrap_or(scene.preset);
        #[cfg(feature = "metar")]
        let (preset_name, reported) = match &self.metar {
            Some(line) => ("metar", Some(MetarSky::parse(line, self.elevation).context("--metar")?.sky(LATITUDE, 0))),
            None => (preset_name, None),
        };
        #[cfg(not(feature = "metar"))]
        let reported = None;
        let (preset, preset_file) = match reported {
            Some(sky) => (sky, None),
            None => find_preset(preset_name)?,
        };
        // A scene has its sun; else the preset's advice is taken.
        let advised = preset.sun_elevation.filter(|_| named.is_none() && (unnamed.is_none() || self.preset.is_some()));
        let elevation = advised.unwrap_or(scene.sun.elevation);
        Ok(Start {
            strip: scene
                .strip
                .iter()
                .map(|panel| self.settings(preset.clone(), clock.clone(), scene, panel))
                .collect::<Result<_>>()?,
            settings: self.settings(preset, clock, scene, &[])?,
            preset: preset_name.to_owned(),
            preset_file,
            named: named.map(|scene| scene.name),
            camera: self.camera.unwrap_or(scene.camera),
            sun: self.sun.unwrap_or(SunPose { elevation, ..scene.sun }),
            sky: !self.no_sky,
            scene,
        })
    }

    fn settings(
        &self,
        preset: CloudPreset,
        clock: CloudClock,
        scene: Scene,
        panel: &[Setting],
    ) -> Result<CloudSettings> {
        let mut settings = CloudSettings {
            model: preset.model,
            layers: preset.layers,
            lighting: preset.lighting,
            textures: preset.textures,
            clock,
            ..Default::default()
        };
        if let Some(quality) = self.quality.as_deref().and_then(CloudQuality::named) {
            settings.quality = quality;
        }
        for (path, value) in scene.settings.iter().chain(panel) {
            settings.set(path, value).with_context(|| format!("scene {}", scene.name))?;
        }
        settings.validate().context("settings")?;
        for text in &self.sets {
            let (path, value) = text
                .split_once('=')
                .ok_or_else(|| anyhow!("--set {text}: expected PATH=VALUE, such as model.coverage=0.2"))?;
            settings.set(path.trim(), value).with_context(|| format!("--set {text}"))?;
        }
        settings.validate().context("--set")?;
        Ok(settings)
    }
}

/// Of airports in temperate regions (degrees north).
#[cfg(feature = "metar")]
const LATITUDE: f32 = 50.0;

#[cfg(feature = "metar")]
fn elevation(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok().filter(|metres| (-430.0..=6000.0).contains(metres));
    number.ok_or_else(|| "expected metres from -430 to 6000".to_owned())
}

fn find_scene(name: &str) -> Result<Scene> {
    Scene::named(name).ok_or_else(|| {
        let known = Scene::all().map(|scene| scene.name).collect::<Vec<_>>().join(", ");
        anyhow!("--scene {name:?}: no such scene; there are {known}")
    })
}

/// A preset by its name or file, and that file.
fn find_preset(name: &str) -> Result<(CloudPreset, Option<PathBuf>)> {
    if let Some(preset) = CloudPreset::named(name) {
        return Ok((preset, None));
    }
    let path = Path::new(name);
    if path.extension().is_some_and(|extension| extension == "ron") || path.is_file() {
        return Ok((read_preset(path)?, Some(path.to_owned())));
    }
    let known = CloudPreset::names().collect::<Vec<_>>().join(", ");
    bail!("--preset {name:?}: no such preset; there are {known}, or give a .ron file")
}

/// Reads a preset whose map files lie in the assets folder.
pub fn read_preset(path: &Path) -> Result<CloudPreset> {
    CloudPreset::read_with(path, is_map_there).context("--preset")
}

/// Looks where Bevy will look.
fn is_map_there(map: &AssetPath) -> Result<(), String> {
    let file = FileAssetReader::get_base_path().join("assets").join(map.path());
    if *map.source() != AssetSourceId::Default || file.is_file() {
        Ok(())
    } else {
        Err(format!("there is no file {}", file.display()))
    }
}
