//! The thesis's ladder on our own switches, and Costa's studies of cost.

mod report;
mod rungs;
mod studies;

use std::fs;

use anyhow::{Context as _, Result, ensure};
use clap::Args;

use crate::{
    Common,
    backdrop::Backdrop,
    engine::{Cost, Engine, Job, is_software, median},
    fidelity,
    label::fill,
    machine::Machine,
    metrics::{Errors, Truth},
    picture::Picture,
    progress::Progress,
    sheet,
    taken::Taken,
    truth::Recipe,
};
use rungs::{DISTANCE, HIGH, RUNGS};
use studies::Study;

const SCENE: &str = "ground_noon";
const SMALL_SIZE: &str = "128x72";
const SAMPLES: u32 = 128;
const FULL_SAMPLES: u32 = 4096;
/// Rungs are measured so many times, one after another, so that a machine that slows down does not tilt the ladder.
const ROUNDS: usize = 8;
const TIMED_FRAMES: u32 = 4;
/// Name of the ladder itself among the parts that `--only` takes.
const LADDER: &str = "rungs";

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
    /// Only these parts: rungs, eye, light, noise, screen
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    only: Vec<String>,
}

/// One rung, or High.
struct Step {
    label: String,
    options: String,
    thesis: Option<f64>,
    /// GPU time of the march and of all our passes (ms): median of the rounds.
    march: Option<f64>,
    total: Option<f64>,
    /// March of the rung before over this one's: median of the rounds. How many times faster.
    gain: Option<f64>,
    to_first: Errors,
    to_truth: Option<Errors>,
}

struct Results {
    taken: Taken,
    noise: Option<f64>,
    steps: Vec<Step>,
    studies: Vec<Study>,
    /// Of the plots, as the report links to them.
    pictures: String,
}

pub fn run(options: &Options) -> Result<()> {
    let common = &options.common;
    for part in &options.only {
        let known = part == LADDER || studies::NAMES.contains(&part.as_str());
        ensure!(known, "--only {part}: there are {LADDER}, {}", studies::NAMES.join(", "));
    }
    let wanted = |part: &str| options.only.is_empty() || options.only.iter().any(|only| only == part);
    let engine = common.engine("ladder")?;
    let recipe = common.recipe(SAMPLES, FULL_SAMPLES)?;
    let size = common.size(SMALL_SIZE);
    let rungs_count = if wanted(LADDER) { (RUNGS.len() + 1) * ROUNDS + 3 + Backdrop::PICTURES } else { 0 };
    let studies_count: usize =
        studies::NAMES.iter().filter(|n| wanted(n)).map(|n| studies::count(n, common.full)).sum();
    let progress = Progress::begin(rungs_count + studies_count);

    let (mut steps, mut noise) = (Vec::new(), None);
    if wanted(LADDER) {
        let truth = truth(&engine, &recipe, &size, &progress)?;
        noise = Some(truth.noise()?);
        steps = climb(&engine, &size, &truth, &progress)?;
    }
    let mut measured = Vec::new();
    for name in studies::NAMES.into_iter().filter(|name| wanted(name)) {
        measured.push(studies::measure(&engine, name, &size, common.full, &progress)?);
    }

    // The first of what was measured tells the device.
    let any_job = if wanted(LADDER) { job_name(0, 0) } else { format!("{}_0_0", options.only[0]) };
    let machine = Machine::this(&engine.cost(SCENE, &any_job)?.adapter, &common.repository);
    let whole = options.only.is_empty() && !recipe.is_stand_in();
    let report_path = common.report(&engine, "ladder", whole)?;
    let pictures = if whole { "../pictures/ladder" } else { "plots" };
    let plots = report_path.parent().unwrap_or(&engine.out).join(pictures);
    let results = Results {
        taken: recipe.taken(size, engine.zoom, machine, progress.seconds()),
        noise,
        steps,
        studies: measured,
        pictures: pictures.to_owned(),
    };
    drop(progress);
    fs::create_dir_all(&plots).with_context(|| format!("cannot make {}", plots.display()))?;
    report::plot(&results, &plots)?;
    fs::write(&report_path, report::write(&results))
        .with_context(|| format!("cannot write {}", report_path.display()))?;
    if !common.keep {
        let folder = engine.folder(SCENE);
        fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    println!("{}\n{}", report_path.display(), plots.display());
    Ok(())
}

/// The reference, cut off where the rungs are.
fn truth(engine: &Engine, recipe: &Recipe, size: &str, progress: &Progress) -> Result<Truth> {
    let noisy = recipe.make(engine, SCENE, size, DISTANCE, progress)?;
    let backdrop = Backdrop::of(engine, SCENE, size, progress)?;
    let options = format!("{} {DISTANCE}", fidelity::converged());
    let job = Job { name: "converged".into(), frames: engine.frames(&options)?, options, picture: true };
    engine.render(SCENE, size, &[job], progress)?;
    noisy.refined(backdrop, &engine.picture(SCENE, "converged")?.cloud)
}

fn job_name(rung: usize, round: usize) -> String {
    format!("rung_{rung}_{round}")
}

/// Renders all rungs, and High after them.
fn climb(engine: &Engine, size: &str, truth: &Truth, progress: &Progress) -> Result<Vec<Step>> {
    let mut all: Vec<(&rungs::Rung, String)> = RUNGS.iter().enumerate().map(|(n, r)| (r, rungs::options(n))).collect();
    all.push((&HIGH, format!("--quality high {DISTANCE}")));
    for n in 0..RUNGS.len() {
        rungs::check_pinned(n, &engine.effective(&rungs::options(n))?["quality"])?;
    }
    let mut jobs = Vec::new();
    for round in 0..ROUNDS {
        for (n, (_, options)) in all.iter().enumerate() {
            let picture = round == 0;
            let frames = if picture { engine.frames(options)? } else { TIMED_FRAMES };
            jobs.push(Job { name: job_name(n, round), options: options.clone(), frames, picture });
        }
    }
    engine.render(SCENE, size, &jobs, progress)?;

    let seen = |rung: usize| -> Result<Picture> {
        let picture = engine.picture(SCENE, &job_name(rung, 0))?;
        Ok(Picture { shown: truth.shown(&picture), ..picture })
    };
    let first = Truth::exact(seen(0)?)?;
    let mut steps = Vec::new();
    let mut sheet_rows = Vec::new();
    let mut before: Option<Vec<Cost>> = None;
    for (n, (rung, options)) in all.iter().enumerate() {
        let picture = seen(n)?;
        let costs: Vec<Cost> =
            (0..ROUNDS).map(|round| engine.cost(SCENE, &job_name(n, round))).collect::<Result<_>>()?;
        // High builds on no rung.
        let gain = before.iter().find(|_| rung.thesis.is_some()).and_then(|before| gain(before, &costs));
        let (to_first, map) = first.judge(&picture)?;
        sheet_rows.push(vec![first.picture().shown.clone(), picture.shown.clone(), map.magma]);
        steps.push(Step {
            label: fill(rung.label, &engine.effective(options)?)?,
            options: options.clone(),
            thesis: rung.thesis,
            march: typical(&costs, Cost::march),
            total: typical(&costs, Cost::total),
            gain,
            to_first,
            to_truth: Some(truth.judge(&picture)?.0),
        });
        before = Some(costs);
    }
    sheet::write(&engine.out.join("ladder.png"), &sheet_rows)?;
    Ok(steps)
}

/// Of the rounds the median; of a software driver, whose time other work only adds to, the least.
fn typical(rounds: &[Cost], get: fn(&Cost) -> Option<f64>) -> Option<f64> {
    let times: Vec<f64> = rounds.iter().filter_map(get).collect();
    if rounds.iter().any(|cost| is_software(&cost.adapter)) {
        times.into_iter().reduce(f64::min)
    } else {
        median(times)
    }
}

/// How many times faster the march has become: median over the rounds, or of the least times.
fn gain(before: &[Cost], now: &[Cost]) -> Option<f64> {
    if now.iter().any(|cost| is_software(&cost.adapter)) {
        return Some(typical(before, Cost::march)? / typical(now, Cost::march)?);
    }
    median(before.iter().zip(now).filter_map(|(before, now)| Some(before.march()? / now.march()?)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_medians_but_least_times_in_software() {
        let rounds = |adapter: &str, times: [f64; 3]| {
            times.map(|ms| Cost { passes: vec![("cloud_march", ms)], adapter: adapter.to_owned() })
        };
        let gpu = gain(&rounds("a GPU", [100.0, 40.0, 10.0]), &rounds("a GPU", [10.0, 20.0, 5.0]));
        assert_eq!(gpu, Some(2.0));
        let software = gain(&rounds("llvmpipe", [100.0, 40.0, 10.0]), &rounds("llvmpipe", [10.0, 20.0, 4.0]));
        assert_eq!(software, Some(2.5));
    }
}
