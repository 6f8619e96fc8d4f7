//! What frames and passes took.

use std::{collections::BTreeMap, time::Instant};

use bevy::{diagnostic::DiagnosticsStore, prelude::*};
use serde_json::{Value, json};

/// The passes of the clouds; listed even where the device has no timestamps.
const CLOUD_PASSES: [&str; 4] = ["cloud_sky", "cloud_march", "cloud_accumulate", "cloud_composite"];

/// Updates from the one that renders a frame to the one that publishes its GPU times: the query buffer is read when
/// the next frame begins, and stored at the start of the one after (`bevy_render/diagnostic/internal.rs`). That holds
/// since each update here waits for the GPU.
pub const LAG: u32 = 2;

/// GPU times by pass, and wall times of whole frames (ms).
#[derive(Default)]
pub struct Timings {
    frames: Vec<f64>,
    passes: BTreeMap<String, Vec<f64>>,
    last_seen: BTreeMap<String, Instant>,
}

impl Timings {
    /// Adds a frame's wall time (ms), GPU included.
    pub fn add_frame(&mut self, milliseconds: f64) {
        self.frames.push(milliseconds);
    }

    /// Takes the GPU times that this update published. With `keep` false they belong to a frame that does not count.
    pub fn take_passes(&mut self, store: &DiagnosticsStore, keep: bool) {
        for diagnostic in store.iter() {
            let path = diagnostic.path().as_str();
            let name = path.strip_prefix("render/").and_then(|path| path.strip_suffix("/elapsed_gpu"));
            let (Some(name), Some(newest)) = (name, diagnostic.measurement()) else {
                continue;
            };
            let seen = self.last_seen.insert(name.to_owned(), newest.time);
            if keep && seen != Some(newest.time) {
                self.passes.entry(name.to_owned()).or_default().push(newest.value);
            }
        }
    }

    /// `{"passes": {name: {median, min, max} or null}, "frame": {median, min, max}}`, in ms.
    pub fn to_json(&self) -> (Value, Value) {
        let mut passes: BTreeMap<&str, Value> = CLOUD_PASSES.into_iter().map(|name| (name, Value::Null)).collect();
        passes.extend(self.passes.iter().map(|(name, times)| (name.as_str(), spread(times))));
        (json!(passes), spread(&self.frames))
    }
}

fn spread(times: &[f64]) -> Value {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (Some(min), Some(max)) = (sorted.first(), sorted.last()) else {
        return Value::Null;
    };
    let middle = sorted.len() / 2;
    let median = if sorted.len() % 2 == 1 { sorted[middle] } else { (sorted[middle - 1] + sorted[middle]) / 2.0 };
    json!({ "median": median, "min": min, "max": max })
}
