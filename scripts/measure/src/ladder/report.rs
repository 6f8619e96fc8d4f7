//! The report on the ladder, and its plots.

use std::path::Path;

use anyhow::Result;

use super::{
    Results, Step,
    studies::{LIGHT_REACH, Study, THICKNESS},
};
use crate::{
    markdown::{maybe, number, table},
    plot::{Plot, Series},
};

const HEAD: &str = "# What each optimisation gains and costs

Ford's thesis (chapter 5.4) adds one optimisation after another to its renderer and reports the time of a frame. Here the same
ladder is climbed on our own switches, and the error of each rung is measured, which the thesis judges by eye. Below it stand
the studies of Costa's dissertation (chapter 4.1). Written by `scripts/report ladder`; edit that, not this file.
[lab-notes.md](../lab-notes.md) says why our ratios differ from the thesis's.
";

const COLUMNS: &str = "
| Column | Meaning |
|---|---|
| march | GPU time of the march (ms a frame): median of the rounds, or the least where the driver runs in software |
| all passes | the same with sky light, accumulation and composite |
| faster | march of the rung before over this one's: how many times faster |
| thesis, faster | the same in the thesis, from its times: 1920×1080, RTX 4060 laptop, its own clouds and view |
| FLIP to first, relMSE, luminance | error against the first rung: what the optimisations together have changed. Terms as in [fidelity.md](fidelity.md) |
| FLIP to reference | error against the path tracer. It also holds what the model of light costs, which no rung changes |

Every rung keeps what the rungs before it have changed. All see as far as each other, and have steps of one length, near and
far, as the thesis's have; our High lengthens its steps with the distance. Every rung's settings stand below.
";

pub fn write(results: &Results) -> String {
    let mut text = HEAD.to_owned();
    text += &results.taken.warning();
    text += &results.taken.measured(&format!(", scene {}", super::SCENE));
    if !results.steps.is_empty() {
        text += &ladder(results);
    }
    for study in &results.studies {
        text += &one_study(results, study);
    }
    text
}

fn ladder(results: &Results) -> String {
    let mut text = format!("\n## The ladder\n{COLUMNS}\n");
    let mut rows = Vec::new();
    let mut thesis_before: Option<f64> = None;
    for step in &results.steps {
        let thesis_gain = thesis_before.zip(step.thesis).map(|(before, now)| before / now);
        rows.push(vec![
            step.label.clone(),
            maybe(step.march),
            maybe(step.total),
            maybe(step.gain),
            maybe(step.thesis),
            maybe(thesis_gain),
            number(step.to_first.flip),
            number(step.to_first.rel_mse),
            number(step.to_first.luminance),
            maybe(step.to_truth.map(|e| e.flip)),
        ]);
        thesis_before = step.thesis;
    }
    let head = [
        "rung",
        "march",
        "all passes",
        "faster",
        "thesis, ms",
        "thesis, faster",
        "FLIP to first",
        "relMSE",
        "luminance",
        "FLIP to reference",
    ];
    text += &table(&head, &rows);
    if let Some(noise) = results.noise {
        text += &format!("\nNoise floor of the reference (FLIP between its halves): {}.\n", number(noise));
    }
    text += &high_against_adaptive(results);
    text += &format!("\n![Time of each rung]({}/ladder.svg)\n", results.pictures);
    text += "\n### Every rung's settings\n\n";
    for step in &results.steps {
        text += &format!("- {}: `{}`\n", step.label, step.options);
    }
    text
}

/// Issue 4: High cheaper than a quarter of "adaptive, full resolution", at lower error.
fn high_against_adaptive(results: &Results) -> String {
    let find = |label: &str| results.steps.iter().find(|step| step.label.contains(label));
    let (Some(adaptive), Some(high)) = (find("adaptive"), find("High")) else { return String::new() };
    let mut rows = Vec::new();
    let mut compare = |what: &str, own: f64, other: f64, margin: f64| {
        rows.push(vec![what.to_owned(), number(own), number(other), number(margin), verdict(own, other, margin)]);
    };
    if let (Some(own), Some(other)) = (high.total, adaptive.total) {
        compare("cost, all passes, against a quarter (ms)", own, other / 4.0, COST_MARGIN * other / 4.0);
    }
    if let (Some(own), Some(other)) = (high.to_truth, adaptive.to_truth) {
        let margin = results.noise.unwrap_or_default() * FLIP_MARGIN;
        compare("FLIP to the reference", own.flip, other.flip, margin);
        compare("relMSE to the reference", own.rel_mse, other.rel_mse, ERROR_MARGIN * other.rel_mse.abs());
        let off = |luminance: f64| (luminance - 1.0).abs();
        compare("luminance, off by", off(own.luminance), off(other.luminance), LUMINANCE_MARGIN);
        let margin = ERROR_MARGIN * other.transmittance;
        compare("T error", own.transmittance, other.transmittance, margin);
    }
    let (own, other) = (high.to_first, adaptive.to_first);
    compare("FLIP to the first rung", own.flip, other.flip, ERROR_MARGIN * other.flip);
    format!(
        "\nTarget: our High costs less than a quarter of the adaptive rung at lower error. It passes in what it is lower in by \
         more than the margin, which is what noise may account for.\n\n{}",
        table(&["", "our High", "adaptive step", "margin", "verdict"], &rows),
    )
}

/// What noise may account for: shares of the cost, of FLIP's noise floor, of other errors; and of luminance.
const COST_MARGIN: f64 = 0.05;
const FLIP_MARGIN: f64 = 0.1;
const ERROR_MARGIN: f64 = 0.05;
const LUMINANCE_MARGIN: f64 = 0.005;

fn verdict(own: f64, other: f64, margin: f64) -> String {
    if own < other - margin {
        "pass".to_owned()
    } else if own > other + margin {
        "**fail**".to_owned()
    } else {
        "no difference beyond noise".to_owned()
    }
}

fn one_study(results: &Results, study: &Study) -> String {
    let mut rows = Vec::new();
    for line in &study.lines {
        for point in &line.points {
            rows.push(vec![line.name.clone(), point.label.clone(), maybe(point.march), maybe(point.flip)]);
        }
    }
    let table = table(&["", study.x, "march, ms", "FLIP to the last of the line"], &rows);
    let said = match study.name {
        "eye" => format!(
            "Costa finds the time linear in the eye steps, and no visible gain beyond 64. Steps here divide the layer's {} km; a \
             slanting ray takes more of them.",
            THICKNESS / 1000.0
        ),
        "light" => format!(
            "Costa finds the time about linear in the light steps, and takes 32. Of what a lit sample of ours reads, some is for \
             diffuse light and for shadow from afar, whatever the light steps. Steps here are of one length and reach {} km \
             together; our presets lengthen them instead, and need fewer.",
            LIGHT_REACH / 1000.0
        ),
        "noise" => "Costa finds little change up to 256 texels and a jump at 512, which is more than ours may have; the view and \
                    the mip levels decide how much of a volume is read, not its size."
            .to_owned(),
        _ => "Costa finds the time growing with the pixels from about 1280×720 on: below that, her GPU was not full."
            .to_owned(),
    };
    format!("\n## {}\n\n{said}\n\n![{}]({}/{}.svg)\n\n{table}", study.title, study.title, results.pictures, study.name)
}

/// Draws the plots; where the device has no timestamps there are none.
pub fn plot(results: &Results, folder: &Path) -> Result<()> {
    for study in &results.studies {
        let series = study.lines.iter().map(|line| Series {
            name: line.name.clone(),
            points: line.points.iter().filter_map(|point| Some((point.x, point.march?))).collect(),
        });
        let series: Vec<Series> = series.filter(|series| !series.points.is_empty()).collect();
        if !series.is_empty() {
            let plot = Plot { title: study.title, x: study.x, y: "march, GPU ms", series };
            plot.write_log(&folder.join(study.name).with_extension("svg"))?;
        }
    }
    let rungs: Vec<&Step> = results.steps.iter().filter(|step| step.thesis.is_some()).collect();
    let points = |get: fn(&Step) -> Option<f64>| -> Vec<(f64, f64)> {
        let first = rungs.first().and_then(|step| get(step));
        let share = |step: &&Step| Some(get(step)? / first?);
        (1..).map(f64::from).zip(rungs.iter().filter_map(share)).collect()
    };
    let series = vec![
        Series { name: "bevy_cumulus".into(), points: points(|step| step.march) },
        Series { name: "thesis".into(), points: points(|step| step.thesis) },
    ];
    if series.iter().all(|series| !series.points.is_empty()) {
        let title = "Time of a frame, first rung = 1";
        let plot = Plot { title, x: "rung: none, stop, skip, window, adaptive, half, quarter", y: "share", series };
        plot.write_log_y(&folder.join("ladder.svg"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_within_noise_is_no_pass() {
        assert_eq!(verdict(0.10, 0.12, 0.01), "pass");
        assert_eq!(verdict(0.115, 0.12, 0.01), "no difference beyond noise");
        assert_eq!(verdict(0.14, 0.12, 0.01), "**fail**");
    }
}
