//! Settings by path: `model.coverage=0.2`. For command lines, consoles and scripts.

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{
        PartialReflect, ReflectMut, TypeInfo,
        enums::{DynamicEnum, DynamicVariant},
    },
};

use super::{
    CloudClock, CloudLighting, CloudModel, CloudQuality, CloudTextures, SettingsError, Validate, check::fields,
};

/// All settings that are plain data, together: what a path can reach.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct CloudSettings {
    /// Paths `model.*`.
    pub model: CloudModel,
    /// Paths `lighting.*`.
    pub lighting: CloudLighting,
    /// Paths `quality.*`.
    pub quality: CloudQuality,
    /// Paths `textures.*`.
    pub textures: CloudTextures,
    /// Paths `clock.*`.
    pub clock: CloudClock,
}

impl CloudSettings {
    fn roots(&self) -> [(&'static str, &dyn PartialReflect); 5] {
        [
            (CloudModel::ROOT, &self.model),
            (CloudLighting::ROOT, &self.lighting),
            (CloudQuality::ROOT, &self.quality),
            (CloudTextures::ROOT, &self.textures),
            (CloudClock::ROOT, &self.clock),
        ]
    }

    fn root_mut(&mut self, root: &str) -> Option<&mut dyn PartialReflect> {
        Some(match root {
            CloudModel::ROOT => &mut self.model,
            CloudLighting::ROOT => &mut self.lighting,
            CloudQuality::ROOT => &mut self.quality,
            CloudTextures::ROOT => &mut self.textures,
            CloudClock::ROOT => &mut self.clock,
            _ => return None,
        })
    }

    /// Every path that [`set`](Self::set) takes, in the order of the structs.
    pub fn paths(&self) -> Vec<String> {
        let mut all = Vec::new();
        for (root, value) in self.roots() {
            all.extend(fields(value).iter().map(|(info, _)| format!("{root}.{}", info.name())));
        }
        all
    }

    /// Sets the field at `path` from text: numbers as they are, vectors as `x,y,z`, choices in snake_case.
    ///
    /// # Errors
    /// [`SettingsError::UnknownPath`], [`SettingsError::WrongType`] or, by the field's range,
    /// [`SettingsError::OutOfRange`]; nothing is changed then. Relations between fields are not checked: call
    /// [`validate`](Self::validate) when all are set.
    pub fn set(&mut self, path: &str, text: &str) -> Result<(), SettingsError> {
        let unknown = || SettingsError::UnknownPath(path.to_owned());
        let (root, name) = path.split_once('.').ok_or_else(unknown)?;
        let mut changed = self.clone();
        let target = changed.root_mut(root).ok_or_else(unknown)?;
        {
            let ReflectMut::Struct(s) = target.reflect_mut() else { return Err(unknown()) };
            let field = s.field_mut(name).ok_or_else(unknown)?;
            parse_into(field, text.trim()).map_err(|expected| SettingsError::WrongType {
                field: path.to_owned(),
                value: text.to_owned(),
                expected,
            })?;
        }
        super::check::check_ranges(target, root)?;
        *self = changed;
        Ok(())
    }

    /// Validates every part.
    ///
    /// # Errors
    /// The first field found wrong.
    pub fn validate(&self) -> Result<(), SettingsError> {
        self.model.validate()?;
        self.lighting.validate()?;
        self.quality.validate()?;
        self.textures.validate()?;
        self.clock.validate()
    }
}

/// Parses `text` into the field; on failure says what was expected.
fn parse_into(field: &mut dyn PartialReflect, text: &str) -> Result<(), String> {
    fn one<T: std::str::FromStr>(text: &str, what: &str) -> Result<T, String> {
        text.trim().parse().map_err(|_| what.to_owned())
    }
    fn three<T: std::str::FromStr>(text: &str) -> Result<[T; 3], String> {
        const WHAT: &str = "three numbers x,y,z";
        let parts: Vec<&str> = text.split(',').collect();
        match parts[..] {
            [x, y, z] => Ok([one(x, WHAT)?, one(y, WHAT)?, one(z, WHAT)?]),
            _ => Err(WHAT.to_owned()),
        }
    }
    if let Some(v) = field.try_downcast_mut::<f32>() {
        *v = one(text, "a number")?;
    } else if let Some(v) = field.try_downcast_mut::<f64>() {
        *v = one(text, "a number")?;
    } else if let Some(v) = field.try_downcast_mut::<u32>() {
        *v = one(text, "a whole number, not negative")?;
    } else if let Some(v) = field.try_downcast_mut::<bool>() {
        *v = one(text, "true or false")?;
    } else if let Some(v) = field.try_downcast_mut::<Vec3>() {
        *v = three::<f32>(text)?.into();
    } else if let Some(v) = field.try_downcast_mut::<DVec3>() {
        *v = three::<f64>(text)?.into();
    } else if let Some(TypeInfo::Enum(info)) = field.get_represented_type_info() {
        let names: Vec<&str> = info.variant_names().to_vec();
        let wanted = names
            .iter()
            .find(|name| snake_case(name) == text || **name == text)
            .ok_or_else(|| format!("one of {}", names.iter().map(|n| snake_case(n)).collect::<Vec<_>>().join(", ")))?;
        field
            .try_apply(&DynamicEnum::new((*wanted).to_owned(), DynamicVariant::Unit))
            .map_err(|error| error.to_string())?;
    } else {
        return Err("a field that can be set from text".to_owned());
    }
    Ok(())
}

/// `SlidingWindow` to `sliding_window`: how choices are written in text.
pub fn snake_case(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.char_indices() {
        if c.is_uppercase() && i > 0 {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}
