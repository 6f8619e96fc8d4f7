//! The sliding window: what is shown is the mean of the frames held, as they are stored.
//!
//! Frames are read in lock step: an update, then the GPU's end, then both images.

use bevy::{
    camera::{Exposure, RenderTarget, Viewport},
    math::DVec2,
    prelude::*,
    render::render_resource::TextureFormat,
};
use bevy_cumulus::testing::textures as captured;
use bevy_cumulus::{
    CloudFrame,
    prelude::*,
    textures::{CloudTextureSlot, n_rooks::n_rooks},
};

use crate::support::{
    app::{Sky, View, cloud_pixels, clouds_app, read_image, spawn_sun, spawn_view, until_drawn},
    gpu::run_updates,
    half::{from_half, worst_relative},
    shared::SharedApp,
    slab::{directions_through, exact_march, full_radiance, length_in_slab, looking, slab_app},
    temporal_modes::{HELD, Mode, in_mode},
};

const SIZE: UVec2 = UVec2::new(20, 12);

/// A picture: radiance times exposure, and transmittance.
type Picture = Vec<[f64; 4]>;

/// A view whose single frames can be read.
struct Watched {
    view: View,
    frame: Handle<Image>,
    size: UVec2,
}

fn quality(window: u32) -> CloudQuality {
    CloudQuality { resolution: MarchResolution::Full, step: 160.0, light_steps: 2, window, ..default() }
}

fn watched_app() -> (SharedApp, Watched) {
    let mut app = clouds_app();
    app.insert_resource(quality(4));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 0.4, -1.0), Vec3::Y);
    let view = spawn_view(&mut app, SIZE, looking, Sky::Black);
    let frame = app.world_mut().resource_mut::<Assets<Image>>().add(CloudFrame::image(SIZE.x, SIZE.y));
    app.world_mut().entity_mut(view.camera).insert(CloudFrame(frame.clone()));
    until_drawn(&mut app);
    // So that nothing is still being baked or loaded.
    run_updates(&mut app, 3);
    let size = view.size;
    (app, Watched { view, frame, size })
}

impl Watched {
    /// Runs one frame; returns it as stored, and what is shown then, times `exposure`.
    fn step(&self, app: &mut App, exposure: f32) -> [Picture; 2] {
        run_updates(app, 1);
        let halves: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(app, &self.frame));
        let stored: Picture = halves.into_iter().map(|p| p.map(from_half)).collect();
        let shown: Picture = cloud_pixels(app, &self.view)
            .into_iter()
            .map(|p| (p.xyz() * exposure).extend(p.w).to_array().map(f64::from))
            .collect();
        [stored, shown].map(|picture| self.cropped(&picture))
    }

    /// The part that the view covers now.
    fn cropped(&self, picture: &Picture) -> Picture {
        let rows = picture.chunks(SIZE.x as usize).take(self.size.y as usize);
        rows.flat_map(|row| &row[..self.size.x as usize]).copied().collect()
    }
}

fn exposure() -> f32 {
    Exposure { ev100: 13.0 }.exposure()
}

fn start_over(app: &mut App, watched: &Watched) {
    let mut view = app.world_mut().get_mut::<CloudView>(watched.view.camera).expect("it shows clouds");
    view.reset += 1;
}

fn mean(pictures: &[Picture]) -> Picture {
    (0..pictures[0].len())
        .map(|i| [0, 1, 2, 3].map(|c| pictures.iter().map(|p| p[i][c]).sum::<f64>() / pictures.len() as f64))
        .collect()
}

/// The largest difference, relative to the value (or to 1e-3, where white is about 1).
fn difference(a: &Picture, b: &Picture) -> f64 {
    assert_eq!(a.len(), b.len());
    worst_relative(a.as_flattened(), b.as_flattened(), 1e-3)
}

#[test]
fn what_is_shown_is_the_mean_of_the_last_frames_as_stored() {
    let (mut app, watched) = watched_app();
    for window in [1, 2, 5, 8, 16] {
        let n = window as usize;
        app.insert_resource(quality(window));
        let mut frames: Vec<Picture> = Vec::new();
        for k in 0..n + 7 {
            let [stored, shown] = watched.step(&mut app, exposure());
            frames.push(stored);
            // While it fills, the mean of those there are; then of the last n.
            let held = &frames[(k + 1).saturating_sub(n)..];
            let error = difference(&shown, &mean(held));
            assert!(error < 1e-5, "window {window}, frame {k}: {error:e}");
            // Each slot's offsets come again after a window, and no earlier.
            if k >= n {
                assert_eq!(difference(&frames[k], &frames[k - n]), 0.0, "window {window}, frame {k}");
            }
            for other in (k + 1).saturating_sub(n)..k {
                let apart = difference(&frames[k], &frames[other]);
                assert!(apart > 1e-2, "window {window}: frames {other} and {k} are one");
            }
        }
    }
}

#[test]
fn rounding_to_half_floats_costs_less_than_a_thousandth() {
    const EXTINCTION: f64 = 4e-4;
    // Unshadowed: no frame's steps change what it sees, only its place in each pixel does.
    let (mut app, view) = slab_app(EXTINCTION, Vec3::new(0.3, 1.0, 0.2));
    until_drawn(&mut app);
    let noise = captured::read(&app, CloudTextureSlot::BlueNoise, 0).expect("it is there before clouds are drawn");
    for window in [1, 5, 8, 16] {
        let held = CloudQuality { offsets: true, temporal: TemporalMode::SlidingWindow, window, ..exact_march(170.0) };
        app.insert_resource(held);
        for viewpoint in [(10.0, 45.0), (1900.0, 40.0), (6000.0, -55.0)] {
            let camera = looking(viewpoint.0, viewpoint.1);
            app.world_mut().entity_mut(view.camera).insert(camera);
            // All of the window's frames from here.
            run_updates(&mut app, 2 * window + 1);
            let seen = cloud_pixels(&app, &view);
            let mut exact = vec![[0.0; 4]; seen.len()];
            for offset in n_rooks(window as usize) {
                let place = |pixel: UVec2| {
                    let [x, y, ..] = noise.at(pixel.as_ivec2().extend(0));
                    let texel = DVec2::new(x.into(), y.into()) * (255.0 / 256.0) + 0.5 / 256.0;
                    (texel + Vec2::from(*offset).as_dvec2()).fract()
                };
                for (sum, ray) in exact.iter_mut().zip(directions_through(&camera, place)) {
                    let through = (-EXTINCTION * length_in_slab(viewpoint.0.into(), ray.y).0).exp();
                    let light = [0, 1, 2].map(|channel| full_radiance(channel) * (1.0 - through));
                    for (sum, value) in sum.iter_mut().zip(light.into_iter().chain([through])) {
                        *sum += value / f64::from(window);
                    }
                }
            }
            let seen: Vec<[f64; 4]> = seen.iter().map(|p| p.to_array().map(f64::from)).collect();
            let error = worst_relative(seen.as_flattened(), exact.as_flattened(), 1e-3);
            println!("window {window}, {viewpoint:?}: {error:e}");
            // A device that cuts takes 9.8e-4 off at most; one that rounds half of that.
            assert!(error < 1e-3, "window {window}, {viewpoint:?}: {error:e}");
            // They are rounded, or nothing was compared.
            assert!(error > 1e-5, "window {window}, {viewpoint:?}: {error:e}");
        }
    }
}

#[test]
fn a_little_brighter_is_no_new_start() {
    let (mut app, watched) = watched_app();
    start_over(&mut app, &watched);
    let mut frames: Vec<Picture> = (0..3).map(|_| watched.step(&mut app, exposure())).map(|[f, _]| f).collect();
    app.world_mut().entity_mut(watched.view.camera).insert(Exposure { ev100: 12.5 });
    let brighter = Exposure { ev100: 12.5 }.exposure();
    let [stored, shown] = watched.step(&mut app, brighter);
    // Held frames are brought to today's exposure.
    for texel in frames.iter_mut().flatten() {
        for radiance in &mut texel[..3] {
            *radiance *= f64::from(brighter / exposure());
        }
    }
    frames.push(stored);
    let error = difference(&shown, &mean(&frames));
    assert!(error < 1e-5, "{error:e}");
}

type Change = (&'static str, fn(&mut App, &mut Watched));

fn camera(app: &mut App, watched: &Watched) -> Entity {
    app.world_mut().flush();
    watched.view.camera
}

/// Whatever makes held frames wrong. Each changes what it finds.
const CHANGES: [Change; 13] = [
    ("reset", start_over_change),
    ("the camera leapt", |app, w| {
        let camera = camera(app, w);
        app.world_mut().get_mut::<Transform>(camera).expect("a camera").translation.x += 400.0;
    }),
    ("the camera turned away", |app, w| {
        let camera = camera(app, w);
        app.world_mut().get_mut::<Transform>(camera).expect("a camera").rotate_y(0.6);
    }),
    ("the lens changed", |app, w| {
        let lens = PerspectiveProjection { fov: 0.5, ..default() };
        let camera = camera(app, w);
        app.world_mut().entity_mut(camera).insert(Projection::Perspective(lens));
    }),
    ("the sun sank", |app, _| {
        let mut suns = app.world_mut().query_filtered::<&mut Transform, With<DirectionalLight>>();
        for mut sun in suns.iter_mut(app.world_mut()) {
            sun.rotate_x(0.2);
        }
    }),
    ("coverage changed", |app, _| app.world_mut().resource_mut::<CloudModel>().coverage += 0.05),
    ("the sun's strength changed", |app, _| {
        app.world_mut().resource_mut::<CloudLighting>().sun_strength = 0.6;
    }),
    ("the step changed", |app, _| app.world_mut().resource_mut::<CloudQuality>().step = 190.0),
    ("the window changed", |app, _| app.world_mut().resource_mut::<CloudQuality>().window = 7),
    ("time leapt", |app, _| app.world_mut().resource_mut::<CloudClock>().seconds += 100.0),
    ("it became thousands of times brighter", |app, w| {
        // Held frames would have to be scaled by more than their half floats can show.
        let camera = camera(app, w);
        app.world_mut().entity_mut(camera).insert(Exposure { ev100: 1.0 });
    }),
    ("the viewport shrank", |app, w| {
        let viewport = Viewport { physical_size: UVec2::new(15, 9), ..default() };
        w.size = viewport.physical_size;
        let camera = camera(app, w);
        app.world_mut().get_mut::<Camera>(camera).expect("a camera").viewport = Some(viewport);
    }),
    ("another target, of another size", |app, w| {
        w.size = UVec2::new(12, 10);
        let camera = camera(app, w);
        let image = Image::new_target_texture(w.size.x, w.size.y, TextureFormat::Rgba8UnormSrgb, None);
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.world_mut().get_mut::<Camera>(camera).expect("a camera").viewport = None;
        app.world_mut().entity_mut(camera).insert(RenderTarget::from(image));
    }),
];

fn start_over_change(app: &mut App, watched: &mut Watched) {
    start_over(app, watched);
}

#[test]
fn whatever_changes_starts_over_and_nothing_smears() {
    for mode in HELD {
        starts_over_whatever_changes(mode);
    }
}

fn starts_over_whatever_changes(mode: Mode) {
    let (mut app, mut watched) = watched_app();
    app.insert_resource(in_mode(mode, quality(4)));
    for (what, change) in CHANGES {
        let what = format!("{mode:?}: {what}");
        let mut before = Picture::new();
        for _ in 0..3 {
            let at = app.world().get::<Exposure>(watched.view.camera).expect("a camera").exposure();
            [_, before] = watched.step(&mut app, at);
        }
        let size = watched.size;
        change(&mut app, &mut watched);
        let at = app.world().get::<Exposure>(watched.view.camera).expect("a camera").exposure();
        let [stored, shown] = watched.step(&mut app, at);
        if mode.0 != TemporalMode::Upscale {
            let error = difference(&shown, &stored);
            assert!(error < 1e-5, "{what}: the first frame after it is not shown alone: {error:e}");
        }
        if watched.size == size {
            assert!(difference(&shown, &before) > 1e-3, "{what}: nothing changed");
        }
        // The same as that of a new history.
        start_over(&mut app, &watched);
        let [_, fresh] = watched.step(&mut app, at);
        assert_eq!(difference(&shown, &fresh), 0.0, "{what}: the first frame is not a fresh one's");
        assert!(fresh.iter().any(|p| p[3] < 0.9), "{what}: no cloud is left to see");
    }
}

#[test]
fn at_rest_again_the_window_is_exact_without_a_jump() {
    const WINDOW: usize = 5;
    let (mut app, watched) = watched_app();
    app.insert_resource(quality(WINDOW as u32));
    let turn = |app: &mut App, angle: f32| {
        app.world_mut().get_mut::<Transform>(watched.view.camera).expect("a camera").rotate_y(angle);
    };
    for _ in 0..2 * WINDOW {
        turn(&mut app, 0.004);
        watched.step(&mut app, exposure());
    }
    let (mut frames, mut pictures): (Vec<Picture>, Vec<Picture>) = default();
    for k in 0..3 * WINDOW {
        let [stored, shown] = watched.step(&mut app, exposure());
        frames.push(stored);
        // The last frame in motion was seen from here as well.
        if k + 1 >= WINDOW {
            let error = difference(&shown, &mean(&frames[k + 1 - WINDOW..]));
            assert!(error < 1e-5, "frame {k} at rest: {error:e}");
        }
        pictures.push(shown);
    }
    let apart = |a: &Picture, b: &Picture| {
        let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    // From picture to picture no more changes than single frames differ by.
    let noise = apart(&frames[0], &frames[1]);
    for (k, pair) in pictures.windows(2).enumerate() {
        let jump = apart(&pair[0], &pair[1]);
        assert!(jump < 0.5 * noise, "frame {k} at rest: {jump} where frames are {noise} apart");
    }
    // And in motion it was no new start.
    turn(&mut app, 0.004);
    let [stored, shown] = watched.step(&mut app, exposure());
    assert!(apart(&stored, &shown) > 0.2 * noise);
}
