//! What a table was measured on.

use std::process::Command;

use crate::engine::is_software;

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
    pub fn this(adapter: &str) -> Self {
        let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        });
        let cpu = cpu.or_else(|| said("sysctl", &["-n", "machdep.cpu.brand_string"]));
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let dirty = if said("git", &["status", "--porcelain", "--untracked-files=no"]).is_some() {
            " with changes"
        } else {
            ""
        };
        let load = std::fs::read_to_string("/proc/loadavg").ok();
        let load = load.and_then(|text| text.split_whitespace().nth(2)?.parse().ok());
        Self {
            load,
            adapter: adapter.to_owned(),
            processor: format!("{} ({cores} threads)", cpu.unwrap_or_else(|| "unknown processor".to_owned())),
            date: said("date", &["-u", "+%Y-%m-%d %H:%M UTC"]).unwrap_or_else(|| "unknown date".to_owned()),
            commit: said("git", &["rev-parse", "--short", "HEAD"])
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
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get) as f64;
        let busy = match self.load {
            // What we run ourselves keeps every core busy.
            Some(load) if load > 1.5 * cores => {
                format!(" **Other work ran beside it (load {load:.1} on {cores} cores): costs are rough.**")
            }
            _ => String::new(),
        };
        format!(
            "This is a software driver, which shares the processor with whatever else runs: times are those of the quickest \
             frame, and say little about a GPU; ratios say more.{busy}"
        )
    }
}

/// What a command prints, if it succeeds and prints something.
fn said(command: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(command).args(arguments).output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (!text.is_empty()).then_some(text)
}
