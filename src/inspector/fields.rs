//! One widget for each field of a reflected struct, chosen by the field's type and the range that stands on it.

use std::ops::RangeInclusive;

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{
        NamedField, PartialReflect, ReflectMut, ReflectRef, TypeInfo,
        enums::{DynamicEnum, DynamicVariant, EnumInfo},
    },
};
use bevy_egui::egui::{self, DragValue, Slider, SliderClamping, TextEdit, Ui};

use crate::settings::snake_case;

/// Whole numbers that may be larger than this get a number box: a slider could not hit one of them.
const MOST_SLIDER_STEPS: u32 = 100_000;
/// A positive range whose ends are farther apart than this factor gets a logarithmic slider.
const LOGARITHMIC_FROM: f32 = 1000.0;
/// Smallest value of a logarithmic slider that runs through 0.
const LEAST_OF_SIGNED: f64 = 0.01;

/// A row for each field: name, widget, and the field's documentation as tooltip. True where the user changed one.
pub(super) fn struct_ui(ui: &mut Ui, value: &mut dyn PartialReflect) -> bool {
    some_fields_ui(ui, value, |_| true)
}

/// [`struct_ui`] of the fields with these names.
pub(super) fn some_fields_ui(ui: &mut Ui, value: &mut dyn PartialReflect, shown: impl Fn(&str) -> bool) -> bool {
    let Some(TypeInfo::Struct(info)) = value.get_represented_type_info() else {
        ui.label("not a struct");
        return false;
    };
    let ReflectMut::Struct(fields) = value.reflect_mut() else { return false };
    let mut changed = false;
    egui::Grid::new(info.type_path()).num_columns(2).striped(true).show(ui, |ui| {
        for index in 0..info.field_len() {
            let (Some(declared), Some(field)) = (info.field_at(index), fields.field_at_mut(index)) else { continue };
            if !shown(declared.name()) {
                continue;
            }
            let docs = plain_docs(declared.docs());
            ui.label(words(declared.name())).on_hover_text(&docs);
            // Scoped, so that the tooltip also shows over the widget's empty parts.
            let row = ui.scope(|ui| field_ui(ui, declared, field));
            row.response.on_hover_text(docs);
            changed |= row.inner;
            ui.end_row();
        }
    });
    changed
}

/// A field's name as it is shown.
pub(super) fn words(name: &str) -> String {
    name.replace('_', " ")
}

/// The widget of one field. True where the user changed it.
fn field_ui(ui: &mut Ui, declared: &NamedField, field: &mut dyn PartialReflect) -> bool {
    let range = declared.get_attribute::<RangeInclusive<f32>>();
    if let Some(v) = field.try_downcast_mut::<f32>() {
        number_ui(ui, v, range)
    } else if let Some(v) = field.try_downcast_mut::<u32>() {
        whole_ui(ui, v, declared.get_attribute::<RangeInclusive<u32>>())
    } else if let Some(v) = field.try_downcast_mut::<bool>() {
        ui.checkbox(v, "").changed()
    } else if let Some(v) = field.try_downcast_mut::<f64>() {
        drag_ui(ui, "", v, range)
    } else if let Some(v) = field.try_downcast_mut::<Vec3>() {
        parts_ui(ui, [("x ", &mut v.x), ("y ", &mut v.y), ("z ", &mut v.z)], range)
    } else if let Some(v) = field.try_downcast_mut::<DVec3>() {
        parts_ui(ui, [("x ", &mut v.x), ("y ", &mut v.y), ("z ", &mut v.z)], range)
    } else if let Some(v) = field.try_downcast_mut::<String>() {
        text_ui(ui, declared.name(), v)
    } else if let Some(v) = field.try_downcast_mut::<Option<Handle<Image>>>() {
        let there = v.is_some();
        ui.weak(if there { "an image" } else { "none; set in code" });
        there && ui.button("Clear").clicked() && v.take().is_some()
    } else if let Some(TypeInfo::Enum(info)) = field.get_represented_type_info() {
        enum_ui(ui, declared.name(), info, field)
    } else if matches!(field.reflect_ref(), ReflectRef::Struct(_)) {
        ui.collapsing(words(declared.name()), |ui| struct_ui(ui, field)).body_returned.unwrap_or_default()
    } else {
        ui.weak("set in code");
        false
    }
}

/// Whether a slider over this range is logarithmic: a wide positive range, or a wide one through 0.
fn is_logarithmic(range: &RangeInclusive<f32>) -> bool {
    let (start, end) = (*range.start(), *range.end());
    start > 0.0 && end / start > LOGARITHMIC_FROM || start <= -LOGARITHMIC_FROM && end >= LOGARITHMIC_FROM
}

fn number_ui(ui: &mut Ui, value: &mut f32, range: Option<&RangeInclusive<f32>>) -> bool {
    let Some(range) = range else { return drag_ui(ui, "", value, None) };
    let mut edited = *value;
    let slider = Slider::new(&mut edited, range.clone())
        .logarithmic(is_logarithmic(range))
        .smallest_positive(LEAST_OF_SIGNED)
        .clamping(SliderClamping::Edits)
        .update_while_editing(false);
    let changed = ui.add(slider).changed() && edited != *value;
    if changed {
        *value = edited;
    }
    changed
}

fn whole_ui(ui: &mut Ui, value: &mut u32, range: Option<&RangeInclusive<u32>>) -> bool {
    let range = range.cloned().unwrap_or(0..=u32::MAX);
    let mut edited = *value;
    let response = if range.end() - range.start() > MOST_SLIDER_STEPS {
        let drag = DragValue::new(&mut edited).range(range).speed(0.1);
        ui.add(drag.clamp_existing_to_range(false).update_while_editing(false))
    } else {
        ui.add(Slider::new(&mut edited, range).clamping(SliderClamping::Edits).update_while_editing(false))
    };
    let changed = response.changed() && edited != *value;
    if changed {
        *value = edited;
    }
    changed
}

/// A number box that is dragged or typed in.
fn drag_ui<N: egui::emath::Numeric>(
    ui: &mut Ui,
    prefix: &str,
    value: &mut N,
    range: Option<&RangeInclusive<f32>>,
) -> bool {
    let mut edited = *value;
    let (min, max) = range.map_or((f64::MIN, f64::MAX), |r| (f64::from(*r.start()), f64::from(*r.end())));
    let drag = DragValue::new(&mut edited)
        .range(min..=max)
        .clamp_existing_to_range(false)
        // A drag over the window's width crosses a small range; a large one is for typing.
        .speed(((max - min) / 1000.0).clamp(0.001, 1.0))
        .max_decimals(5)
        .prefix(prefix)
        .update_while_editing(false);
    let changed = ui.add(drag).changed() && edited != *value;
    if changed {
        *value = edited;
    }
    changed
}

fn parts_ui<N: egui::emath::Numeric>(
    ui: &mut Ui,
    parts: [(&str, &mut N); 3],
    range: Option<&RangeInclusive<f32>>,
) -> bool {
    ui.horizontal(|ui| parts.into_iter().fold(false, |changed, (name, v)| drag_ui(ui, name, v, range) | changed)).inner
}

/// A line of text, which counts once it is left or entered: half a path is none.
fn text_ui(ui: &mut Ui, name: &str, value: &mut String) -> bool {
    let id = ui.make_persistent_id(("text", name));
    let mut edited = ui.data(|data| data.get_temp(id)).unwrap_or_else(|| value.clone());
    let response = ui.add(TextEdit::singleline(&mut edited).id(id).desired_width(170.0));
    if response.has_focus() {
        ui.data_mut(|data| data.insert_temp(id, edited));
        return false;
    }
    ui.data_mut(|data| data.remove_temp::<String>(id));
    let changed = response.lost_focus() && edited != *value;
    if changed {
        *value = edited;
    }
    changed
}

/// A choice among the variants of an enum that carry nothing.
fn enum_ui(ui: &mut Ui, name: &str, info: &EnumInfo, field: &mut dyn PartialReflect) -> bool {
    let ReflectRef::Enum(current) = field.reflect_ref() else { return false };
    let current = current.variant_name().to_owned();
    let shown = |variant: &str| snake_case(variant).replace('_', " ");
    let mut chosen = None;
    egui::ComboBox::from_id_salt(name).selected_text(shown(&current)).show_ui(ui, |ui| {
        for variant in info.iter().filter(|variant| variant.as_unit_variant().is_ok()) {
            let here = variant.name() == current;
            let item = ui.selectable_label(here, shown(variant.name())).on_hover_text(plain_docs(variant.docs()));
            if item.clicked() && !here {
                chosen = Some(variant.name());
            }
        }
    });
    let Some(chosen) = chosen else { return false };
    field.try_apply(&DynamicEnum::new(chosen, DynamicVariant::Unit)).is_ok()
}

/// A documentation comment as plain text: without links, code marks and its line breaks.
pub(super) fn plain_docs(docs: Option<&str>) -> String {
    let text = docs.unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
    let mut plain = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((name, behind)) = after.split_once("`]") else { break };
        plain.push_str(before);
        plain.push_str(name);
        // The target of a link, if it has one of its own.
        rest = match behind.strip_prefix('(').and_then(|target| target.split_once(')')) {
            Some((_, behind)) => behind,
            None => behind,
        };
    }
    plain.push_str(rest);
    plain.replace('`', "")
}

#[cfg(test)]
#[path = "fields_tests.rs"]
pub(super) mod tests;
