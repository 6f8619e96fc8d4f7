//! Errors and costs of presets and of single approximations, against the path tracer and against our own converged
//! march.

mod report;
mod rows;

use std::fs;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use serde_json::{Value, json};

use crate::{
    Common,
    backdrop::Backdrop,
    engine::{Cost, Engine, Job},
    machine::Machine,
    metrics::{Errors, Truth},
    picture::Picture,
    progress::Progress,
    sheet,
    taken::Taken,
};
pub use rows::converged;
use rows::{CONVERGED, Group, HIGH, Row};

/// Scenes of a full run; a small one, which is to end within half an hour on two processor cores, has the first ones only.
const SCENES: [&str; 6] = ["ground_noon", "ground_backlit", "overcast", "sunset", "hills", "above"];
const FEW_SCENES: usize = 4;
const SMALL_SIZE: &str = "96x54";
/// Samples of a reference, both halves together.
const SAMPLES: u32 = 64;
const FULL_SAMPLES: u32 = 4096;
/// Frames of a job that only measures High's cost again, and rows between two of them: machines speed up and slow down.
const HIGH_AGAIN_FRAMES: u32 = 8;
const HIGH_AGAIN_EVERY: usize = 3;

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
    /// Only these scenes
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    scenes: Vec<String>,
    /// Only rows with one of these in their name, such as octaves,window
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    only: Vec<String>,
    /// Print the names of the rows
    #[arg(long)]
    list: bool,
}

/// What was found for one row in one scene.
struct Found {
    /// Against the reference, and against the converged march.
    to_truth: Errors,
    to_converged: Errors,
    cost: Cost,
    /// Cost over High's at about the same time.
    ratio: Option<f64>,
}

struct SceneResult {
    scene: String,
    /// Share of the picture that is cloud.
    cover: f64,
    /// FLIP between the reference's halves, smoothed.
    noise: f64,
    /// How far pictures as shown here are from the renderer's own (codes of 255).
    apart: f64,
    /// One for each row.
    found: Vec<Found>,
}

/// All that a report is written from.
struct Results {
    taken: Taken,
    rows: Vec<Row>,
    scenes: Vec<SceneResult>,
}

pub fn run(options: &Options) -> Result<()> {
    if options.list {
        let mut rows = rows::all();
        rows::label(&mut rows, &options.common.engine("fidelity")?)?;
        rows.iter().for_each(|row| println!("{:16} {}", row.name, row.label));
        return Ok(());
    }
    let common = &options.common;
    let engine = common.engine("fidelity")?;
    let recipe = common.recipe(SAMPLES, FULL_SAMPLES)?;
    let size = common.size(SMALL_SIZE);
    let mut rows = rows::chosen(&options.only);
    rows::label(&mut rows, &engine)?;
    let usual = &SCENES[..if common.full { SCENES.len() } else { FEW_SCENES }];
    let scenes: Vec<String> = if options.scenes.is_empty() {
        usual.iter().map(|scene| (*scene).to_owned()).collect()
    } else {
        options.scenes.clone()
    };
    let jobs = jobs(&engine, &rows)?;
    let progress = Progress::begin(scenes.len() * (jobs.len() + 2 + Backdrop::PICTURES));
    let mut results = Vec::new();
    for scene in &scenes {
        let truth = recipe.make(&engine, scene, &size, "", &progress)?;
        let backdrop = Backdrop::of(&engine, scene, &size, &progress)?;
        engine.render(scene, &size, &jobs, &progress)?;
        let truth = truth.refined(backdrop, &engine.picture(scene, CONVERGED)?.cloud)?;
        results.push(judge(&engine, scene, &rows, &jobs, &truth)?);
    }
    let adapter = results.first().and_then(|r| r.found.first()).map(|f| f.cost.adapter.clone()).unwrap_or_default();
    let whole = options.scenes.is_empty() && options.only.is_empty() && !recipe.is_stand_in();
    let taken = recipe.taken(size, engine.zoom, Machine::this(&adapter, &common.repository), progress.seconds());
    let results = Results { taken, rows, scenes: results };
    drop(progress);
    if !common.keep {
        scenes.iter().try_for_each(|scene| remove_pictures(&engine, scene))?;
    }
    let json_path = engine.out.join("fidelity.json");
    fs::write(&json_path, serde_json::to_string_pretty(&results.to_json())?)
        .with_context(|| format!("cannot write {}", json_path.display()))?;
    let path = common.report(&engine, "fidelity", whole)?;
    fs::write(&path, report::write(&results)).with_context(|| format!("cannot write {}", path.display()))?;
    println!("{}\n{}\n{}", path.display(), json_path.display(), engine.out.join("SCENE.png").display());
    Ok(())
}

fn again(index: usize) -> String {
    format!("high_again_{index}")
}

/// The rows' jobs, with High's cost measured again between them: first, last, around each preset and every few rows.
fn jobs(engine: &Engine, rows: &[Row]) -> Result<Vec<Job>> {
    let high = |index| Job {
        name: again(index),
        options: "--quality high".to_owned(),
        frames: HIGH_AGAIN_FRAMES,
        picture: false,
    };
    let mut jobs = vec![high(0)];
    let mut count = 1;
    for (i, row) in rows.iter().enumerate() {
        let frames = engine.frames(&row.options)?;
        jobs.push(Job { name: row.name.to_owned(), options: row.options.clone(), frames, picture: true });
        if row.group == Group::Preset || (i + 1) % HIGH_AGAIN_EVERY == 0 || i + 1 == rows.len() {
            jobs.push(high(count));
            count += 1;
        }
    }
    Ok(jobs)
}

/// Cost of a job over High's: the mean of the measurements before and after it. All are had alike, from about as many
/// frames: the least of more frames, or of more jobs, would be less.
fn cost_ratio(engine: &Engine, scene: &str, jobs: &[Job], name: &str) -> Result<Option<f64>> {
    // By definition; another measurement of it would only show the noise.
    if name == HIGH {
        return Ok(Some(1.0));
    }
    let Some(at) = jobs.iter().position(|job| job.name == name) else { bail!("there is no job {name}") };
    let is_high = |job: &&Job| !job.picture || job.name == HIGH;
    let around = [jobs[..at].iter().rev().find(is_high), jobs[at + 1..].iter().find(is_high)];
    let high = around.into_iter().flatten().map(|job| Ok(engine.cost(scene, &job.name)?.total()));
    let Some(high) = high.collect::<Result<Option<Vec<f64>>>>()? else { return Ok(None) };
    let mean = high.iter().sum::<f64>() / high.len() as f64;
    Ok(engine.cost(scene, name)?.total().map(|own| own / mean))
}

fn judge(engine: &Engine, scene: &str, rows: &[Row], jobs: &[Job], truth: &Truth) -> Result<SceneResult> {
    let converged = engine.picture(scene, CONVERGED)?;
    let apart = truth.apart_from_renderer(&converged)?;
    let converged = Truth::exact(Picture { shown: truth.shown(&converged), ..converged })?;
    let mut found = Vec::new();
    let mut sheet_rows = Vec::new();
    for row in rows {
        let mut picture = engine.picture(scene, row.name)?;
        picture.shown = truth.shown(&picture);
        let (to_truth, map) = truth.judge(&picture).with_context(|| format!("{scene}: {}", row.name))?;
        let (to_converged, _) = converged.judge(&picture).with_context(|| format!("{scene}: {}", row.name))?;
        let cost = engine.cost(scene, row.name)?;
        let ratio = cost_ratio(engine, scene, jobs, row.name)?;
        found.push(Found { to_truth, to_converged, cost, ratio });
        if row.name == HIGH {
            sheet_rows.insert(0, vec![truth.picture().shown.clone(), picture.shown.clone(), map.magma]);
        } else if matches!(row.group, Group::Preset | Group::Converged) {
            sheet_rows.push(vec![truth.picture().shown.clone(), picture.shown.clone(), map.magma]);
        }
    }
    sheet::write(&engine.out.join(scene).with_extension("png"), &sheet_rows)?;
    Ok(SceneResult { scene: scene.to_owned(), cover: truth.cover(), noise: truth.noise()?, apart, found })
}

fn remove_pictures(engine: &Engine, scene: &str) -> Result<()> {
    let folder = engine.folder(scene);
    fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))
}

impl Results {
    /// Errors of a row in all scenes.
    fn errors(&self, row: usize, of: fn(&Found) -> Errors) -> Vec<Errors> {
        self.scenes.iter().filter_map(|scene| scene.found.get(row).map(of)).collect()
    }

    /// Geometric mean over the scenes of a row's cost ratio.
    fn ratio(&self, row: usize) -> Option<f64> {
        let logs: Option<Vec<f64>> = self.scenes.iter().map(|scene| Some(scene.found.get(row)?.ratio?.ln())).collect();
        let logs = logs.filter(|logs| !logs.is_empty())?;
        Some((logs.iter().sum::<f64>() / logs.len() as f64).exp())
    }

    fn row(&self, name: &str) -> Option<usize> {
        self.rows.iter().position(|row| row.name == name)
    }

    fn to_json(&self) -> Value {
        let found = |scene: &SceneResult| -> Value {
            let rows = self.rows.iter().zip(&scene.found).map(|(row, found)| {
                let passes: Value =
                    found.cost.passes.iter().map(|(name, ms)| ((*name).to_owned(), json!(ms))).collect();
                let all = json!({ "to_reference": found.to_truth.to_json(), "passes_ms": passes,
                    "to_converged": found.to_converged.to_json(), "cost_ratio": found.ratio });
                (row.name.to_owned(), all)
            });
            json!({ "cover": scene.cover, "noise": scene.noise, "apart": scene.apart, "rows": rows.collect::<Value>() })
        };
        let scenes: Value = self.scenes.iter().map(|scene| (scene.scene.clone(), found(scene))).collect();
        let Taken { size, zoom, samples, stand_in, machine, .. } = &self.taken;
        json!({ "size": size, "zoom": zoom, "samples": samples, "stand_in": stand_in, "date": machine.date,
            "adapter": machine.adapter, "commit": machine.commit, "scenes": scenes })
    }
}
