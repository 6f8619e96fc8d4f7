//! The report on fidelity.

use std::fmt::Write as _;

use super::{Errors, Found, HIGH, Results, rows::Group};
use crate::{
    markdown::{maybe, number, table},
    metrics::{CLOUD_BELOW, FLOOR},
    smooth::RADIUS,
};

/// What High is to reach, and where (issue 4).
const FLIP_TARGET: f64 = 0.06;
const LUMINANCE_TARGET: f64 = 0.05;
const TARGET_SCENES: [&str; 4] = ["ground_noon", "ground_backlit", "overcast", "sunset"];

const HEAD: &str = "# What each approximation costs in truth and in time

A real-time cloud is a stack of approximations. Here each preset, and each approximation alone, is held against a path
tracer that makes none of them (`CloudQuality::reference()`), and against our own march with steps so short that only the
model of light is left to differ. Written by `scripts/report fidelity`; edit that, not this file.
[lab-notes.md](../lab-notes.md) says what was tried because of such tables.
";

const COLUMNS: &str = "## How to read the tables

Every picture is rendered twice over: by the row's settings, and by what it is held against. \"Cloud\" are the pixels whose
transmittance in the reference is below CLOUD_BELOW.

| Column | Meaning |
|---|---|
| FLIP | what an eye that flips between the two pictures notices, from 0 (nothing) to 1: mean over the cloud of [LDR-FLIP](https://github.com/NVlabs/flip) (NVIDIA's own code) between the pictures as shown: same exposure, ACES tone mapping, sRGB, 67 pixels a degree |
| FLIP, all | the same over the whole picture |
| relMSE | squared error of the clouds' linear radiance, per colour channel, over the squared luminance around the pixel (mean of the cloud in 3×3 pixels, plus FLOOR of the clouds' mean luminance, added in squares); mean over the cloud. 0.01 is about a tenth off everywhere |
| luminance | total luminance of the clouds over the reference's: 1.05 is five percent too bright. Unlike the others it does not care where the light is |
| T error | root of the mean squared error of transmittance over the cloud |
| cost | GPU time of our passes (sky light, march, accumulation, composite) over High's, which is measured again every few rows, so that a machine that slows down does not count; geometric mean over the scenes |

**Noise.** A path-traced picture of few samples is noisy. Radiance and transmittance are therefore held against two halves A
and B of independent samples: `(x − A)(x − B)` has the mean `(x − truth)²`, so the reference's noise adds nothing to relMSE
and T error on average (a small one may come out slightly negative).

FLIP compares pictures as shown, and tone mapping bends: a noisy picture is shown too dark, in the colour of its most frequent
samples. For FLIP the halves are therefore averaged as light, before tone mapping, and over several pixels: what their light is
as a share of our converged march's, and what their transmittance differs by per opacity, is averaged over a Gaussian of
RADIUS pixels, and the march is changed by it. What march and reference differ in within a few pixels is thus not in FLIP, but in
relMSE and T error, which go by the halves as they are.
Before the sky, clouds are then shown by this tool, exposed and tone-mapped as Bevy does it; so is every picture that is
compared. The noise floor below is FLIP between the two halves so treated: a perfect picture would score about half of it, and
less of it is left beside a larger error, since the two add like squares.

Errors depend on how fine the pixels are: noise is filtered over a pixel, so coarse ones lose the thin parts of clouds. Compare
figures of one size and zoom only. With zoom, a small picture shows the middle of a view with the pixels of a larger one.
";

/// The report.
pub fn write(results: &Results) -> String {
    let mut text = HEAD.to_owned();
    text += &results.taken.warning();
    text += &targets(results);
    text += &results.taken.measured("");
    text += "\n";
    text += &COLUMNS
        .replace("CLOUD_BELOW", &number(f64::from(CLOUD_BELOW)))
        .replace("FLOOR", &format!("{} %", number(FLOOR * 100.0)))
        .replace("RADIUS", &RADIUS.to_string());
    text += &noise(results);
    text += &presets(results);
    text += &front(results);
    text += &passes(results);
    text += &alone(results);
    for scene in 0..results.scenes.len() {
        text += &one_scene(results, scene);
    }
    text += &settings(results);
    text
}

fn targets(results: &Results) -> String {
    let high = results.row(HIGH);
    let label = high.map_or(HIGH, |row| &results.rows[row].label);
    let mut text = format!("\n## Targets\n\n{label} against the reference:\n\n");
    let mut rows = Vec::new();
    for scene in results.scenes.iter().filter(|s| TARGET_SCENES.contains(&s.scene.as_str())) {
        let Some(found) = high.and_then(|row| scene.found.get(row)) else { continue };
        let verdict = |good: bool| if good { "pass" } else { "**fail**" };
        let errors = found.to_truth;
        rows.push(vec![
            scene.scene.clone(),
            number(errors.flip),
            verdict(errors.flip <= FLIP_TARGET).to_owned(),
            number(errors.luminance),
            verdict((errors.luminance - 1.0).abs() <= LUMINANCE_TARGET).to_owned(),
        ]);
    }
    let flip_head = format!("≤ {FLIP_TARGET}");
    let luminance_head = format!("within {} %", LUMINANCE_TARGET * 100.0);
    text += &table(&["scene", "FLIP", &flip_head, "luminance", &luminance_head], &rows);
    text
}

fn noise(results: &Results) -> String {
    let rows: Vec<_> = results
        .scenes
        .iter()
        .map(|s| vec![s.scene.clone(), format!("{:.0} %", s.cover * 100.0), number(s.noise), number(s.apart)])
        .collect();
    let head = [
        "scene",
        "cloud in the picture",
        "noise floor (FLIP between halves)",
        "shown here and by the renderer, apart by (codes of 255)",
    ];
    format!("\n### Noise floor\n\n{}", table(&head, &rows))
}

/// The columns of errors.
fn columns(errors: Option<Errors>) -> Vec<String> {
    let get = |of: fn(&Errors) -> f64| maybe(errors.as_ref().map(of));
    vec![get(|e| e.flip), get(|e| e.flip_all), get(|e| e.rel_mse), get(|e| e.luminance), get(|e| e.transmittance)]
}

fn mean(results: &Results, row: usize, of: fn(&Found) -> Errors) -> Option<Errors> {
    Errors::mean(&results.errors(row, of))
}

fn of_group(results: &Results, groups: &[Group]) -> Vec<usize> {
    (0..results.rows.len()).filter(|i| groups.contains(&results.rows[*i].group)).collect()
}

fn presets(results: &Results) -> String {
    let rows: Vec<_> = of_group(results, &[Group::Preset, Group::Converged, Group::FromHigh])
        .into_iter()
        .map(|i| {
            let mut cells = vec![results.rows[i].label.clone()];
            cells.extend(columns(mean(results, i, |f| f.to_truth)));
            cells.extend([maybe(results.ratio(i))]);
            cells
        })
        .collect();
    let head = ["mean of the scenes", "FLIP", "FLIP, all", "relMSE", "luminance", "T error", "cost"];
    format!("\n## Presets against the reference\n\n{}", table(&head, &rows))
}

/// Costs that differ by less are taken as equal: they are not measured more closely than that.
const SAME_COST: f64 = 0.03;

/// What a row costs and how wrong it is; less is better in each.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Place {
    cost: f64,
    flip: f64,
    rel_mse: f64,
}

impl Place {
    /// Whether nothing speaks for the other one.
    fn dominates(&self, other: &Self) -> bool {
        self.cost <= other.cost * (1.0 + SAME_COST)
            && self.flip <= other.flip
            && self.rel_mse <= other.rel_mse
            && (self.cost < other.cost * (1.0 - SAME_COST) || self.flip < other.flip || self.rel_mse < other.rel_mse)
    }
}

/// Which presets, and changes of High, are worth what they cost.
fn front(results: &Results) -> String {
    let all: Vec<(usize, Place)> = of_group(results, &[Group::Preset, Group::FromHigh])
        .into_iter()
        .filter_map(|i| {
            let errors = mean(results, i, |f| f.to_truth)?;
            Some((i, Place { cost: results.ratio(i)?, flip: errors.flip, rel_mse: errors.rel_mse }))
        })
        .collect();
    let mut sorted = all.clone();
    sorted.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let rows: Vec<_> = sorted
        .into_iter()
        .map(|(i, place)| {
            let better: Vec<&str> = all
                .iter()
                .filter(|(other, at)| *other != i && at.dominates(&place))
                .map(|(other, _)| results.rows[*other].label.as_str())
                .collect();
            let verdict = if better.is_empty() { "on the front".to_owned() } else { better.join("; ") };
            vec![results.rows[i].label.clone(), number(place.cost), number(place.flip), number(place.rel_mse), verdict]
        })
        .collect();
    format!(
        "\n### What is worth its cost\n\nBy cost. A row is dominated where another one costs no more (within {} %) and is worse \
         in neither error.\n\n{}",
        SAME_COST * 100.0,
        table(&["mean of the scenes", "cost", "FLIP", "relMSE", "dominated by"], &rows),
    )
}

/// Time of each pass of each preset.
fn passes(results: &Results) -> String {
    let mut rows = Vec::new();
    for i in of_group(results, &[Group::Preset, Group::Converged]) {
        for scene in &results.scenes {
            let Some(found) = scene.found.get(i) else { continue };
            let mut cells = vec![results.rows[i].label.clone(), scene.scene.clone()];
            cells.extend(found.cost.passes.iter().map(|(_, ms)| number(*ms)));
            cells.push(maybe(found.cost.total()));
            rows.push(cells);
        }
    }
    let head = ["GPU ms", "scene", "sky light", "march", "accumulate", "composite", "together"];
    format!("\n### Time of each pass\n\n{}", table(&head, &rows))
}

fn alone(results: &Results) -> String {
    let rows: Vec<_> = of_group(results, &[Group::Converged, Group::Alone])
        .into_iter()
        .map(|i| {
            let to_converged = mean(results, i, |f| f.to_converged);
            let to_truth = mean(results, i, |f| f.to_truth);
            let get = |errors: Option<Errors>, of: fn(&Errors) -> f64| maybe(errors.as_ref().map(of));
            vec![
                results.rows[i].label.clone(),
                get(to_converged, |e| e.flip),
                get(to_converged, |e| e.rel_mse),
                get(to_converged, |e| e.luminance),
                get(to_converged, |e| e.transmittance),
                get(to_truth, |e| e.flip),
                get(to_truth, |e| e.rel_mse),
                get(to_truth, |e| e.luminance),
                maybe(results.ratio(i)),
            ]
        })
        .collect();
    let head = [
        "converged march, but …",
        "FLIP to converged",
        "relMSE",
        "luminance",
        "T error",
        "FLIP to reference",
        "relMSE",
        "luminance",
        "cost",
    ];
    let table = table(&head, &rows);
    format!(
        "\n## Each approximation alone\n\nThe converged march with one thing changed, mean of the scenes. Its own line says what
the model of light costs; the others, held against it, what the one approximation adds. Where a row comes nearer to the
reference than the converged march does, two errors make up for each other.\n\n{table}"
    )
}

fn one_scene(results: &Results, scene: usize) -> String {
    let scene = &results.scenes[scene];
    let mut rows = Vec::new();
    for (row, found) in results.rows.iter().zip(&scene.found) {
        let mut cells = vec![if row.group == Group::Alone { format!("… {}", row.label) } else { row.label.clone() }];
        cells.extend(columns(Some(found.to_truth)));
        let near = found.to_converged;
        cells.extend([near.flip, near.rel_mse, near.luminance].map(number));
        cells.push(maybe(found.ratio));
        rows.push(cells);
    }
    let head = [
        "",
        "FLIP to reference",
        "FLIP, all",
        "relMSE",
        "luminance",
        "T error",
        "FLIP to converged",
        "relMSE",
        "luminance",
        "cost",
    ];
    format!("\n## {}\n\n{}", scene.scene, table(&head, &rows))
}

/// What each row's options were: a figure that cannot be had again is worth little.
fn settings(results: &Results) -> String {
    let mut text = "\n## Every row's options\n\n`headless --scene SCENE --size SIZE --frames N` and:\n\n".to_owned();
    for row in &results.rows {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "- {}: `{}`", row.label, row.options);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_dominated_where_nothing_speaks_for_it() {
        let at = |cost: f64, flip: f64, rel_mse: f64| Place { cost, flip, rel_mse };
        let own = at(1.0, 0.1, 0.2);
        assert!(at(0.9, 0.1, 0.2).dominates(&own), "cheaper");
        assert!(at(1.02, 0.09, 0.2).dominates(&own), "as cheap, and better");
        assert!(!at(1.1, 0.05, 0.1).dominates(&own), "better, but dearer");
        assert!(!at(0.5, 0.05, 0.3).dominates(&own), "worse in one error");
        assert!(!own.dominates(&own), "itself");
    }
}
