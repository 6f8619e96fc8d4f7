//! Pictures in motion: as good as at rest, without ghosts, and at rest again without a jump.

use bevy::{camera::Exposure, prelude::*};
use bevy_cumulus::prelude::*;

use crate::{
    gpu::run_updates,
    stage::spawn_box,
    view::{Sky, View, cloud_pixels, clouds_app, spawn_sun, spawn_view, until_drawn},
};

const SIZE: UVec2 = UVec2::new(80, 44);
const MODES: [TemporalMode; 3] = [TemporalMode::SlidingWindow, TemporalMode::Exponential, TemporalMode::Upscale];

/// Colour as it would show, 0 to 1, and transmittance.
type Picture = Vec<Vec4>;

fn quality(temporal: TemporalMode) -> CloudQuality {
    let resolution = MarchResolution::Full;
    CloudQuality { temporal, resolution, step: 160.0, step_growth: 0.012, light_steps: 3, ..CloudQuality::high() }
}

/// So many frames that nothing is left of noise.
fn converged() -> CloudQuality {
    CloudQuality { window: 16, ..quality(TemporalMode::SlidingWindow) }
}

fn picture(app: &App, view: &View) -> Picture {
    let exposure = app.world().get::<Exposure>(view.camera).expect("a camera").exposure();
    let shown = |p: Vec4| (p.truncate() * exposure).map(|c| c / (1.0 + c)).extend(p.w);
    cloud_pixels(app, view).into_iter().map(shown).collect()
}

fn rms(a: &Picture, b: &Picture) -> f32 {
    assert_eq!(a.len(), b.len());
    (a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f32>() / a.len() as f32).sqrt()
}

fn start_over(app: &mut App, view: &View) {
    app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").reset += 1;
}

/// What should be seen now.
fn truth(app: &mut App, view: &View, resolution: MarchResolution) -> Picture {
    app.insert_resource(CloudQuality { resolution, ..converged() });
    start_over(app, view);
    run_updates(app, 16);
    picture(app, view)
}

fn sky() -> (App, View, Entity) {
    let mut app = clouds_app();
    app.insert_resource(quality(TemporalMode::SlidingWindow));
    app.insert_resource(CloudModel { wind: Vec3::new(20.0, 0.0, 0.0), ..default() });
    let sun = spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_view(&mut app, SIZE, Transform::default(), Sky::Black);
    until_drawn(&mut app);
    run_updates(&mut app, 3);
    (app, view, sun)
}

/// One frame's motion.
#[derive(Clone, Copy)]
struct Motion {
    name: &'static str,
    from: Vec3,
    pitch: f32,
    metres: Vec3,
    turn: f32,
    sun: f32,
    seconds: f64,
}

const REST: Motion = Motion {
    name: "",
    from: Vec3::new(0.0, 10.0, 0.0),
    pitch: 0.35,
    metres: Vec3::ZERO,
    turn: 0.0,
    sun: 0.0,
    seconds: 0.0,
};
const FRAME: f64 = 1.0 / 60.0;

/// 30°/s, 200 m/s past, through and over clouds, 2000 m/s over them, wind of 20 m/s, a sun of 15°/min.
const MOTIONS: [Motion; 7] = [
    Motion { name: "pan", turn: 0.5, seconds: FRAME, ..REST },
    Motion { name: "fly", from: Vec3::new(0.0, 900.0, 0.0), pitch: 0.1, metres: Vec3::new(0.0, 0.5, -3.3), ..REST },
    Motion { name: "inside", from: Vec3::new(0.0, 1900.0, 0.0), pitch: 0.0, metres: Vec3::new(0.0, 0.0, -3.3), ..REST },
    Motion { name: "above", from: Vec3::new(0.0, 4500.0, 0.0), pitch: -0.4, metres: Vec3::new(3.3, 0.0, 0.0), ..REST },
    Motion { name: "dash", from: Vec3::new(0.0, 4500.0, 0.0), pitch: -0.4, metres: Vec3::new(33.3, 0.0, 0.0), ..REST },
    Motion { name: "wind", seconds: FRAME, ..REST },
    Motion { name: "sun", sun: 0.25 / 60.0, ..REST },
];

fn pose(app: &mut App, view: &View, sun: Entity, motion: Motion, k: u32) {
    let turned = Quat::from_rotation_y(-(motion.turn * k as f32).to_radians()) * Quat::from_rotation_x(motion.pitch);
    let transform = Transform::from_translation(motion.from + motion.metres * k as f32).with_rotation(turned);
    app.world_mut().entity_mut(view.camera).insert(transform);
    let height = 1.0 + (motion.sun * k as f32).to_radians();
    let light = Transform::default().looking_to(Vec3::new(-0.4, -height, -0.3), Vec3::Y);
    app.world_mut().entity_mut(sun).insert(light);
    app.world_mut().resource_mut::<CloudClock>().seconds = motion.seconds * f64::from(k);
}

#[test]
fn in_motion_a_picture_is_nearly_as_good_as_at_rest() {
    const FRAMES: u32 = 16;
    let (mut app, view, sun) = sky();
    for motion in MOTIONS {
        pose(&mut app, &view, sun, motion, FRAMES - 1);
        let truth = truth(&mut app, &view, MarchResolution::Full);
        let mut single = 0.0;
        for temporal in [TemporalMode::Off].into_iter().chain(MODES) {
            app.insert_resource(quality(temporal));
            start_over(&mut app, &view);
            run_updates(&mut app, FRAMES);
            let rest = rms(&picture(&app, &view), &truth);
            start_over(&mut app, &view);
            for k in 0..FRAMES {
                pose(&mut app, &view, sun, motion, k);
                run_updates(&mut app, 1);
            }
            let moving = rms(&picture(&app, &view), &truth);
            println!("{} {temporal:?}: {rest:.4} at rest, {moving:.4} in motion, {single:.4} alone", motion.name);
            let most = match temporal {
                TemporalMode::Off => {
                    single = moving;
                    f32::INFINITY
                }
                TemporalMode::SlidingWindow => 0.4 * single,
                TemporalMode::Exponential => 0.45 * single,
                TemporalMode::Upscale => 0.75 * single,
            };
            assert!(moving < most, "{} {temporal:?}: {moving} in motion, {single} alone", motion.name);
        }
    }
}

#[test]
fn layers_are_taken_along_with_their_own_wind() {
    const FRAMES: u32 = 12;
    let (mut app, view, sun) = sky();
    // Seconds a frame, in which shapes go by about a texel.
    for (name, seconds) in [("Cumulus", 2.0), ("Cirrus", 3.0)] {
        let mut preset = CloudPreset::named(name).expect("a built-in preset");
        for layer in &mut preset.layers.0 {
            // Whatever is not followed stays as it is.
            (layer.evolution, layer.renewal) = (0.0, 0.0);
            layer.map.size = 256;
        }
        preset.textures = app.world().resource::<CloudTextures>().clone();
        preset.lighting = CloudLighting::default();
        // The hidden layer's wind is nobody's.
        preset.model.wind = Vec3::ZERO;
        preset.apply(app.world_mut());
        let narrow = PerspectiveProjection { fov: 0.4, ..default() };
        app.world_mut().entity_mut(view.camera).insert(Projection::Perspective(narrow));
        run_updates(&mut app, 2);
        until_drawn(&mut app);
        let motion = Motion { pitch: 0.8, seconds, ..REST };
        // The middle of a window of eight: what it shows if nothing is followed is about as far off.
        pose(&mut app, &view, sun, motion, FRAMES - 5);
        let earlier = truth(&mut app, &view, MarchResolution::Full);
        pose(&mut app, &view, sun, motion, FRAMES - 1);
        let truth = truth(&mut app, &view, MarchResolution::Full);
        let behind = rms(&earlier, &truth);
        for temporal in MODES {
            app.insert_resource(quality(temporal));
            start_over(&mut app, &view);
            run_updates(&mut app, FRAMES);
            let rest = rms(&picture(&app, &view), &truth);
            start_over(&mut app, &view);
            for k in 0..FRAMES {
                pose(&mut app, &view, sun, motion, k);
                run_updates(&mut app, 1);
            }
            let moving = rms(&picture(&app, &view), &truth);
            println!("{name} {temporal:?}: {rest:.4} at rest, {moving:.4} in motion, {behind:.4} left behind");
            let most = rest + 0.4 * behind;
            assert!(moving < most, "{name} {temporal:?}: {moving} in motion, {rest} at rest, {behind} left behind");
        }
    }
}

#[test]
fn what_a_box_uncovers_is_right_within_four_frames() {
    const SPEED: u32 = 3;
    const SETTLED: u32 = 4;
    let (mut app, view, sun) = sky();
    pose(&mut app, &view, sun, REST, 0);
    // A wall between camera and clouds, as high as the view; its right edge moves to the left.
    let camera = *app.world().get::<Transform>(view.camera).expect("a camera");
    let pixel = 2.0 * 0.414_213_56 / SIZE.y as f32;
    let wall_at = |edge: f32| camera * Transform::from_xyz((edge - 40.0) * pixel * 200.0 - 100.0, 0.0, -200.0);
    let wall = spawn_box(&mut app, Vec3::new(200.0, 400.0, 0.1), wall_at(70.0), Vec3::ONE);
    for (resolution, texel) in [(MarchResolution::Full, 1), (MarchResolution::Half, 2)] {
        app.world_mut().entity_mut(wall).insert(wall_at(-200.0));
        let open = truth(&mut app, &view, resolution);
        let mut alone = 0.0;
        for temporal in [TemporalMode::Off].into_iter().chain(MODES) {
            app.insert_resource(CloudQuality { resolution, ..quality(temporal) });
            app.world_mut().entity_mut(wall).insert(wall_at(70.0));
            run_updates(&mut app, 12);
            let (mut error, mut pixels, mut ghosts) = (0.0, 0, 0);
            for k in 0..12 {
                let edge = 70 - SPEED * k;
                app.world_mut().entity_mut(wall).insert(wall_at(edge as f32));
                run_updates(&mut app, 1);
                let now = picture(&app, &view);
                // Uncovered four frames ago or more, but covered at first.
                for (i, (now, open)) in now.iter().zip(&open).enumerate() {
                    let x = i as u32 % SIZE.x;
                    if x > edge + SPEED * (SETTLED - 1) + texel && x < 70 - texel {
                        error += now.distance_squared(*open);
                        pixels += 1;
                        // Cloud of which not half is there.
                        ghosts += u32::from(open.w < 0.5 && now.w > 0.5 + 0.5 * open.w);
                    }
                }
            }
            let error = (error / pixels as f32).sqrt();
            println!("{temporal:?} {resolution:?}: {error:.4} over {pixels} pixels, {ghosts} ghosts");
            assert!(pixels > 3000, "{pixels}");
            let most = match temporal {
                TemporalMode::Off => {
                    alone = error;
                    f32::INFINITY
                }
                TemporalMode::Upscale => alone,
                _ => 0.45 * alone,
            };
            // Single frames are too noisy to tell.
            let few = temporal == TemporalMode::Off || ghosts * 150 < pixels;
            assert!(error < most && few, "{temporal:?} {resolution:?}: {error} for {alone}, {ghosts} of {pixels}");
        }
    }
}

#[test]
fn a_shift_of_the_origin_does_not_show() {
    let (mut app, view, sun) = sky();
    for temporal in MODES {
        app.insert_resource(quality(temporal));
        pose(&mut app, &view, sun, REST, 0);
        start_over(&mut app, &view);
        run_updates(&mut app, 17);
        let before = picture(&app, &view);
        run_updates(&mut app, 1);
        let usual = rms(&picture(&app, &view), &before);
        // The world moves away under the camera by as much as the offset grows.
        let shift = Vec3::new(4096.0, 0.0, -8192.0);
        app.world_mut().get_mut::<Transform>(view.camera).expect("a camera").translation -= shift;
        app.world_mut().resource_mut::<CloudModel>().world_offset += shift.as_dvec3();
        run_updates(&mut app, 1);
        let shifted = rms(&picture(&app, &view), &before);
        app.world_mut().resource_mut::<CloudModel>().world_offset -= shift.as_dvec3();
        start_over(&mut app, &view);
        run_updates(&mut app, 1);
        println!("{temporal:?}: {usual:.5} from frame to frame, {shifted:.5} over the shift");
        assert!(shifted < 2.0 * usual + 1e-3, "{temporal:?}: {shifted} for {usual}");
    }
}

#[test]
fn crossing_the_layer_at_2000_m_per_s_has_no_pop() {
    // Frames that one is compared with on either side: entering thick cloud takes no more of them.
    const NEAR: usize = 2;
    let (mut app, view, _) = sky();
    let climb = Vec3::new(3.0, 33.2, -4.0);
    let mut worst = 0.0_f32;
    for temporal in [TemporalMode::SlidingWindow, TemporalMode::Exponential] {
        app.insert_resource(quality(temporal));
        // From below the lower shell through cloud and the upper shell to above it.
        let mut means = Vec::new();
        for k in 0..110 {
            let at = Vec3::new(0.0, 700.0, 0.0) + climb * k as f32;
            let level = Transform::from_translation(at).with_rotation(Quat::from_rotation_x(-0.1));
            app.world_mut().entity_mut(view.camera).insert(level);
            run_updates(&mut app, 1);
            let now = picture(&app, &view);
            means.push(now.iter().map(|p| p.element_sum()).sum::<f32>() / now.len() as f32);
        }
        let changes: Vec<f32> = means.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let typical = changes.iter().sum::<f32>() / changes.len() as f32;
        for k in NEAR..changes.len() - NEAR {
            let mut near = [&changes[k - NEAR..k], &changes[k + 1..=k + NEAR]].concat();
            near.sort_by(f32::total_cmp);
            // Where next to nothing changes any change is many times that.
            let jump = changes[k] / near[NEAR].max(typical);
            worst = worst.max(jump);
            assert!(jump < 3.0, "{temporal:?}: frame {k} changes by {}, those around by {near:?}", changes[k]);
        }
    }
    println!("largest change {worst:.2} times those around");
}
