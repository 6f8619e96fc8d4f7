//! Judges bevy_cumulus: what each approximation costs in truth and in time.
//!
//! `fidelity`, `ladder` and `motion` drive the `headless` example (`engine`), compare its pictures (`metrics`) with references
//! (`truth`) and write tables and plots; `baseline` and `frozen` drive that of commit eba2f38 beside it. `scripts/report` builds
//! and starts all of them.

mod backdrop;
mod baseline;
mod engine;
mod fidelity;
mod frozen;
mod label;
mod ladder;
mod machine;
mod markdown;
mod metrics;
mod motion;
mod picture;
mod plot;
mod progress;
mod sheet;
mod smooth;
mod taken;
mod truth;

use std::{
    fs,
    path::PathBuf,
    process::ExitCode,
    time::{Duration, Instant},
};

use anyhow::{Context as _, Result, anyhow, bail};
use clap::{Args, Parser, Subcommand};

use crate::{engine::Engine, metrics::Truth, picture::Picture, truth::Recipe};

/// Measures bevy_cumulus. Usually started by scripts/report.
#[derive(Parser)]
#[command(name = "measure")]
struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Errors and costs of presets and of single approximations
    Fidelity(fidelity::Options),
    /// The thesis's ladder of optimisations, and cost studies
    Ladder(ladder::Options),
    /// Each temporal mode in motion
    Motion(motion::Options),
    /// Costs and counts beside those of commit eba2f38
    Baseline(baseline::Options),
    /// Whether the presets of commit eba2f38 look as they did
    Frozen(frozen::Options),
    /// Errors of one picture against another; both are STEM.png and STEM.exr
    Compare { truth: PathBuf, test: PathBuf },
}

/// Small pictures of a whole view have pixels so coarse that the noise is filtered away under them, which no large
/// picture shows.
const ZOOM: f64 = 3.0;

/// What every measurement needs.
#[derive(Args, Clone)]
struct Common {
    /// The built `headless` example
    #[arg(long, value_name = "FILE")]
    headless: PathBuf,
    /// Root of the repository
    #[arg(long, value_name = "DIR", default_value = ".")]
    repository: PathBuf,
    /// Size of the pictures
    #[arg(long, value_name = "WxH")]
    size: Option<String>,
    /// Shows the middle of each view so many times larger: a small picture then has pixels as fine as a large one's
    /// [default: 3; with --full 1]
    #[arg(long, value_name = "Z")]
    zoom: Option<f64>,
    /// Samples a pixel of a reference picture
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// 1920x1080 and more samples: for a GPU
    #[arg(long)]
    full: bool,
    /// Where pictures and results go
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The report [default: docs/reports/NAME.md; of a part or with a stand-in, NAME.md in the output folder]
    #[arg(long, value_name = "FILE.md")]
    report: Option<PathBuf>,
    /// Where reference pictures are kept from run to run [default: target/references]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Make the references anew
    #[arg(long)]
    fresh: bool,
    /// Stop after so many minutes; the same command then goes on from there
    #[arg(long, value_name = "N")]
    minutes: Option<f64>,
    /// Keep every picture and its timings
    #[arg(long)]
    keep: bool,
    /// What stands for the truth: `reference`, the path tracer, or a quality preset in its stead (for development)
    #[arg(long, value_name = "NAME", default_value = "reference")]
    truth_quality: String,
    /// Options of headless that make the two halves of a reference independent, split by `|`
    #[arg(
        long,
        value_name = "A|B",
        default_value = "--set quality.seed=1|--set quality.seed=2",
        allow_hyphen_values = true
    )]
    truth_halves: String,
}

impl Common {
    fn size(&self, small: &str) -> String {
        self.size.clone().unwrap_or_else(|| if self.full { "1920x1080" } else { small }.to_owned())
    }

    fn engine(&self, name: &str) -> Result<Engine> {
        let zoom = self.zoom.unwrap_or(if self.full { 1.0 } else { ZOOM });
        if !(0.5..=60.0).contains(&zoom) {
            bail!("--zoom {zoom}: takes a number from 0.5 to 60");
        }
        if !self.headless.is_file() {
            bail!("--headless {}: there is no such file", self.headless.display());
        }
        let out = self.out.clone().unwrap_or_else(|| self.repository.join("target").join(name));
        let limit = self.minutes.map(|minutes| Duration::try_from_secs_f64(60.0 * minutes));
        let limit = limit.transpose().map_err(|error| anyhow!("--minutes: {error}"))?;
        let deadline = limit.and_then(|limit| Instant::now().checked_add(limit));
        fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
        Ok(Engine { headless: self.headless.clone(), assets: None, out, zoom, deadline })
    }

    fn recipe(&self, small: u32, full: u32) -> Result<Recipe> {
        let stand_in = self.truth_quality != "reference";
        let (a, b) = self.truth_halves.split_once('|').ok_or_else(|| anyhow!("--truth-halves takes A|B"))?;
        Ok(Recipe {
            quality: self.truth_quality.clone(),
            samples: self.spp.unwrap_or(if self.full { full } else { small }).max(2),
            halves: if stand_in { Default::default() } else { [a.trim().to_owned(), b.trim().to_owned()] },
            repository: self.repository.clone(),
            cache: self.cache.clone().unwrap_or_else(|| self.repository.join("target/references")),
            fresh: self.fresh,
        })
    }

    /// Where the report goes: into the repository only where it is whole and true.
    fn report(&self, engine: &Engine, name: &str, whole: bool) -> Result<PathBuf> {
        let folder = if whole { &self.repository.join("docs/reports") } else { &engine.out };
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(self.report.clone().unwrap_or_else(|| folder.join(name).with_extension("md")))
    }
}

fn main() -> ExitCode {
    let result = match Options::parse().what {
        What::Fidelity(options) => fidelity::run(&options),
        What::Ladder(options) => ladder::run(&options),
        What::Motion(options) => motion::run(&options),
        What::Baseline(options) => baseline::run(&options),
        What::Frozen(options) => frozen::run(&options),
        What::Compare { truth, test } => compare(&truth, &test),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn compare(truth: &std::path::Path, test: &std::path::Path) -> Result<()> {
    let truth = Truth::exact(Picture::read(truth)?)?;
    let (errors, _) = truth.judge(&Picture::read(test)?)?;
    println!("{}", errors.to_json());
    Ok(())
}
