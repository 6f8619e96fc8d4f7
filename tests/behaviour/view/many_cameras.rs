//! Several cameras that share a target, a rig or a scene: each sees what it would alone.

use bevy::{
    camera::{RenderTarget, Viewport},
    prelude::*,
};
use bevy_cumulus::{CloudsPlugin, ModelShader, prelude::*};

use crate::support::{
    app::{Sky, View, cloud_pixels, clouds_app, new_clouds_app_with, shown_pixels, spawn_sun, spawn_view, until_drawn},
    gpu::run_updates,
    scene::{
        CLEAR, exact, greatest_difference, linear_pixels, noisy, render_components, settle, slab_app, spawn_box,
        spawn_linear,
    },
    shared::SharedApp,
};

const SIZE: UVec2 = UVec2::new(32, 24);

fn looking(yaw: f32) -> Transform {
    let turned = Quat::from_rotation_y(yaw.to_radians()) * Quat::from_rotation_x(35_f32.to_radians());
    Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(turned)
}

/// The built-in clouds, in frames that are noisy alone and held for eight.
fn noisy_app() -> SharedApp {
    let mut app = clouds_app();
    app.insert_resource(CloudModel { wind: Vec3::new(20.0, 0.0, 0.0), coverage: 0.3, ..default() });
    app.insert_resource(noisy());
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    app
}

/// Another camera like this one, into the same target, with a part of it.
fn beside(app: &mut App, view: &View, order: isize, corner: UVec2, size: UVec2) -> Entity {
    let second = app.world_mut().entity_mut(view.camera).clone_and_spawn();
    let viewport = Viewport { physical_position: corner, physical_size: size, ..default() };
    let clear_color = ClearColorConfig::None;
    app.world_mut().entity_mut(second).remove::<CloudBuffer>().insert(Camera {
        order,
        clear_color,
        viewport: Some(viewport),
        ..default()
    });
    second
}

/// Part of a picture.
fn crop(picture: &[Vec3], width: u32, corner: UVec2, size: UVec2) -> Vec<Vec3> {
    let rows = corner.y..corner.y + size.y;
    rows.flat_map(|y| (corner.x..corner.x + size.x).map(move |x| (y * width + x) as usize))
        .map(|i| picture[i])
        .collect()
}

#[test]
fn each_eye_of_a_stereo_pair_has_its_own_history() {
    let mut app = noisy_app();
    // Two eyes of one rig, side by side in one target, and beside them each eye's twin with a target of its own.
    let wide = UVec2::new(2 * SIZE.x, SIZE.y);
    let left = spawn_linear(&mut app, wide, Transform::default());
    let half = Viewport { physical_size: SIZE, ..default() };
    app.world_mut().get_mut::<Camera>(left.camera).unwrap().viewport = Some(half);
    let right = beside(&mut app, &left, 1, UVec2::new(SIZE.x, 0), SIZE);
    let twins = [0.0, 1.0].map(|_| spawn_linear(&mut app, SIZE, Transform::default()));
    let eyes = [(left.camera, -30.0), (right, 30.0)];
    let rig = app.world_mut().spawn((Transform::default(), Visibility::default())).id();
    for (eye, across) in eyes {
        // Giants' eyes, so that each sees another sky.
        app.world_mut().entity_mut(eye).insert((Transform::from_xyz(across, 0.0, 0.0), ChildOf(rig)));
    }
    let pose = |app: &mut App, k: u32| {
        let turned = Quat::from_rotation_y(-0.01 * k as f32) * Quat::from_rotation_x(0.6);
        let rig_now = Transform::from_xyz(0.0, 700.0, -10.0 * k as f32).with_rotation(turned);
        app.world_mut().entity_mut(rig).insert(rig_now);
        for (twin, (_, across)) in twins.iter().zip(eyes) {
            app.world_mut().entity_mut(twin.camera).insert(rig_now * Transform::from_xyz(across, 0.0, 0.0));
        }
    };
    pose(&mut app, 0);
    until_drawn(&mut app);
    for k in 1..12 {
        pose(&mut app, k);
        run_updates(&mut app, 1);
    }
    let both = linear_pixels(&app, &left);
    let [seen_left, seen_right] = [0, SIZE.x].map(|x| crop(&both, wide.x, UVec2::new(x, 0), SIZE));
    let [alone_left, alone_right] = twins.each_ref().map(|twin| linear_pixels(&app, twin));
    let apart = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f32>() / a.len() as f32;
    // The rig's and the twins' places differ in their last digits.
    let (left, right) = (apart(&seen_left, &alone_left), apart(&seen_right, &alone_right));
    let (eyes, swapped) = (apart(&seen_left, &seen_right), apart(&seen_left, &alone_right));
    println!("{left:.5} and {right:.5} from each eye alone, {eyes:.5} from the other, {swapped:.5}");
    assert!(left.max(right) < 0.02 * eyes.min(swapped), "{left} and {right} from alone, {eyes} from each other");
}

#[test]
fn a_view_that_cannot_be_drawn_costs_the_others_no_history() {
    // Cloud in lumps, so that single frames are noisy. Without `extinction_bound` the path tracer cannot draw it.
    let lumps = ModelShader(
        "import package::model::medium::{Medium, empty_medium};
        fn model_bounds() -> vec2<f32> { return vec2(1000.0, 2000.0); }
        fn density_bound(p: vec3<f32>, lod: f32) -> f32 { return 1.0; }
        fn sample_medium(p: vec3<f32>, lod: f32) -> Medium {
            let lump = sin(p.x * 0.02) + sin(p.y * 0.03) + sin(p.z * 0.02);
            if lump < 0.5 || p.y < 1000.0 || p.y > 2000.0 { return empty_medium(); }
            return Medium(1.0, 0.01, vec3(0.99), 0.5, vec2(500.0), vec4(1.0, 0.0, 0.0, 0.0));
        }"
        .to_owned(),
    );
    let mut app = new_clouds_app_with((move |app: &mut App| _ = app.insert_resource(lumps.clone()), CloudsPlugin));
    let quality = CloudQuality { light_steps: 2, ..noisy() };
    app.insert_resource(quality.clone());
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_view(&mut app, SIZE, looking(0.0), Sky::Black);
    until_drawn(&mut app);
    let filled = |app: &mut App, temporal| {
        let own = CloudQuality { temporal, ..quality.clone() };
        let mut shown = app.world_mut().get_mut::<CloudView>(view.camera).unwrap();
        (shown.quality, shown.reset) = (Some(own), shown.reset + 1);
        run_updates(app, 12);
        cloud_pixels(app, &view)
    };
    let apart = |a: &[Vec4], b: &[Vec4]| a.iter().zip(b).map(|(a, b)| (a.w - b.w).abs()).sum::<f32>() / a.len() as f32;
    let alone = filled(&mut app, TemporalMode::SlidingWindow);
    let single = filled(&mut app, TemporalMode::Off);
    let noise = apart(&single, &alone);
    assert!(noise > 0.01, "single frames have no noise: {noise}");
    let traced = spawn_view(&mut app, SIZE, looking(90.0), Sky::Black);
    let reference = CloudView { quality: Some(CloudQuality::reference()), ..default() };
    app.world_mut().entity_mut(traced.camera).insert(reference);
    settle(&mut app);
    assert!(!app.world().resource::<CloudStatus>().is_ready(), "the second view is drawn, so nothing is tested");
    let beside = apart(&filled(&mut app, TemporalMode::SlidingWindow), &alone);
    println!("{beside:.5} beside it, {noise:.5} if all is lost");
    // The same frames over again, to the bit.
    assert!(beside < 1e-6, "{beside} beside it");
}

#[test]
fn a_picture_in_a_picture_has_its_own_quality_and_leaves_the_rest_alone() {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let size = UVec2::new(64, 48);
    let main = spawn_linear(&mut app, size, looking(0.0));
    let alone = spawn_linear(&mut app, SIZE, looking(120.0));
    let coarse = CloudView { quality: Some(exact(MarchResolution::Quarter)), ..default() };
    app.world_mut().entity_mut(alone.camera).insert(coarse.clone());
    until_drawn(&mut app);
    settle(&mut app);
    let whole = linear_pixels(&app, &main);
    let corner = UVec2::new(27, 19);
    let small = beside(&mut app, &main, 1, corner, SIZE);
    app.world_mut().entity_mut(small).insert((looking(120.0), coarse));
    settle(&mut app);
    let both = linear_pixels(&app, &main);
    let expected = linear_pixels(&app, &alone);
    // It clears nothing: clouds are drawn over the picture that is there, which shows through them.
    for (k, pixel) in both.iter().enumerate() {
        let at = UVec2::new(k as u32 % size.x, k as u32 / size.x);
        let inside = at.cmpge(corner).all() && at.cmplt(corner + SIZE).all();
        if inside {
            let own = at - corner;
            let fresh = expected[(own.y * SIZE.x + own.x) as usize];
            assert!(pixel.distance(whole[k]) > 1e-3, "no second layer of clouds at {at}");
            assert!(pixel.cmpge(fresh * 0.5).all(), "{pixel} at {at}, {fresh} alone");
        } else {
            assert_eq!(*pixel, whole[k], "the small picture changes the large one at {at}");
        }
    }
    // With a background of its own it shows what the other camera of this quality does, and none of another quality.
    let own = ClearColorConfig::Custom(Color::linear_rgb(CLEAR.x, CLEAR.y, CLEAR.z));
    app.world_mut().get_mut::<Camera>(small).unwrap().clear_color = own;
    settle(&mut app);
    let apart = |app: &App| {
        let both = linear_pixels(app, &main);
        greatest_difference(&crop(&both, size.x, corner, SIZE), &expected)
    };
    let right = apart(&app);
    assert!(right < 4e-3, "the small picture is {right} from what its camera sees");
    let fine = CloudView { quality: Some(exact(MarchResolution::Full)), ..default() };
    app.world_mut().entity_mut(small).insert(fine);
    settle(&mut app);
    let wrong = apart(&app);
    println!("{right} from its own, {wrong} where its quality is not");
    assert!(wrong > 10.0 * right.max(1e-3), "its quality does not matter: {wrong} for {right}");
    app.world_mut().despawn(small);
    settle(&mut app);
    assert_eq!(linear_pixels(&app, &main), whole, "the large picture is not the same again");
}

#[test]
fn clouds_in_a_texture_show_on_what_wears_it() {
    let mut app = noisy_app();
    let inner = spawn_view(&mut app, UVec2::new(48, 32), looking(0.0), Sky::Black);
    app.world_mut().get_mut::<Camera>(inner.camera).unwrap().order = -1;
    let outer = spawn_view(&mut app, UVec2::new(48, 32), Transform::from_xyz(0.0, -500.0, 0.0), Sky::Black);
    // The camera below the ground that looks at the screen has no clouds of its own.
    app.world_mut().entity_mut(outer.camera).remove::<CloudView>();
    let screen = spawn_box(&mut app, Vec3::new(30.0, 20.0, 0.1), Transform::from_xyz(0.0, -500.0, -20.0), Vec3::ONE);
    let handle = app.world().get::<MeshMaterial3d<StandardMaterial>>(screen).expect("a material").0.clone();
    let texture = inner.target.clone();
    app.world_mut().resource_mut::<Assets<StandardMaterial>>().get_mut(&handle).unwrap().base_color_texture =
        Some(texture);
    until_drawn(&mut app);
    settle(&mut app);
    run_updates(&mut app, 8);
    let mean = |view: &View| {
        let pixels = shown_pixels(&app, view);
        pixels.iter().map(|p| f32::from(p[1])).sum::<f32>() / pixels.len() as f32
    };
    let (inside, outside) = (mean(&inner), mean(&outer));
    assert!(inside > 20.0, "there is nothing in the texture: {inside}");
    assert!(outside > 0.3 * inside, "the screen shows {outside} of {inside}");
}

#[test]
fn cameras_come_and_go_and_leave_nothing_behind() {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let first = spawn_linear(&mut app, SIZE, looking(0.0));
    until_drawn(&mut app);
    settle(&mut app);
    let picture = linear_pixels(&app, &first);
    let mut others: Vec<View> = Vec::new();
    for k in 0..12 {
        others.push(spawn_linear(&mut app, SIZE + k, looking(30.0 * k as f32)));
        if k % 3 == 2 {
            for gone in others.drain(..2) {
                app.world_mut().despawn(gone.camera);
            }
        }
        run_updates(&mut app, 1);
        assert_eq!(linear_pixels(&app, &first), picture, "camera {k} changes the first one's picture");
    }
    for gone in others {
        app.world_mut().despawn(gone.camera);
    }
    // None at all for a while.
    app.world_mut().entity_mut(first.camera).remove::<CloudView>();
    run_updates(&mut app, 3);
    assert!(render_components(&app, first.camera).is_empty(), "{:?}", render_components(&app, first.camera));
    assert!(!app.world().resource::<CloudStatus>().is_ready());
    app.world_mut().despawn(first.camera);
    run_updates(&mut app, 3);
    let again = spawn_linear(&mut app, SIZE, looking(0.0));
    settle(&mut app);
    assert_eq!(linear_pixels(&app, &again), picture, "not the same as before");
    assert!(app.world().resource::<CloudStatus>().is_ready());
    // A target that is another camera's as well, with another format, is drawn by both.
    let shared = app.world_mut().entity_mut(again.camera).clone_and_spawn();
    app.world_mut().entity_mut(shared).insert((
        Camera { order: 1, ..default() },
        RenderTarget::from(again.target.clone()),
        looking(90.0),
    ));
    settle(&mut app);
    assert_ne!(linear_pixels(&app, &again), picture, "the second camera draws nothing over the first");
}
