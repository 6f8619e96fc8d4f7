//! Beside Bevy's own effects: temporal anti-aliasing, motion blur, bloom, and a scene drawn smaller than it is shown.

use bevy::{
    anti_alias::taa::TemporalAntiAliasing,
    camera::MainPassResolutionOverride,
    post_process::{bloom::Bloom, motion_blur::MotionBlur},
    prelude::*,
    render::{RenderApp, sync_world::RenderEntity},
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{View, cloud_pixels, clouds_app, spawn_sun, until_drawn},
    gpu::run_updates,
    scene::{CLEAR, linear_pixels, noisy, settle, spawn_linear},
    shared::SharedApp,
    temporal_modes::{HELD, in_mode},
};

const SIZE: UVec2 = UVec2::new(48, 32);
const ORDERS: [CloudOrder; 2] = [CloudOrder::Sorted, CloudOrder::AfterTransparent];

/// The built-in clouds, a camera with an effect, and one without.
fn pair(effect: impl Bundle) -> (SharedApp, [View; 2]) {
    let mut app = clouds_app();
    app.insert_resource(noisy());
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let views = [0, 1].map(|_| spawn_linear(&mut app, SIZE, Transform::default()));
    app.world_mut().entity_mut(views[0].camera).insert(effect);
    until_drawn(&mut app);
    settle(&mut app);
    (app, views)
}

/// Puts both where they are after so many frames of a pan (degrees a frame) and of flight (m a frame).
fn pose(app: &mut App, views: &[View; 2], turn: f32, metres: f32, k: u32) {
    let turned = Quat::from_rotation_y((-turn * k as f32).to_radians()) * Quat::from_rotation_x(0.3);
    let place = Transform::from_xyz(0.0, 900.0, -metres * k as f32).with_rotation(turned);
    for view in views {
        app.world_mut().entity_mut(view.camera).insert(place);
    }
}

/// Starts over at rest, then moves; what either camera sees in the end.
fn moved(app: &mut App, views: &[View; 2], order: CloudOrder, turn: f32, metres: f32) -> [Vec<Vec3>; 2] {
    pose(app, views, turn, metres, 0);
    for view in views {
        let mut cloud = app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds");
        (cloud.order, cloud.reset) = (order, cloud.reset + 1);
    }
    run_updates(app, 8);
    for k in 1..13 {
        pose(app, views, turn, metres, k);
        run_updates(app, 1);
    }
    let pictures = views.each_ref().map(|view| linear_pixels(app, view));
    for (view, picture) in views.iter().zip(&pictures) {
        assert!(picture.iter().all(|p| p.is_finite() && p.min_element() >= 0.0), "{order:?}");
        let clouds = cloud_pixels(app, view);
        assert!(clouds.iter().all(|p| p.is_finite()), "{order:?}");
        let cloudy = clouds.iter().filter(|p| p.w < 0.5).count();
        assert!(cloudy > 100, "{order:?}: {cloudy} cloudy pixels");
        let shown = clouds.iter().zip(picture).filter(|(c, p)| c.w < 0.5 && p.distance(CLEAR) > 0.1).count();
        assert!(shown > cloudy / 2, "{order:?}: {shown} of {cloudy} cloudy pixels show cloud");
    }
    pictures
}

fn mean(picture: &[Vec3]) -> f32 {
    picture.iter().map(|p| p.element_sum() / 3.0).sum::<f32>() / picture.len() as f32
}

/// Mean difference, as a share of the mean brightness.
fn apart([a, b]: &[Vec<Vec3>; 2]) -> f32 {
    let off: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).abs().element_sum() / 3.0).sum();
    off / a.len() as f32 / mean(b)
}

#[test]
fn temporal_anti_aliasing_softens_moving_clouds_a_little() {
    let (mut app, views) = pair(TemporalAntiAliasing::default());
    for order in ORDERS {
        for (what, turn, metres) in [("pan", 0.5, 0.0), ("flight", 0.0, 3.3)] {
            let off = apart(&moved(&mut app, &views, order, turn, metres));
            println!("{order:?} {what}: {off:.5} apart");
            // Past it, clouds are as they are without; before it, they are smoothed, and lag where it follows the sky
            // that they cover.
            let (least, most) = if order == CloudOrder::Sorted { (1e-4, 0.1) } else { (0.0, 1e-3) };
            assert!((least..most).contains(&off), "{order:?} {what}: {off} of the brightness apart");
        }
    }
}

#[test]
fn motion_blur_takes_clouds_along() {
    let (mut app, views) = pair(MotionBlur { shutter_angle: 1.0, samples: 3 });
    for order in ORDERS {
        let still = apart(&moved(&mut app, &views, order, 0.0, 0.0));
        let pan = moved(&mut app, &views, order, 4.0, 0.0);
        let (blurred, bright) = (apart(&pan), mean(&pan[0]) / mean(&pan[1]));
        println!("{order:?}: {still:.5} apart at rest, {blurred:.5} turning, {bright:.4} as bright");
        assert!(still < 1e-3, "{order:?}: {still} of the brightness apart at rest");
        assert!(blurred > 0.01 && blurred < 0.3, "{order:?}: {blurred} of the brightness apart in motion");
        assert!((bright - 1.0).abs() < 0.05, "{order:?}: {bright} as bright");
    }
}

#[test]
fn bloom_brightens_the_sky_beside_a_bright_cloud() {
    let (mut app, views) = pair(Bloom { max_mip_dimension: 64, ..Bloom::NATURAL });
    for order in ORDERS {
        let [bloom, plain] = moved(&mut app, &views, order, 0.0, 0.0);
        let clouds = cloud_pixels(&app, &views[1]);
        let is_near = |k: usize| {
            let at = IVec2::new((k as u32 % SIZE.x) as i32, (k as u32 / SIZE.x) as i32);
            (-2..=2).flat_map(|y| (-2..=2).map(move |x| at + IVec2::new(x, y))).any(|p| {
                let inside = p.cmpge(IVec2::ZERO).all() && p.cmplt(SIZE.as_ivec2()).all();
                inside && clouds[p.y as usize * SIZE.x as usize + p.x as usize].w < 0.3
            })
        };
        let beside: Vec<usize> = (0..clouds.len()).filter(|k| clouds[*k].w > 0.98 && is_near(*k)).collect();
        let gain =
            beside.iter().map(|k| (bloom[*k] - plain[*k]).element_sum() / 3.0).sum::<f32>() / beside.len() as f32;
        println!("{order:?}: {gain:.4} brighter in {} pixels; mean {:.3}", beside.len(), mean(&plain));
        assert!(beside.len() > 10, "{order:?}: {} clear pixels beside cloud", beside.len());
        assert!(gain > 0.01 * mean(&plain), "{order:?}: {gain} of {}", mean(&plain));
    }
}

/// Has the scene drawn at this size: what an upscaler such as DLSS asks for.
fn draw_small(app: &mut App, view: &View, size: UVec2) {
    let entity = app.world().get::<RenderEntity>(view.camera).expect("it is rendered").id();
    app.sub_app_mut(RenderApp).world_mut().entity_mut(entity).insert(MainPassResolutionOverride(size));
}

/// Asks that the upper left part of the one be the other.
fn assert_alike(app: &App, [whole, alone]: [&View; 2], what: &str) {
    let (picture, expected) = (linear_pixels(app, whole), linear_pixels(app, alone));
    for (k, right) in expected.iter().enumerate() {
        let (x, y) = (k as u32 % alone.size.x, k as u32 / alone.size.x);
        let found = picture[(y * whole.size.x + x) as usize];
        assert!(
            found.abs_diff_eq(*right, 4e-3 * right.max_element().max(1.0)),
            "{what}: {found}, not {right} at {x}, {y}"
        );
    }
    assert!(expected.iter().filter(|p| !p.abs_diff_eq(CLEAR, 0.05)).count() > 50, "{what}: no cloud");
    let beside = picture[picture.len() - 1];
    assert!(beside.abs_diff_eq(CLEAR, 1e-3), "{what}: clouds beside the scene: {beside}");
}

#[test]
fn a_scene_drawn_small_keeps_its_history_and_starts_over_at_another_size() {
    // Of one shape, so that all see the same.
    let sizes = [UVec2::new(36, 24), UVec2::new(24, 16)];
    let mut app = clouds_app();
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let whole = spawn_linear(&mut app, SIZE, Transform::default());
    let alone = sizes.map(|size| spawn_linear(&mut app, size, Transform::default()));
    until_drawn(&mut app);
    settle(&mut app);
    for mode in HELD {
        app.insert_resource(in_mode(mode, noisy()));
        let mut k = 0;
        for (size, alone) in sizes.into_iter().zip(&alone) {
            draw_small(&mut app, &whole, size);
            // The other is told so; the one has to see it.
            app.world_mut().get_mut::<CloudView>(alone.camera).expect("it shows clouds").reset += 1;
            for frame in 0..10 {
                let place = Transform::from_xyz(0.0, 900.0, -3.3 * k as f32).with_rotation(Quat::from_rotation_x(0.3));
                for view in [&whole, alone] {
                    app.world_mut().entity_mut(view.camera).insert(place);
                }
                run_updates(&mut app, 1);
                k += 1;
                if [0, 9].contains(&frame) {
                    assert_alike(&app, [&whole, alone], &format!("{mode:?}, {size}, frame {frame}"));
                }
            }
        }
    }
}
