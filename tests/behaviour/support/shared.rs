//! Apps that tests take turns with.
//!
//! A new app compiles every pipeline anew, which takes a software driver longer than most tests take themselves. So an app
//! that a test is done with is cleared and kept, and the next test that asks for one of the same kind gets it. Tests that
//! look at how an app starts ask for a new one.

use std::{
    collections::HashMap,
    ops::{Deref, DerefMut},
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    sync::{Condvar, LazyLock, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bevy::{app::SubApps, light::Atmosphere, prelude::*, time::TimeUpdateStrategy};
use bevy_cumulus::{CloudPhaseStatus, CloudPhaseTables, ModelPhases, prelude::*};

use super::{
    app::until_baked,
    gpu::{run_until, run_updates},
};

/// What there is of a kind.
#[derive(Default)]
struct Kind {
    /// Apps that nobody has now. `SubApps` is what of an app can go from one thread to another: all but its runner.
    idle: Vec<SubApps>,
    /// Apps that tests have.
    taken: usize,
}

static KINDS: LazyLock<Mutex<HashMap<&str, Kind>>> = LazyLock::new(Mutex::default);
static GIVEN_BACK: Condvar = Condvar::new();

fn kinds() -> MutexGuard<'static, HashMap<&'static str, Kind>> {
    KINDS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An app that goes back to the others of its kind when its test has passed. One whose test failed is not used again.
pub struct SharedApp {
    app: App,
    kind: &'static str,
    textures: CloudTextures,
    works: bool,
}

impl SharedApp {
    /// An app of this kind: one that was used before, or a new one. Two apps of one kind have the same plugins and the
    /// same model shader.
    pub fn of_kind(kind: &'static str, new: impl FnOnce() -> App) -> Self {
        Self::with_textures(kind, small_textures(), new)
    }

    /// The same, of which there is one at a time, and others wait for it: its shaders take so long to compile.
    pub fn only_one(kind: &'static str, new: impl FnOnce() -> App) -> Self {
        Self::take(kind, small_textures(), 1, new)
    }

    /// The same, where all apps of the kind have these textures.
    pub fn with_textures(kind: &'static str, textures: CloudTextures, new: impl FnOnce() -> App) -> Self {
        Self::take(kind, textures, usize::MAX, new)
    }

    fn take(kind: &'static str, textures: CloudTextures, most: usize, new: impl FnOnce() -> App) -> Self {
        let mut kinds = kinds();
        while kinds.entry(kind).or_default().taken >= most {
            kinds = GIVEN_BACK.wait(kinds).unwrap_or_else(PoisonError::into_inner);
        }
        let of_kind = kinds.entry(kind).or_default();
        of_kind.taken += 1;
        let idle = of_kind.idle.pop();
        drop(kinds);
        // Gives its place back if starting it fails.
        let mut shared = Self { app: App::empty(), kind, textures, works: false };
        match idle {
            Some(sub_apps) => *shared.app.sub_apps_mut() = sub_apps,
            None => shared.app = new(),
        }
        let textures = shared.textures.clone();
        shared.insert_resource(textures);
        until_baked(&mut shared);
        shared.works = true;
        shared
    }

    fn is_good_for_others(&self) -> bool {
        self.works && !std::thread::panicking() && !has_other_textures(self.app.world(), &self.textures)
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
        let cleared = self.is_good_for_others().then(|| {
            catch_unwind(AssertUnwindSafe(|| {
                clear(&mut self.app, &self.textures);
                std::mem::take(self.app.sub_apps_mut())
            }))
        });
        // Whatever went wrong, others must not wait for this one.
        let (idle, failure) = match cleared {
            Some(Ok(sub_apps)) => (Some(sub_apps), None),
            Some(Err(failure)) => (None, Some(failure)),
            None => (None, None),
        };
        if let Some(of_kind) = kinds().get_mut(self.kind) {
            of_kind.taken -= 1;
            of_kind.idle.extend(idle);
        }
        GIVEN_BACK.notify_all();
        if let Some(failure) = failure {
            resume_unwind(failure);
        }
    }
}

/// Settings as [`clouds_app`](super::app::clouds_app) has them: small textures, a clock that stands still.
pub fn small_settings(app: &mut App) {
    app.insert_resource(small_textures())
        .insert_resource(CloudClock { seconds: 0.0, speed: 0.0 })
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
}

/// Textures that no other test asks for: baking those that it asks for may take longer than a new app.
fn has_other_textures(world: &World, own: &CloudTextures) -> bool {
    world.resource::<CloudTextures>() != own || *world.resource::<CloudTextureSlots>() != CloudTextureSlots::default()
}

fn small_textures() -> CloudTextures {
    CloudTextures { volume_size: 32, map_size: 64, ..default() }
}

/// What stands in the world, and each setting, goes back to what it was at first.
fn clear(app: &mut App, textures: &CloudTextures) {
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
    world.insert_resource(CloudPhaseTables::default());
    world.insert_resource(CloudWeather::default());
    world.insert_resource(ClearColor::default());
    world.remove_resource::<CloudPresetFile>();
    small_settings(app);
    app.insert_resource(textures.clone());
    // What was despawned leaves the render world, and its textures are freed.
    run_updates(app, 2);
    run_until(app, "no phase function is computed", 10, |app| !app.world().resource::<CloudPhaseStatus>().computing);
}
