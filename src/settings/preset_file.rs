//! Presets as assets: the loader, and the file that the settings follow.

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
};

use super::{CloudModel, CloudPreset, PresetError};
use crate::textures::weather_maps::asset_path;

/// A preset that the settings follow: it is [applied](CloudPreset::apply) when it has loaded, and again whenever it changes.
///
/// ```no_run
/// # use bevy::prelude::*;
/// use bevy_cumulus::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.insert_resource(CloudPresetFile(assets.load("sky.clouds.ron")));
/// }
/// ```
///
/// It changes when its file does (with Bevy's feature `file_watcher`, or by [`AssetServer::reload`]), when it is replaced in
/// `Assets<CloudPreset>`, and when another handle is put here. Between changes the settings are yours; a file that has been
/// read again and says the same changes nothing. [`CloudModel::world_offset`] stays what it is.
///
/// A file that is bad is reported by Bevy, in the log and as
/// [`AssetLoadFailedEvent<CloudPreset>`](bevy::asset::AssetLoadFailedEvent), with its line and field ([`PresetError`]); the
/// last good sky stays. Not there by default; remove it to stop.
#[derive(Resource, Reflect, Clone, PartialEq, Debug, Default)]
#[reflect(Resource, Default, PartialEq)]
pub struct CloudPresetFile(pub Handle<CloudPreset>);

/// Applies the preset that is followed.
pub(super) fn follow_preset_file(
    file: Option<Res<CloudPresetFile>>,
    presets: Res<Assets<CloudPreset>>,
    mut changes: MessageReader<AssetEvent<CloudPreset>>,
    model: Option<Res<CloudModel>>,
    mut commands: Commands,
    mut is_due: Local<bool>,
    mut seen: Local<Option<CloudPreset>>,
) {
    let Some(file) = file else {
        changes.clear();
        (*is_due, *seen) = (false, None);
        return;
    };
    let id = file.0.id();
    if file.is_changed() {
        (*is_due, *seen) = (true, None);
    }
    *is_due |= changes.read().any(|change| change.is_modified(id) || change.is_added(id));
    let Some(preset) = presets.get(id).filter(|_| *is_due) else { return };
    *is_due = false;
    if seen.as_ref() == Some(preset) {
        return;
    }
    *seen = Some(preset.clone());
    if let Err(error) = preset.validate() {
        error!("clouds: preset: {error}; the last good sky stays");
        return;
    }
    let mut preset = preset.clone();
    if let Some(model) = model {
        // A floating origin's, and none of the preset's.
        preset.model.world_offset = model.world_offset;
    }
    commands.queue(move |world: &mut World| preset.apply(world));
}

/// Loads `*.clouds.ron` files as [`CloudPreset`] assets.
#[derive(Default, TypePath)]
pub(super) struct CloudPresetLoader;

impl AssetLoader for CloudPresetLoader {
    type Asset = CloudPreset;
    type Settings = ();
    type Error = PresetError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<CloudPreset, PresetError> {
        let file = context.path().to_string();
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|source| PresetError::Io { file: file.clone(), source })?;
        let text = String::from_utf8_lossy(&bytes);
        let preset = CloudPreset::parse(&text, &file)?;
        for (layer, map) in preset.map_files() {
            // Once more than needed, since nothing else says whether it is there.
            let read = match asset_path(map) {
                Ok(map) => context.read_asset_bytes(map).await.map_err(|error| error.to_string()),
                Err(reason) => Err(reason),
            };
            read.map_err(|reason| PresetError::map(&text, &file, layer, map, reason))?;
        }
        Ok(preset)
    }

    fn extensions(&self) -> &[&str] {
        &["clouds.ron"]
    }
}
