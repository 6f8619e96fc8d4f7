//! The preset's file: edited while its sky is shown, it is read again.

use std::{
    path::{Path, PathBuf},
    time::SystemTime,
};

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use crate::{Flight, start::read_preset};

/// How often it is looked at (s).
const EVERY: f32 = 0.3;

/// The file, and when it was last written.
///
/// With Bevy's feature `file_watcher` the asset server would tell of changes; this example builds without, and takes files
/// from outside the assets folder.
#[derive(Resource)]
pub struct PresetWatch {
    path: PathBuf,
    seen: Option<(SystemTime, u64)>,
    /// It has changed: it is read once it has stopped changing.
    is_changing: bool,
    timer: Timer,
}

impl PresetWatch {
    pub fn new(path: &Path) -> Self {
        let timer = Timer::from_seconds(EVERY, TimerMode::Repeating);
        Self { path: path.to_owned(), seen: stamp(path), is_changing: false, timer }
    }

    /// Whether it has changed, and is whole.
    fn is_due(&mut self) -> bool {
        let now = stamp(&self.path);
        if now.is_some() && now != self.seen {
            self.seen = now;
            self.is_changing = true;
            return false;
        }
        std::mem::take(&mut self.is_changing)
    }
}

/// When a file was written, and its length.
fn stamp(path: &Path) -> Option<(SystemTime, u64)> {
    let about = std::fs::metadata(path).ok()?;
    Some((about.modified().ok()?, about.len()))
}

/// Follows the file. It says all that the sky is: what keys, panel and `--set` have changed goes.
pub fn follow(
    watch: Option<ResMut<PresetWatch>>,
    time: Res<Time<Real>>,
    mut presets: ResMut<Assets<CloudPreset>>,
    mut flight: ResMut<Flight>,
    mut commands: Commands,
) {
    let Some(mut watch) = watch else { return };
    if !watch.timer.tick(time.delta()).just_finished() || !watch.is_due() {
        return;
    }
    match read_preset(&watch.path) {
        Ok(preset) => {
            if let Some(elevation) = preset.sun_elevation {
                flight.sun.elevation = elevation;
            }
            info!("{} is read again", watch.path.display());
            commands.insert_resource(CloudPresetFile(presets.add(preset)));
        }
        Err(error) => error!("{error:#}; the last good sky stays"),
    }
}
