//! An egui panel over every setting (feature `inspector`).
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_cumulus::{inspector::CloudInspectorPlugin, prelude::*};
//!
//! App::new().add_plugins((DefaultPlugins, CloudsPlugin, CloudInspectorPlugin)).run();
//! ```
//!
//! | Part | What it shows |
//! |---|---|
//! | Preset | the built-in skies; loading and saving `*.clouds.ron`; [`CloudPresetChosen`] tells the app |
//! | Modelling | [`CloudModel`](crate::CloudModel), [`CloudTextures`](crate::CloudTextures), the texture slots |
//! | | the list of [`CloudLayers`](crate::CloudLayers): add, copy, move, rename, remove, and each layer's fields by group |
//! | (a box) | [`CloudDebugView`](crate::CloudDebugView) of all cameras |
//! | Rendering | [`CloudLighting`](crate::CloudLighting) |
//! | Sampling | [`CloudQuality`](crate::CloudQuality) and its presets |
//! | Clock | [`CloudClock`](crate::CloudClock) |
//! | GPU time | each pass, if the app has `RenderDiagnosticsPlugin` |
//!
//! The fields are found by reflection, with their ranges and documentation, so a new setting needs nothing here.

mod fields;
mod files;
mod layers;
mod panel;

use bevy::{diagnostic::DiagnosticsStore, prelude::*};
use bevy_egui::{EguiPlugin, EguiPostUpdateSet, EguiPrimaryContextPass, input::EguiWantsInput};

use crate::settings::CloudPreset;

/// Shows the panel in the window of the first camera.
///
/// Add it after `CloudsPlugin`. It adds bevy_egui's `EguiPlugin` if the app has none yet; an app that adds its own
/// must do so before this plugin. A setting is written only when the user changed it and it is valid, so change
/// detection works and nothing is baked for nothing. Costs about a millisecond of CPU time a frame while open.
pub struct CloudInspectorPlugin;

impl Plugin for CloudInspectorPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<CloudInspector>()
            .init_resource::<InspectorWantsInput>()
            .add_message::<crate::textures::CloudTextureError>()
            .add_message::<CloudPresetChosen>()
            .add_systems(EguiPrimaryContextPass, panel::show)
            .add_systems(PostUpdate, publish_wants.after(EguiPostUpdateSet::ProcessOutput));
    }
}

/// Whether the panel is shown. The user closes it with its ✕; an app opens it again here.
#[derive(Resource, Reflect, Clone, Copy, PartialEq, Eq, Debug)]
#[reflect(Resource, Default, PartialEq)]
pub struct CloudInspector {
    /// Whether the panel is shown. Default true.
    pub open: bool,
}

impl Default for CloudInspector {
    fn default() -> Self {
        Self { open: true }
    }
}

/// The user chose this preset in the panel, or loaded it from a file. Its settings are in place already; the plugin
/// moves no light, so an app that wants the preset's sun moves its own to [`CloudPreset::sun_elevation`].
#[derive(Message, Clone, PartialEq, Debug)]
pub struct CloudPresetChosen(pub CloudPreset);

/// Which input egui takes for itself, as of the last frame: leave it to the panel then. Covers all of the app's egui,
/// not only this panel. Writing to it does nothing.
#[derive(Resource, Reflect, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[reflect(Resource, Default, PartialEq)]
pub struct InspectorWantsInput {
    /// The pointer is over a panel or drags one of its widgets. Default false.
    pub pointer: bool,
    /// A text box has the keyboard, or a list is open. Default false.
    pub keyboard: bool,
}

fn publish_wants(egui: Res<EguiWantsInput>, mut wants: ResMut<InspectorWantsInput>) {
    wants.set_if_neq(InspectorWantsInput {
        pointer: egui.wants_any_pointer_input(),
        keyboard: egui.wants_any_keyboard_input(),
    });
}

/// GPU time of each pass of the clouds (ms, smoothed), by the pass's name in alphabetical order. Empty where the app
/// has no `RenderDiagnosticsPlugin`, or the device no timestamps.
pub fn gpu_times(store: &DiagnosticsStore) -> Vec<(String, f64)> {
    let time = |diagnostic: &bevy::diagnostic::Diagnostic| {
        let path = diagnostic.path().as_str();
        let name = path.strip_prefix("render/")?.strip_suffix("/elapsed_gpu")?;
        let time = diagnostic.smoothed().filter(|_| name.starts_with("cloud_"))?;
        Some((name.to_owned(), time))
    };
    let mut times: Vec<_> = store.iter().filter_map(time).collect();
    times.sort_by(|a, b| a.0.cmp(&b.0));
    times
}
