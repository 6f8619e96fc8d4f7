//! Apps that tests take turns with.
//!
//! A new app compiles every pipeline anew, which takes a software driver longer than most tests take themselves. So an app
//! that a test is done with is cleared and kept, and the next test that asks for one of the same kind gets it. Tests that
//! look at how an app starts ask for a new one.

use std::{
    collections::HashMap,
    ops::{Deref, DerefMut},
    sync::{LazyLock, Mutex, PoisonError},
    time::Duration,
};

use bevy::{app::SubApps, light::Atmosphere, prelude::*, time::TimeUpdateStrategy};
use bevy_cumulus::{CloudPhaseTables, ModelPhases, prelude::*};

use super::gpu::run_updates;

/// Apps that nobody has now, by kind. `SubApps` is what of an app can go from one thread to another: all but its runner.
static IDLE: LazyLock<Mutex<HashMap<&str, Vec<SubApps>>>> = LazyLock::new(Mutex::default);

/// An app that goes back to the others of its kind when its test has passed. One whose test failed is not used again.
pub struct SharedApp {
    app: App,
    kind: &'static str,
}

impl SharedApp {
    /// An app of this kind: one that was used before, or a new one. Two apps of one kind have the same plugins and the
    /// same model shader.
    pub fn of_kind(kind: &'static str, new: impl FnOnce() -> App) -> Self {
        let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).get_mut(kind).and_then(Vec::pop);
        let app = match idle {
            Some(sub_apps) => {
                let mut app = App::empty();
                *app.sub_apps_mut() = sub_apps;
                app
            }
            None => new(),
        };
        Self { app, kind }
    }
}

impl Deref for SharedApp {
    type Target = App;
    fn deref(&self) -> &App {
        &self.app
    }
}

impl DerefMut for SharedApp {
    fn deref_mut(&mut self) -> &mut App {
        &mut self.app
    }
}

impl Drop for SharedApp {
    fn drop(&mut self) {
        if std::thread::panicking() || has_other_textures(self.app.world()) {
            return;
        }
        clear(&mut self.app);
        let sub_apps = std::mem::take(self.app.sub_apps_mut());
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.entry(self.kind).or_default().push(sub_apps);
    }
}

/// Settings as [`clouds_app`](super::app::clouds_app) has them: small textures, a clock that stands still.
pub fn small_settings(app: &mut App) {
    app.insert_resource(small_textures())
        .insert_resource(CloudClock { seconds: 0.0, speed: 0.0 })
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
}

/// Textures that no other test asks for: baking those that it asks for may take longer than a new app.
fn has_other_textures(world: &World) -> bool {
    *world.resource::<CloudTextures>() != small_textures()
        || *world.resource::<CloudTextureSlots>() != CloudTextureSlots::default()
        || *world.resource::<CloudPhaseTables>() != CloudPhaseTables::default()
}

fn small_textures() -> CloudTextures {
    CloudTextures { volume_size: 32, map_size: 64, ..default() }
}

/// What stands in the world, and each setting, goes back to what it was at first.
fn clear(app: &mut App) {
    let world = app.world_mut();
    type Placed = Or<(With<Transform>, With<Atmosphere>, With<CloudZone>, With<Camera>)>;
    let placed: Vec<Entity> = world.query_filtered::<Entity, Placed>().iter(world).collect();
    for entity in placed {
        // Children go with their parents.
        let _ = world.try_despawn(entity);
    }
    world.insert_resource(CloudModel::default());
    world.insert_resource(CloudLayers::default());
    world.insert_resource(CloudLighting::default());
    world.insert_resource(CloudQuality::default());
    world.insert_resource(ModelPhases::default());
    world.insert_resource(CloudWeather::default());
    world.insert_resource(ClearColor::default());
    world.remove_resource::<CloudPresetFile>();
    small_settings(app);
    // What was despawned leaves the render world, and its textures are freed.
    run_updates(app, 2);
}
