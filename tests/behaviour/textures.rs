//! Baked textures and a user's images in their place, on the real GPU path.

use std::path::{Path, PathBuf};

use bevy::{
    asset::RenderAssetUsages,
    image::ImageLoaderSettings,
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages},
};
use bevy_cumulus::{
    CloudsPlugin,
    settings::{CloudTextureSlots, CloudTextures},
    textures::{
        CloudTextureError, CloudTextureFault, CloudTextureSlot, CloudTextureStatus,
        capture::{self, Captured},
        vertical_profile,
    },
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::gpu;

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
    assert!(capture::generation(app).1, "baking is over, but a texture is missing");
}

fn read(app: &App, slot: CloudTextureSlot, level: u32) -> Captured {
    capture::read(app, slot, level).unwrap()
}

fn channel(captured: &Captured, channel: usize) -> Vec<f32> {
    captured.texels.iter().map(|texel| texel[channel]).collect()
}

/// Largest and mean difference between the planes `at` and `at + 1` across an axis, wrapping.
fn step_between(captured: &Captured, axis: usize, at: i32, channel: usize) -> (f32, f32) {
    let size = captured.size.as_ivec3();
    let (mut most, mut sum, mut count) = (0.0_f32, 0.0, 0.0);
    let others = [(axis + 1) % 3, (axis + 2) % 3];
    for i in 0..size[others[0]] {
        for j in 0..size[others[1]] {
            let mut p = IVec3::ZERO;
            (p[axis], p[others[0]], p[others[1]]) = (at, i, j);
            let mut q = p;
            q[axis] += 1;
            let step = (captured.at(p)[channel] - captured.at(q)[channel]).abs();
            most = most.max(step);
            sum += step;
            count += 1.0;
        }
    }
    (most, sum / count)
}

/// The seam must be as smooth as the inside, judged by mean and by largest step.
fn assert_tiles(captured: &Captured, axes: usize, channels: usize, what: &str) {
    for axis in 0..axes {
        let last = captured.size[axis] as i32 - 1;
        for channel in 0..channels {
            let inside: Vec<_> = (0..last).map(|at| step_between(captured, axis, at, channel)).collect();
            let most = inside.iter().map(|step| step.0).fold(0.0, f32::max);
            let mean = inside.iter().map(|step| step.1).fold(0.0, f32::max);
            let seam = step_between(captured, axis, last, channel);
            assert!(
                seam.0 <= most * 1.02 && seam.1 <= mean * 1.1,
                "{what}, axis {axis}, channel {channel}: steps of {seam:?} at the seam, {most} and {mean} inside"
            );
        }
    }
}

#[test]
fn noise_volumes_and_maps_tile() {
    let app = baked(SMALL);
    for slot in [CloudTextureSlot::Billow, CloudTextureSlot::Wisp] {
        // The finest channels change by half their range from texel to texel, where a seam would not show.
        assert_tiles(&read(&app, slot, 0), 3, 2, &slot.to_string());
    }
    for slot in [CloudTextureSlot::Coverage, CloudTextureSlot::TypeMap] {
        assert_tiles(&read(&app, slot, 0), 2, 1, &slot.to_string());
    }
}

#[test]
fn the_seam_check_sees_a_seam() {
    let size = UVec3::new(32, 32, 1);
    let texels = (0..32 * 32).map(|i| [((i % 32) as f32 * 0.02).sin(), 0.0, 0.0, 1.0]).collect();
    let ramp = Captured { size, texels };
    assert!(std::panic::catch_unwind(|| assert_tiles(&ramp, 1, 1, "a ramp")).is_err());
}

#[test]
fn a_seed_gives_the_same_sky_again_and_another_seed_another() {
    let slots = [
        CloudTextureSlot::Billow,
        CloudTextureSlot::Wisp,
        CloudTextureSlot::Coverage,
        CloudTextureSlot::TypeMap,
    ];
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
    let (generation, _) = capture::generation(&app);
    app.world_mut().resource_mut::<CloudTextures>().billow_cells = 8;
    bake(&mut app);
    assert_eq!(capture::generation(&app).0, generation + 1);
    assert!(before == read(&app, CloudTextureSlot::Wisp, 0));
}

#[test]
fn a_bake_that_is_superseded_starts_again() {
    let mut app = app(SMALL);
    gpu::run_updates(&mut app, 4);
    assert!(app.world().resource::<CloudTextureStatus>().baking);
    app.world_mut().resource_mut::<CloudTextures>().seed = 9;
    bake(&mut app);
    let expected = baked(CloudTextures { seed: 9, ..SMALL });
    for slot in [CloudTextureSlot::Gradient, CloudTextureSlot::Coverage, CloudTextureSlot::Wisp] {
        assert!(read(&app, slot, 0) == read(&expected, slot, 0), "{slot}");
    }
}

fn quantile(sorted: &[f32], share: f32) -> f32 {
    sorted[((sorted.len() - 1) as f32 * share) as usize]
}

#[test]
fn every_channel_spans_its_range() {
    let app = baked(CloudTextures { volume_size: 64, ..SMALL });
    for slot in [CloudTextureSlot::Billow, CloudTextureSlot::Wisp] {
        let volume = read(&app, slot, 0);
        for k in 0..4 {
            let mut values = channel(&volume, k);
            values.sort_by(f32::total_cmp);
            let (low, mid, high) = (quantile(&values, 0.005), quantile(&values, 0.5), quantile(&values, 0.995));
            assert!(low < 0.15 && (0.4..0.6).contains(&mid) && high > 0.85, "{slot} {k}: {low} {mid} {high}");
        }
    }
    let mut types = channel(&read(&app, CloudTextureSlot::TypeMap, 0), 0);
    types.sort_by(f32::total_cmp);
    assert!(quantile(&types, 0.01) < 0.1 && quantile(&types, 0.995) > 0.7, "type map");
}

#[test]
fn the_coverage_map_is_a_sky_of_separate_clouds() {
    for seed in [1, 2] {
        let app = baked(CloudTextures { seed, map_size: 256, ..SMALL });
        let values = channel(&read(&app, CloudTextureSlot::Coverage, 0), 0);
        let share = |test: fn(f32) -> bool| values.iter().filter(|v| test(**v)).count() as f32 / values.len() as f32;
        let (clear, cloud, core) = (share(|v| v < 0.02), share(|v| v > 0.5), share(|v| v > 0.95));
        assert!((0.35..0.6).contains(&clear), "seed {seed}: {clear} of the map is clear");
        assert!((0.1..0.35).contains(&cloud), "seed {seed}: {cloud} of the map is cloud");
        assert!((0.001..0.1).contains(&core), "seed {seed}: {core} of the map is at its peak");
    }
}

/// R read with bilinear filtering at `uv`, wrapping.
fn bilinear(level: &Captured, uv: Vec2) -> f32 {
    let p = uv * level.size.xy().as_vec2() - 0.5;
    let (cell, f) = (p.floor().as_ivec2(), p - p.floor());
    let at = |x, y| level.at((cell + IVec2::new(x, y)).extend(0))[0];
    let (top, bottom) = (at(0, 0).lerp(at(1, 0), f.x), at(0, 1).lerp(at(1, 1), f.x));
    top.lerp(bottom, f.y)
}

/// Random places: no finer or equal level may exceed the bound of a level within half of its texel.
fn assert_bounds(app: &App, slot: CloudTextureSlot) {
    let levels: Vec<Captured> = (0..capture::levels(app, slot)).map(|level| read(app, slot, level)).collect();
    assert_eq!(levels.last().unwrap().size, UVec3::ONE, "{slot}: the pyramid ends at one texel");
    let mut random = StdRng::seed_from_u64(7);
    let mut tight = 0;
    for round in 0..60_000 {
        let bounding = round % levels.len();
        let finer = random.random_range(0..=bounding);
        let p = Vec2::new(random.random(), random.random());
        let size = levels[bounding].size.xy().as_vec2();
        let texel = (p * size).as_ivec2().min(size.as_ivec2() - 1);
        let bound = levels[bounding].at(texel.extend(0))[1];
        let reach = Vec2::new(random.random_range(-0.5..=0.5), random.random_range(-0.5..=0.5));
        let value = bilinear(&levels[finer], p + reach / size);
        assert!(
            value <= bound * (1.0 + 1e-6),
            "{slot}: {value} at level {finer} near {p}, above the bound {bound} of level {bounding}"
        );
        tight += u32::from(value > 0.9 * bound && bound > 0.0);
    }
    assert!(tight > 100, "{slot}: the bound is never near the value, so it licenses nothing");
}

#[test]
fn pyramids_bound_what_is_read_of_them() {
    let app = baked(SMALL);
    assert_bounds(&app, CloudTextureSlot::Coverage);
    assert_bounds(&app, CloudTextureSlot::TypeMap);
}

#[test]
fn volumes_have_mips_that_average() {
    let app = baked(SMALL);
    let slot = CloudTextureSlot::Billow;
    assert_eq!(capture::levels(&app, slot), 6);
    let (fine, coarse) = (read(&app, slot, 0), read(&app, slot, 1));
    assert_eq!(coarse.size, UVec3::splat(16));
    for p in [IVec3::new(0, 0, 0), IVec3::new(3, 15, 9), IVec3::new(15, 15, 15)] {
        let children = (0..8).map(|i| fine.at(2 * p + IVec3::new(i & 1, (i >> 1) & 1, i >> 2))[0]);
        let mean = children.sum::<f32>() / 8.0;
        assert!((coarse.at(p)[0] - mean).abs() < 0.51 / 255.0, "{p}: {} instead of {mean}", coarse.at(p)[0]);
    }
}

#[test]
fn the_gradient_is_the_formula() {
    let app = baked(SMALL);
    let gradient = read(&app, CloudTextureSlot::Gradient, 0);
    assert_eq!(gradient.size, UVec3::new(256, 256, 1));
    for y in 0..256 {
        for x in 0..256 {
            let expected = vertical_profile((x as f32 + 0.5) / 256.0, (y as f32 + 0.5) / 256.0);
            let found = gradient.at(IVec3::new(x, y, 0))[0];
            assert!((found - expected).abs() < 1e-3, "type {x}, height {y}: {found} instead of {expected}");
        }
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

#[test]
fn blue_noise_is_the_file_that_ships() {
    let app = baked(SMALL);
    let shown = read(&app, CloudTextureSlot::BlueNoise, 0);
    let file = image::open(assets().join("textures/blue_noise.png")).unwrap().to_rgba8();
    assert_eq!((shown.size.x, shown.size.y), file.dimensions());
    for (texel, pixel) in shown.texels.iter().zip(file.pixels()) {
        assert_eq!(texel.map(|v| (v * 255.0).round() as u8), pixel.0);
    }
}

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

/// An image made in code that can be read back.
fn picture(size: UVec3, dimension: TextureDimension, format: TextureFormat, texel: &[u8]) -> Image {
    let size = Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z };
    let mut image = Image::new_fill(size, dimension, texel, format, RenderAssetUsages::all());
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    image
}

fn put(app: &mut App, slot: fn(&mut CloudTextureSlots) -> &mut Option<Handle<Image>>, image: Image) -> Handle<Image> {
    let handle = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    *slot(&mut app.world_mut().resource_mut::<CloudTextureSlots>()) = Some(handle.clone());
    handle
}

fn errors(app: &App) -> Vec<CloudTextureError> {
    let messages = app.world().resource::<Messages<CloudTextureError>>();
    messages.iter_current_update_messages().cloned().collect()
}

/// Runs until an image has been refused.
fn refusal(app: &mut App) -> CloudTextureError {
    let mut found = Vec::new();
    gpu::run_until(app, "an error about the image", 100, |app| {
        found = errors(app);
        !found.is_empty()
    });
    assert_eq!(found.len(), 1, "{found:?}");
    found.remove(0)
}

#[test]
fn an_image_of_the_wrong_dimension_is_refused_and_the_last_good_one_stays() {
    let mut app = baked(SMALL);
    let before = read(&app, CloudTextureSlot::Billow, 0);
    put(&mut app, |s| &mut s.billow, picture(UVec3::new(8, 8, 1), TextureDimension::D2, TextureFormat::Rgba8Unorm, &[9; 4]));
    let error = refusal(&mut app);
    assert_eq!(error.slot, CloudTextureSlot::Billow);
    assert_eq!(error.fault, CloudTextureFault::Dimension { found: "a 2D image", expected: "a 3D image" });
    assert!(error.to_string().starts_with("textures.billow: "), "{error}");
    bake(&mut app);
    assert!(before == read(&app, CloudTextureSlot::Billow, 0));

    // The last good one may be a user's too.
    let good = picture(UVec3::splat(8), TextureDimension::D3, TextureFormat::Rgba8Unorm, &[51, 102, 153, 204]);
    put(&mut app, |s| &mut s.billow, good);
    bake(&mut app);
    assert_eq!(read(&app, CloudTextureSlot::Billow, 0).size, UVec3::splat(8));
    put(&mut app, |s| &mut s.billow, picture(UVec3::splat(2), TextureDimension::D3, TextureFormat::Rgba8Unorm, &[9; 4]));
    assert_eq!(
        refusal(&mut app).fault,
        CloudTextureFault::Size { size: UVec3::splat(2), min: 4, max: 512 }
    );
    bake(&mut app);
    assert_eq!(read(&app, CloudTextureSlot::Billow, 0).texels[0], [0.2, 0.4, 0.6, 0.8]);

    app.world_mut().resource_mut::<CloudTextureSlots>().billow = None;
    bake(&mut app);
    assert!(before == read(&app, CloudTextureSlot::Billow, 0), "clearing a slot goes back to the baked texture");
}

#[test]
fn an_image_of_the_wrong_format_is_refused_with_a_hint() {
    let mut app = baked(SMALL);
    let before = read(&app, CloudTextureSlot::Coverage, 0);
    let srgb = picture(UVec3::new(8, 8, 1), TextureDimension::D2, TextureFormat::Rgba8UnormSrgb, &[9; 4]);
    put(&mut app, |s| &mut s.coverage, srgb);
    let error = refusal(&mut app);
    assert!(matches!(error.fault, CloudTextureFault::Format { found: TextureFormat::Rgba8UnormSrgb, .. }), "{error}");
    assert!(error.to_string().contains("is_srgb = false"), "{error}");
    let floats = picture(UVec3::new(8, 8, 1), TextureDimension::D2, TextureFormat::R32Float, &[0; 4]);
    put(&mut app, |s| &mut s.coverage, floats);
    let error = refusal(&mut app);
    assert!(error.to_string().contains("R32Float") && error.to_string().contains("R16Float"), "{error}");
    bake(&mut app);
    assert!(before == read(&app, CloudTextureSlot::Coverage, 0));
}

#[test]
fn a_missing_file_is_named_and_the_baked_texture_stays() {
    let mut app = baked(SMALL);
    let before = read(&app, CloudTextureSlot::Gradient, 0);
    let handle = app.world().resource::<AssetServer>().load("textures/there_is_no_such_file.png");
    app.world_mut().resource_mut::<CloudTextureSlots>().gradient = Some(handle);
    let error = refusal(&mut app);
    assert_eq!((error.slot, error.file.as_str()), (CloudTextureSlot::Gradient, "textures/there_is_no_such_file.png"));
    assert!(matches!(error.fault, CloudTextureFault::NotLoaded { .. }), "{error}");
    bake(&mut app);
    assert!(before == read(&app, CloudTextureSlot::Gradient, 0));
}

/// A map of one bright texel per quarter, `size` texels, R only.
fn dots(size: UVec2) -> Image {
    let mut image =
        picture(size.extend(1), TextureDimension::D2, TextureFormat::R8Unorm, &[0]);
    let data = image.data.as_mut().unwrap();
    for (i, byte) in data.iter_mut().enumerate() {
        *byte = if i % 37 == 0 { 255 } else { (i % 11) as u8 };
    }
    image
}

#[test]
fn a_users_map_of_any_size_becomes_a_pyramid_and_follows_its_changes() {
    let mut app = baked(SMALL);
    for size in [UVec2::new(45, 70), UVec2::new(4, 4), UVec2::new(33, 9)] {
        let image = dots(size);
        let bytes = image.data.clone().unwrap();
        let handle = put(&mut app, |s| &mut s.coverage, image);
        bake(&mut app);
        let shown = read(&app, CloudTextureSlot::Coverage, 0);
        assert_eq!(shown.size, size.extend(1));
        for (texel, byte) in shown.texels.iter().zip(&bytes) {
            assert!((texel[0] - f32::from(*byte) / 255.0).abs() < 5e-4);
        }
        assert_bounds(&app, CloudTextureSlot::Coverage);

        let mean = channel(&shown, 0).iter().sum::<f32>() / shown.texels.len() as f32;
        let last = capture::levels(&app, CloudTextureSlot::Coverage) - 1;
        let top = read(&app, CloudTextureSlot::Coverage, last).texels[0];
        assert!((top[0] - mean).abs() < 2e-3 && top[1] == 1.0, "{top:?}, mean {mean}");

        let mut images = app.world_mut().resource_mut::<Assets<Image>>();
        images.get_mut(&handle).unwrap().data.as_mut().unwrap().fill(255);
        bake(&mut app);
        let shown = read(&app, CloudTextureSlot::Coverage, 0);
        assert!(shown.texels.iter().all(|texel| texel[0] == 1.0), "{size}: the change does not show");
    }
}

#[test]
fn an_image_that_turns_bad_in_place_leaves_the_good_one() {
    let mut app = baked(SMALL);
    let good = picture(UVec3::splat(8), TextureDimension::D3, TextureFormat::Rgba8Unorm, &[51, 102, 153, 204]);
    let handle = put(&mut app, |s| &mut s.wisp, good);
    bake(&mut app);
    let bad = picture(UVec3::new(8, 8, 1), TextureDimension::D2, TextureFormat::Rgba8Unorm, &[9; 4]);
    app.world_mut().resource_mut::<Assets<Image>>().insert(&handle, bad).unwrap();
    assert!(matches!(refusal(&mut app).fault, CloudTextureFault::Dimension { .. }));
    bake(&mut app);
    assert_eq!(read(&app, CloudTextureSlot::Wisp, 0).texels[0], [0.2, 0.4, 0.6, 0.8]);
}

#[test]
fn a_png_from_disk_fills_a_slot() {
    let mut app = baked(SMALL);
    let (generation, _) = capture::generation(&app);
    let data = |settings: &mut ImageLoaderSettings| settings.is_srgb = false;
    let server = app.world().resource::<AssetServer>();
    let handle = server.load_builder().with_settings(data).load("textures/blue_noise.png");
    app.world_mut().resource_mut::<CloudTextureSlots>().type_map = Some(handle);
    bake(&mut app);
    assert_eq!(capture::generation(&app).0, generation + 1);
    let shown = read(&app, CloudTextureSlot::TypeMap, 0);
    let file = image::open(assets().join("textures/blue_noise.png")).unwrap().to_rgba8();
    assert_eq!((shown.size.x, shown.size.y), file.dimensions());
    for (texel, pixel) in shown.texels.iter().zip(file.pixels()) {
        assert!((texel[0] - f32::from(pixel.0[0]) / 255.0).abs() < 5e-4);
    }
}
