//! Today's code beside that of commit eba2f38: both render the same scenes in turn, pair by pair, so that a machine that
//! slows down does not count; and what their rays do is counted, which repeats to the digit.
//!
//! Both are started once a scene, since a software driver takes half a minute to compile, and wait for their turns.

mod report;
mod scenes;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, Result, ensure};
use clap::Args;
use serde_json::{Value, json};

use crate::{
    Common,
    engine::{Cost, Engine, Job, PASSES, cost_of, median, read_json},
    machine::Machine,
    progress::Progress,
};
use scenes::{SCENES, Scene};

/// The commit that is measured by.
pub const COMMIT: &str = "eba2f38";
const SMALL_SIZE: &str = "160x90";
/// What the old program calls its passes; `PASSES` is what ours does.
const OLD_PASSES: [&str; 4] = ["cloud_sky", "cloud_march", "cloud_accumulate", "cloud_composite"];
/// Frames of a picture: enough for a full window in either program.
const FRAMES: u32 = 20;
/// What is counted, as the counts file calls it.
const COUNTED: [&str; 3] = ["steps", "samples", "reads"];
/// Name of the job that counts.
const COUNTED_JOB: &str = "counted";

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
    /// The `headless` of commit eba2f38, as scripts/baseline prints it
    #[arg(long, value_name = "FILE")]
    old: PathBuf,
    /// Only these scenes
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    only: Vec<String>,
    /// How often old and new are timed in turn
    #[arg(long, value_name = "N", default_value_t = 8)]
    rounds: usize,
    /// Count, time nothing
    #[arg(long)]
    counts_only: bool,
}

/// One of the two programs.
struct Side {
    engine: Engine,
    passes: &'static [&'static str],
    options: fn(&Scene) -> &'static str,
}

/// What one thing counts up to, and a ray's mean of it.
#[derive(Clone, Copy)]
struct Count {
    total: u64,
    mean: f64,
}

/// The two programs' rays in a frame, and the three counts.
struct Counts {
    rays: u64,
    counts: [Count; 3],
}

/// All that was found of one scene; the old program's first.
struct Found {
    scene: &'static Scene,
    /// A pair for each round.
    costs: Vec<[Cost; 2]>,
    counts: [Counts; 2],
}

struct Results {
    size: String,
    rounds: usize,
    scenes: Vec<Found>,
    machine: Machine,
    seconds: u64,
}

pub fn run(options: &Options) -> Result<()> {
    let common = &options.common;
    for name in &options.only {
        let known = SCENES.iter().any(|scene| scene.name == *name);
        ensure!(known, "--only {name}: there are {}", SCENES.iter().map(|s| s.name).collect::<Vec<_>>().join(", "));
    }
    ensure!(options.rounds > 0, "--rounds 0: takes one at least");
    let sides = sides(common, "baseline", &options.old)?;
    let chosen: Vec<&'static Scene> = SCENES
        .iter()
        .filter(|scene| options.only.is_empty() || options.only.iter().any(|name| name == scene.name))
        .collect();
    let rounds = if options.counts_only { 0 } else { options.rounds };
    let size = common.size(SMALL_SIZE);
    let progress = Progress::begin(chosen.len() * 2 * (rounds + 2));
    let found = chosen.iter().map(|scene| measure(&sides, scene, &size, rounds, &progress));
    let scenes = found.collect::<Result<Vec<_>>>()?;
    let machine = Machine::this(&adapter(&sides, &scenes)?, &common.repository);
    let results = Results { size, rounds, scenes, machine, seconds: progress.seconds() };
    drop(progress);
    let whole = options.only.is_empty() && !options.counts_only;
    let json_path = sides[1].engine.out.with_file_name("baseline.json");
    fs::write(&json_path, serde_json::to_string_pretty(&results.to_json())?)
        .with_context(|| format!("cannot write {}", json_path.display()))?;
    let path = common.report(&common.engine("baseline")?, "baseline", whole)?;
    fs::write(&path, report::write(&results)).with_context(|| format!("cannot write {}", path.display()))?;
    println!("{}\n{}", path.display(), json_path.display());
    Ok(())
}

/// The two programs, the old one first, each with a folder and its presets.
fn sides(common: &Common, name: &str, old: &Path) -> Result<[Side; 2]> {
    let [old, new] = engines(common, name, old)?;
    Ok([
        Side { engine: old, passes: &OLD_PASSES, options: |scene| scene.old },
        Side { engine: new, passes: &PASSES, options: |scene| scene.new },
    ])
}

/// The renderers of the old program and of ours. In each one's folder, `presets` holds the frozen presets in its form.
pub fn engines(common: &Common, name: &str, old: &Path) -> Result<[Engine; 2]> {
    ensure!(old.is_file(), "--old {}: there is no such file", old.display());
    ensure!(common.zoom.is_none(), "--zoom: scenes of {name} bring their own cameras");
    let new = common.engine(name)?;
    // Where scripts/baseline has laid out the commit: `source` beside `target/debug/examples/headless`.
    let source = fs::canonicalize(old)?.ancestors().nth(4).map(|home| home.join("source"));
    let source = source.filter(|source| source.is_dir());
    let source = source.with_context(|| format!("--old {}: there is no source beside it", old.display()))?;
    let side = |headless: PathBuf, assets, form: &str| -> Result<Engine> {
        let out = new.out.join(form);
        copy_presets(&common.repository.join("scripts/measure/frozen").join(form), &out.join("presets"))?;
        Ok(Engine { headless, assets, out, zoom: 1.0, deadline: new.deadline })
    };
    Ok([side(old.to_owned(), Some(source), COMMIT)?, side(new.headless.clone(), None, "current")?])
}

/// Nothing is quoted in a batch, so presets have to lie where no folder's name has a space in it.
fn copy_presets(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let path = entry?.path();
        let name = path.file_name().with_context(|| path.display().to_string())?;
        fs::copy(&path, to.join(name)).with_context(|| format!("cannot copy {}", path.display()))?;
    }
    Ok(())
}

/// Counts a scene and times it, old and new in turn; which of them comes first changes from round to round.
fn measure(sides: &[Side; 2], scene: &'static Scene, size: &str, rounds: usize, progress: &Progress) -> Result<Found> {
    let job = |name: String, options: &str| Job { name, options: options.to_owned(), frames: FRAMES, picture: false };
    let mut jobs = vec![job("warm_up".to_owned(), "")];
    jobs.extend((0..rounds).map(|round| job(round_name(round), "")));
    // Last, so that its shaders are compiled when nothing is timed any more.
    jobs.push(job(COUNTED_JOB.to_owned(), "--counts counts.json"));
    let common = sides
        .each_ref()
        .map(|side| format!("--size {size} {}", (side.options)(scene).replace("PRESETS", "../presets")));
    let done = |i: usize| sides[i].engine.is_done(scene.name, &common[i], &jobs);
    if done(0)? && done(1)? {
        progress.skip(2 * jobs.len());
    } else {
        let start = |i: usize| sides[i].engine.start(scene.name, &common[i], &jobs);
        let mut programs = [start(0)?, start(1)?];
        // The first turn is not timed: one program may still compile while the other has it.
        for (turn, job) in jobs.iter().enumerate() {
            for i in if turn % 2 == 0 { [0, 1] } else { [1, 0] } {
                programs[i].take_turn()?;
                progress.done(&format!("{}, {}: {}", scene.name, ["old", "new"][i], job.name));
            }
        }
    }
    let count = |side: &Side| Counts::read(&side.engine.folder(scene.name).join("counts.json"));
    let pair = |round| {
        Ok([cost(&sides[0], scene.name, &round_name(round))?, cost(&sides[1], scene.name, &round_name(round))?])
    };
    Ok(Found {
        scene,
        costs: (0..rounds).map(pair).collect::<Result<_>>()?,
        counts: [count(&sides[0])?, count(&sides[1])?],
    })
}

fn round_name(round: usize) -> String {
    format!("round_{round}")
}

/// The median frame: of a window that fills the first frames are cheaper.
fn cost(side: &Side, scene: &str, job: &str) -> Result<Cost> {
    let timings = read_json(&side.engine.folder(scene).join(job).with_extension("json"))?;
    Ok(cost_of(&timings, side.passes, "median"))
}

fn adapter(sides: &[Side; 2], scenes: &[Found]) -> Result<String> {
    let first = scenes.first().context("there is no scene")?;
    Ok(cost(&sides[1], first.scene.name, COUNTED_JOB)?.adapter)
}

impl Counts {
    fn read(path: &Path) -> Result<Self> {
        Self::of(&read_json(path)?).with_context(|| format!("{}: a count is missing", path.display()))
    }

    fn of(all: &Value) -> Option<Self> {
        let count = |name| Some(Count { total: all[name]["total"].as_u64()?, mean: all[name]["mean"].as_f64()? });
        let [steps, samples, reads] = COUNTED.map(count);
        Some(Self { rays: all["rays"].as_u64()?, counts: [steps?, samples?, reads?] })
    }
}

impl Found {
    /// Median over the rounds.
    fn time(&self, side: usize, get: fn(&Cost) -> Option<f64>) -> Option<f64> {
        median(self.costs.iter().filter_map(|pair| get(&pair[side])).collect())
    }

    /// New over old of each pair.
    fn ratios(&self, get: fn(&Cost) -> Option<f64>) -> Vec<f64> {
        self.costs.iter().filter_map(|[old, new]| Some(get(new)? / get(old)?)).collect()
    }

    /// New over old of a total.
    fn count_ratio(&self, i: usize) -> Option<f64> {
        let [old, new] = [0, 1].map(|side: usize| self.counts[side].counts[i].total);
        (old > 0).then(|| new as f64 / old as f64)
    }
}

impl Results {
    fn to_json(&self) -> Value {
        let counts = |counts: &Counts| {
            let named = COUNTED.iter().zip(counts.counts);
            let mut all: Value =
                named.map(|(n, c)| ((*n).to_owned(), json!({ "total": c.total, "mean": c.mean }))).collect();
            all["rays"] = counts.rays.into();
            all
        };
        let scene = |found: &Found| {
            let [old, new] = &found.counts;
            let ratios: Value =
                (0..COUNTED.len()).map(|i| (COUNTED[i].to_owned(), json!(found.count_ratio(i)))).collect();
            json!({ "old": counts(old), "new": counts(new), "ratios": ratios,
                "march_ratios": found.ratios(Cost::march), "total_ratios": found.ratios(Cost::total) })
        };
        let scenes: Value = self.scenes.iter().map(|found| (found.scene.name.to_owned(), scene(found))).collect();
        json!({ "size": self.size, "date": self.machine.date, "adapter": self.machine.adapter, "old": COMMIT,
            "commit": self.machine.commit, "scenes": scenes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(ms: f64) -> Cost {
        Cost { passes: vec![("cloud_march", ms)], adapter: String::new() }
    }

    fn counts(total: u64) -> Counts {
        Counts { rays: 2, counts: [Count { total, mean: total as f64 / 2.0 }; 3] }
    }

    #[test]
    fn ratios_are_those_of_pairs() {
        // The machine is half as fast in the second round.
        let costs = vec![[cost(10.0), cost(5.0)], [cost(20.0), cost(10.0)], [cost(10.0), cost(6.0)]];
        let found = Found { scene: &SCENES[0], costs, counts: [counts(100), counts(25)] };
        assert_eq!(median(found.ratios(Cost::march)), Some(0.5));
        assert_eq!((found.time(0, Cost::march), found.time(1, Cost::march)), (Some(10.0), Some(6.0)));
        assert_eq!(found.count_ratio(2), Some(0.25));
    }

    #[test]
    fn a_counts_file_has_all_of_them() {
        let one = json!({ "total": 12, "mean": 6.0, "most": 9 });
        let whole = json!({ "rays": 2, "steps": one, "samples": one, "reads": one });
        assert_eq!(Counts::of(&whole).map(|counts| (counts.rays, counts.counts[2].total)), Some((2, 12)));
        assert!(Counts::of(&json!({ "rays": 2, "steps": one })).is_none());
    }
}
