//! What the panel shows, from top to bottom.

use bevy::{
    diagnostic::DiagnosticsStore,
    ecs::{component::Mutable, system::SystemParam},
    prelude::*,
    reflect::{ReflectMut, structs::Struct},
};
use bevy_egui::{
    EguiContexts,
    egui::{self, CollapsingHeader, Ui},
};

use super::{
    CloudInspector, CloudPresetChosen,
    fields::struct_ui,
    files::{PresetState, RED, SlotsState, current},
    layers::LayersState,
};
use crate::{
    CloudStatus,
    settings::{
        CloudClock, CloudDebugView, CloudLayers, CloudLighting, CloudModel, CloudQuality, CloudTextureSlots,
        CloudTextures, CloudView, SettingsError, Validate,
    },
    textures::{CloudTextureError, CloudTextureStatus},
};

/// Everything the panel reads and writes.
#[derive(SystemParam)]
pub(super) struct Shown<'w, 's> {
    views: Query<'w, 's, &'static mut CloudView>,
    lights: Query<'w, 's, (&'static DirectionalLight, &'static GlobalTransform)>,
    chosen: MessageWriter<'w, CloudPresetChosen>,
    model: Option<ResMut<'w, CloudModel>>,
    layers: Option<ResMut<'w, CloudLayers>>,
    lighting: Option<ResMut<'w, CloudLighting>>,
    quality: Option<ResMut<'w, CloudQuality>>,
    textures: Option<ResMut<'w, CloudTextures>>,
    slots: Option<ResMut<'w, CloudTextureSlots>>,
    clock: Option<ResMut<'w, CloudClock>>,
    status: Option<Res<'w, CloudStatus>>,
    baking: Option<Res<'w, CloudTextureStatus>>,
    times: Option<Res<'w, DiagnosticsStore>>,
    server: Option<Res<'w, AssetServer>>,
}

/// What the panel remembers from frame to frame.
#[derive(Default)]
pub(super) struct PanelState {
    presets: PresetState,
    slots: SlotsState,
    layers: LayersState,
    model: Section<CloudModel>,
    lighting: Section<CloudLighting>,
    quality: Section<CloudQuality>,
    textures: Section<CloudTextures>,
    clock: Section<CloudClock>,
}

/// Draws the panel.
pub(super) fn show(
    mut contexts: EguiContexts,
    mut inspector: ResMut<CloudInspector>,
    mut shown: Shown,
    mut state: Local<PanelState>,
    mut errors: MessageReader<CloudTextureError>,
) {
    errors.read().for_each(|error| state.slots.hear(error));
    // Without a camera there is no context, and nothing to draw on.
    let Ok(ctx) = contexts.ctx_mut() else { return };
    let mut open = inspector.open;
    egui::Window::new("Clouds")
        .open(&mut open)
        .default_pos(egui::pos2(ctx.content_rect().right() - 400.0, 8.0))
        .default_size([380.0, 560.0])
        .vscroll(true)
        .show(ctx, |ui| panel(ui, &mut shown, &mut state));
    if inspector.open != open {
        inspector.open = open;
    }
}

fn panel(ui: &mut Ui, shown: &mut Shown, state: &mut PanelState) {
    if let Some(reason) = shown.status.as_ref().and_then(|status| status.unsupported()) {
        ui.colored_label(RED, format!("clouds are off: {reason}"));
    }
    part(ui, "Preset", true, |ui| presets_ui(ui, shown, state));
    part(ui, "Modelling", true, |ui| {
        part(ui, "Cloud layer", true, |ui| state.model.ui(ui, shown.model.as_mut(), When::AtOnce));
        part(ui, "Weather-map layers", true, |ui| layers_ui(ui, shown, state));
        part(ui, "Baked textures", false, |ui| {
            if let Some(baking) = shown.baking.as_ref().filter(|status| status.baking) {
                ui.add(egui::ProgressBar::new(baking.progress).text("baking"));
            }
            // Each change bakes anew, so a drag is taken when it ends.
            state.textures.ui(ui, shown.textures.as_mut(), When::LetGo);
        });
        part(ui, "Your own textures", false, |ui| slots_ui(ui, shown, state));
    });
    debug_view_ui(ui, shown);
    part(ui, "Rendering", false, |ui| state.lighting.ui(ui, shown.lighting.as_mut(), When::AtOnce));
    part(ui, "Sampling", false, |ui| {
        quality_presets_ui(ui, shown.quality.as_mut());
        state.quality.ui(ui, shown.quality.as_mut(), When::AtOnce);
    });
    part(ui, "Clock", false, |ui| state.clock.ui(ui, shown.clock.as_mut(), When::AtOnce));
    part(ui, "GPU time", false, |ui| times_ui(ui, shown.times.as_deref()));
}

fn part(ui: &mut Ui, title: &str, open: bool, contents: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(title).default_open(open).show(ui, contents);
}

fn presets_ui(ui: &mut Ui, shown: &mut Shown, state: &mut PanelState) {
    let (Some(model), Some(layers), Some(lighting), Some(textures)) =
        (&mut shown.model, &mut shown.layers, &mut shown.lighting, &mut shown.textures)
    else {
        ui.label("there is no CloudsPlugin");
        return;
    };
    if let Some(preset) = state.presets.ui(ui, &current(model, layers, lighting, textures, shown.lights.iter())) {
        preset.apply_to(model, layers, lighting, textures);
        shown.chosen.write(CloudPresetChosen(preset));
    }
}

fn layers_ui(ui: &mut Ui, shown: &mut Shown, state: &mut PanelState) {
    let Some(layers) = &mut shown.layers else {
        ui.label("there is no CloudsPlugin");
        return;
    };
    if let Some(good) = state.layers.edit(ui, layers, state.presets.built_in()) {
        layers.set_if_neq(good);
    }
}

/// A choice of the stage that all cameras show; that of the first is shown as chosen.
fn debug_view_ui(ui: &mut Ui, shown: &mut Shown) {
    let Some(now) = shown.views.iter().map(|view| view.debug).next() else { return };
    if let Some(chosen) = choose_debug_view(ui, now) {
        for mut view in &mut shown.views {
            // Without a change nothing is touched: change detection stays right.
            if view.debug != chosen {
                view.debug = chosen;
            }
        }
    }
}

/// The box alone. What was chosen, if something else than `now`.
pub(super) fn choose_debug_view(ui: &mut Ui, now: CloudDebugView) -> Option<CloudDebugView> {
    let mut chosen = now;
    let words = |view: CloudDebugView| view.name().replace('_', " ");
    egui::ComboBox::from_label("stage shown alone").selected_text(words(now)).show_ui(ui, |ui| {
        for view in CloudDebugView::ALL {
            ui.selectable_value(&mut chosen, view, words(view));
        }
    });
    (chosen != now).then_some(chosen)
}

fn slots_ui(ui: &mut Ui, shown: &mut Shown, state: &mut PanelState) {
    let (Some(slots), Some(server)) = (&mut shown.slots, &shown.server) else { return };
    let mut edited = CloudTextureSlots::clone(slots);
    if state.slots.ui(ui, &mut edited, server) {
        slots.set_if_neq(edited);
    }
}

/// Names of the presets that [`CloudQuality::named`] knows.
pub(super) const QUALITIES: [&str; 4] = ["low", "medium", "high", "ultra"];

fn quality_presets_ui(ui: &mut Ui, quality: Option<&mut ResMut<CloudQuality>>) {
    let Some(quality) = quality else { return };
    ui.horizontal(|ui| {
        for name in QUALITIES {
            let Some(preset) = CloudQuality::named(name) else { continue };
            if ui.selectable_label(**quality == preset, name).clicked() {
                quality.set_if_neq(preset);
            }
        }
    });
}

/// GPU time of each pass of the clouds, and their sum (ms).
fn times_ui(ui: &mut Ui, store: Option<&DiagnosticsStore>) {
    let times = store.map(super::gpu_times).unwrap_or_default();
    if times.is_empty() {
        ui.label("none measured: the app lacks RenderDiagnosticsPlugin, or the device has no timestamps");
        return;
    }
    egui::Grid::new("cloud times").num_columns(2).striped(true).show(ui, |ui| {
        let sum = times.iter().map(|(_, ms)| ms).sum();
        for (name, ms) in times.iter().map(|(name, ms)| (name.as_str(), *ms)).chain([("all", sum)]) {
            ui.label(name);
            ui.monospace(format!("{ms:8.3} ms"));
            ui.end_row();
        }
    });
}

/// When an edit reaches the resource.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum When {
    /// In the same frame.
    AtOnce,
    /// When the mouse button is let go.
    LetGo,
}

/// The fields of one resource. Until an edit is good it lives here, and the resource keeps its last good value.
pub(super) struct Section<R> {
    draft: Option<Draft<R>>,
}

struct Draft<R> {
    /// The resource when the draft was begun: another change to it ends the draft.
    base: R,
    value: R,
    error: Option<SettingsError>,
}

impl<R> Default for Section<R> {
    fn default() -> Self {
        Self { draft: None }
    }
}

impl<R: Resource<Mutability = Mutable> + Validate + Struct + Clone + PartialEq + Default> Section<R> {
    fn ui(&mut self, ui: &mut Ui, resource: Option<&mut ResMut<R>>, when: When) {
        let Some(resource) = resource else {
            ui.label("there is no CloudsPlugin");
            return;
        };
        let held = when == When::LetGo && ui.input(|input| input.pointer.any_down());
        if let Some(good) = self.edit(ui, resource, held) {
            resource.set_if_neq(good);
        }
    }

    /// Shows the fields. Returns what the resource should become, if the user changed it to something good; while
    /// `held` that is kept back.
    pub fn edit(&mut self, ui: &mut Ui, now: &R, held: bool) -> Option<R> {
        self.edit_with(ui, now, held, |ui, value| struct_ui(ui, value.as_partial_reflect_mut()), settle)
    }
}

impl<R: Validate + Clone + PartialEq + Default> Section<R> {
    /// [`edit`](Section::edit), with what draws the fields and says whether the user changed one, and what validates.
    pub fn edit_with(
        &mut self,
        ui: &mut Ui,
        now: &R,
        held: bool,
        draw: impl FnOnce(&mut Ui, &mut R) -> bool,
        settle: fn(&mut R) -> Result<(), SettingsError>,
    ) -> Option<R> {
        self.draft.take_if(|draft| draft.base != *now);
        let mut value = self.draft.as_ref().map_or(now, |draft| &draft.value).clone();
        let mut changed = draw(ui, &mut value);
        if let Some(error) = self.draft.as_ref().and_then(|draft| draft.error.as_ref()) {
            ui.colored_label(RED, format!("{error}; the last good value stays"));
        }
        if ui.button("Reset").on_hover_text(format!("All of {} to its defaults", R::ROOT)).clicked() {
            value = R::default();
            changed = true;
        }
        if !changed && self.draft.is_none() {
            return None;
        }
        let error = settle(&mut value).err();
        if held || error.is_some() {
            self.draft = Some(Draft { base: now.clone(), value, error });
            return None;
        }
        self.draft = None;
        Some(value)
    }
}

/// Validates, after moving sizes that must be powers of two to the nearest one: a slider stops anywhere.
fn settle<R: Validate + Struct>(value: &mut R) -> Result<(), SettingsError> {
    loop {
        let error = match value.validate() {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        let SettingsError::NotPowerOfTwo { field, value: size, min, max } = &error else { return Err(error) };
        let name = field.split_once('.').map_or(&**field, |(_, name)| name);
        let ReflectMut::Struct(fields) = value.reflect_mut() else { return Err(error) };
        let Some(target) = fields.field_mut(name).and_then(|field| field.try_downcast_mut::<u32>()) else {
            return Err(error);
        };
        let nearest = nearest_power_of_two(*size).clamp(*min, *max);
        if !nearest.is_power_of_two() {
            return Err(error);
        }
        *target = nearest;
    }
}

/// The nearest on a logarithmic scale.
pub(super) fn nearest_power_of_two(size: u32) -> u32 {
    1 << f64::from(size.max(1)).log2().round().min(31.0) as u32
}

#[cfg(test)]
#[path = "panel_tests.rs"]
mod tests;
