//! Light and exposure; none, one or many cameras, whole targets and parts of them.

use bevy::{
    camera::{Exposure, Viewport},
    light::light_consts::lux,
    prelude::*,
    render::render_resource::TextureUsages,
};
use bevy_cumulus::{CloudDepth, prelude::*};

use crate::support::{
    app::{View, cloud_pixels, read_image, spawn_sun, until_drawn},
    gpu::run_updates,
    half::from_half,
    scene::{
        CLEAR, enable, exact, greatest_difference, linear_pixels, render_components, settle, slab_app, spawn_linear,
        without_clouds,
    },
    shared::SharedApp,
};

const SIZE: UVec2 = UVec2::new(32, 24);

/// Looks up to the clouds, towards this compass direction (degrees).
fn looking(yaw: f32) -> Transform {
    let turned = Quat::from_rotation_y(yaw.to_radians()) * Quat::from_rotation_x(35_f32.to_radians());
    Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(turned)
}

/// A slab above one camera, with the sun that [`slab_app`] brings.
fn above_one_camera() -> (SharedApp, View) {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let view = spawn_linear(&mut app, SIZE, looking(0.0));
    until_drawn(&mut app);
    settle(&mut app);
    (app, view)
}

fn radiance(app: &App, view: &View) -> Vec<Vec3> {
    cloud_pixels(app, view).iter().map(|p| p.truncate()).collect()
}

fn transmittance(app: &App, view: &View) -> Vec<f32> {
    cloud_pixels(app, view).iter().map(|p| p.w).collect()
}

fn mean(pixels: &[Vec3]) -> f32 {
    pixels.iter().map(|p| p.element_sum() / 3.0).sum::<f32>() / pixels.len() as f32
}

fn is_bare(app: &App, view: &View) -> bool {
    linear_pixels(app, view).iter().all(|p| p.abs_diff_eq(CLEAR, 1e-3))
}

#[test]
fn the_brightest_light_is_the_sun_and_without_one_clouds_are_dark() {
    let (mut app, view) = above_one_camera();
    let (lit, through) = (radiance(&app, &view), transmittance(&app, &view));
    // A dimmer light from elsewhere changes nothing.
    let other = spawn_sun(&mut app, Vec3::new(1.0, -0.4, 0.2));
    let light = |illuminance| DirectionalLight { illuminance, color: Color::linear_rgb(1.0, 0.5, 0.2), ..default() };
    app.world_mut().entity_mut(other).insert(light(0.9 * lux::RAW_SUNLIGHT));
    settle(&mut app);
    assert_eq!(radiance(&app, &view), lit, "the dimmer light matters");
    // Once it is the brighter one, it is the sun alone.
    app.world_mut().entity_mut(other).insert(light(10.0 * lux::RAW_SUNLIGHT));
    settle(&mut app);
    let both = radiance(&app, &view);
    assert!(greatest_difference(&both, &lit) > 0.5 * mean(&lit));
    let suns: Vec<Entity> =
        app.world_mut().query_filtered::<Entity, With<DirectionalLight>>().iter(app.world()).collect();
    for sun in suns.into_iter().filter(|sun| *sun != other) {
        app.world_mut().despawn(sun);
    }
    settle(&mut app);
    assert_eq!(radiance(&app, &view), both, "the light that was not the sun mattered");
    // The sky's light follows the sun where there is no atmosphere: of it alone there is some...
    app.insert_resource(CloudLighting { octaves: 0, ..default() });
    settle(&mut app);
    let ambient = mean(&radiance(&app, &view));
    assert!(ambient > 0.01 * mean(&both) && ambient < 0.9 * mean(&both), "{ambient} of {}", mean(&both));
    // ...and without any sun none, though the clouds still cover what is behind.
    app.world_mut().despawn(other);
    settle(&mut app);
    assert!(radiance(&app, &view).iter().all(|p| *p == Vec3::ZERO));
    assert_eq!(transmittance(&app, &view), through);
}

#[test]
fn twice_the_exposure_is_twice_as_bright_and_history_goes_on() {
    let (mut app, view) = above_one_camera();
    // Eight noisy frames, so that a restart would show.
    let noisy = CloudQuality {
        offsets: true,
        temporal: TemporalMode::SlidingWindow,
        window: 8,
        ..exact(MarchResolution::Full)
    };
    app.insert_resource(CloudQuality { step: 700.0, ..noisy });
    run_updates(&mut app, 1);
    let first = radiance(&app, &view);
    run_updates(&mut app, 15);
    let (before, shown) = (radiance(&app, &view), linear_pixels(&app, &view));
    let noise = greatest_difference(&first, &before);
    app.world_mut().entity_mut(view.camera).insert(Exposure { ev100: 12.0 });
    run_updates(&mut app, 1);
    let (after, brighter) = (radiance(&app, &view), linear_pixels(&app, &view));
    let jump = greatest_difference(&before, &after);
    assert!(noise > 0.005 * mean(&before), "one frame is as good as eight: nothing is tested");
    assert!(jump < 0.1 * noise, "the exposure's change shows: {jump}, where a restart makes {noise}");
    let through = transmittance(&app, &view);
    for ((dim, bright), through) in shown.iter().zip(&brighter).zip(through) {
        let behind = CLEAR * through;
        let (dim, bright) = (*dim - behind, *bright - behind);
        assert!(bright.abs_diff_eq(2.0 * dim, 4e-3 * bright.max_element().max(1.0)), "{bright} for twice {dim}");
    }
    // By a factor of 128 in a frame it goes on as well.
    for ev100 in [16.0, 9.0] {
        app.world_mut().entity_mut(view.camera).insert(Exposure { ev100 });
        run_updates(&mut app, 1);
        let jump = greatest_difference(&radiance(&app, &view), &before);
        assert!(jump < 0.1 * noise, "EV {ev100} shows: {jump}, where a restart makes {noise}");
    }
    run_updates(&mut app, 16);
    let relative = greatest_difference(&radiance(&app, &view), &before) / mean(&before);
    assert!(relative < 0.02, "cd/m² depend on the exposure: {relative}");
}

#[test]
fn clouds_stay_inside_the_viewport() {
    let (mut app, view) = above_one_camera();
    let size = UVec2::new(2 * SIZE.x, SIZE.y + 8);
    let half = spawn_linear(&mut app, size, looking(0.0));
    let corner = UVec2::new(SIZE.x - 3, 5);
    let viewport = Viewport { physical_position: corner, physical_size: SIZE, ..default() };
    app.world_mut().get_mut::<Camera>(half.camera).unwrap().viewport = Some(viewport);
    for resolution in [MarchResolution::Full, MarchResolution::Half, MarchResolution::Quarter] {
        app.insert_resource(exact(resolution));
        settle(&mut app);
        let outside = without_clouds(&mut app, &half);
        let (alone, part) = (linear_pixels(&app, &view), linear_pixels(&app, &half));
        for (k, pixel) in part.iter().enumerate() {
            let at = UVec2::new(k as u32 % size.x, k as u32 / size.x);
            let inside = at.cmpge(corner).all() && at.cmplt(corner + SIZE).all();
            let expected = if inside {
                let own = at - corner;
                alone[(own.y * SIZE.x + own.x) as usize]
            } else {
                outside[k]
            };
            let tolerance = 2e-3 * expected.max_element().max(1.0);
            assert!(pixel.abs_diff_eq(expected, tolerance), "{resolution:?} at {at}: {pixel} for {expected}");
        }
        let published = cloud_pixels(&app, &half);
        assert!(published[0].w < 0.9, "{resolution:?}: the buffer does not start at the viewport's corner");
    }
}

#[test]
fn pictures_of_a_few_texels_are_upscaled_too() {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let off = exact(MarchResolution::Full);
    for size in [UVec2::ONE, UVec2::new(3, 2), UVec2::new(2, 9), UVec2::new(5, 6)] {
        let view = spawn_linear(&mut app, size, looking(0.0));
        let mut image = CloudDepth::image(size.x, size.y);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let depth = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.world_mut().entity_mut(view.camera).insert(CloudDepth(depth.clone()));
        app.insert_resource(off.clone());
        until_drawn(&mut app);
        settle(&mut app);
        // Where cloud begins, in kilometres.
        let front = |app: &App| -> Vec<f64> {
            let texels: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(app, &depth));
            texels.into_iter().map(|texel| from_half(texel[2])).collect()
        };
        let (whole, begins) = (cloud_pixels(&app, &view), front(&app));
        app.insert_resource(CloudQuality { temporal: TemporalMode::Upscale, block: UpscaleBlock::Four, ..off.clone() });
        for k in 0..48 {
            run_updates(&mut app, 1);
            let (now, fronts) = (cloud_pixels(&app, &view), front(&app));
            for i in 0..whole.len() {
                let (now, exact) = (now[i], whole[i]);
                let there = now.x > 0.3 * exact.x && (now.w - exact.w).abs() < 0.45;
                assert!(now.is_finite() && there, "{size}, frame {k}: {now}, {exact} is right");
                // It is told from the nearest texel that is marched, up to two rows of 22° off.
                let off = fronts[i] / begins[i];
                assert!((0.4..2.5).contains(&off), "{size}, frame {k}: from {} km, {} is right", fronts[i], begins[i]);
                // Once every texel has been marched a guess counts for a twentieth of that sample.
                let bright = now.truncate().distance(exact.truncate()) < 0.05 * exact.length();
                let settled = bright && (now.w - exact.w).abs() < 0.02;
                assert!(k < 16 || settled, "{size}, frame {k}: {now}, {exact} is right");
            }
        }
        app.world_mut().despawn(view.camera);
    }
}

#[test]
fn two_cameras_see_their_own_clouds() {
    let (mut app, view) = above_one_camera();
    let alone = linear_pixels(&app, &view);
    let second = spawn_linear(&mut app, UVec2::new(20, 28), looking(100.0));
    let plain = spawn_linear(&mut app, SIZE, looking(0.0));
    app.world_mut().entity_mut(plain.camera).remove::<CloudView>();
    settle(&mut app);
    let beside = linear_pixels(&app, &second);
    assert_eq!(linear_pixels(&app, &view), alone, "a second camera changes the first one's clouds");
    assert!(is_bare(&app, &plain), "a camera without CloudView shows clouds");
    app.world_mut().despawn(view.camera);
    settle(&mut app);
    assert_eq!(linear_pixels(&app, &second), beside, "the second camera needs the first");
    assert!(beside.iter().all(|p| !p.abs_diff_eq(CLEAR, 1e-2)), "the second camera shows no clouds");
}

#[test]
fn what_is_off_costs_nothing_and_comes_back() {
    let (mut app, view) = above_one_camera();
    let on = linear_pixels(&app, &view);
    assert!(!render_components(&app, view.camera).is_empty());
    let ways: [(&str, fn(&mut App, &View, bool)); 3] = [
        ("enabled = false", enable),
        ("no CloudView", |app, view, on| {
            let mut camera = app.world_mut().entity_mut(view.camera);
            if on {
                camera.insert(CloudView::default())
            } else {
                camera.remove::<CloudView>()
            };
        }),
        ("inactive", |app, view, on| app.world_mut().get_mut::<Camera>(view.camera).unwrap().is_active = on),
    ];
    for (what, switch) in ways {
        switch(&mut app, &view, false);
        settle(&mut app);
        let left = render_components(&app, view.camera);
        assert!(left.is_empty(), "{what}: {left:?} are left");
        assert!(!app.world().resource::<CloudStatus>().is_ready(), "{what}: ready to draw nothing");
        if what != "inactive" {
            assert!(is_bare(&app, &view), "{what}: clouds are drawn");
        }
        switch(&mut app, &view, true);
        settle(&mut app);
        assert_eq!(linear_pixels(&app, &view), on, "{what}: not the same when back");
    }
}
