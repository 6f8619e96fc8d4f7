//! A sky from one METAR report line: flight simulators' everyday input.
//!
//! METAR is WMO code form FM 15 (WMO-No. 306, Manual on Codes, volume I.1). The crate `metar` parses the report; this module
//! gives it what matters here, and turns the answer into plain data in metres, seconds and degrees.

mod clouds;
mod layers;
mod report;
mod sky;

pub use sky::{CloudGroup, CloudKind, MetarSky, MetarWind, Precipitation, PrecipitationKind};

use thiserror::Error;

/// A report that is none.
#[derive(Error, Clone, PartialEq, Eq, Debug)]
pub enum MetarError {
    /// There is no word in it.
    #[error("the METAR report is empty")]
    Empty,
    /// The station did not report.
    #[error("the METAR report says NIL: the station made no observation")]
    Nil,
    /// A group is not one that can stand where it does.
    #[error("METAR group {number}, {group:?}, cannot be read: {problem}")]
    Group {
        /// The group as it was written.
        group: String,
        /// Its place in the report; the first is 1.
        number: usize,
        /// What is wrong with it, as far as is known.
        problem: String,
    },
    /// It ends before all that must be there has come.
    #[error(
        "the METAR report ends after {0:?}; station, time (such as 231150Z) and observations must follow each other"
    )]
    Ends(String),
}
