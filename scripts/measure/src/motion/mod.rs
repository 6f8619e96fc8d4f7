//! Every temporal mode in motion against converged stills of the same instants, its flicker, and its cost.

mod flicker;
mod judge;
mod plan;
mod report;

use std::fs;

use anyhow::{Context as _, Result, ensure};
use clap::Args;
use serde_json::Value;

use crate::{
    Common,
    engine::Engine,
    label::fill,
    machine::Machine,
    picture::{Picture, encode},
    progress::Progress,
};
use judge::Moved;
use plan::{FLICKER_FRAMES, FLICKERS, MODES, MOTIONS, Motion};

const SMALL_SIZE: &str = "128x72";
/// Small pictures show the middle of each view so many times larger: more would be another speed.
const ZOOM: f64 = 2.0;
/// Bevy's sky costs a software driver ten times what small clouds do, and no mode touches it: they are shown over a plain
/// one, of this light (linear, as it shows).
const NO_SKY: &str = "--no-sky";
const PLAIN_SKY: [f64; 3] = [0.12, 0.23, 0.45];
/// The part beside the motions.
const FLICKER: &str = "flicker";

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
    /// Only these parts: pan, past, into, out, sun, wind, flicker
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    only: Vec<String>,
}

impl Options {
    fn has(&self, part: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|only| only == part)
    }
}

/// What every picture has in common.
struct Bench {
    engine: Engine,
    size: String,
    zoom: f64,
    /// Bevy's sky, or [`PLAIN_SKY`].
    real_sky: bool,
    progress: Progress,
}

struct Results {
    size: String,
    zoom: f64,
    sky: bool,
    /// The default's, if it is a preset.
    preset: Option<&'static str>,
    /// Names of [`MODES`], with their settings.
    modes: Vec<String>,
    motions: Vec<Moved>,
    /// Of each of [`FLICKERS`], for each mode.
    flicker: Option<Vec<Vec<f64>>>,
    machine: Machine,
    seconds: u64,
}

pub fn run(options: &Options) -> Result<()> {
    let common = &options.common;
    for part in &options.only {
        let mut names = MOTIONS.iter().map(|motion| motion.name).chain([FLICKER]);
        ensure!(
            names.any(|name| name == part),
            "--only {part}: there are {}, {FLICKER}",
            MOTIONS.map(|motion| motion.name).join(", ")
        );
    }
    let mut engine = common.engine("motion")?;
    let chosen: Vec<&'static Motion> = MOTIONS.iter().filter(|motion| options.has(motion.name)).collect();
    let instants: usize = chosen.iter().map(|motion| motion.judged.len()).sum();
    let flickers = if options.has(FLICKER) { FLICKERS.len() * FLICKER_FRAMES as usize } else { 0 };
    let progress = Progress::begin(instants * (1 + 2 * MODES.len()) + flickers * MODES.len());
    // Each job brings its own camera, with the zoom in it.
    let zoom = common.zoom.unwrap_or(if common.full { 1.0 } else { ZOOM });
    engine.zoom = 1.0;
    let bench = Bench { engine, size: common.size(SMALL_SIZE), zoom, real_sky: common.full, progress };
    let motions = chosen.iter().map(|motion| judge::measure(&bench, motion)).collect::<Result<Vec<_>>>()?;
    let flicker = options.has(FLICKER).then(|| flicker::measure(&bench)).transpose()?;
    let adapter = bench.adapter(&motions)?;
    if !common.keep {
        bench.clear_up()?;
    }
    let report_path = common.report(&bench.engine, "motion", options.only.is_empty())?;
    let modes = MODES.iter().map(|mode| fill(mode.name, &bench.engine.effective(mode.options)?));
    let modes = modes.collect::<Result<Vec<_>>>()?;
    let preset = bench.engine.quality_preset(None)?;
    let Bench { size, zoom, real_sky, progress, .. } = bench;
    let seconds = progress.seconds();
    drop(progress);
    let machine = Machine::this(&adapter, &common.repository);
    let results = Results { size, zoom, sky: real_sky, preset, modes, motions, flicker, machine, seconds };
    fs::write(&report_path, report::write(&results))
        .with_context(|| format!("cannot write {}", report_path.display()))?;
    println!("{}", report_path.display());
    Ok(())
}

impl Bench {
    /// Options for what is behind the clouds.
    fn sky(&self) -> &'static str {
        if self.real_sky { "" } else { NO_SKY }
    }

    /// A job's picture, as it is judged.
    fn picture(&self, scene: &str, job: &str, effective: &Value) -> Result<Picture> {
        let seen = self.engine.picture(scene, job)?;
        let ev100 = effective["ev100"].as_f64().context("headless --effective: no ev100")?;
        Ok(if self.real_sky { seen } else { over_plain_sky(seen, ev100) })
    }

    /// The device, as any of the jobs names it.
    fn adapter(&self, motions: &[Moved]) -> Result<String> {
        let (scene, job) = match motions.first() {
            Some(Moved { motion, .. }) => {
                let k = motion.judged.first().copied().unwrap_or_default();
                (motion.scene, judge::job(motion, 0, k, "moving"))
            }
            None => (FLICKERS[0].scene, flicker::job(&FLICKERS[0], 0, 0)),
        };
        Ok(self.engine.cost(scene, &job)?.adapter)
    }

    fn clear_up(&self) -> Result<()> {
        for motion in MOTIONS.iter().chain(&FLICKERS) {
            let folder = self.engine.folder(motion.scene);
            if folder.is_dir() {
                fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
            }
        }
        Ok(())
    }
}

/// The clouds as they would show over a plain sky, by a plain tone mapping.
fn over_plain_sky(mut picture: Picture, ev100: f64) -> Picture {
    // Bevy's `Exposure`.
    let exposure = 1.0 / (1.2 * ev100.exp2());
    for (shown, cloud) in picture.shown.pixels_mut().zip(picture.cloud.pixels()) {
        let [light @ .., through] = cloud.0.map(f64::from);
        shown.0 = std::array::from_fn(|i| {
            let linear = light[i] * exposure + through * PLAIN_SKY[i];
            encode(linear / (1.0 + linear))
        });
    }
    picture
}
