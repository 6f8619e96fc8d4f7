//! The thesis's ladder of optimisations (chapter 5.4) on our own switches.

use anyhow::{Result, ensure};
use serde_json::Value;

/// One rung: what it changes of the rung before.
pub struct Rung {
    /// With settings in braces, as `label::fill` takes them.
    pub label: &'static str,
    changes: &'static [&'static str],
    /// The thesis's time (ms), at 1920×1080 on an RTX 4060 laptop.
    pub thesis: Option<f64>,
}

/// All rungs see as far, and their steps are as long far away as near by, as the thesis's are. 36 km is what 9 m steps
/// reach within `max_steps`.
pub const DISTANCE: &str = "--set quality.max_distance=36000";

/// What no rung changes. Every setting of the quality is pinned, to the thesis's method where it has one, so that no preset,
/// and nothing that later makes presets cheaper, moves the ladder. The light's steps are those of High at commit eba2f38.
const GROUND: &[&str] = &[
    "quality.method=march",
    "quality.max_distance=36000",
    "quality.step_growth=0",
    "quality.max_steps=8192",
    "quality.light_steps=6",
    "quality.light_step=45",
    "quality.light_growth=1.9",
    "quality.lod_bias=0",
    "quality.integration=energy_conserving",
    "quality.empty_steps=6",
    "quality.window=8",
];
/// Read by none of the rungs: they belong to other temporal modes, and to the path tracer.
const UNUSED: [&str; 3] = ["alpha", "block", "seed"];

pub const RUNGS: [Rung; 7] = [
    Rung {
        label: "none: step {quality.step} m",
        changes: &[
            "quality.resolution=full",
            "quality.step=9",
            "quality.long_step=1",
            "quality.transmittance_stop=0",
            "quality.density_skip=0",
            "quality.temporal=off",
            "quality.offsets=false",
        ],
        thesis: Some(1558.0),
    },
    Rung {
        label: "stop at transmittance {quality.transmittance_stop}",
        changes: &["quality.transmittance_stop=0.075"],
        thesis: Some(373.0),
    },
    Rung {
        label: "skip density below {quality.density_skip}",
        changes: &["quality.density_skip=0.01"],
        thesis: Some(34.6),
    },
    Rung {
        label: "unified TAA, {quality.window} frames: step {quality.step} m",
        changes: &["quality.temporal=sliding_window", "quality.window=8", "quality.offsets=true", "quality.step=100"],
        thesis: Some(6.5),
    },
    Rung { label: "adaptive step", changes: &["quality.long_step=4"], thesis: Some(6.0) },
    Rung { label: "{quality.resolution} resolution", changes: &["quality.resolution=half"], thesis: Some(2.7) },
    Rung { label: "{quality.resolution} resolution", changes: &["quality.resolution=quarter"], thesis: Some(1.8) },
];

/// The default preset, cut off where the rungs are.
pub const HIGH: Rung = Rung { label: "our High", changes: &[], thesis: None };

/// Settings that rung `n` is rendered with: all changes up to it.
pub fn settings(n: usize) -> Vec<&'static str> {
    let mut all: Vec<&str> = GROUND.to_vec();
    for change in RUNGS.iter().take(n + 1).flat_map(|rung| rung.changes) {
        // The last value counts; naming one twice would only confuse a reader.
        let path = change.split('=').next();
        all.retain(|before| before.split('=').next() != path);
        all.push(change);
    }
    all
}

/// Whether a rung says what each setting of the quality is. `quality` is what `headless --effective` says of it.
pub fn check_pinned(n: usize, quality: &Value) -> Result<()> {
    let settings = settings(n);
    for name in quality.as_object().into_iter().flat_map(|all| all.keys()).filter(|name| !UNUSED.contains(&&***name)) {
        let pinned = settings.iter().any(|setting| setting.starts_with(&format!("quality.{name}=")));
        ensure!(
            pinned,
            "rung {n} of the ladder leaves quality.{name} to a preset: pin it to the thesis's method in rungs.rs"
        );
    }
    Ok(())
}

/// Options of `headless` for rung `n`.
pub fn options(n: usize) -> String {
    settings(n).iter().fold("--quality high".to_owned(), |options, setting| format!("{options} --set {setting}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_that_is_not_pinned_is_named() {
        let quality = |more: &str| serde_json::json!({ "step": 9.0, "alpha": 0.05, more: 1 });
        assert!(check_pinned(0, &quality("light_steps")).is_ok());
        assert!(check_pinned(0, &quality("space")).is_err_and(|error| error.to_string().contains("quality.space")));
    }

    #[test]
    fn rungs_add_up() {
        assert_eq!(RUNGS.map(|r| r.thesis.unwrap()), [1558.0, 373.0, 34.6, 6.5, 6.0, 2.7, 1.8]);
        let first = settings(0);
        assert!(first.contains(&"quality.step=9") && first.contains(&"quality.long_step=1"));
        let last = settings(RUNGS.len() - 1);
        assert!(last.contains(&"quality.step=100") && !last.contains(&"quality.step=9"));
        assert!(last.contains(&"quality.resolution=quarter") && last.contains(&"quality.transmittance_stop=0.075"));
        let paths: std::collections::BTreeSet<_> = last.iter().map(|s| s.split('=').next()).collect();
        assert_eq!(paths.len(), last.len());
    }
}
