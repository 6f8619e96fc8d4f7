//! What frames and passes took.

use std::{collections::BTreeMap, fs, time::Instant};

use bevy::{diagnostic::DiagnosticsStore, prelude::*};
use serde_json::{Value, json};

/// The passes of the clouds; listed even where the device has no timestamps.
const CLOUD_PASSES: [&str; 4] = ["cloud_sky", "cloud_march", "cloud_accumulate", "cloud_composite"];

/// Updates from the one that renders a frame to the one that publishes its GPU times: the query buffer is read when
/// the next frame begins, and stored at the start of the one after (`bevy_render/diagnostic/internal.rs`). That holds
/// since each update here waits for the GPU.
pub const LAG: u32 = 2;

/// GPU times by pass, and wall and processor times of whole frames (ms).
#[derive(Default)]
pub struct Timings {
    frames: Vec<f64>,
    processor: Vec<f64>,
    passes: BTreeMap<String, Vec<f64>>,
    last_seen: BTreeMap<String, Instant>,
}

impl Timings {
    /// Adds a frame's wall time (ms), GPU included, and the time that the processor spent on it.
    pub fn add_frame(&mut self, milliseconds: f64, processor: Option<f64>) {
        self.frames.push(milliseconds);
        self.processor.extend(processor);
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

    /// Of each pass, of the frame, and of the processor in it: `{median, min, max}` or null, in ms.
    pub fn to_json(&self) -> [Value; 3] {
        let mut passes: BTreeMap<&str, Value> = CLOUD_PASSES.into_iter().map(|name| (name, Value::Null)).collect();
        passes.extend(self.passes.iter().map(|(name, times)| (name.as_str(), spread(times))));
        [json!(passes), spread(&self.frames), spread(&self.processor)]
    }
}

/// Time that the processor has spent on this process so far (ms), all threads together; only Linux tells without further
/// ado. Where the driver runs in software it is what a frame costs, however busy the machine is with other things.
pub fn processor_ms() -> Option<f64> {
    let mut nanoseconds = 0.0;
    for task in fs::read_dir("/proc/self/task").ok()?.flatten() {
        // A thread may end meanwhile.
        let text = fs::read_to_string(task.path().join("schedstat")).unwrap_or_default();
        nanoseconds += text.split_whitespace().next().and_then(|n| n.parse::<f64>().ok()).unwrap_or(0.0);
    }
    (nanoseconds > 0.0).then_some(nanoseconds * 1e-6)
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
