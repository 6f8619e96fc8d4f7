//! The twin follows settings and textures, says why it cannot, and is not there unless asked for.

use bevy::{
    asset::RenderAssetUsages,
    math::DVec3,
    prelude::*,
    render::{
        Render, RenderApp,
        render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages},
        renderer::RenderGraph,
    },
};
use bevy_cumulus::testing::textures::{self as captured, Captured};
use bevy_cumulus::{
    CloudFieldError, ModelShader, prelude::*, reference::field::ModelTextures, textures::CloudTextureSlot,
};

use super::{field_app, sky, small, until_current};
use crate::support::{
    app::{new_clouds_app, new_clouds_app_with, spawn_sun},
    gpu::{run_until, run_updates},
};

/// A volume whose texels all differ, and are no multiple of anything.
fn volume(size: UVec3) -> Image {
    let texels = (0..size.element_product() * 4).map(|i| (i * 37 % 251) as u8).collect();
    let size = Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z };
    Image::new(size, TextureDimension::D3, texels, TextureFormat::Rgba8Unorm, RenderAssetUsages::default())
}

fn put(app: &mut App, image: Image, set: impl FnOnce(&mut CloudTextureSlots, Handle<Image>)) {
    let handle = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    set(&mut app.world_mut().resource_mut::<CloudTextureSlots>(), handle);
}

/// Every texel of every level, as the GPU has it, against the twin's at the texel's centre.
fn assert_same(app: &App, slot: CloudTextureSlot, read: impl Fn(DVec3, f64) -> f64, value: impl Fn([f32; 4]) -> f32) {
    let levels = captured::levels(app, slot);
    assert!(levels > 0, "{slot}");
    for level in 0..levels {
        let Captured { size, texels } = captured::read(app, slot, level).unwrap();
        for (i, texel) in (0..).zip(&texels) {
            let at = UVec3::new(i % size.x, i / size.x % size.y, i / (size.x * size.y));
            let found = read((at.as_dvec3() + 0.5) / size.as_dvec3(), level.into());
            let exact = value(*texel);
            assert!((found - f64::from(exact)).abs() < 1e-6, "{slot} level {level} texel {at}: {found}, not {exact}");
        }
    }
}

fn shares([a, b, c, d]: [f32; 4]) -> f32 {
    0.5 * a + 0.25 * b + 0.15 * c + 0.1 * d
}

#[test]
fn every_texel_of_every_level_comes_back() {
    // Maps of two pieces and more, volumes of levels.
    let mut app = field_app(CloudTextures { volume_size: 32, map_size: 512, ..default() });
    let here = sky(&app);
    let textures = here.textures();
    assert_same(&app, CloudTextureSlot::Billow, |at, l| textures.billow.sample(at, l), shares);
    assert_same(&app, CloudTextureSlot::Wisp, |at, l| textures.wisp.sample(at, l), shares);
    assert_same(&app, CloudTextureSlot::Coverage, |at, l| textures.coverage.sample(at, l), |t| t[0]);
    assert_same(&app, CloudTextureSlot::Coverage, |at, l| textures.coverage_bound.sample(at, l), |t| t[1]);
    assert_same(&app, CloudTextureSlot::TypeMap, |at, l| textures.type_map.sample(at, l), |t| t[0]);
    assert_same(&app, CloudTextureSlot::Gradient, |at, l| textures.gradient.sample(at, l), |t| t[0]);
    assert_eq!(textures.bytes(), 4 * (2 * 37_449 + 3 * 349_525 + 65_536));

    // Layers' volumes come with the first layer.
    assert!(textures.layers.is_none());
    app.insert_resource(CloudLayers(vec![super::layers::sheet()]));
    until_current(&mut app);
    let here = sky(&app);
    let layers = here.textures().layers.as_ref().expect("there is a layer");
    let worley = |[_, g, b, a]: [f32; 4]| 0.625 * g + 0.25 * b + 0.125 * a;
    let octaves = |[r, g, b, _]: [f32; 4]| (0.5 * r + 0.25 * g + 0.125 * b) / 0.875;
    assert_same(&app, CloudTextureSlot::Shape, |at, l| layers.shape.sample(at, l), |t| t[0]);
    assert_same(&app, CloudTextureSlot::Shape, |at, l| layers.shape_octaves.sample(at, l), worley);
    assert_same(&app, CloudTextureSlot::Detail, |at, l| layers.detail.sample(at, l), octaves);

    // A user's volume that can be copied, in slices; and the same as the main world has it.
    let size = UVec3::new(96, 64, 80);
    put(&mut app, volume(size), |slots, image| slots.billow = Some(image));
    let mut image = volume(size);
    image.texture_descriptor.usage -= TextureUsages::COPY_SRC;
    put(&mut app, image, |slots, image| slots.wisp = Some(image));
    until_current(&mut app);
    let here = sky(&app);
    let textures = here.textures();
    assert_eq!(textures.billow.size(), size);
    assert_same(&app, CloudTextureSlot::Billow, |at, l| textures.billow.sample(at, l), shares);
    assert!(*textures.billow == *textures.wisp, "the two ways differ");
}

#[test]
fn the_twin_follows_settings_clock_sun_and_textures() {
    let mut app = field_app(small(1));
    let p = Vec3::new(2000.0, 1700.0, -500.0);
    let first = sky(&app);
    assert_eq!((first.sun(), first.seconds(), first.sun_visibility(p)), (None, 0.0, 0.0));
    app.insert_resource(CloudClock { seconds: 50.0, speed: 0.0 });
    app.insert_resource(CloudModel {
        coverage: 1.0,
        noise_strength: 0.0,
        type_variation: 0.0,
        cloud_type: 1.0,
        ..default()
    });
    spawn_sun(&mut app, Vec3::new(0.0, -1.0, -1.0));
    run_updates(&mut app, 1);
    let overcast = sky(&app);
    assert_eq!(overcast.seconds(), 50.0);
    assert!(overcast.is_in_cloud(p) && overcast.density(p, 50.0) > 0.99, "{}", overcast.density(p, 50.0));
    assert!((overcast.sun().unwrap() - DVec3::new(0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt())).length() < 1e-6);
    // What was taken away stays as it was.
    assert_eq!(first.seconds(), 0.0);
    // A bad setting changes nothing.
    app.world_mut().resource_mut::<CloudModel>().coverage = -7.0;
    run_updates(&mut app, 1);
    assert!(sky(&app).is_in_cloud(p));
    app.insert_resource(CloudModel { coverage: -1.0, ..default() });
    run_updates(&mut app, 1);
    let clear = sky(&app);
    assert_eq!((clear.density(p, 50.0), clear.sun_visibility(p)), (0.0, 1.0));
    // Another seed: all but the gradient is baked and read again, and until then the old sky stays.
    app.insert_resource(small(9));
    run_updates(&mut app, 4);
    assert!(!app.world().resource::<CloudField>().is_current());
    assert!(*sky(&app).textures().wisp == *first.textures().wisp);
    until_current(&mut app);
    let other = sky(&app);
    assert!(*other.textures().billow != *first.textures().billow);
    assert!(*other.textures().coverage != *first.textures().coverage);
    assert!(std::sync::Arc::ptr_eq(&other.textures().gradient, &first.textures().gradient));
    // A painted map takes effect, and so does painting on it.
    let grey = |value| {
        let size = Extent3d { width: 16, height: 16, depth_or_array_layers: 1 };
        let format = TextureFormat::R8Unorm;
        Image::new_fill(size, TextureDimension::D2, &[value], format, RenderAssetUsages::default())
    };
    put(&mut app, grey(51), |slots, image| slots.coverage = Some(image));
    until_current(&mut app);
    let coverage = |app: &App| sky(app).textures().coverage.sample(DVec3::splat(0.4), 0.0);
    assert!((coverage(&app) - 0.2).abs() < 1e-3, "{}", coverage(&app));
    let handle = app.world().resource::<CloudTextureSlots>().coverage.clone().unwrap();
    app.world_mut().resource_mut::<Assets<Image>>().insert(handle.id(), grey(204)).unwrap();
    until_current(&mut app);
    assert!((coverage(&app) - 0.8).abs() < 1e-3, "{}", coverage(&app));
}

#[test]
fn the_twin_follows_layers() {
    let mut app = field_app(small(1));
    app.insert_resource(CloudModel { enabled: false, ..default() });
    run_updates(&mut app, 1);
    let p = Vec3::new(2000.0, 3000.0, -500.0);
    let clear = sky(&app);
    assert_eq!((clear.density(p, 0.0), clear.transmittance(p, p * 2.0)), (0.0, 1.0));
    let solid = CloudLayer {
        map: super::layers::map(1, 20_000.0, 8.0),
        coverage: 1.0,
        base: 2900.0,
        base_rise: 0.0,
        thickness: 4000.0,
        shape_strength: 0.0,
        detail_strength: 0.0,
        profile_strength: 4.0,
        ..default()
    };
    app.insert_resource(CloudLayers(vec![solid.clone()]));
    run_updates(&mut app, 1);
    // The old sky stays until the layer's map and volumes are here.
    assert!(!app.world().resource::<CloudField>().is_current() && sky(&app).density(p, 0.0) == 0.0);
    until_current(&mut app);
    let overcast = sky(&app);
    assert!(overcast.is_in_cloud(p) && !overcast.is_in_cloud(p - Vec3::Y * 200.0), "{:?}", overcast.medium(p, 0.0));
    assert!(overcast.transmittance(Vec3::Y * 10.0, Vec3::Y * 20_000.0) < 1e-6);
    assert_eq!(clear.density(p, 0.0), 0.0);
    // A setting at once; another map when it is made.
    app.world_mut().resource_mut::<CloudLayers>().0[0].density = 0.25;
    run_updates(&mut app, 1);
    assert!((sky(&app).density(p, 0.0) - 0.25 * overcast.density(p, 0.0)).abs() < 1e-9);
    let coverage = |app: &App| sky(app).textures().weather(0, bevy::math::DVec2::splat(0.3), 0.0);
    let before = coverage(&app);
    app.world_mut().resource_mut::<CloudLayers>().0[0].map.seed = 77;
    until_current(&mut app);
    assert_ne!(coverage(&app), before);
    // What is wrong or disabled is not there.
    app.world_mut().resource_mut::<CloudLayers>().0[0].density = -3.0;
    run_updates(&mut app, 1);
    assert!(sky(&app).density(p, 0.0) > 0.0);
    app.insert_resource(CloudLayers(vec![CloudLayer { enabled: false, ..solid }]));
    run_updates(&mut app, 1);
    assert_eq!(sky(&app).density(p, 0.0), 0.0);
}

#[test]
fn a_sky_of_layers_is_not_told_of_before_they_are_there() {
    let mut app = new_clouds_app_with((CloudFieldPlugin, CloudsPlugin));
    app.insert_resource(small(1)).insert_resource(CloudLayers(vec![super::layers::storm()]));
    run_until(&mut app, "there is a sky", 900, |app| app.world().resource::<CloudField>().is_ready());
    let textures = sky(&app).textures().clone();
    assert!(textures.layers.is_some() && textures.layer_sides().is_some_and(|sides| sides.maps[0]));
    // A volume that nobody can read back is said of where there is a layer to read it, and only there.
    let mut image = volume(UVec3::splat(8));
    image.asset_usage = RenderAssetUsages::RENDER_WORLD;
    image.texture_descriptor.usage -= TextureUsages::COPY_SRC;
    put(&mut app, image, |slots, image| slots.shape = Some(image));
    until_current(&mut app);
    let error = |app: &App| app.world().resource::<CloudField>().get().err().cloned();
    assert_eq!(error(&app), Some(CloudFieldError::Unreadable { slot: CloudTextureSlot::Shape }));
    app.insert_resource(CloudLayers::default());
    run_updates(&mut app, 1);
    assert_eq!(error(&app), None);
}

#[test]
fn what_cannot_be_told_is_said() {
    let mut app = field_app(small(1));
    let error = |app: &App| app.world().resource::<CloudField>().get().err().cloned();
    assert_eq!(error(&app), None);
    let mut image = volume(UVec3::splat(8));
    image.asset_usage = RenderAssetUsages::RENDER_WORLD;
    image.texture_descriptor.usage -= TextureUsages::COPY_SRC;
    put(&mut app, image, |slots, image| slots.billow = Some(image));
    until_current(&mut app);
    let told = error(&app).expect("the image is gone from the main world");
    assert_eq!(told, CloudFieldError::Unreadable { slot: CloudTextureSlot::Billow });
    assert!(told.to_string().contains("textures.billow") && told.to_string().contains("MAIN_WORLD"), "{told}");
    app.world_mut().resource_mut::<CloudTextureSlots>().billow = None;
    until_current(&mut app);
    assert_eq!(error(&app), None);
    app.insert_resource(crate::support::uniform_slab::slab_text(1000.0, 2000.0, 0.01));
    run_updates(&mut app, 1);
    assert_eq!(error(&app), Some(CloudFieldError::CustomModel));
    // Taking the resource away brings the built-in model back.
    app.world_mut().remove_resource::<ModelShader>();
    run_updates(&mut app, 1);
    assert_eq!(error(&app), None);
    // One that does not compile does not take its place.
    app.insert_resource(ModelShader("fn nothing() {}".to_owned()));
    run_updates(&mut app, 1);
    assert_eq!(error(&app), None);
}

#[test]
fn nothing_is_read_back_unless_asked_for() {
    let systems = |app: &App| {
        let schedules = app.sub_app(RenderApp).world().resource::<Schedules>();
        let count = |schedule: &Schedule| {
            let systems = schedule.systems().expect("it has run");
            systems.filter(|(_, system)| system.name().to_string().contains("bevy_cumulus::textures::readback")).count()
        };
        count(schedules.get(Render).unwrap()) + count(schedules.get(RenderGraph).unwrap())
    };
    let mut without = new_clouds_app();
    run_updates(&mut without, 2);
    assert!(without.world().get_resource::<CloudField>().is_none());
    assert_eq!([systems(&without), systems(&field_app(small(1)))], [0, 2]);
}

#[test]
fn the_sky_comes_without_anyone_waiting_for_the_gpu() {
    let mut app = new_clouds_app_with((CloudsPlugin, CloudFieldPlugin));
    app.insert_resource(small(1));
    let there = |app: &App| {
        let field = app.world().resource::<CloudField>();
        field.is_ready() && field.is_current()
    };
    // Nothing but the app's own frames, which submit and never wait.
    for _ in 0..5000 {
        if there(&app) {
            return;
        }
        app.update();
    }
    panic!("not there after 5000 frames");
}

#[test]
fn without_a_renderer_the_field_says_so() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), CloudsPlugin, CloudFieldPlugin));
    app.finish();
    app.cleanup();
    app.update();
    let field = app.world().resource::<CloudField>();
    assert!(!field.is_ready());
    assert!(matches!(field.get(), Err(CloudFieldError::Unsupported { .. })), "{field:?}");
}
