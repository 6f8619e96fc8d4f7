//! The list of weather-map layers, and the fields of each by group.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_egui::egui::{self, CollapsingHeader, ColorImage, Image as Picture, TextureHandle, TextureOptions, Ui};

use super::{
    fields::{some_fields_ui, struct_ui},
    panel::{Section, nearest_power_of_two},
};
use crate::{
    settings::{CloudLayer, CloudLayers, CloudPreset, LayerKind, MAX_LAYERS, SettingsError, Validate},
    weather::WeatherRecipe,
};

/// Groups of a layer's fields. What stands in none of them is shown before them.
const GROUPS: [(&str, &[&str]); 7] = [
    ("Coverage", &["coverage", "sharpness", "far_coverage", "far_start", "far_end"]),
    (
        "Altitude and profile",
        &["base", "base_rise", "thickness", "peak_height", "profile_strength", "base_to_top", "anvil"],
    ),
    ("Shape", &["shape_gain", "shape_strength", "shape_scale", "stretch", "stretch_angle"]),
    (
        "Detail and turbulence",
        &[
            "detail_strength",
            "edge_threshold",
            "detail_scale",
            "wispiness",
            "turbulence",
            "turbulence_height",
            "turbulence_scale",
        ],
    ),
    ("Light", &["density", "extinction", "albedo", "own_phase", "phase", "phase_file"]),
    ("Rain", &["rain", "rain_extinction", "rain_depth", "rain_slant"]),
    ("Wind", &["wind", "wind_skew", "evolution", "renewal", "drift", "renewal_drift"]),
];

/// What the map is, which has a group of its own.
const MAP: [&str; 4] = ["map", "map_file", "map_image", "map_channels"];
/// Largest side of a map's small picture (texels): what can be made within a frame.
const PREVIEW: u32 = 128;

/// Small pictures of maps, by the layers' places, and what they are made from.
type Previews = BTreeMap<usize, (WeatherRecipe, TextureHandle)>;

/// What the layers' part of the panel remembers.
#[derive(Default)]
pub(super) struct LayersState {
    section: Section<CloudLayers>,
    previews: Previews,
}

/// What a button of a layer asks for.
#[derive(Clone, Copy, PartialEq)]
enum Asked {
    Up,
    Down,
    Copy,
    Remove,
}

impl LayersState {
    /// Shows the layers. Returns what they should become, if the user changed them to something good. The presets' layers
    /// can be added, too.
    pub fn edit(&mut self, ui: &mut Ui, now: &CloudLayers, presets: &[(&str, CloudPreset)]) -> Option<CloudLayers> {
        let Self { section, previews } = self;
        let draw = |ui: &mut Ui, layers: &mut CloudLayers| {
            let mut changed = add_ui(ui, &mut layers.0, presets);
            let mut asked = None;
            for (i, layer) in layers.0.iter_mut().enumerate() {
                ui.push_id(i, |ui| {
                    changed |= buttons_ui(ui, i, layer, &mut asked);
                    let title = format!("{:.0} to {:.0} m", layer.bottom(), layer.top());
                    CollapsingHeader::new(title)
                        .id_salt("layer")
                        .show(ui, |ui| changed |= layer_ui(ui, i, layer, previews));
                });
            }
            changed | asked.is_some_and(|(i, asked)| obey(&mut layers.0, i, asked))
        };
        section.edit_with(ui, now, false, draw, settle)
    }
}

/// A box with what can be added.
fn add_ui(ui: &mut Ui, layers: &mut Vec<CloudLayer>, presets: &[(&str, CloudPreset)]) -> bool {
    let mut added = None;
    let full = layers.len() >= MAX_LAYERS;
    ui.add_enabled_ui(!full, |ui| {
        egui::ComboBox::from_id_salt("add a layer").selected_text("Add a layer").show_ui(ui, |ui| {
            for (name, layer) in kinds() {
                if ui.selectable_label(false, name).clicked() {
                    added = Some(layer);
                }
            }
            for (preset, layer) in
                presets.iter().flat_map(|(name, preset)| preset.layers.0.iter().map(move |l| (name, l)))
            {
                if ui.selectable_label(false, format!("{preset}: {}", layer.name)).clicked() {
                    added = Some(layer.clone());
                }
            }
        });
    });
    if full {
        ui.weak(format!("{MAX_LAYERS} layers are the most"));
    }
    let Some(layer) = added else { return false };
    layers.push(layer);
    true
}

/// Layers to begin with.
fn kinds() -> [(&'static str, CloudLayer); 2] {
    let cloud = CloudLayer { name: "clouds".to_owned(), ..default() };
    let sheet = CloudLayer {
        name: "thin cloud".to_owned(),
        kind: LayerKind::Sheet,
        base: 8000.0,
        thickness: 700.0,
        stretch: 6.0,
        extinction: 0.0008,
        shape_scale: 12_000.0,
        wispiness: 0.2,
        wind: Vec3::new(25.0, 0.0, 8.0),
        ..default()
    };
    [("Volume: cloud with a body", cloud), ("Sheet: thin high cloud", sheet)]
}

/// The line of a layer: whether it is shown, its name, and what can be done with it.
fn buttons_ui(ui: &mut Ui, i: usize, layer: &mut CloudLayer, asked: &mut Option<(usize, Asked)>) -> bool {
    let mut changed = false;
    ui.horizontal(|ui| {
        changed |= ui.checkbox(&mut layer.enabled, "").on_hover_text("Whether it is shown").changed();
        ui.strong(if layer.name.is_empty() { format!("Layer {i}") } else { layer.name.clone() });
        for (text, ask, tip) in [
            ("Up", Asked::Up, "One place up in the list; the order changes nothing in the picture"),
            ("Down", Asked::Down, "One place down"),
            ("Copy", Asked::Copy, "Another one like it, behind it"),
            ("Remove", Asked::Remove, "Away with it"),
        ] {
            if ui.small_button(text).on_hover_text(tip).clicked() {
                *asked = Some((i, ask));
            }
        }
    });
    changed
}

/// Does what was asked of layer `i`; whether that changes anything.
fn obey(layers: &mut Vec<CloudLayer>, i: usize, asked: Asked) -> bool {
    match asked {
        Asked::Up if i > 0 => layers.swap(i - 1, i),
        Asked::Down if i + 1 < layers.len() => layers.swap(i, i + 1),
        Asked::Copy if layers.len() < MAX_LAYERS => layers.insert(i + 1, layers[i].clone()),
        Asked::Remove => _ = layers.remove(i),
        _ => return false,
    }
    true
}

/// The fields of a layer.
fn layer_ui(ui: &mut Ui, i: usize, layer: &mut CloudLayer, previews: &mut Previews) -> bool {
    let grouped = |name: &str| GROUPS.iter().any(|(_, names)| names.contains(&name));
    // Whether it is shown stands above.
    let rest = |name: &str| name != "enabled" && !MAP.contains(&name) && !grouped(name);
    let mut changed = some_fields_ui(ui, layer, rest);
    ui.collapsing("Map", |ui| {
        changed |= some_fields_ui(ui, layer, |name| MAP[1..].contains(&name));
        if layer.map_file.is_empty() && layer.map_image.is_none() {
            preview_ui(ui, i, &layer.map, previews);
            changed |= struct_ui(ui, &mut layer.map);
        }
    });
    for (title, names) in GROUPS {
        ui.collapsing(title, |ui| changed |= some_fields_ui(ui, layer, |name| names.contains(&name)));
    }
    changed
}

/// A small picture of the coverage, made anew when the recipe changes.
fn preview_ui(ui: &mut Ui, i: usize, recipe: &WeatherRecipe, previews: &mut Previews) {
    if previews.get(&i).is_none_or(|(made, _)| made != recipe) {
        // One that cannot be made is explained below the fields.
        let small = WeatherRecipe { size: recipe.size.min(PREVIEW), ..recipe.clone() };
        let Ok(map) = small.generate() else { return };
        let greys: Vec<u8> = map.texels().iter().map(|texel| texel[0]).collect();
        let size = [map.size().x as usize, map.size().y as usize];
        let picture = ColorImage::from_gray(size, &greys);
        let texture = ui.ctx().load_texture(format!("cloud layer {i}"), picture, TextureOptions::LINEAR);
        previews.insert(i, (recipe.clone(), texture));
    }
    if let Some((_, texture)) = previews.get(&i) {
        let side = PREVIEW as f32;
        let tip = format!("Coverage over one repeat of {:.0} m, coarser than it is", recipe.scale);
        ui.add(Picture::new(texture).fit_to_exact_size(egui::vec2(side, side))).on_hover_text(tip);
    }
}

/// Validates, after moving the maps' sizes to powers of two: a slider stops anywhere.
fn settle(layers: &mut CloudLayers) -> Result<(), SettingsError> {
    for layer in &mut layers.0 {
        layer.map.size = nearest_power_of_two(layer.map.size);
    }
    layers.validate()
}

#[cfg(test)]
#[path = "layers_tests.rs"]
mod tests;
