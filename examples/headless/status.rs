//! Says on stderr how far things are: bars on a terminal, else one plain line a stage.

use std::{
    io::{IsTerminal as _, Write as _},
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};

/// One stage of the work.
pub struct Stage(ProgressBar);

impl Stage {
    /// Begins a stage of so many steps.
    pub fn begin(what: &'static str, steps: u64) -> Self {
        if !std::io::stderr().is_terminal() {
            // A closed stderr is no reason to stop.
            let _ = writeln!(std::io::stderr(), "{what} …");
            return Self(ProgressBar::hidden());
        }
        let style = ProgressStyle::with_template("{msg:24} {bar:32} {pos}/{len} {elapsed}");
        let bar = ProgressBar::new(steps).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(what);
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    /// So many steps are done.
    pub fn at(&self, step: u64) {
        self.0.set_position(step);
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
