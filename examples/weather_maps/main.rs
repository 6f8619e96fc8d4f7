//! Makes weather maps as PNG files: `weather_maps --pattern streets --set cover=4 --out streets.png --preview`.
//!
//! `options` says what is wanted, `output` writes it.

mod options;
mod output;

use std::{io::Write as _, process::ExitCode};

use anyhow::{Context as _, Result};
use bevy_cumulus::{prelude::*, weather::orographic};
use clap::Parser as _;
use indicatif::{ProgressBar, ProgressStyle};
use options::{Job, Options};

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
    let mut out = std::io::stdout().lock();
    if options.list {
        for name in WeatherRecipe::PATTERNS {
            writeln!(out, "{name}")?;
        }
        return Ok(());
    }
    let jobs = options.jobs()?;
    if options.print {
        for job in &jobs {
            writeln!(out, "{}", ron::ser::to_string_pretty(&job.recipe, ron::ser::PrettyConfig::default())?)?;
        }
    }
    let Some(path) = &options.out else { return Ok(()) };
    let files = output::names(path, jobs.len())?;
    // Hidden where stderr is no terminal.
    let progress = ProgressBar::new(jobs.len() as u64)
        .with_style(ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}").context("the bar's style")?);
    for (job, file) in jobs.iter().zip(&files) {
        progress.set_message(file.display().to_string());
        let map = make(options, job)?;
        output::write(&map, file, options)?;
        let asked = job.recipe.cover;
        let line = format!(
            "{}: {} × {} texels of {:.1} m, cover {:.2} oktas ({asked} asked){}",
            file.display(),
            map.size().x,
            map.size().y,
            job.recipe.scale / map.size().x as f32,
            map.cover() * 8.0,
            job.note
        );
        progress.suspend(|| writeln!(out, "{line}"))?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(out.flush()?)
}

fn make(options: &Options, job: &Job) -> Result<WeatherMap> {
    let mut map = job.recipe.generate()?;
    if let (Some(terrain), Some(air)) = (options.terrain()?, &job.air) {
        orographic(&mut map, &terrain, air, job.recipe.scale)?;
    }
    for storm in &options.storms {
        map.stamp_storm(storm.centre, storm.radius, &options.storm_cell(&job.recipe));
    }
    for zone in &options.clear {
        map.clear_zone(zone.centre, zone.radius, options.clear_softness);
    }
    Ok(map)
}
