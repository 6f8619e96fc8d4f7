//! Buffers of the wrong kind, and devices that cannot.

use bevy::{
    prelude::*,
    render::{
        RenderApp, RenderPlugin,
        render_resource::{TextureFormat, TextureUsages, WgpuLimits},
        settings::WgpuSettings,
    },
};
use bevy_cumulus::{CloudFrame, prelude::*};

use super::{SIZE, above_one_camera, is_bare, looking_up};
use crate::support::{
    app::{View, cloud_pixels, spawn_sun},
    gpu::{headless_plugins, run_until, run_updates, times_logged},
    scene::{linear_pixels, settle, spawn_linear},
};

#[test]
fn an_unfit_buffer_is_reported_once_and_left_alone() {
    let (mut app, view) = above_one_camera();
    let picture = linear_pixels(&app, &view);
    let mut wrong_format = CloudBuffer::image(SIZE.x, SIZE.y);
    wrong_format.texture_descriptor.format = TextureFormat::Rgba16Float;
    wrong_format.data = Some(vec![0; (8 * SIZE.x * SIZE.y) as usize]);
    let mut wrong_usage = CloudBuffer::image(SIZE.x, SIZE.y);
    wrong_usage.texture_descriptor.usage = TextureUsages::TEXTURE_BINDING;
    for (what, image) in [("format", wrong_format), ("usage", wrong_usage)] {
        let logged = times_logged("CloudBuffer");
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.world_mut().entity_mut(view.camera).insert(CloudBuffer(image.clone()));
        settle(&mut app);
        assert_eq!(linear_pixels(&app, &view), picture, "{what}: the view's own picture suffers");
        assert!(times_logged("CloudBuffer") > logged, "the wrong {what} is not reported");
        let logged = times_logged("CloudFrame");
        app.world_mut().entity_mut(view.camera).insert(CloudFrame(image)).remove::<CloudBuffer>();
        settle(&mut app);
        assert_eq!(linear_pixels(&app, &view), picture, "{what}: the view's own picture suffers");
        if what == "usage" {
            assert!(times_logged("CloudFrame") > logged, "the wrong {what} is not reported");
        }
        app.world_mut().entity_mut(view.camera).remove::<CloudFrame>();
    }
}

#[test]
fn a_buffer_of_another_size_takes_what_fits() {
    let (mut app, view) = above_one_camera();
    let whole = cloud_pixels(&app, &view);
    for size in [UVec2::new(7, 5), UVec2::new(40, 20)] {
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(CloudBuffer::image(size.x, size.y));
        app.world_mut().entity_mut(view.camera).insert(CloudBuffer(image.clone()));
        settle(&mut app);
        let part = cloud_pixels(&app, &View { clouds: image, size, ..view.clone() });
        for (k, pixel) in part.iter().enumerate() {
            let at = UVec2::new(k as u32 % size.x, k as u32 / size.x);
            let inside = at.cmplt(SIZE).all();
            let expected = if inside { whole[(at.y * SIZE.x + at.x) as usize] } else { Vec4::ZERO };
            assert_eq!(*pixel, expected, "{size} at {at}");
        }
    }
}

#[test]
fn a_device_that_cannot_is_named_once_and_the_app_runs_on() {
    let weak = WgpuSettings { constrained_limits: Some(WgpuLimits::downlevel_webgl2_defaults()), ..default() };
    let weak = RenderPlugin { render_creation: weak.into(), synchronous_pipeline_compilation: true, ..default() };
    let mut app = App::new();
    app.add_plugins(headless_plugins().set(weak)).add_plugins(CloudsPlugin);
    app.finish();
    app.cleanup();
    assert!(app.get_sub_app(RenderApp).is_some(), "no Vulkan device");
    let adapter = app.world().resource::<bevy::render::renderer::RenderAdapterInfo>().name.clone();
    let reason = app.world().resource::<CloudStatus>().unsupported().expect("it cannot draw clouds").to_owned();
    assert!(reason.contains(&adapter) && !adapter.is_empty(), "{reason:?} does not name {adapter:?}");
    assert!(reason.contains("max_storage_textures_per_shader_stage is 0"), "{reason}");
    let view = spawn_linear(&mut app, SIZE, looking_up());
    spawn_sun(&mut app, Vec3::NEG_Y);
    run_updates(&mut app, 5);
    // Bevy's own shaders load while the app runs: how many frames that takes is the machine's affair.
    run_until(&mut app, "the camera draws its clear colour", 500, |app| is_bare(app, &view));
    run_updates(&mut app, 5);
    assert_eq!(times_logged(&format!("clouds are off: {reason}")), 1, "not reported once");
    assert!(is_bare(&app, &view), "the camera draws clouds");
    assert!(!app.world().resource::<CloudStatus>().is_ready());
}
