//! What can be wrong with a preset, and where in its file.

use std::fmt;

use bevy::reflect::Typed;
use thiserror::Error;

use super::{
    CloudPreset, SettingsError,
    check::range_at,
    preset_lines::{Places, line_and_column, offset, skip_space},
};

/// A place in a preset's file. Shown as `file:line:column`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PresetPlace {
    /// The file.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The character in the line, from 1.
    pub column: usize,
}

impl PresetPlace {
    fn new(text: &str, file: &str, offset: usize) -> Self {
        let (line, column) = line_and_column(text, offset);
        Self { file: file.to_owned(), line, column }
    }
}

impl fmt::Display for PresetPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// A preset that cannot be used.
#[derive(Error, Debug)]
pub enum PresetError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not a preset: unknown field, wrong type, or not RON at all.
    #[error("{place}: {}{source}{}", before(.field), within(.range))]
    Parse {
        /// Where.
        place: PresetPlace,
        /// Path of the field that is being read there, if it is one.
        field: Option<String>,
        /// Why.
        source: Box<ron::Error>,
        /// What that field takes, where its value is no such number.
        range: Option<String>,
    },
    /// A field is out of its range.
    #[error("{place}: {source}")]
    Settings {
        /// Where that field is written, or what is around it.
        place: PresetPlace,
        /// Which and why.
        source: Box<SettingsError>,
    },
    /// The image that a layer is to read is not there.
    #[error("{place}: layers.{layer}.map_file = {map:?}: {reason}")]
    Map {
        /// Where it is named.
        place: PresetPlace,
        /// The layer's number, from 0.
        layer: usize,
        /// The image's path.
        map: String,
        /// Why it cannot be read.
        reason: String,
    },
}

fn before(field: &Option<String>) -> String {
    field.as_ref().map_or_else(String::new, |field| format!("{field}: "))
}

fn within(range: &Option<String>) -> String {
    range.as_ref().map_or_else(String::new, |range| format!(" ({range})"))
}

impl PresetError {
    /// What RON's parser found.
    pub(super) fn parse(text: &str, file: &str, error: ron::error::SpannedError) -> Self {
        let begins = error.span.start;
        // The span begins before white space.
        let at = skip_space(text, offset(text, begins.line, begins.col));
        let field = Places::of(text).around(at).map(str::to_owned);
        // A fraction where a whole number should be.
        let is_cut_off = error.code == ron::Error::ExpectedComma && text[at..].starts_with('.');
        let range = field.as_deref().filter(|_| is_cut_off || is_wrong_value(&error.code));
        let range = range.and_then(|path| range_at(CloudPreset::type_info(), path));
        Self::Parse { place: PresetPlace::new(text, file, at), field, source: Box::new(error.code), range }
    }

    /// What the checks found.
    pub(super) fn settings(text: &str, file: &str, error: SettingsError) -> Self {
        let places = Places::of(text);
        let paths = error.paths();
        let written = paths.iter().find_map(|path| places.find(path));
        let around = || paths.first().map_or(0, |path| places.nearest(path));
        let place = PresetPlace::new(text, file, written.unwrap_or_else(around));
        Self::Settings { place, source: Box::new(error) }
    }

    /// A layer's image is not there.
    pub(super) fn map(text: &str, file: &str, layer: usize, map: &str, reason: String) -> Self {
        let at = Places::of(text).nearest(&format!("layers.{layer}.map_file"));
        Self::Map { place: PresetPlace::new(text, file, at), layer, map: map.to_owned(), reason }
    }
}

/// Whether the field is a number and its value is none.
fn is_wrong_value(code: &ron::Error) -> bool {
    use ron::Error::*;
    matches!(
        code,
        ExpectedFloat
            | ExpectedInteger
            | FloatUnderscore
            | IntegerOutOfBounds
            | InvalidIntegerDigit { .. }
            | InvalidValueForType { .. }
            | UnderscoreAtBeginning
    )
}
