//! What a table was measured on.

use std::{path::Path, process::Command};

use crate::engine::is_software;

/// What a report's figures follow from.
const MEASURED: [&str; 6] = ["src", "examples", "assets", "scripts", "Cargo.toml", "Cargo.lock"];

/// Lines for the head of a report.
pub struct Machine {
    pub adapter: String,
    pub processor: String,
    pub date: String,
    pub commit: String,
    /// Load average while measuring, where the system tells.
    load: Option<f64>,
}

impl Machine {
    pub fn this(adapter: &str, repository: &Path) -> Self {
        let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        });
        let cpu = cpu.or_else(|| said("sysctl", &["-n", "machdep.cpu.brand_string"]));
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let folder = repository.display().to_string();
        let git = |arguments: &[&str]| said("git", &[&["-C", &folder], arguments].concat());
        // Reports that were just written are no change of what is measured.
        let changed = git(&[&["status", "--porcelain", "--untracked-files=no", "--"], &MEASURED[..]].concat());
        let dirty = if changed.is_some() { " **with changes that are in no commit**" } else { "" };
        let load = std::fs::read_to_string("/proc/loadavg").ok();
        let load = load.and_then(|text| text.split_whitespace().nth(2)?.parse().ok());
        Self {
            load,
            adapter: adapter.to_owned(),
            processor: format!("{} ({cores} threads)", cpu.unwrap_or_else(|| "unknown processor".to_owned())),
            date: said("date", &["-u", "+%Y-%m-%d %H:%M UTC"]).unwrap_or_else(|| "unknown date".to_owned()),
            commit: git(&["rev-parse", "--short", "HEAD"])
                .map_or_else(|| "unknown commit".to_owned(), |commit| commit + dirty),
        }
    }
}

impl Machine {
    /// What a reader has to know about the times, in one paragraph.
    pub fn about_times(&self) -> String {
        if !is_software(&self.adapter) {
            return "Times are medians of the frames.".to_owned();
        }
        format!(
            "This is a software driver, which shares the processor with whatever else runs: times are those of the quickest \
             frame, and say little about a GPU; ratios say more.{}",
            self.about_load()
        )
    }

    /// The same where times are medians on any driver, and ratios those of pairs.
    pub fn about_medians(&self) -> String {
        if !is_software(&self.adapter) {
            return String::new();
        }
        format!(
            "This is a software driver: times say little about a GPU, ratios more, and counts most.{}",
            self.about_load()
        )
    }

    fn about_load(&self) -> String {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get) as f64;
        match self.load {
            // What we run ourselves keeps every core busy.
            Some(load) if load > 1.5 * cores => {
                format!(" **Other work ran beside it (load {load:.1} on {cores} cores): costs are rough.**")
            }
            _ => String::new(),
        }
    }
}

/// What a command prints, if it succeeds and prints something.
fn said(command: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(command).args(arguments).output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (!text.is_empty()).then_some(text)
}
