//! How far a long run is: a bar with the time left on a terminal, else a line for each picture.

use std::{
    io::{IsTerminal as _, Write as _},
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

pub struct Progress {
    bar: ProgressBar,
    lines: bool,
    began: Instant,
}

impl Progress {
    pub fn begin(steps: usize) -> Self {
        let lines = !std::io::stderr().is_terminal();
        let bar = if lines { ProgressBar::hidden() } else { ProgressBar::no_length() };
        bar.set_length(steps as u64);
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} {elapsed}, {eta} left  {msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(500));
        Self { bar, lines, began: Instant::now() }
    }

    /// One more is done.
    pub fn done(&self, what: &str) {
        self.bar.inc(1);
        self.bar.set_message(what.to_owned());
        if self.lines {
            let (at, of) = (self.bar.position(), self.bar.length().unwrap_or_default());
            let seconds = self.began.elapsed().as_secs();
            // Nobody is left to tell where stderr is closed.
            let _ = writeln!(std::io::stderr(), "[{at}/{of}, {seconds} s] {what}");
        }
    }

    /// These need no work after all.
    pub fn skip(&self, steps: usize) {
        self.bar.set_length(self.bar.length().unwrap_or_default().saturating_sub(steps as u64));
    }

    pub fn seconds(&self) -> u64 {
        self.began.elapsed().as_secs()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
