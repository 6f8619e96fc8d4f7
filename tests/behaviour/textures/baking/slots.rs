//! A user's images, good and bad, and the loss of a device under them.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use bevy::{
    asset::RenderAssetUsages,
    image::ImageLoaderSettings,
    prelude::*,
    render::{
        error_handler::{RenderErrorHandler, RenderErrorPolicy},
        render_resource::{Extent3d, PollType, TextureDimension, TextureFormat, TextureUsages},
        renderer::RenderDevice,
        settings::RenderCreation,
    },
};
use bevy_cumulus::testing::textures as captured;
use bevy_cumulus::{
    settings::CloudTextureSlots,
    textures::{CloudTextureError, CloudTextureFault, CloudTextureSlot},
};

use super::{SMALL, bake, baked, channel, content::assert_bounds, read};
use crate::support::gpu;

#[test]
fn a_lost_device_is_baked_for_again() {
    let mut app = baked(SMALL);
    let good = picture(UVec3::splat(8), TextureDimension::D3, TextureFormat::Rgba8Unorm, &[51, 102, 153, 204]);
    put(&mut app, |s| &mut s.wisp, good);
    bake(&mut app);
    let slots = [CloudTextureSlot::Wisp, CloudTextureSlot::Billow, CloudTextureSlot::Coverage];
    let before = slots.map(|slot| read(&app, slot, 0));
    let (generation, _) = captured::generation(&app);
    app.insert_resource(RenderErrorHandler(|_, _, _| RenderErrorPolicy::Recover(RenderCreation::Automatic(default()))));
    let device = app.world().resource::<RenderDevice>().wgpu_device().clone();
    device.destroy();
    // The loss is told by a callback, and those are called when polling.
    let _ = device.poll(PollType::Poll);
    // The adapter is asked for a device on another thread, which can take a while.
    let start = Instant::now();
    while captured::generation(&app).0 == generation && start.elapsed() < Duration::from_secs(60) {
        app.update();
        std::thread::sleep(Duration::from_millis(20));
    }
    bake(&mut app);
    assert!(captured::generation(&app).0 > generation, "views of the lost device pass for current");
    for (slot, before) in slots.iter().zip(&before) {
        assert!(*before == read(&app, *slot, 0), "{slot} differs on the new device");
    }
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
    app.world_mut().resource_mut::<Messages<CloudTextureError>>().clear();
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
    put(
        &mut app,
        |s| &mut s.billow,
        picture(UVec3::new(8, 8, 1), TextureDimension::D2, TextureFormat::Rgba8Unorm, &[9; 4]),
    );
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
    put(
        &mut app,
        |s| &mut s.billow,
        picture(UVec3::splat(2), TextureDimension::D3, TextureFormat::Rgba8Unorm, &[9; 4]),
    );
    assert_eq!(refusal(&mut app).fault, CloudTextureFault::Size { size: UVec3::splat(2), min: 4, max: 512 });
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
    let mut image = picture(size.extend(1), TextureDimension::D2, TextureFormat::R8Unorm, &[0]);
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
        assert_bounds(&app, CloudTextureSlot::Coverage, 1);

        let mean = channel(&shown, 0).iter().sum::<f32>() / shown.texels.len() as f32;
        let last = captured::levels(&app, CloudTextureSlot::Coverage) - 1;
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
    let (generation, _) = captured::generation(&app);
    let data = |settings: &mut ImageLoaderSettings| settings.is_srgb = false;
    let server = app.world().resource::<AssetServer>();
    let handle = server.load_builder().with_settings(data).load("textures/blue_noise.png");
    app.world_mut().resource_mut::<CloudTextureSlots>().type_map = Some(handle);
    bake(&mut app);
    assert_eq!(captured::generation(&app).0, generation + 1);
    let shown = read(&app, CloudTextureSlot::TypeMap, 0);
    let file = image::open(assets().join("textures/blue_noise.png")).unwrap().to_rgba8();
    assert_eq!((shown.size.x, shown.size.y), file.dimensions());
    for (texel, pixel) in shown.texels.iter().zip(file.pixels()) {
        assert!((texel[0] - f32::from(pixel.0[0]) / 255.0).abs() < 5e-4);
    }
}
