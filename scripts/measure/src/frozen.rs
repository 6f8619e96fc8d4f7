//! Whether the presets of commit eba2f38 look as they did: the old program renders them in the old form, ours in today's.

use std::{fs, path::PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use clap::Args;

use crate::{
    Common,
    baseline::{COMMIT, engines},
    engine::Job,
    machine::Machine,
    markdown::{number, table},
    picture::Picture,
    progress::Progress,
};

const SMALL_SIZE: &str = "64x36";
const FRAMES: u32 = 16;
/// The view of all, and so little noise that what differs is the sky: options of the old program, and of ours.
const VIEW: [&str; 2] = ["--quality ultra --no-sky --camera 0,2,0,0,20 --sun 40,130"; 2];
/// How far transmittance may differ: root of the mean square over the picture, and the means.
const MOST_APART: f64 = 0.03;
const MEAN_APART: f64 = 0.005;

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
    /// The `headless` of commit eba2f38, as scripts/baseline prints it
    #[arg(long, value_name = "FILE")]
    old: PathBuf,
    /// Only these presets, as their files are called
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    only: Vec<String>,
}

/// How one preset's pictures differ.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Apart {
    /// Root of the mean squared difference of transmittance, and the difference of its means.
    square: f64,
    mean: f64,
    /// Luminance of the clouds, new over old.
    luminance: f64,
}

pub fn run(options: &Options) -> Result<()> {
    let common = &options.common;
    let sides = engines(common, "frozen", &options.old)?;
    let names = names(&sides[0].out.join("presets"), &options.only)?;
    ensure!(
        names.len() == names_in_both(&names, &sides[1].out.join("presets")),
        "a frozen preset lacks one of its forms"
    );
    let size = common.size(SMALL_SIZE);
    let progress = Progress::begin(2 * names.len());
    for (engine, view) in sides.iter().zip(VIEW) {
        let job = |name: &String| Job {
            name: name.clone(),
            options: format!("--preset ../presets/{name}.clouds.ron"),
            frames: FRAMES,
            picture: true,
        };
        engine.render_in(
            "shown",
            &format!("--size {size} {view}"),
            &names.iter().map(job).collect::<Vec<_>>(),
            &progress,
        )?;
    }
    let mut rows = Vec::new();
    let mut changed = Vec::new();
    for name in &names {
        let [old, new] = [0, 1].map(|i: usize| sides[i].picture("shown", name));
        let apart = Apart::of(&old?, &new?)?;
        let verdict = if apart.is_within() { "as it was" } else { "**changed**" };
        rows.push(vec![
            name.clone(),
            number(apart.square),
            number(apart.mean),
            number(apart.luminance),
            verdict.to_owned(),
        ]);
        changed.extend((!apart.is_within()).then(|| name.clone()));
    }
    let adapter = sides[1].cost("shown", &names[0])?.adapter;
    let machine = Machine::this(&adapter, &common.repository);
    let head =
        ["preset", "transmittance apart (root mean square)", "apart (mean)", "luminance, new over old", "verdict"];
    let text = format!(
        "# Frozen presets\n\nThe presets of commit {COMMIT} by its own code, and in today's form by today's. Written by \
         `scripts/report frozen`.\n\nMeasured {} at commit {} on {}, {}: pictures of {size}. Transmittance may be {MOST_APART} \
         apart, its mean {MEAN_APART}.\n\n{}",
        machine.date,
        machine.commit,
        machine.adapter,
        machine.processor,
        table(&head, &rows)
    );
    drop(progress);
    let path = common.report(&common.engine("frozen")?, "frozen", false)?;
    fs::write(&path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    println!("{}", path.display());
    if !changed.is_empty() {
        bail!("these presets do not look as they did at {COMMIT}: {}", changed.join(", "));
    }
    Ok(())
}

/// Names of the presets in a folder, sorted; those asked for, where some are.
fn names(folder: &std::path::Path, only: &[String]) -> Result<Vec<String>> {
    let files = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let files = files.map(|file| Ok(file?.file_name().to_string_lossy().into_owned()));
    let files = files.collect::<Result<Vec<_>>>()?;
    let mut all: Vec<String> =
        files.iter().filter_map(|file| Some(file.strip_suffix(".clouds.ron")?.to_owned())).collect();
    all.sort();
    for name in only {
        ensure!(all.contains(name), "--only {name}: there are {}", all.join(", "));
    }
    all.retain(|name| only.is_empty() || only.contains(name));
    ensure!(!all.is_empty(), "there is no preset in {}", folder.display());
    Ok(all)
}

fn names_in_both(names: &[String], other: &std::path::Path) -> usize {
    names.iter().filter(|name| other.join(format!("{name}.clouds.ron")).is_file()).count()
}

impl Apart {
    fn of(old: &Picture, new: &Picture) -> Result<Self> {
        ensure!(old.cloud.dimensions() == new.cloud.dimensions(), "the pictures differ in size");
        let pairs = || old.cloud.pixels().zip(new.cloud.pixels());
        let count = pairs().count().max(1) as f64;
        let through = |p: &image::Rgba<f32>| f64::from(p.0[3]);
        let light =
            |p: &image::Rgba<f32>| 0.2126 * f64::from(p.0[0]) + 0.7152 * f64::from(p.0[1]) + 0.0722 * f64::from(p.0[2]);
        let square = pairs().map(|(a, b)| (through(a) - through(b)).powi(2)).sum::<f64>() / count;
        let mean = pairs().map(|(a, b)| through(b) - through(a)).sum::<f64>() / count;
        let [before, now] = [&old.cloud, &new.cloud].map(|cloud| cloud.pixels().map(light).sum::<f64>());
        Ok(Self { square: square.sqrt(), mean, luminance: now / before.max(1e-9) })
    }

    fn is_within(&self) -> bool {
        self.square <= MOST_APART && self.mean.abs() <= MEAN_APART
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::plain;

    #[test]
    fn what_has_changed_is_told() {
        let clouds = |light: f32, through: f32| plain([128; 3], [light, light, light, through]);
        let same = Apart::of(&clouds(100.0, 0.5), &clouds(100.0, 0.5)).unwrap();
        assert!(same.is_within() && (same.luminance - 1.0).abs() < 1e-9, "{same:?}");
        let thinner = Apart::of(&clouds(100.0, 0.5), &clouds(80.0, 0.54)).unwrap();
        assert!(!thinner.is_within() && (thinner.mean - 0.04).abs() < 1e-6, "{thinner:?}");
        assert!((thinner.luminance - 0.8).abs() < 1e-6, "{thinner:?}");
    }
}
