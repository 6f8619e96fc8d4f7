//! Cameras, windows and sizes that show no clouds, or must not disturb them.

use bevy::{
    camera::{MainPassResolutionOverride, RenderTarget},
    prelude::*,
    render::{
        RenderApp,
        render_resource::{TextureFormat, TextureUsages},
        sync_world::RenderEntity,
    },
    window::{WindowRef, WindowResolution},
};
use bevy_cumulus::prelude::*;

use super::{SIZE, above_one_camera, is_bare, looking_up};
use crate::support::{
    app::{View, cloud_pixels, clouds_app, spawn_sun, until_drawn},
    gpu::{run_updates, times_logged},
    scene::{CLEAR, exact, linear_pixels, noisy, render_components, settle, spawn_linear},
    temporal_modes::{HELD, all, in_mode},
};

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
