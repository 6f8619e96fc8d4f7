//! What comes from files: presets, and images for the texture slots.

use std::{collections::BTreeMap, path::Path};

use bevy::{
    asset::AssetPath,
    image::{ImageAddressMode, ImageLoaderSettings, ImageSampler, ImageSamplerDescriptor},
    prelude::*,
    reflect::{PartialReflect, ReflectMut, TypeInfo},
};
use bevy_egui::egui::{self, Color32, TextEdit, Ui};

use super::fields::plain_docs;
use crate::{
    settings::{CloudLayers, CloudLighting, CloudModel, CloudPreset, CloudTextureSlots, CloudTextures, Validate},
    textures::{CloudTextureError, weather_maps::asset_path},
};

/// The end of every preset file's name, which the asset loader goes by.
const EXTENSION: &str = ".clouds.ron";
pub(super) const RED: Color32 = Color32::from_rgb(255, 110, 90);

/// What the presets' part of the panel remembers.
pub(super) struct PresetState {
    /// Parsed once.
    built_in: Vec<(&'static str, CloudPreset)>,
    path: String,
    /// What came of the last load or save.
    said: Option<Result<String, String>>,
}

impl Default for PresetState {
    fn default() -> Self {
        let built_in = CloudPreset::names().filter_map(|name| Some((name, CloudPreset::named(name)?)));
        Self { built_in: built_in.collect(), path: String::new(), said: None }
    }
}

impl PresetState {
    /// The presets that come with the crate, with their names.
    pub fn built_in(&self) -> &[(&'static str, CloudPreset)] {
        &self.built_in
    }

    /// Shows the presets; `current` is what would be saved. Returns one that was chosen or loaded; it is already
    /// validated.
    pub fn ui(&mut self, ui: &mut Ui, current: &CloudPreset) -> Option<CloudPreset> {
        let mut chosen = None;
        ui.horizontal_wrapped(|ui| {
            for (name, preset) in &self.built_in {
                let here = is_same(preset, current);
                // One in use may still be chosen, for its sun.
                if ui.selectable_label(here, *name).on_hover_text(sun_advice(preset)).clicked() {
                    self.said = None;
                    chosen = Some(preset.clone());
                }
            }
        });
        ui.horizontal(|ui| {
            let hint = format!("sky{EXTENSION}");
            ui.add(TextEdit::singleline(&mut self.path).hint_text(hint).desired_width(170.0));
            let tip = "Reads this file. The app is told for which sun it was saved, and may move its light there";
            if ui.button("Load").on_hover_text(tip).clicked() {
                chosen = self.load();
            }
            let tip =
                "Writes model, layers, lighting, textures and the sun's elevation to this file; what is in it is replaced";
            if ui.button("Save").on_hover_text(tip).clicked() {
                self.save(current);
            }
        });
        match &self.said {
            Some(Ok(text)) => _ = ui.label(text),
            Some(Err(text)) => _ = ui.colored_label(RED, text),
            None => {}
        }
        chosen
    }

    fn load(&mut self) -> Option<CloudPreset> {
        match CloudPreset::read(Path::new(self.path.trim())) {
            Ok(preset) => {
                self.said = Some(Ok(format!("loaded {}", self.path.trim())));
                Some(preset)
            }
            Err(error) => {
                self.said = Some(Err(error.to_string()));
                None
            }
        }
    }

    fn save(&mut self, current: &CloudPreset) {
        let path = self.path.trim();
        self.said = Some(match write(current, path) {
            Ok(()) => Ok(format!("saved {path}")),
            Err(reason) => Err(format!("{path}: {reason}")),
        });
    }
}

/// Whether the presets make the same sky; the sun is the scene's.
fn is_same(a: &CloudPreset, b: &CloudPreset) -> bool {
    a.is_sky(&b.model, &b.layers, &b.lighting) && a.textures == b.textures
}

/// Writes a preset that can be read again.
fn write(preset: &CloudPreset, path: &str) -> Result<(), String> {
    if path.strip_suffix(EXTENSION).is_none_or(|stem| stem.is_empty() || stem.ends_with('/')) {
        return Err(format!("the name of a preset file must end in {EXTENSION}"));
    }
    preset.model.validate().map_err(|error| error.to_string())?;
    preset.layers.validate().map_err(|error| error.to_string())?;
    preset.lighting.validate().map_err(|error| error.to_string())?;
    preset.textures.validate().map_err(|error| error.to_string())?;
    let text = preset.to_ron();
    if text.is_empty() {
        return Err("the preset cannot be written as RON".to_owned());
    }
    std::fs::write(path, text).map_err(|error| error.to_string())
}

/// A preset's tooltip.
fn sun_advice(preset: &CloudPreset) -> String {
    let made_for = match preset.sun_elevation {
        Some(elevation) => format!("Made for a sun {elevation:.0}° above the horizon"),
        None => "Made for any sun".to_owned(),
    };
    format!(
        "{made_for}. Sets model, layers, lighting and textures; the light is the app's, which is told and may move it."
    )
}

/// The preset that the settings and the scene's brightest light amount to.
pub(super) fn current<'a>(
    model: &CloudModel,
    layers: &CloudLayers,
    lighting: &CloudLighting,
    textures: &CloudTextures,
    lights: impl Iterator<Item = (&'a DirectionalLight, &'a GlobalTransform)>,
) -> CloudPreset {
    let sun = lights.max_by(|(a, _), (b, _)| a.illuminance.total_cmp(&b.illuminance));
    CloudPreset {
        model: model.clone(),
        layers: layers.clone(),
        lighting: lighting.clone(),
        textures: textures.clone(),
        sun_elevation: sun.map(|(_, place)| elevation(place)),
    }
}

/// Of a sun with this transform (degrees). Rounded, so that one that was saved, loaded and saved again stays the same.
fn elevation(sun: &GlobalTransform) -> f32 {
    let towards = sun.back();
    (towards.y.atan2(towards.xz().length()).to_degrees() * 100.0).round() / 100.0
}

/// What the texture slots' part of the panel remembers, by the slot's name.
#[derive(Default)]
pub(super) struct SlotsState {
    paths: BTreeMap<&'static str, String>,
    errors: BTreeMap<String, String>,
}

impl SlotsState {
    /// Keeps the last error of each slot.
    pub fn hear(&mut self, error: &CloudTextureError) {
        self.errors.insert(error.slot.to_string(), error.to_string());
    }

    /// Shows a row for each slot, edits `slots`, and returns whether it did.
    pub fn ui(&mut self, ui: &mut Ui, slots: &mut CloudTextureSlots, server: &AssetServer) -> bool {
        let Some(TypeInfo::Struct(info)) = slots.get_represented_type_info() else { return false };
        let ReflectMut::Struct(fields) = slots.reflect_mut() else { return false };
        let mut changed = false;
        for index in 0..info.field_len() {
            let (Some(declared), Some(field)) = (info.field_at(index), fields.field_at_mut(index)) else { continue };
            let Some(slot) = field.try_downcast_mut::<Option<Handle<Image>>>() else { continue };
            let shown = slot.as_ref().map(|handle| shown(handle, server));
            ui.horizontal(|ui| {
                ui.label(declared.name().replace('_', " ")).on_hover_text(plain_docs(declared.docs()));
                ui.weak(shown.as_deref().unwrap_or("baked"));
            });
            ui.horizontal(|ui| changed |= self.slot_ui(ui, declared.name(), slot, server));
            if let Some(error) = self.errors.get(declared.name()) {
                ui.colored_label(RED, error);
            }
        }
        changed
    }

    fn slot_ui(
        &mut self,
        ui: &mut Ui,
        name: &'static str,
        slot: &mut Option<Handle<Image>>,
        server: &AssetServer,
    ) -> bool {
        let path = self.paths.entry(name).or_default();
        let edit = TextEdit::singleline(path).hint_text("path below assets/").desired_width(170.0);
        ui.add(edit.id(egui::Id::new(("cloud slot", name))));
        let load = ui.button("Load").on_hover_text("Loads this image as linear, repeating data").clicked();
        let clear = ui.add_enabled(slot.is_some(), egui::Button::new("Clear"));
        if load {
            match asset_path(path) {
                Ok(path) => {
                    self.errors.remove(name);
                    *slot = Some(load_image(server, path));
                    return true;
                }
                Err(reason) => _ = self.errors.insert(name.to_owned(), format!("textures.{name}: {reason}")),
            }
        } else if clear.on_hover_text("Back to the baked texture").clicked() {
            self.errors.remove(name);
            *slot = None;
            return true;
        }
        false
    }
}

fn shown(handle: &Handle<Image>, server: &AssetServer) -> String {
    server.get_path(handle.id()).map_or_else(|| "an image made in code".to_owned(), |path| path.to_string())
}

/// Loads an image the way the slots want it: linear, and repeating.
fn load_image(server: &AssetServer, path: AssetPath<'static>) -> Handle<Image> {
    let load = server.load_builder().with_settings(|settings: &mut ImageLoaderSettings| {
        settings.is_srgb = false;
        settings.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
            address_mode_u: ImageAddressMode::Repeat,
            address_mode_v: ImageAddressMode::Repeat,
            address_mode_w: ImageAddressMode::Repeat,
            ..ImageSamplerDescriptor::linear()
        });
    });
    load.load(path)
}

#[cfg(test)]
#[path = "files_tests.rs"]
mod tests;
