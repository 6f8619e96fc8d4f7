//! What is measured: each row is a set of options of `headless`.

use anyhow::Result;

use crate::{
    engine::{Engine, QUALITIES},
    label::{Presets, fill},
};

/// Where a row stands in the report.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Group {
    /// A quality preset as it is.
    Preset,
    /// The march with nothing left to save: what every `Alone` differs from in one thing.
    Converged,
    /// One approximation of the converged march.
    Alone,
    /// One change of the default preset.
    FromHigh,
}

#[derive(Clone, Debug)]
pub struct Row {
    pub group: Group,
    /// Name of its files; `--only` looks for parts of it.
    pub name: &'static str,
    /// What it is, in the tables; [`label`] fills in the settings.
    pub label: String,
    pub options: String,
    /// Settings of which the label says which presets have them.
    shared: &'static [&'static str],
}

/// Name of the row that the others' cost is measured by.
pub const HIGH: &str = "high";
pub const CONVERGED: &str = "converged";

/// Steps so short, and so many towards the sun, that shorter and more change nothing that matters (docs/lab-notes.md).
const CONVERGED_SETTINGS: &[&str] = &[
    "quality.step=30",
    "quality.step_growth=0.003",
    "quality.max_steps=8192",
    "quality.light_steps=24",
    "quality.light_step=12",
    "quality.light_growth=1.2",
    "quality.transmittance_stop=0",
    "quality.density_skip=0",
    "quality.lod_bias=-3",
];

/// Name, label with the settings in braces, and settings.
type Change = (&'static str, &'static str, &'static [&'static str]);

/// The approximations, each alone.
const ALONE: [Change; 27] = [
    ("octaves_1", "{lighting.octaves} octave: single scattering", &["lighting.octaves=1"]),
    ("octaves_2", "{lighting.octaves} octaves", &["lighting.octaves=2"]),
    ("octaves_3", "{lighting.octaves} octaves", &["lighting.octaves=3"]),
    ("octaves_4", "{lighting.octaves} octaves", &["lighting.octaves=4"]),
    ("octaves_8", "{lighting.octaves} octaves", &["lighting.octaves=8"]),
    ("diffusion_off", "no diffusion term", &["lighting.diffusion=0"]),
    ("phase_cut_10", "phase cut at {lighting.phase_limit}", &["lighting.phase_limit=10"]),
    ("phase_cut_100", "phase cut at {lighting.phase_limit}", &["lighting.phase_limit=100"]),
    ("phase_cut_none", "phase not cut", &["lighting.phase_limit=100000"]),
    ("ambient_off", "no ambient light", &["lighting.ambient_strength=0"]),
    ("light_4", "{quality.light_steps} light steps", &LIGHT_FEW),
    ("light_6", "{quality.light_steps} light steps", &LIGHT_PRESETS),
    ("light_16", "{quality.light_steps} light steps", &LIGHT_MANY),
    ("step_140", "step {quality.step} m", &["quality.step=140", "quality.step_growth=0.014"]),
    ("step_100", "step {quality.step} m", &["quality.step=100", "quality.step_growth=0.009"]),
    ("step_60", "step {quality.step} m", &["quality.step=60", "quality.step_growth=0.006"]),
    ("half", "{quality.resolution} resolution", &["quality.resolution=half"]),
    ("quarter", "{quality.resolution} resolution", &["quality.resolution=quarter"]),
    ("window_1", "1 frame", &["quality.temporal=off"]),
    ("window_8", "{quality.window} frames", &["quality.window=8"]),
    ("stop_high", "stop at transmittance {quality.transmittance_stop}", &["quality.transmittance_stop=0.02"]),
    (
        "stop_thesis",
        "stop at transmittance {quality.transmittance_stop} (thesis)",
        &["quality.transmittance_stop=0.075"],
    ),
    ("skip_high", "skip density below {quality.density_skip}", &["quality.density_skip=0.002"]),
    ("skip_thesis", "skip density below {quality.density_skip} (thesis)", &["quality.density_skip=0.01"]),
    ("lod_0", "bias of noise levels {quality.lod_bias}", &["quality.lod_bias=0"]),
    ("distance_90", "{quality.max_distance km}", &["quality.max_distance=90000"]),
    ("distance_50", "{quality.max_distance km}", &["quality.max_distance=50000"]),
];
const LIGHT_FEW: [&str; 3] = ["quality.light_steps=4", "quality.light_step=60", "quality.light_growth=2.2"];
const LIGHT_PRESETS: [&str; 3] = ["quality.light_steps=6", "quality.light_step=45", "quality.light_growth=1.9"];
const LIGHT_MANY: [&str; 3] = ["quality.light_steps=16", "quality.light_step=20", "quality.light_growth=1.3"];

const UPSCALE: [&str; 3] = ["quality.resolution=full", "quality.temporal=upscale", "quality.block=two"];

/// Changes of the default preset: there a window does more than where steps are short.
const FROM_HIGH: [Change; 8] = [
    ("high_window_1", "High, 1 frame", &["quality.temporal=off"]),
    ("high_window_8", "High, {quality.window} frames", &["quality.window=8"]),
    ("high_full", "High, {quality.resolution} resolution", &["quality.resolution=full"]),
    ("high_quarter", "High, {quality.resolution} resolution", &["quality.resolution=quarter"]),
    ("high_upscale", "High, {quality.resolution} resolution, a quarter of it a frame", &UPSCALE),
    ("high_step_60", "High, step {quality.step} m", &["quality.step=60", "quality.step_growth=0.006"]),
    ("high_light_16", "High, {quality.light_steps} light steps", &LIGHT_MANY),
    ("high_90", "High, {quality.max_distance km}", &["quality.max_distance=90000"]),
];

/// All rows, in the order of the report.
pub fn all() -> Vec<Row> {
    let change = |group, base: &str, (name, label, settings): Change| Row {
        group,
        name,
        label: label.to_owned(),
        options: with(base, settings),
        shared: if group == Group::Alone { settings } else { &[] },
    };
    let converged = converged();
    let plain = |group, name, options| Row { group, name, label: "Converged march".to_owned(), options, shared: &[] };
    QUALITIES
        .into_iter()
        .map(|name| plain(Group::Preset, name, format!("--quality {name}")))
        .chain([plain(Group::Converged, CONVERGED, converged.clone())])
        .chain(ALONE.into_iter().map(|row| change(Group::Alone, &converged, row)))
        .chain(FROM_HIGH.into_iter().map(|row| change(Group::FromHigh, "--quality high", row)))
        .collect()
}

/// Makes the rows' labels from what their options amount to.
pub fn label(rows: &mut [Row], engine: &Engine) -> Result<()> {
    let presets = Presets::of(engine)?;
    for row in rows {
        if row.group == Group::Preset {
            row.label = presets.title(row.name);
            continue;
        }
        let effective = engine.effective(&row.options)?;
        let owners =
            if row.shared.is_empty() { String::new() } else { presets.with_the_same(&effective, row.shared)? };
        row.label = fill(&row.label, &effective)? + &owners;
    }
    Ok(())
}

/// Options of the converged march.
pub fn converged() -> String {
    with("--quality ultra", CONVERGED_SETTINGS)
}

/// The rows asked for, with those that others are measured by.
pub fn chosen(only: &[String]) -> Vec<Row> {
    let wanted = |row: &Row| {
        only.is_empty()
            || row.name == HIGH
            || row.group == Group::Converged
            || only.iter().any(|part| row.name.contains(part.as_str()))
    };
    all().into_iter().filter(wanted).collect()
}

fn with(base: &str, settings: &[&str]) -> String {
    settings.iter().fold(base.to_owned(), |options, setting| format!("{options} --set {setting}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_file_names_of_their_own() {
        let rows = all();
        let names: std::collections::BTreeSet<_> = rows.iter().map(|row| row.name).collect();
        assert_eq!(names.len(), rows.len());
        assert!(names.iter().all(|name| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')));
    }

    #[test]
    fn a_part_still_has_what_it_is_measured_by() {
        let names: Vec<_> = chosen(&["octaves".to_owned()]).iter().map(|row| row.name).collect();
        assert_eq!(names, [HIGH, CONVERGED, "octaves_1", "octaves_2", "octaves_3", "octaves_4", "octaves_8"]);
    }
}
