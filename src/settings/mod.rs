//! What a user sets. One file per resource; every field says meaning, unit, range, default and cost.

mod check;
mod debug;
mod layers;
mod lighting;
mod model;
mod paths;
mod phase;
mod preset;
mod preset_error;
mod preset_file;
mod preset_lines;
mod quality;
mod textures;
mod transition;
mod view;
mod zone;

use bevy::prelude::*;

use crate::weather::{LclFormula, Steering, StormCell, WeatherRecipe};

pub use check::{SettingsError, Validate};
pub use debug::CloudDebugView;
pub(crate) use debug::DebugShader;
pub use layers::{CloudLayer, CloudLayers, LayerKind, MAX_LAYERS, MapChannels};
pub(crate) use layers::{MAX_OWN_PHASES, OwnPhase};
pub use lighting::CloudLighting;
pub use model::{CloudModel, Erosion};
pub use paths::{CloudSettings, snake_case};
pub(crate) use phase::GoodPhases;
pub use phase::{CloudPhase, ModelPhases, PhaseFunction};
pub use preset::CloudPreset;
pub use preset_error::{PresetError, PresetPlace};
pub use preset_file::CloudPresetFile;
pub use quality::{CloudMethod, CloudQuality, Integration, MarchResolution, TemporalMode, UpscaleBlock};
pub use textures::{CloudTextureSlots, CloudTextures};
pub use transition::CloudWeather;
pub(crate) use transition::LightMix;
pub use view::{CloudClock, CloudOrder, CloudView};
pub use zone::CloudZone;

/// The last good value of each setting: what the renderer sees. A bad change is reported once and ignored.
#[derive(Resource, Clone, Debug, Default)]
pub(crate) struct GoodSettings(pub CloudSettings);

/// Where [`GoodSettings`] takes in what has changed, in `Last`.
#[derive(SystemSet, Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct KeepGood;

/// Settings resources, their types, checks and clock.
pub(crate) struct CloudSettingsPlugin;

impl Plugin for CloudSettingsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<CloudModel>()
            .init_resource::<CloudLayers>()
            .init_resource::<CloudLighting>()
            .init_resource::<CloudQuality>()
            .init_resource::<CloudTextures>()
            .init_resource::<CloudTextureSlots>()
            .init_resource::<CloudClock>()
            .init_resource::<CloudWeather>()
            .init_resource::<GoodSettings>()
            .init_resource::<ModelPhases>()
            .init_resource::<GoodPhases>()
            .register_type::<CloudModel>()
            .register_type::<CloudLayers>()
            .register_type::<CloudLighting>()
            .register_type::<CloudQuality>()
            .register_type::<CloudTextures>()
            .register_type::<CloudTextureSlots>()
            .register_type::<CloudClock>()
            .register_type::<CloudView>()
            .register_type::<CloudOrder>()
            .register_type::<CloudDebugView>()
            .register_type::<CloudPreset>()
            .register_type::<CloudPresetFile>()
            .register_type::<CloudPhase>()
            .register_type::<ModelPhases>()
            .register_type::<CloudWeather>()
            .register_type::<CloudZone>()
            .register_type::<WeatherRecipe>()
            .register_type::<StormCell>()
            .register_type::<Steering>()
            .register_type::<LclFormula>()
            .init_asset::<CloudPreset>()
            .init_asset_loader::<preset_file::CloudPresetLoader>()
            .add_systems(
                First,
                view::advance_clock
                    .after(bevy::time::TimeSystems)
                    // As Bevy's own clock is: it rotates messages, and this system has none.
                    .ambiguous_with(bevy::ecs::message::message_update_system),
            )
            .add_systems(Last, (preset_file::follow_preset_file, transition::change_weather).chain().before(KeepGood))
            .add_systems(
                Last,
                (
                    keep_good::<CloudModel>,
                    keep_good::<CloudLayers>,
                    keep_good::<CloudLighting>,
                    keep_good::<CloudQuality>,
                    keep_good::<CloudTextures>,
                    keep_good::<CloudClock>,
                    phase::keep_good_phases,
                )
                    .chain()
                    .in_set(KeepGood),
            );
    }
}

/// Settings that [`GoodSettings`] keeps a copy of.
trait Kept: Resource + Validate + Clone {
    fn slot(good: &mut CloudSettings) -> &mut Self;
}

macro_rules! kept {
    ($($type:ty => $field:ident),* $(,)?) => {
        $(impl Kept for $type {
            fn slot(good: &mut CloudSettings) -> &mut Self { &mut good.$field }
        })*
    };
}
kept!(CloudModel => model, CloudLayers => layers, CloudLighting => lighting, CloudQuality => quality,
      CloudTextures => textures, CloudClock => clock);

fn keep_good<S: Kept>(setting: Option<Res<S>>, mut good: ResMut<GoodSettings>, mut reported: Local<Option<String>>) {
    let Some(setting) = setting.filter(|s| s.is_changed()) else { return };
    match setting.validate() {
        Ok(()) => {
            S::slot(&mut good.0).clone_from(&setting);
            *reported = None;
        }
        Err(error) => {
            // The clock changes every frame: the same mistake is told once.
            let text = error.to_string();
            if reported.as_ref() != Some(&text) {
                error!("clouds: {text}; the last good value stays");
                *reported = Some(text);
            }
        }
    }
}
