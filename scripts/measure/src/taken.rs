//! How the figures of a report were had.

use crate::{machine::Machine, markdown::zoomed};

/// What both reports say of themselves.
pub struct Taken {
    pub size: String,
    pub zoom: f64,
    /// Samples a pixel of each reference.
    pub samples: u32,
    /// What stands for the reference, where it is not the path tracer.
    pub stand_in: Option<String>,
    pub machine: Machine,
    pub seconds: u64,
}

impl Taken {
    /// A warning where the reference is none; else nothing.
    pub fn warning(&self) -> String {
        self.stand_in.as_ref().map_or_else(String::new, |name| {
            format!("\n**Not the real thing: preset `{name}` stands in for the path tracer in this run.**\n")
        })
    }

    /// When, where and on what; `more` comes after the pictures' size.
    pub fn measured(&self, more: &str) -> String {
        let Self { size, zoom, samples, machine, seconds, .. } = self;
        format!(
            "\nMeasured {} at commit {} on {}, {}: pictures of {size}{}{more}, {samples} samples a pixel in each reference, \
             {} min {} s in all. {}\n",
            machine.date,
            machine.commit,
            machine.adapter,
            machine.processor,
            zoomed(*zoom),
            seconds / 60,
            seconds % 60,
            machine.about_times(),
        )
    }
}
