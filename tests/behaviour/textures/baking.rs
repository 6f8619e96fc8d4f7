//! Baked textures and a user's images in their place, on the real GPU path.

mod content;
mod slots;

use bevy::prelude::*;
use bevy_cumulus::testing::textures::{self as captured, Captured};
use bevy_cumulus::{
    CloudsPlugin,
    settings::CloudTextures,
    textures::{CloudTextureSlot, CloudTextureStatus},
};

use crate::support::gpu;

/// Frames within which a small bake is done.
const LIMIT: u32 = 400;

const SMALL: CloudTextures = CloudTextures {
    seed: 1,
    volume_size: 32,
    map_size: 128,
    billow_cells: 4,
    wisp_cells: 4,
    coverage_cells: 7,
    type_cells: 6,
    shape_cells: 4,
    detail_cells: 4,
};

fn app(settings: CloudTextures) -> App {
    let mut app = gpu::app_with(CloudsPlugin);
    app.insert_resource(settings);
    app
}

fn baked(settings: CloudTextures) -> App {
    let mut app = app(settings);
    bake(&mut app);
    app
}

/// Runs until everything asked for is shown.
fn bake(app: &mut App) {
    // What was changed just now counts from the next frame on.
    gpu::run_updates(app, 2);
    gpu::run_until(app, "the bake", LIMIT, |app| !app.world().resource::<CloudTextureStatus>().baking);
    assert!(captured::generation(app).1, "baking is over, but a texture is missing");
}

fn read(app: &App, slot: CloudTextureSlot, level: u32) -> Captured {
    captured::read(app, slot, level).unwrap()
}

fn channel(captured: &Captured, channel: usize) -> Vec<f32> {
    captured.texels.iter().map(|texel| texel[channel]).collect()
}

#[test]
fn a_seed_gives_the_same_sky_again_and_another_seed_another() {
    let slots =
        [CloudTextureSlot::Billow, CloudTextureSlot::Wisp, CloudTextureSlot::Coverage, CloudTextureSlot::TypeMap];
    let mut app = baked(SMALL);
    let first = slots.map(|slot| read(&app, slot, 0));
    let again = baked(SMALL);
    for (slot, first) in slots.iter().zip(&first) {
        assert!(*first == read(&again, *slot, 0), "{slot} differs between two bakes of one seed");
    }
    app.world_mut().resource_mut::<CloudTextures>().seed = 2;
    bake(&mut app);
    for (slot, first) in slots.iter().zip(&first) {
        let other = read(&app, *slot, 0);
        let differing = first.texels.iter().zip(&other.texels).filter(|(a, b)| a[0] != b[0]).count();
        // Much of the coverage map is 0 with any seed.
        assert!(differing * 3 > first.texels.len(), "{slot}: another seed changes {differing} texels only");
    }
}

#[test]
fn a_changed_parameter_bakes_only_what_it_concerns() {
    let mut app = baked(SMALL);
    let before = read(&app, CloudTextureSlot::Wisp, 0);
    let (generation, _) = captured::generation(&app);
    app.world_mut().resource_mut::<CloudTextures>().billow_cells = 8;
    bake(&mut app);
    assert_eq!(captured::generation(&app).0, generation + 1);
    assert!(before == read(&app, CloudTextureSlot::Wisp, 0));
}

#[test]
fn a_bake_that_is_superseded_starts_again() {
    let mut app = app(SMALL);
    let progress = |app: &App| app.world().resource::<CloudTextureStatus>().progress;
    gpu::run_until(&mut app, "half of the bake", LIMIT, |app| progress(app) > 0.3);
    assert!(progress(&app) < 1.0);
    app.world_mut().resource_mut::<CloudTextures>().seed = 9;
    bake(&mut app);
    let expected = baked(CloudTextures { seed: 9, ..SMALL });
    for slot in [CloudTextureSlot::Gradient, CloudTextureSlot::Coverage, CloudTextureSlot::Wisp] {
        assert!(read(&app, slot, 0) == read(&expected, slot, 0), "{slot}");
    }
}

#[test]
fn baking_is_spread_over_frames_within_the_budget() {
    let mut app = app(CloudTextures { volume_size: 64, ..SMALL });
    let mut progress = Vec::new();
    gpu::run_until(&mut app, "the bake", LIMIT, |app| {
        let status = *app.world().resource::<CloudTextureStatus>();
        progress.push(status.progress);
        !status.baking
    });
    let status = *app.world().resource::<CloudTextureStatus>();
    assert!(status.frames > 3, "{status:?}");
    assert!(status.largest_frame > 0 && status.largest_frame <= status.frame_budget, "{status:?}");
    assert!(progress.windows(2).all(|pair| pair[0] <= pair[1]), "progress goes back: {progress:?}");
    assert!(progress.iter().any(|p| (0.1..0.9).contains(p)), "no frame in between: {progress:?}");
    assert_eq!(progress.last(), Some(&1.0));
    let idle = status.frames;
    gpu::run_updates(&mut app, 5);
    assert_eq!(app.world().resource::<CloudTextureStatus>().frames, idle, "baking goes on without end");
}
