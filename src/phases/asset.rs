//! Tables of a user's own, from text.

use std::sync::Arc;

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
};
use glam::DVec3;
use thiserror::Error;

use crate::reference::phase_table::PhaseTable;

/// A phase function from a table.
///
/// As a file (`*.phase.csv`) each line has the scattering angle in degrees, from 0 (straight on) to 180 (straight back) in
/// rising order, and either one value or one each for red, green and blue, with commas between. Values are linear, in any
/// unit: they are normalised, each colour by itself. Between them the function is linear in the angle. Empty lines, what
/// comes after a `#`, and a first line of names are skipped.
#[derive(Asset, TypePath, Clone, PartialEq, Debug)]
pub struct CloudPhaseTable(pub Arc<PhaseTable>);

/// A table that cannot be used.
#[derive(Error, Debug)]
pub enum PhaseTableError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// A line has too few or too many columns.
    #[error("{file}:{line}: {found} columns, but 2 (angle, value) or 4 (angle, red, green, blue) are needed{others}")]
    Columns {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// How many there are.
        found: usize,
        /// What the lines before have, where that is the trouble.
        others: String,
    },
    /// A field is not a number.
    #[error("{file}:{line}: {text:?} is not a number")]
    NotANumber {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// The field.
        text: String,
    },
    /// A value is negative or infinite.
    #[error("{file}:{line}: the value {value} is outside its range 0 to 1e30")]
    OutOfRange {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// The value.
        value: f64,
    },
    /// An angle does not rise, or is no angle.
    #[error("{file}:{line}: the angle {angle} must be above {after}, the one before, and at most 180")]
    Angle {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// The angle (degrees).
        angle: f64,
        /// The one before (degrees).
        after: f64,
    },
    /// The angles do not begin at 0 and end at 180.
    #[error("{file}: the angles go from {first} to {last}, but 0 to 180 are needed")]
    Reach {
        /// The file.
        file: String,
        /// The first angle (degrees).
        first: f64,
        /// The last angle (degrees).
        last: f64,
    },
    /// There are no lines.
    #[error("{file}: there is no line with numbers")]
    Empty {
        /// The file.
        file: String,
    },
    /// One colour has no light at all.
    #[error("{file}: all values of a column are 0")]
    Dark {
        /// The file.
        file: String,
    },
}

impl CloudPhaseTable {
    /// Parses the text of a table; `file` names it in errors.
    ///
    /// # Errors
    /// What is wrong, with file and line.
    pub fn parse(text: &str, file: &str) -> Result<Self, PhaseTableError> {
        let rows = rows(text, file)?;
        let file = file.to_owned();
        let (Some((first, _)), Some((last, _))) = (rows.first(), rows.last()) else {
            return Err(PhaseTableError::Empty { file });
        };
        if *first != 0.0 || *last != 180.0 {
            return Err(PhaseTableError::Reach { file, first: *first, last: *last });
        }
        let table = PhaseTable::from_fn(|angle| at(&rows, angle.to_degrees()));
        if !table.value(1.0).is_finite() {
            return Err(PhaseTableError::Dark { file });
        }
        Ok(Self(Arc::new(table)))
    }
}

/// Angle and values of each line.
fn rows(text: &str, file: &str) -> Result<Vec<(f64, DVec3)>, PhaseTableError> {
    let mut rows: Vec<(f64, DVec3)> = Vec::new();
    let (mut columns, mut names) = (None, false);
    for (i, line) in text.lines().enumerate() {
        let (file, line_number) = (file.to_owned(), i + 1);
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if columns.is_none() && !names && fields.iter().all(|field| field.parse::<f64>().is_err()) {
            names = true;
            continue;
        }
        let found = fields.len();
        if !(found == 2 || found == 4) || columns.is_some_and(|columns| columns != found) {
            let others = columns.map_or_else(String::new, |n| format!("; the lines before have {n}"));
            return Err(PhaseTableError::Columns { file, line: line_number, found, others });
        }
        columns = Some(found);
        let mut numbers = [0.0; 4];
        for (number, text) in numbers.iter_mut().zip(&fields) {
            *number = text.parse().map_err(|_| PhaseTableError::NotANumber {
                file: file.clone(),
                line: line_number,
                text: (*text).to_owned(),
            })?;
        }
        let [angle, values @ ..] = numbers;
        let after = rows.last().map_or(-1e-300, |(angle, _)| *angle);
        if !(angle > after && angle <= 180.0) {
            return Err(PhaseTableError::Angle { file, line: line_number, angle, after: after.max(0.0) });
        }
        let values = if found == 2 { DVec3::splat(values[0]) } else { DVec3::from_array(values) };
        if let Some(value) = values.to_array().into_iter().find(|value| !(0.0..=1e30).contains(value)) {
            return Err(PhaseTableError::OutOfRange { file, line: line_number, value });
        }
        rows.push((angle, values));
    }
    Ok(rows)
}

/// Between the rows around an angle (degrees).
fn at(rows: &[(f64, DVec3)], angle: f64) -> DVec3 {
    let next = rows.partition_point(|(a, _)| *a <= angle).clamp(1, rows.len() - 1);
    let ((a, before), (b, after)) = (rows[next - 1], rows[next]);
    before.lerp(after, ((angle - a) / (b - a)).clamp(0.0, 1.0))
}

/// Loads `*.phase.csv` files as [`CloudPhaseTable`] assets.
#[derive(Default, TypePath)]
pub(crate) struct CloudPhaseTableLoader;

impl AssetLoader for CloudPhaseTableLoader {
    type Asset = CloudPhaseTable;
    type Settings = ();
    type Error = PhaseTableError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<CloudPhaseTable, PhaseTableError> {
        let file = context.path().to_string();
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|source| PhaseTableError::Io { file: file.clone(), source })?;
        CloudPhaseTable::parse(&String::from_utf8_lossy(&bytes), &file)
    }

    fn extensions(&self) -> &[&str] {
        &["phase.csv"]
    }
}
