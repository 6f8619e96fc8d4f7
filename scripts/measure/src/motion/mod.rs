//! Every temporal mode in motion against a converged still of the same instant, its flicker at rest, and its cost.

mod report;

use std::fs;

use anyhow::{Context as _, Result, ensure};
use clap::Args;
use serde_json::Value;

use crate::{
    Common,
    engine::{Engine, Job},
    machine::Machine,
    metrics::Truth,
    picture::{Picture, encode},
    progress::Progress,
    sheet,
};

const SMALL_SIZE: &str = "128x72";
/// Small pictures show the middle of each view so many times larger: more would be another speed.
const ZOOM: f64 = 2.0;
/// Frames of motion; the last one is judged.
const FRAMES: u32 = 32;
/// Frames of a still view, one after another, that flicker is measured by.
const STILLS: u32 = 3;
/// How far a moving frame's FLIP may be above that of the same mode at rest.
const TARGET: f64 = 0.05;

/// Per frame at 60 frames a second.
struct Motion {
    name: &'static str,
    what: &'static str,
    scene: &'static str,
    /// Position, yaw and pitch at first; `None` for the scene's own.
    from: Option<[f64; 5]>,
    metres: [f64; 3],
    yaw: f64,
    /// Of the sun's elevation.
    sun: f64,
    /// Of the cloud clock, in a wind of 20 m/s.
    seconds: f64,
}

const REST: Motion =
    Motion { name: "", what: "", scene: "ground_noon", from: None, metres: [0.0; 3], yaw: 0.0, sun: 0.0, seconds: 0.0 };
const FRAME: f64 = 1.0 / 60.0;

const MOTIONS: [Motion; 5] = [
    Motion { name: "pan", what: "turning by 30°/s on the ground, wind", yaw: 0.5, seconds: FRAME, ..REST },
    Motion {
        name: "past",
        what: "200 m/s below and past clouds",
        from: Some([0.0, 1100.0, 0.0, 0.0, 12.0]),
        metres: [0.0, 0.0, -200.0 * FRAME],
        ..REST
    },
    Motion {
        name: "through",
        what: "200 m/s through clouds",
        scene: "inside",
        from: Some([0.0, 2100.0, 0.0, 0.0, 4.0]),
        metres: [0.0, 0.0, -200.0 * FRAME],
        ..REST
    },
    Motion { name: "sun", what: "a sun that climbs 15° a minute", sun: 0.25 * FRAME, ..REST },
    Motion { name: "wind", what: "a wind of 20 m/s", seconds: FRAME, ..REST },
];

/// The modes: name in the report, and options.
const MODES: [(&str, &str); 5] = [
    ("Off", "--set quality.temporal=off"),
    ("SlidingWindow(8)", "--set quality.temporal=sliding_window"),
    ("Exponential(0.05)", "--set quality.temporal=exponential"),
    ("Upscale 2×2", "--set quality.temporal=upscale --set quality.block=two"),
    ("Upscale 4×4", "--set quality.temporal=upscale --set quality.block=four"),
];
/// The converged still: as many frames as a window holds.
const CONVERGED: &str = "--set quality.temporal=sliding_window --set quality.window=16";
/// Bevy's sky costs a software driver ten times what small clouds do, and no mode touches it: they are shown over a plain
/// one, of this light (linear, as it shows).
const NO_SKY: &str = "--no-sky";
const PLAIN_SKY: [f64; 3] = [0.12, 0.23, 0.45];
/// Frames of the converged still, and until every mode is at rest.
const CONVERGED_AFTER: u32 = 16;
const SETTLED: u32 = 40;

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
    /// Only these motions: pan, past, through, sun, wind
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    only: Vec<String>,
}

/// One mode in one motion.
struct Row {
    /// FLIP to the converged still, over the cloud: at rest and in motion.
    still: f64,
    moving: f64,
    /// Flicker of a still view, in the first motion alone.
    flicker: Option<f64>,
    /// GPU time of the march and of all our passes in motion (ms).
    march: Option<f64>,
    total: Option<f64>,
}

struct Results {
    size: String,
    zoom: f64,
    sky: bool,
    /// Motion and its rows, one for each mode.
    motions: Vec<(&'static Motion, Vec<Row>)>,
    machine: Machine,
    seconds: u64,
}

pub fn run(options: &Options) -> Result<()> {
    let common = &options.common;
    for part in &options.only {
        let names = MOTIONS.map(|motion| motion.name);
        ensure!(names.contains(&part.as_str()), "--only {part}: there are {}", names.join(", "));
    }
    let mut engine = common.engine("motion")?;
    let size = common.size(SMALL_SIZE);
    let chosen: Vec<&'static Motion> = MOTIONS
        .iter()
        .filter(|motion| options.only.is_empty() || options.only.iter().any(|only| only == motion.name))
        .collect();
    let progress = Progress::begin(chosen.len() * (1 + MODES.len() * 2) + MODES.len() * (STILLS as usize - 1));
    // Each job brings its own camera, with the zoom in it.
    let zoom = common.zoom.unwrap_or(if common.full { 1.0 } else { ZOOM });
    engine.zoom = 1.0;
    let mut motions = Vec::new();
    let mut adapter = String::new();
    for motion in chosen {
        let stills = if motions.is_empty() { STILLS } else { 1 };
        let view = View { size: &size, zoom, real_sky: common.full };
        let rows = measure(&engine, motion, stills, &view, &progress)?;
        adapter = engine.cost(motion.scene, &job(motion, 0, "moving"))?.adapter;
        motions.push((motion, rows));
    }
    if !common.keep {
        for (motion, _) in &motions {
            let folder = engine.folder(motion.scene);
            if folder.is_dir() {
                fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
            }
        }
    }
    let report_path = common.report(&engine, "MOTION.md", options.only.is_empty());
    let results = Results {
        size,
        zoom,
        sky: common.full,
        motions,
        machine: Machine::this(&adapter),
        seconds: progress.seconds(),
    };
    drop(progress);
    fs::write(&report_path, report::write(&results))
        .with_context(|| format!("cannot write {}", report_path.display()))?;
    println!("{}", report_path.display());
    Ok(())
}

fn job(motion: &Motion, mode: usize, what: &str) -> String {
    format!("{}_{mode}_{what}", motion.name)
}

/// What every picture has in common.
struct View<'a> {
    size: &'a str,
    zoom: f64,
    /// Bevy's sky, or [`PLAIN_SKY`].
    real_sky: bool,
}

/// Options that put camera, sun and clock where they are `k` frames after the start, and move nothing.
fn instant(motion: &Motion, effective: &Value, zoom: f64, k: u32) -> Result<String> {
    let number = |value: &Value| value.as_f64().with_context(|| format!("headless --effective: {effective}"));
    let camera = &effective["camera"];
    let own =
        [&camera["position"][0], &camera["position"][1], &camera["position"][2], &camera["yaw"], &camera["pitch"]];
    let [x, y, z, yaw, pitch] = match motion.from {
        Some(from) => from,
        None => {
            let mut from = [0.0; 5];
            for (to, value) in from.iter_mut().zip(own) {
                *to = number(value)?;
            }
            from
        }
    };
    let fov = 2.0 * ((number(&camera["fov"])?.to_radians() / 2.0).tan() / zoom).atan().to_degrees();
    let k = f64::from(k);
    let [dx, dy, dz] = motion.metres;
    let (elevation, azimuth) = (number(&effective["sun"]["elevation"])?, number(&effective["sun"]["azimuth"])?);
    Ok(format!(
        "--camera {},{},{},{},{pitch},{fov} --sun {},{azimuth} --time {} --ev {} --set model.wind=20,0,0",
        x + k * dx,
        y + k * dy,
        z + k * dz,
        yaw + k * motion.yaw,
        elevation + k * motion.sun,
        k * motion.seconds,
        number(&effective["ev100"])?,
    ))
}

fn measure(engine: &Engine, motion: &Motion, stills: u32, view: &View, progress: &Progress) -> Result<Vec<Row>> {
    let effective = engine.effective(&format!("--scene {}", motion.scene))?;
    let sky = if view.real_sky { "" } else { NO_SKY };
    let ev100 = effective["ev100"].as_f64().context("headless --effective: no ev100")?;
    let picture = |name: &str| -> Result<Picture> {
        let seen = engine.picture(motion.scene, name)?;
        Ok(if view.real_sky { seen } else { over_plain_sky(seen, ev100) })
    };
    let at = |k| Ok::<_, anyhow::Error>(format!("{} {}", instant(motion, &effective, view.zoom, k)?, sky));
    let (first, last) = (at(0)?, at(FRAMES - 1)?);
    let [dx, dy, dz] = motion.metres;
    let moves = format!("--move {dx},{dy},{dz},{},0 --sun-move {},0 --dt {}", motion.yaw, motion.sun, motion.seconds);
    let new = |name: String, options: String, frames| Job { name, options, frames, picture: true };
    let mut jobs = vec![new(job(motion, MODES.len(), "truth"), format!("{last} {CONVERGED}"), CONVERGED_AFTER)];
    for (mode, (_, options)) in MODES.iter().enumerate() {
        jobs.push(new(job(motion, mode, "moving"), format!("{first} {moves} {options}"), FRAMES));
        for k in 0..stills {
            // Each starts over, and ends a frame later.
            jobs.push(new(job(motion, mode, &format!("still{k}")), format!("{last} {options}"), SETTLED + k));
        }
    }
    engine.render(motion.scene, view.size, &jobs, progress)?;
    let truth = Truth::exact(picture(&job(motion, MODES.len(), "truth"))?)?;
    let mut rows = Vec::new();
    let mut pictures = Vec::new();
    for (mode, _) in MODES.iter().enumerate() {
        let moving = picture(&job(motion, mode, "moving"))?;
        let stills: Vec<Picture> =
            (0..stills).map(|k| picture(&job(motion, mode, &format!("still{k}")))).collect::<Result<_>>()?;
        let cost = engine.cost(motion.scene, &job(motion, mode, "moving"))?;
        let (in_motion, map) = truth.judge(&moving)?;
        rows.push(Row {
            still: truth.judge(&stills[0])?.0.flip,
            moving: in_motion.flip,
            flicker: (stills.len() > 1).then(|| flicker(&stills)),
            march: cost.march(),
            total: cost.total(),
        });
        pictures.push(vec![truth.picture().shown.clone(), stills[0].shown.clone(), moving.shown.clone(), map.magma]);
    }
    sheet::write(&engine.out.join(format!("{}.png", motion.name)), &pictures)?;
    Ok(rows)
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

/// Root of the mean variance over time of the pixels' brightness as shown, over the mean brightness; 0 for nothing.
fn flicker(pictures: &[Picture]) -> f64 {
    let count = pictures.len() as f64;
    let Some(first) = pictures.first() else { return 0.0 };
    let (mut variance, mut total) = (0.0, 0.0);
    for (x, y, _) in first.shown.enumerate_pixels() {
        let of = |p: &Picture| {
            let [r, g, b] = p.shown.get_pixel(x, y).0.map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let mean = pictures.iter().map(of).sum::<f64>() / count;
        variance += pictures.iter().map(|p| (of(p) - mean).powi(2)).sum::<f64>() / count;
        total += mean;
    }
    let pixels = f64::from(first.shown.width() * first.shown.height()).max(1.0);
    if total > 0.0 { (variance / pixels).sqrt() / (total / pixels) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::plain;

    #[test]
    fn flicker_is_the_share_that_changes() {
        let grey = |code| plain([code; 3], [1.0; 4]);
        assert_eq!(flicker(&[]), 0.0);
        assert_eq!(flicker(&[grey(100), grey(100)]), 0.0);
        assert!((flicker(&[grey(90), grey(110)]) - 0.1).abs() < 1e-9);
    }

    #[test]
    fn the_still_stands_where_the_motion_ends() {
        let effective = serde_json::json!({
            "camera": { "position": [1.0, 2.0, 3.0], "yaw": 10.0, "pitch": 5.0, "fov": 60.0 },
            "sun": { "elevation": 40.0, "azimuth": 90.0 }, "ev100": 14.0
        });
        let motion = Motion { metres: [0.0, 1.0, 0.0], yaw: 0.5, sun: 0.25, seconds: 2.0, ..REST };
        let options = instant(&motion, &effective, 1.0, 4).unwrap();
        assert!(options.starts_with("--camera 1,6,3,12,5,"), "{options}");
        assert!(options.contains("--sun 41,90 --time 8 --ev 14"), "{options}");
    }
}
