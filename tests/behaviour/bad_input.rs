//! Bad input is reported by name; the last good value stays, and nothing panics.

use bevy::{
    camera::{MainPassResolutionOverride, RenderTarget},
    ecs::component::Mutable,
    prelude::*,
    render::{
        RenderApp, RenderPlugin,
        render_resource::{TextureFormat, TextureUsages, WgpuLimits},
        settings::WgpuSettings,
        sync_world::RenderEntity,
    },
    window::{WindowRef, WindowResolution},
};
use bevy_cumulus::{CloudFrame, prelude::*, settings::SettingsError, settings::Validate};

use crate::{
    gpu::{headless_plugins, run_until, run_updates, times_logged},
    modes::{HELD, all, in_mode},
    stage::{CLEAR, exact, linear_pixels, noisy, render_components, settle, slab_app, spawn_linear},
    view::{View, cloud_pixels, clouds_app, spawn_sun, until_drawn},
};

const SIZE: UVec2 = UVec2::new(24, 16);

fn looking_up() -> Transform {
    Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()))
}

fn above_one_camera() -> (App, View) {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let view = spawn_linear(&mut app, SIZE, looking_up());
    until_drawn(&mut app);
    settle(&mut app);
    (app, view)
}

fn is_bare(app: &App, view: &View) -> bool {
    linear_pixels(app, view).iter().all(|p| p.abs_diff_eq(CLEAR, 1e-3))
}

/// One bad change: what the error says, and the change.
pub type Bad<S> = (&'static str, fn(&mut S));

/// Makes each change, and asks that it be reported and the picture stay as it is.
pub fn refuses<S>(app: &mut App, view: &View, changes: &[Bad<S>])
where
    S: Resource<Mutability = Mutable> + Validate + Clone,
{
    let good = app.world().resource::<S>().clone();
    let picture = cloud_pixels(app, view);
    for (says, change) in changes {
        let logged = times_logged(says);
        change(&mut app.world_mut().resource_mut::<S>());
        let error = app.world().resource::<S>().validate().expect_err(says).to_string();
        assert!(error.contains(says), "{error:?} does not say {says:?}");
        run_updates(app, 3);
        assert_eq!(times_logged(says), logged + 1, "{says:?} is not reported once");
        assert!(cloud_pixels(app, view) == picture, "{says:?} changes the picture");
        app.insert_resource(good.clone());
        run_updates(app, 1);
    }
    assert!(cloud_pixels(app, view) == picture, "the good value does not come back");
}

#[test]
fn bad_settings_are_reported_and_change_nothing() {
    // The built-in model: a slab would not see half of these.
    let mut app = clouds_app();
    app.insert_resource(exact(MarchResolution::Full));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_linear(&mut app, SIZE, looking_up());
    until_drawn(&mut app);
    settle(&mut app);
    refuses::<CloudModel>(
        &mut app,
        &view,
        &[
            ("model.coverage = 7.5 is outside its range -1 to 1", |m| m.coverage = 7.5),
            ("model.density = -0.5 is outside its range 0 to 10", |m| m.density = -0.5),
            ("model.extinction = NaN is outside its range 0 to 1", |m| m.extinction = f32::NAN),
            ("model.map_scale = inf is outside", |m| m.map_scale = f32::INFINITY),
            ("model.albedo.y = -1 is outside", |m| m.albedo.y = -1.0),
            ("model.wind.x = NaN is outside", |m| m.wind.x = f32::NAN),
            ("model.world_offset.z = 1000000000000000000000000000000 is outside", |m| m.world_offset.z = 1e30),
            ("model.top = 1000 must be above model.bottom = 2000", |m| (m.bottom, m.top) = (2000.0, 1000.0)),
            ("model.top = 1234 must be above model.bottom = 1234", |m| (m.bottom, m.top) = (1234.0, 1234.0)),
        ],
    );
    refuses::<CloudLighting>(
        &mut app,
        &view,
        &[
            ("lighting.octaves = 4000000000 is outside its range 0 to 16", |l| l.octaves = 4_000_000_000),
            ("lighting.g = 1 is outside its range -0.99 to 0.99", |l| l.g = 1.0),
            ("lighting.phase_limit = NaN is outside", |l| l.phase_limit = f32::NAN),
            ("lighting.sun_strength = -2 is outside", |l| l.sun_strength = -2.0),
            ("lighting.droplet_diameter = 0 is outside its range 5 to 50", |l| l.droplet_diameter = 0.0),
        ],
    );
    refuses::<CloudQuality>(
        &mut app,
        &view,
        &[
            ("quality.step = 0 is outside its range 0.5 to 5000", |q| q.step = 0.0),
            ("quality.step = NaN is outside", |q| q.step = f32::NAN),
            ("quality.window = 0 is outside its range 1 to 16", |q| q.window = 0),
            ("quality.max_steps = 4294967295 is outside", |q| q.max_steps = u32::MAX),
            ("quality.max_distance = -5 is outside", |q| q.max_distance = -5.0),
            ("quality.long_step = 0 is outside its range 1 to 16", |q| q.long_step = 0),
        ],
    );
    refuses::<CloudTextures>(
        &mut app,
        &view,
        &[
            ("textures.volume_size = 48 must be a power of two from 32 to 256", |t| t.volume_size = 48),
            ("textures.map_size = 1000000000 is outside", |t| t.map_size = 1_000_000_000),
            ("textures.billow_cells = 0 is outside its range 1 to 32", |t| t.billow_cells = 0),
        ],
    );
    refuses::<CloudClock>(
        &mut app,
        &view,
        &[
            ("clock.seconds = NaN is outside", |c| c.seconds = f64::NAN),
            ("clock.speed = -20000 is outside its range -10000 to 10000", |c| c.speed = -20000.0),
        ],
    );
    // Good values are taken, or all of the above would prove nothing.
    let picture = cloud_pixels(&app, &view);
    app.world_mut().resource_mut::<CloudModel>().coverage = 0.3;
    settle(&mut app);
    assert!(cloud_pixels(&app, &view) != picture, "a good value changes nothing either");
}

#[test]
fn a_bad_clock_stands_still() {
    let (mut app, _) = above_one_camera();
    app.insert_resource(CloudClock { seconds: 5.0, speed: 34_567.0 });
    run_updates(&mut app, 3);
    assert_eq!(app.world().resource::<CloudClock>().seconds, 5.0);
    assert_eq!(times_logged("clock.speed = 34567 is outside"), 1, "not reported once");
    app.world_mut().resource_mut::<CloudClock>().speed = 100.0;
    run_updates(&mut app, 2);
    // The first update of the two takes 16 ms as well.
    assert_eq!(app.world().resource::<CloudClock>().seconds, 5.0 + 2.0 * 0.016 * 100.0);
}

#[test]
fn a_views_bad_quality_falls_back_to_the_resource() {
    let (mut app, view) = above_one_camera();
    let picture = cloud_pixels(&app, &view);
    let own = |step| CloudView { quality: Some(CloudQuality { step, ..exact(MarchResolution::Quarter) }), ..default() };
    app.world_mut().entity_mut(view.camera).insert(own(-17.0));
    settle(&mut app);
    assert!(cloud_pixels(&app, &view) == picture);
    assert_eq!(times_logged("view.quality.step = -17"), 1, "the bad step is not reported once");
    app.world_mut().entity_mut(view.camera).insert(own(500.0));
    settle(&mut app);
    assert!(cloud_pixels(&app, &view) != picture, "a good quality of its own changes nothing");
}

/// Makes the view bad, asks for no clouds and where its target is still `drawn` for no trace of them, and for all of
/// them once it is good again.
fn is_refused_and_recovers(what: &str, drawn: bool, spoil: fn(&mut App, &View), mend: fn(&mut App, &View)) {
    let (mut app, view) = above_one_camera();
    let picture = linear_pixels(&app, &view);
    spoil(&mut app, &view);
    settle(&mut app);
    if drawn {
        assert!(is_bare(&app, &view), "{what}: clouds are drawn");
        let left = render_components(&app, view.camera);
        let kept = ["CloudHistory", "CloudBindGroups", "CloudUniforms"];
        assert!(!left.iter().any(|name| kept.iter().any(|k| name.contains(k))), "{what}: {left:?} are left");
        assert!(!app.world().resource::<CloudStatus>().is_ready(), "{what}: ready to draw nothing");
    }
    mend(&mut app, &view);
    settle(&mut app);
    assert_eq!(linear_pixels(&app, &view), picture, "{what}: not the same once mended");
}

fn set_projection(app: &mut App, view: &View, projection: Projection) {
    app.world_mut().entity_mut(view.camera).insert(projection);
}

#[test]
fn an_orthographic_camera_shows_no_clouds() {
    let before = times_logged("its projection is orthographic");
    is_refused_and_recovers(
        "orthographic",
        true,
        |app, view| set_projection(app, view, Projection::Orthographic(OrthographicProjection::default_3d())),
        |app, view| set_projection(app, view, Projection::default()),
    );
    assert_eq!(times_logged("its projection is orthographic"), before + 1, "not reported once");
}

#[test]
fn a_near_plane_of_zero_shows_no_clouds() {
    is_refused_and_recovers(
        "near = 0",
        true,
        |app, view| {
            set_projection(app, view, Projection::Perspective(PerspectiveProjection { near: 0.0, ..default() }))
        },
        |app, view| set_projection(app, view, Projection::default()),
    );
}

#[test]
fn a_camera_that_is_nowhere_shows_no_clouds() {
    is_refused_and_recovers(
        "NaN",
        true,
        |app, view| {
            app.world_mut().entity_mut(view.camera).insert(Transform::from_xyz(f32::NAN, 0.0, 0.0));
        },
        |app, view| {
            app.world_mut().entity_mut(view.camera).insert(looking_up());
        },
    );
}

#[test]
fn transforms_that_are_no_place_show_no_clouds() {
    // Out of this universe, and turned inside out: one camera through all of it. A rotation that is not a number, no size
    // and a place at infinity are not tried: Bevy itself asserts there.
    let (mut app, view) = above_one_camera();
    let picture = linear_pixels(&app, &view);
    let nowhere = [
        Transform::from_xyz(0.0, -1e30, 1e30),
        Transform::from_xyz(f32::NAN, f32::NAN, f32::NAN),
        looking_up().with_scale(Vec3::new(-1.0, 1.0, 1e-20)),
    ];
    for place in nowhere {
        app.world_mut().entity_mut(view.camera).insert(place);
        settle(&mut app);
        let seen = linear_pixels(&app, &view);
        assert!(seen.iter().all(|p| p.is_finite()), "{place:?}: {seen:?}");
        app.world_mut().entity_mut(view.camera).insert(looking_up());
        settle(&mut app);
        assert_eq!(linear_pixels(&app, &view), picture, "{place:?}: not the same once mended");
    }
}

#[test]
fn an_infinite_far_plane_changes_nothing() {
    let (mut app, view) = above_one_camera();
    let picture = linear_pixels(&app, &view);
    let endless = PerspectiveProjection { far: f32::INFINITY, ..default() };
    set_projection(&mut app, &view, Projection::Perspective(endless));
    settle(&mut app);
    assert_eq!(linear_pixels(&app, &view), picture);
}

#[test]
fn a_bad_frame_leaves_no_trace_in_what_is_held() {
    for mode in HELD {
        let (mut app, view) = above_one_camera();
        app.insert_resource(in_mode(mode, CloudQuality { offsets: true, ..exact(MarchResolution::Full) }));
        settle(&mut app);
        run_updates(&mut app, 16);
        let before = cloud_pixels(&app, &view);
        for spoilt in [Transform::from_xyz(0.0, f32::NAN, 0.0), Transform::from_xyz(0.0, 1e30, 0.0)] {
            app.world_mut().entity_mut(view.camera).insert(spoilt);
            run_updates(&mut app, 1);
            app.world_mut().entity_mut(view.camera).insert((looking_up(), bevy::camera::Exposure { ev100: f32::NAN }));
            run_updates(&mut app, 1);
            app.world_mut().entity_mut(view.camera).insert(bevy::camera::Exposure { ev100: 13.0 });
            run_updates(&mut app, 17);
            for (now, before) in cloud_pixels(&app, &view).iter().zip(&before) {
                assert!(now.is_finite(), "{mode:?}: {now}");
                let off = (*now - *before).abs().max_element() / before.max_element();
                assert!(off < 0.05, "{mode:?}: {now}, before {before}");
            }
        }
    }
}

#[test]
fn a_camera_at_the_planets_centre_shows_no_clouds() {
    is_refused_and_recovers(
        "centre",
        true,
        |app, view| {
            app.world_mut().entity_mut(view.camera).insert(Transform::from_xyz(0.0, -6_360_000.0, 0.0));
        },
        |app, view| {
            app.world_mut().entity_mut(view.camera).insert(looking_up());
        },
    );
}

#[test]
fn a_scene_drawn_at_no_size_shows_no_clouds() {
    is_refused_and_recovers(
        "no size",
        true,
        |app, view| draw_small(app, view, Some(UVec2::ZERO)),
        |app, view| draw_small(app, view, None),
    );
}

/// As an upscaler has it drawn.
fn draw_small(app: &mut App, view: &View, size: Option<UVec2>) {
    let entity = app.world().get::<RenderEntity>(view.camera).expect("it is rendered").id();
    let mut camera = app.sub_app_mut(RenderApp).world_mut().entity_mut(entity);
    match size {
        Some(size) => camera.insert(MainPassResolutionOverride(size)),
        None => camera.remove::<MainPassResolutionOverride>(),
    };
}

#[test]
fn a_minimised_window_is_waited_out() {
    // A viewport of no size is not tried: Bevy's own light clusters fail validation there.
    is_refused_and_recovers(
        "minimised",
        false,
        |app, view| {
            let window = app.world_mut().spawn(Window { resolution: WindowResolution::new(0, 0), ..default() }).id();
            let target = RenderTarget::Window(WindowRef::Entity(window));
            app.world_mut().entity_mut(view.camera).insert(target);
        },
        |app, view| {
            app.world_mut().entity_mut(view.camera).insert(RenderTarget::from(view.target.clone()));
        },
    );
}

#[test]
fn a_target_may_change_its_size() {
    let (mut app, view) = above_one_camera();
    let picture = linear_pixels(&app, &view);
    for size in [UVec2::ONE, UVec2::new(70, 3), SIZE] {
        let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba32Float, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        app.world_mut().resource_mut::<Assets<Image>>().insert(&view.target, image).unwrap();
        settle(&mut app);
        let now = linear_pixels(&app, &view);
        assert_eq!(now.len(), (size.x * size.y) as usize);
        assert!(now.iter().all(|p| p.is_finite() && !p.abs_diff_eq(CLEAR, 1e-2)), "{size}: no clouds");
    }
    assert_eq!(linear_pixels(&app, &view), picture);
}

#[test]
fn from_any_height_all_numbers_are_finite() {
    let (mut app, view) = above_one_camera();
    for (height, seen) in
        [(-1000.0, true), (-1.0e6, false), (0.0, true), (2000.0, true), (1.0e5, false), (1.0e7, false)]
    {
        for pitch in [-90.0_f32, -20.0, 35.0, 90.0] {
            let turned = Quat::from_rotation_x(pitch.to_radians());
            let placed = Transform::from_xyz(0.0, height, 0.0).with_rotation(turned);
            app.world_mut().entity_mut(view.camera).insert(placed);
            settle(&mut app);
            let what = format!("{height} m, {pitch}°");
            let pixels = cloud_pixels(&app, &view);
            let valid = |p: &Vec4| p.is_finite() && p.min_element() >= 0.0 && p.w <= 1.0;
            assert!(pixels.iter().all(valid), "{what}");
            assert!(linear_pixels(&app, &view).iter().all(|p| p.is_finite()), "{what}");
            if seen && pitch == 90.0 {
                assert!(pixels.iter().all(|p| p.w < 0.9), "{what}: no clouds overhead");
            }
        }
    }
}

#[test]
fn in_the_planet_every_mode_is_finite_and_comes_back() {
    const FRAMES: u32 = 6;
    let mut app = clouds_app();
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_linear(&mut app, SIZE, looking_up());
    until_drawn(&mut app);
    settle(&mut app);
    let place = |app: &mut App, height: f32, pitch: f32| {
        let turned = Quat::from_rotation_x(pitch.to_radians());
        let placed = Transform::from_xyz(0.0, height, 0.0).with_rotation(turned);
        app.world_mut().entity_mut(view.camera).insert(placed);
    };
    for mode in all() {
        app.insert_resource(in_mode(mode, noisy()));
        place(&mut app, 10.0, 35.0);
        run_updates(&mut app, FRAMES);
        let before = cloud_pixels(&app, &view);
        assert!(before.iter().any(|p| p.w < 0.5), "{mode:?}: no clouds");
        // There at once, and by a dive through the ground at 2000 m/s.
        let deep = [-3.0, -1000.0, -1e6, -6e6].map(|height| (height, 3));
        let dive = (0..14).map(|k| (200.0 - 33.3 * k as f32, 1));
        for pitch in [-90.0, 35.0] {
            for (height, frames) in deep.into_iter().chain(dive.clone()) {
                place(&mut app, height, pitch);
                run_updates(&mut app, frames);
                let valid = |p: &Vec4| p.is_finite() && p.min_element() >= 0.0 && p.w <= 1.0;
                assert!(cloud_pixels(&app, &view).iter().all(valid), "{mode:?}: {height} m, {pitch}°");
                assert!(linear_pixels(&app, &view).iter().all(|p| p.is_finite()), "{mode:?}: {height} m, {pitch}°");
            }
        }
        // A cut, after which frames are those of a new history.
        place(&mut app, -1e6, 35.0);
        run_updates(&mut app, 1);
        place(&mut app, 10.0, 35.0);
        run_updates(&mut app, FRAMES);
        assert_eq!(cloud_pixels(&app, &view), before, "{mode:?}: not the same once out again");
    }
}

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

#[test]
fn errors_name_field_value_and_range() {
    let error = CloudModel { coverage: 2.0, ..default() }.validate().unwrap_err();
    let SettingsError::OutOfRange { field, value, min, max } = &error else { panic!("{error:?}") };
    assert_eq!([field, value, min, max], ["model.coverage", "2", "-1", "1"]);
}

#[test]
fn without_a_renderer_nothing_happens() {
    // As on a server: with the asset server and nothing else, and with all of Bevy but a GPU.
    let mut bare = App::new();
    bare.add_plugins((MinimalPlugins, bevy::asset::AssetPlugin::default()));
    let mut server = App::new();
    let no_gpu = RenderPlugin { render_creation: WgpuSettings { backends: None, ..default() }.into(), ..default() };
    server.add_plugins(headless_plugins().set(no_gpu));
    for mut app in [bare, server] {
        app.add_plugins(CloudsPlugin);
        app.finish();
        app.cleanup();
        app.world_mut().spawn((Transform::default(), CloudView::default()));
        for _ in 0..3 {
            app.update();
        }
        let status = app.world().resource::<CloudStatus>();
        assert!(status.unsupported().is_some_and(|why| why.contains("no renderer")) && !status.is_ready());
    }
}
