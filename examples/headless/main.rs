//! Makes a picture of a sky without a window: `headless --scene ground_noon --out shot.png`.
//!
//! `options` says what is wanted (`batch`: of many pictures), `shoot` renders it, `timings` measures it, `output` writes it.

mod batch;
#[path = "../common/mod.rs"]
mod common;
mod finite;
mod options;
mod output;
mod shoot;
#[path = "../common/start.rs"]
mod start;
mod status;
mod timings;

use std::{
    io::Write as _,
    panic::{AssertUnwindSafe, catch_unwind},
    process::ExitCode,
    sync::{Arc, Mutex},
};

use anyhow::{Context as _, Result, anyhow, bail};
use bevy_cumulus::prelude::*;
use clap::Parser as _;
use options::{Options, Plan};

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nobody is left to tell where stderr is closed.
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<()> {
    if let Some(file) = &options.batch {
        let plans = batch::plans(file)?;
        for plan in &plans {
            check_files(plan)?;
        }
        return guarded(|| batch::shoot(&plans, options.paced));
    }
    let plan = options.plan()?;
    if options.list {
        list().context("--list")?;
    }
    if options.effective {
        return print_effective(&plan);
    }
    if plan.files().is_empty() {
        if options.list {
            return Ok(());
        }
        bail!("nothing to do: give --out, --cloud, --timings, --counts, --list or --effective");
    }
    check_files(&plan)?;
    let shot = guarded(|| shoot::shoot(&plan))?;
    output::write(&plan, &shot)
}

/// Says before the work whether the files can be written after it.
fn check_files(plan: &Plan) -> Result<()> {
    for (option, path, extension) in plan.files() {
        output::check(path, extension).with_context(|| option.to_owned())?;
    }
    Ok(())
}

fn print_effective(plan: &Plan) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", serde_json::to_string_pretty(&plan.effective())?)?;
    Ok(out.flush()?)
}

/// Runs `work` and makes an error of a panic in it: the engine panics where there is no GPU or its memory is full.
fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    let said = Arc::new(Mutex::new(None));
    let hear = said.clone();
    std::panic::set_hook(Box::new(move |info| {
        let text = info.payload_as_str().unwrap_or("no reason given").to_owned();
        let place = info.location().map_or_else(String::new, |at| format!(" ({}:{})", at.file(), at.line()));
        if let Ok(mut said) = hear.lock() {
            // The first one is the cause of those that follow.
            said.get_or_insert(format!("{text}{place}"));
        }
    }));
    let result = catch_unwind(AssertUnwindSafe(work));
    drop(std::panic::take_hook());
    result.unwrap_or_else(|_| {
        let said = said.lock().ok().and_then(|mut said| said.take());
        Err(anyhow!("the engine gave up: {}", said.as_deref().unwrap_or("no reason given")))
    })
}

/// Prints the names of scenes, presets and settable paths, one a line.
fn list() -> std::io::Result<()> {
    let scenes = common::Scene::all().map(|scene| scene.name.to_owned());
    let presets = CloudPreset::names().map(str::to_owned);
    let mut out = std::io::stdout().lock();
    for name in scenes.chain(presets).chain(CloudSettings::default().paths()) {
        writeln!(out, "{name}")?;
    }
    out.flush()
}
