//! Range checks, driven by the ranges that stand on the fields.

use std::ops::RangeInclusive;

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{NamedField, PartialReflect, Reflect, ReflectRef, TypeInfo},
};
use thiserror::Error;

use super::{CloudClock, CloudLighting, CloudModel, CloudQuality, CloudTextures, CloudView};

/// A setting that cannot be used.
#[derive(Error, Clone, PartialEq, Debug)]
pub enum SettingsError {
    /// A number is outside its range, infinite or NaN.
    #[error("{field} = {value} is outside its range {min} to {max}")]
    OutOfRange {
        /// Path of the field, such as `model.coverage`.
        field: String,
        /// What it was set to.
        value: String,
        /// Least allowed value.
        min: String,
        /// Greatest allowed value.
        max: String,
    },
    /// `model.top` is not above `model.bottom`.
    #[error("model.top = {top} must be above model.bottom = {bottom}")]
    InvertedAltitudes {
        /// `model.bottom` (m).
        bottom: f32,
        /// `model.top` (m).
        top: f32,
    },
    /// Two fields of which one must be above the other are not.
    #[error("{high} = {high_value} must be above {low} = {low_value}")]
    Inverted {
        /// Path of the one that must be lower.
        low: String,
        /// What it was set to.
        low_value: f32,
        /// Path of the one that must be higher.
        high: String,
        /// What it was set to.
        high_value: f32,
    },
    /// More layers than are shown at once.
    #[error("layers holds {count} layers, and {most} is the most")]
    TooManyLayers {
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// A size that must be a power of two is not.
    #[error("{field} = {value} must be a power of two from {min} to {max}")]
    NotPowerOfTwo {
        /// Path of the field.
        field: String,
        /// What it was set to.
        value: u32,
        /// Least allowed value.
        min: u32,
        /// Greatest allowed value.
        max: u32,
    },
    /// No field has this path.
    #[error("no setting is called {0:?}; `CloudSettings::paths` (`--list` in the examples) names them all")]
    UnknownPath(String),
    /// The text is not a value of the field's type.
    #[error("{field} = {value:?}: expected {expected}")]
    WrongType {
        /// Path of the field.
        field: String,
        /// The text.
        value: String,
        /// What would do.
        expected: String,
    },
}

impl SettingsError {
    /// Paths of the fields that it is about, the one to be changed first.
    pub(super) fn paths(&self) -> Vec<String> {
        match self {
            Self::OutOfRange { field, .. } | Self::NotPowerOfTwo { field, .. } | Self::WrongType { field, .. } => {
                vec![field.clone()]
            }
            Self::InvertedAltitudes { .. } => vec!["model.top".to_owned(), "model.bottom".to_owned()],
            Self::Inverted { low, high, .. } => vec![high.clone(), low.clone()],
            // The first that is one too many.
            Self::TooManyLayers { most, .. } => vec![format!("layers.{most}")],
            Self::UnknownPath(path) => vec![path.clone()],
        }
    }
}

/// Settings that can say whether they are usable.
pub trait Validate: Reflect + Sized {
    /// The first segment of the paths of its fields, such as `model`.
    const ROOT: &'static str;

    /// Checks every field against the range that stands on it, and fields against each other.
    ///
    /// # Errors
    /// The first field found wrong, with its path, value and range.
    fn validate(&self) -> Result<(), SettingsError> {
        check_ranges(self.as_partial_reflect(), Self::ROOT)?;
        self.validate_relations()
    }

    /// Checks fields against each other.
    ///
    /// # Errors
    /// As [`validate`](Self::validate).
    fn validate_relations(&self) -> Result<(), SettingsError> {
        Ok(())
    }
}

impl Validate for CloudModel {
    const ROOT: &'static str = "model";
    fn validate_relations(&self) -> Result<(), SettingsError> {
        if self.top <= self.bottom {
            return Err(SettingsError::InvertedAltitudes { bottom: self.bottom, top: self.top });
        }
        Ok(())
    }
}
impl Validate for CloudLighting {
    const ROOT: &'static str = "lighting";
}
impl Validate for CloudQuality {
    const ROOT: &'static str = "quality";
}
impl Validate for CloudView {
    const ROOT: &'static str = "view";
    fn validate_relations(&self) -> Result<(), SettingsError> {
        self.quality.as_ref().map_or(Ok(()), |q| check_ranges(q, "view.quality"))
    }
}
impl Validate for CloudClock {
    const ROOT: &'static str = "clock";
}
impl Validate for CloudTextures {
    const ROOT: &'static str = "textures";
    fn validate_relations(&self) -> Result<(), SettingsError> {
        for (field, value, min, max) in
            [("textures.volume_size", self.volume_size, 32, 256), ("textures.map_size", self.map_size, 64, 4096)]
        {
            if !value.is_power_of_two() {
                return Err(SettingsError::NotPowerOfTwo { field: field.to_owned(), value, min, max });
            }
        }
        Ok(())
    }
}

/// The named fields of a reflected struct, with their declarations.
pub(crate) fn fields(value: &dyn PartialReflect) -> Vec<(&'static NamedField, &dyn PartialReflect)> {
    let (ReflectRef::Struct(s), Some(TypeInfo::Struct(info))) =
        (value.reflect_ref(), value.get_represented_type_info())
    else {
        return Vec::new();
    };
    (0..info.field_len()).filter_map(|i| Some((info.field_at(i)?, s.field_at(i)?))).collect()
}

/// The layers in [`CloudLayers`], each a struct.
pub(crate) fn items(value: &dyn PartialReflect) -> Vec<&dyn PartialReflect> {
    match value.reflect_ref() {
        ReflectRef::TupleStruct(s) => s.field(0).map_or_else(Vec::new, items),
        ReflectRef::List(list) => list.iter().collect(),
        _ => Vec::new(),
    }
}

/// Checks each field of `value`, and of what it holds, that carries a range.
pub(crate) fn check_ranges(value: &dyn PartialReflect, root: &str) -> Result<(), SettingsError> {
    for (i, item) in items(value).into_iter().enumerate() {
        check_ranges(item, &format!("{root}.{i}"))?;
    }
    for (info, field) in fields(value) {
        let path = format!("{root}.{}", info.name());
        if let Some(range) = info.get_attribute::<RangeInclusive<u32>>() {
            let n = field.try_downcast_ref::<u32>().copied().unwrap_or(*range.start());
            if !range.contains(&n) {
                return Err(out_of_range(&path, n, range.start(), range.end()));
            }
        } else if let Some(range) = info.get_attribute::<RangeInclusive<f32>>() {
            for (suffix, n) in numbers(field) {
                // As f32, as the ends are written: 1e12 is not among the numbers that f32 has.
                let inside = range.contains(&(n as f32));
                if !inside {
                    return Err(out_of_range(&format!("{path}{suffix}"), n, range.start(), range.end()));
                }
            }
        } else if numbers(field).is_empty() {
            check_ranges(field, &path)?;
        }
    }
    Ok(())
}

/// The numbers in a field, with the suffix of each in the path.
fn numbers(field: &dyn PartialReflect) -> Vec<(&'static str, f64)> {
    if let Some(v) = field.try_downcast_ref::<f32>() {
        vec![("", f64::from(*v))]
    } else if let Some(v) = field.try_downcast_ref::<f64>() {
        vec![("", *v)]
    } else if let Some(v) = field.try_downcast_ref::<Vec3>() {
        vec![(".x", v.x.into()), (".y", v.y.into()), (".z", v.z.into())]
    } else if let Some(v) = field.try_downcast_ref::<DVec3>() {
        vec![(".x", v.x), (".y", v.y), (".z", v.z)]
    } else {
        Vec::new()
    }
}

/// What the field at this path below a type takes, such as `a number from -1 to 1`; of a vector's parts, what each takes.
pub(super) fn range_at(info: &'static TypeInfo, path: &str) -> Option<String> {
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    match info {
        TypeInfo::Struct(info) => {
            let field = info.field(name)?;
            range_on(field).or_else(|| range_at(field.type_info()?, rest?))
        }
        TypeInfo::TupleStruct(info) => range_at(info.field_at(0)?.type_info()?, path),
        TypeInfo::List(info) => range_at(info.item_info()?, rest?),
        _ => None,
    }
}

fn range_on(field: &NamedField) -> Option<String> {
    if let Some(range) = field.get_attribute::<RangeInclusive<u32>>() {
        return Some(format!("a whole number from {} to {}", range.start(), range.end()));
    }
    let range = field.get_attribute::<RangeInclusive<f32>>()?;
    Some(format!("a number from {} to {}", range.start(), range.end()))
}

fn out_of_range<T: ToString, R: ToString>(field: &str, value: T, min: &R, max: &R) -> SettingsError {
    SettingsError::OutOfRange {
        field: field.to_owned(),
        value: value.to_string(),
        min: min.to_string(),
        max: max.to_string(),
    }
}
