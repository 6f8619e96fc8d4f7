//! The page: every field of every setting, as reflection knows it. Also part of the tests, which compare it with
//! docs/settings.md.

use std::{fmt::Write, ops::RangeInclusive};

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{NamedField, PartialReflect, ReflectRef, TypeInfo, Typed, enums::EnumInfo, structs::StructInfo},
};
use bevy_cumulus::{prelude::*, settings::snake_case};

const INTRODUCTION: &str = "\
# Settings

<!-- Written by `cargo run --example settings_reference` from the fields' documentation: change that, not this page. -->

All of them are optional, and can be changed at any time. A value out of range is reported with field and range, and the
last good one stays. `CloudModel`, `CloudLayers`, `CloudLighting` and `CloudTextures` together make a sky, which presets
keep in files: see [Weather](weather.md).

A path, such as `model.coverage`, names a field in text: for `CloudSettings::set`, in `headless --set model.coverage=0.2`,
and in every report of what is wrong. In text, vectors are written `x,y,z` and choices in snake_case, as here. Fields
without a path are set in code. All settings are reflected: the feature `inspector` brings a panel over them
(`CloudInspectorPlugin`), and [bevy-inspector-egui](https://github.com/jakobhellermann/bevy-inspector-egui) shows them as
well (`examples/resource_inspector.rs`).

[Högfeldt's controls](hogfeldt_controls.md) finds the controls of the Frostbite clouds among them.
";

/// A type whose fields are settings.
struct Part {
    info: &'static StructInfo,
    /// Whether it is a resource, a component, or within one.
    kind: &'static str,
    /// Path of its fields, where they have one.
    root: Option<&'static str>,
    default: Box<dyn PartialReflect>,
}

impl Part {
    fn of<T: Typed + Default + PartialReflect>(kind: &'static str, root: Option<&'static str>) -> Option<Self> {
        let TypeInfo::Struct(info) = T::type_info() else { return None };
        Some(Self { info, kind, root, default: Box::new(T::default()) })
    }
}

fn parts() -> impl Iterator<Item = Part> {
    let layer = "One of the resource `CloudLayers`, which holds up to 8, numbered from 0";
    [
        Part::of::<CloudModel>("Resource", Some("model")),
        Part::of::<CloudLayer>(layer, Some("layers.0")),
        Part::of::<WeatherRecipe>("A layer's field `map`", Some("layers.0.map")),
        Part::of::<CloudLighting>("Resource", Some("lighting")),
        Part::of::<CloudQuality>("Resource, and `CloudView::quality` for one camera", Some("quality")),
        Part::of::<CloudTextures>("Resource", Some("textures")),
        Part::of::<CloudTextureSlots>("Resource", None),
        Part::of::<CloudClock>("Resource", Some("clock")),
        Part::of::<CloudView>("Component on a camera", None),
        Part::of::<CloudZone>("Component on an entity", None),
    ]
    .into_iter()
    .flatten()
}

/// docs/settings.md.
pub fn page() -> String {
    let mut page = INTRODUCTION.to_owned();
    let mut choices: Vec<&EnumInfo> = Vec::new();
    for part in parts() {
        section(&mut page, &part);
        for field in part.info.iter() {
            if let Some(info) = choice(field)
                && choices.iter().all(|known| known.type_path() != info.type_path())
            {
                choices.push(info);
            }
        }
        if part.info.is::<CloudQuality>() {
            quality_presets(&mut page, part.info);
        }
    }
    for info in choices {
        choice_section(&mut page, info);
    }
    page
}

fn section(page: &mut String, part: &Part) {
    let name = name_of(part.info.type_path_table().ident());
    _ = write!(page, "\n## {name}\n\n{}.", part.kind);
    for paragraph in paragraphs(part.info.docs()) {
        _ = write!(page, "\n\n{paragraph}");
    }
    page.push_str("\n\n| Setting | Type | Range | Default | |\n|---|---|---|---|---|\n");
    rows(page, part.root, part.info, part.default.as_ref());
}

/// A row for each field, and for each field of the structs within.
fn rows(page: &mut String, root: Option<&str>, info: &StructInfo, values: &dyn PartialReflect) {
    let ReflectRef::Struct(values) = values.reflect_ref() else { return };
    for (index, field) in info.iter().enumerate() {
        let Some(value) = values.field_at(index) else { continue };
        let path = root.map_or_else(|| field.name().to_owned(), |root| format!("{root}.{}", field.name()));
        if let Some(inner) = group(field) {
            if !field.is::<WeatherRecipe>() {
                rows(page, Some(&path), inner, value);
            }
            continue;
        }
        let docs = paragraphs(field.docs()).join(" ").replace('|', "\\|");
        _ = writeln!(page, "| `{path}` | {} | {} | {} | {docs} |", type_of(field), range(field), text(value));
    }
}

/// What the presets of `CloudQuality` set otherwise than each other.
fn quality_presets(page: &mut String, info: &StructInfo) {
    let presets = ["low", "medium", "high", "ultra", "reference"];
    let all: Vec<_> = presets.iter().filter_map(|name| CloudQuality::named(name)).collect();
    let columns = presets.map(|name| format!("`{name}()`")).join(" | ");
    _ = write!(
        page,
        "\nIts presets differ in these (`high` is the default):\n\n| | {columns} |\n|---|---|---|---|---|---|\n"
    );
    for field in info.iter() {
        let value = |quality: &CloudQuality| match quality.reflect_ref() {
            ReflectRef::Struct(values) => values.field(field.name()).map_or_else(String::new, text),
            _ => String::new(),
        };
        let values: Vec<String> = all.iter().map(value).collect();
        if values.iter().any(|value| *value != values[0]) {
            _ = writeln!(page, "| `{}` | {} |", field.name(), values.join(" | "));
        }
    }
}

fn choice_section(page: &mut String, info: &EnumInfo) {
    _ = write!(page, "\n## {}", name_of(info.type_path_table().ident()));
    for paragraph in paragraphs(info.docs()) {
        _ = write!(page, "\n\n{paragraph}");
    }
    page.push_str("\n\n| Choice | |\n|---|---|\n");
    for variant in info.iter() {
        let docs = paragraphs(variant.docs()).join(" ").replace('|', "\\|");
        _ = writeln!(page, "| `{}` | {docs} |", snake_case(variant.name()));
    }
}

fn name_of(ident: Option<&'static str>) -> &'static str {
    ident.unwrap_or_default()
}

/// A struct of settings, not a vector. That of a layer's map has a section of its own.
fn group(field: &NamedField) -> Option<&'static StructInfo> {
    match field.type_info() {
        Some(TypeInfo::Struct(info)) if !field.is::<Vec3>() && !field.is::<DVec3>() => Some(info),
        _ => None,
    }
}

fn choice(field: &NamedField) -> Option<&'static EnumInfo> {
    match field.type_info() {
        Some(TypeInfo::Enum(info)) if !info.type_path().starts_with("core::option::Option") => Some(info),
        _ => None,
    }
}

fn type_of(field: &NamedField) -> String {
    if field.is::<f32>() || field.is::<f64>() {
        "number".to_owned()
    } else if field.is::<u32>() {
        "whole number".to_owned()
    } else if field.is::<bool>() {
        "true or false".to_owned()
    } else if field.is::<String>() {
        "text".to_owned()
    } else if field.is::<Vec3>() || field.is::<DVec3>() {
        "three numbers".to_owned()
    } else if field.is::<Option<Handle<Image>>>() {
        "image".to_owned()
    } else if field.is::<Option<CloudQuality>>() {
        "[CloudQuality](#cloudquality)".to_owned()
    } else if let Some(info) = choice(field) {
        let name = name_of(info.type_path_table().ident());
        format!("[{name}](#{})", name.to_lowercase())
    } else {
        format!("`{}`", field.type_path_table().short_path())
    }
}

fn range(field: &NamedField) -> String {
    if let Some(range) = field.get_attribute::<RangeInclusive<u32>>() {
        format!("{} to {}", range.start(), range.end())
    } else if let Some(range) = field.get_attribute::<RangeInclusive<f32>>() {
        format!("{} to {}", range.start(), range.end())
    } else {
        String::new()
    }
}

/// A value as `CloudSettings::set` takes it.
fn text(value: &dyn PartialReflect) -> String {
    if let Some(v) = value.try_downcast_ref::<f32>() {
        v.to_string()
    } else if let Some(v) = value.try_downcast_ref::<f64>() {
        v.to_string()
    } else if let Some(v) = value.try_downcast_ref::<u32>() {
        v.to_string()
    } else if let Some(v) = value.try_downcast_ref::<bool>() {
        v.to_string()
    } else if let Some(v) = value.try_downcast_ref::<String>() {
        if v.is_empty() { "empty".to_owned() } else { v.clone() }
    } else if let Some(v) = value.try_downcast_ref::<Vec3>() {
        format!("{},{},{}", v.x, v.y, v.z)
    } else if let Some(v) = value.try_downcast_ref::<DVec3>() {
        format!("{},{},{}", v.x, v.y, v.z)
    } else if let ReflectRef::Enum(v) = value.reflect_ref() {
        snake_case(v.variant_name())
    } else {
        String::new()
    }
}

/// A documentation comment as Markdown, a paragraph each: without examples, and without links, which lead into Rust.
fn paragraphs(docs: Option<&str>) -> Vec<String> {
    let mut text = String::new();
    for (k, piece) in docs.unwrap_or_default().split("```").enumerate() {
        if k % 2 == 0 {
            text.push_str(piece);
        }
    }
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let paragraphs = lines.split(|line| line.is_empty()).filter(|lines| !lines.is_empty());
    paragraphs.map(|lines| without_links(&lines.join(" "))).collect()
}

/// `` [`A::b`](super::A::b) `` and `` [`A::b`] `` as `` `A::b` ``.
fn without_links(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((name, behind)) = after.split_once("`]") else { break };
        _ = write!(plain, "{before}`{name}`");
        rest = match behind.strip_prefix('(').and_then(|target| target.split_once(')')) {
            Some((_, behind)) => behind,
            None => behind,
        };
    }
    plain + rest
}
