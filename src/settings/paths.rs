//! Settings by path: `model.coverage=0.2`. For command lines, consoles and scripts.

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{
        PartialReflect, ReflectMut, ReflectRef, TypeInfo,
        enums::{DynamicEnum, DynamicVariant},
    },
};

use super::{
    CloudClock, CloudLayer, CloudLayers, CloudLighting, CloudModel, CloudQuality, CloudTextures, MAX_LAYERS,
    SettingsError, Validate,
    check::{fields, items},
};

/// All settings that are plain data, together: what a path can reach.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct CloudSettings {
    /// Paths `model.*`.
    pub model: CloudModel,
    /// Paths `layers.0.*`, `layers.1.*` and so on.
    pub layers: CloudLayers,
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
    fn roots(&self) -> [(&'static str, &dyn PartialReflect); 6] {
        [
            (CloudModel::ROOT, &self.model),
            (CloudLayers::ROOT, &self.layers),
            (CloudLighting::ROOT, &self.lighting),
            (CloudQuality::ROOT, &self.quality),
            (CloudTextures::ROOT, &self.textures),
            (CloudClock::ROOT, &self.clock),
        ]
    }

    fn root_mut(&mut self, root: &str) -> Option<&mut dyn PartialReflect> {
        Some(match root {
            CloudModel::ROOT => &mut self.model,
            CloudLayers::ROOT => &mut self.layers,
            CloudLighting::ROOT => &mut self.lighting,
            CloudQuality::ROOT => &mut self.quality,
            CloudTextures::ROOT => &mut self.textures,
            CloudClock::ROOT => &mut self.clock,
            _ => return None,
        })
    }

    /// Every path that [`set`](Self::set) takes, in the order of the structs. Layers are numbered from 0; the one after the
    /// last is listed too, since setting any of its fields adds it.
    pub fn paths(&self) -> Vec<String> {
        let mut more = self.clone();
        if more.layers.0.len() < MAX_LAYERS {
            more.layers.0.push(CloudLayer::default());
        }
        let mut all = Vec::new();
        for (root, value) in more.roots() {
            list_paths(value, root, &mut all);
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
        let (root, rest) = path.split_once('.').ok_or_else(unknown)?;
        let mut changed = self.clone();
        if root == CloudLayers::ROOT && rest.split('.').next() == Some(&*changed.layers.0.len().to_string()) {
            changed.layers.0.push(CloudLayer::default());
            if changed.layers.0.len() > MAX_LAYERS {
                return Err(SettingsError::TooManyLayers { count: changed.layers.0.len(), most: MAX_LAYERS });
            }
        }
        let target = changed.root_mut(root).ok_or_else(unknown)?;
        let field = field_at(target, rest).ok_or_else(unknown)?;
        parse_into(field, text.trim()).map_err(|expected| SettingsError::WrongType {
            field: path.to_owned(),
            value: text.to_owned(),
            expected,
        })?;
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
        self.layers.validate()?;
        self.lighting.validate()?;
        self.quality.validate()?;
        self.textures.validate()?;
        self.clock.validate()
    }
}

/// Whether a field is a struct of settings, and not a value such as a vector.
fn is_group(field: &dyn PartialReflect) -> bool {
    matches!(field.reflect_ref(), ReflectRef::Struct(_))
        && !(field.try_downcast_ref::<Vec3>().is_some() || field.try_downcast_ref::<DVec3>().is_some())
}

fn list_paths(value: &dyn PartialReflect, root: &str, all: &mut Vec<String>) {
    for (i, item) in items(value).into_iter().enumerate() {
        list_paths(item, &format!("{root}.{i}"), all);
    }
    for (info, field) in fields(value) {
        let path = format!("{root}.{}", info.name());
        if is_group(field) {
            list_paths(field, &path, all);
        } else if field.try_downcast_ref::<Option<Handle<Image>>>().is_none() {
            all.push(path);
        }
    }
}

/// The field that the dotted path leads to from `value`.
fn field_at<'a>(value: &'a mut dyn PartialReflect, path: &str) -> Option<&'a mut dyn PartialReflect> {
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    let field = match value.reflect_mut() {
        ReflectMut::Struct(s) => s.field_mut(name)?,
        ReflectMut::TupleStruct(s) => {
            let ReflectMut::List(list) = s.field_mut(0)?.reflect_mut() else { return None };
            list.get_mut(name.parse().ok()?)?
        }
        _ => return None,
    };
    match rest {
        Some(rest) if is_group(field) => field_at(field, rest),
        Some(_) => None,
        None => Some(field),
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
    } else if let Some(v) = field.try_downcast_mut::<String>() {
        text.clone_into(v);
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
