//! The sky over time: transitions without a jump, the same sky for the same time, drift and evolution.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::{CloudFrame, prelude::*, settings::SettingsError, textures::CloudTextureStatus};

use crate::support::{
    app::{Sky, View, cloud_pixels, clouds_app, read_image, spawn_sun, spawn_view, until_drawn},
    gpu::{run_until, run_updates},
    half::from_half,
};

const SIZE: UVec2 = UVec2::new(28, 16);

fn preset(name: &str) -> CloudPreset {
    CloudPreset::named(name).expect("a built-in preset")
}

fn bare_app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), CloudsPlugin));
    app.insert_resource(CloudClock { seconds: 0.0, speed: 0.0 });
    app.finish();
    app.cleanup();
    app
}

fn at(app: &mut App, seconds: f64) -> (CloudModel, CloudLayers, CloudLighting) {
    app.world_mut().resource_mut::<CloudClock>().seconds = seconds;
    app.update();
    let world = app.world();
    (
        world.resource::<CloudModel>().clone(),
        world.resource::<CloudLayers>().clone(),
        world.resource::<CloudLighting>().clone(),
    )
}

fn to(app: &mut App, name: &str, seconds: f64) {
    app.world_mut().resource_mut::<CloudWeather>().transition_to(&preset(name), seconds).expect("a good preset");
}

#[test]
fn the_same_time_has_the_same_sky_whatever_came_before() {
    let mut app = bare_app();
    at(&mut app, 1000.0);
    to(&mut app, "Storm", 60.0);
    at(&mut app, 1000.0);
    // Midway it is sent elsewhere.
    at(&mut app, 1030.0);
    to(&mut app, "MackerelSky", 100.0);
    at(&mut app, 1030.0);
    let times = [990.0, 1000.0, 1012.5, 1029.0, 1030.0, 1055.0, 1129.0, 1130.0, 5000.0];
    let forth = times.map(|t| at(&mut app, t));
    let mut back: Vec<_> = times.iter().rev().map(|t| at(&mut app, *t)).collect();
    back.reverse();
    for ((t, forth), back) in times.iter().zip(&forth).zip(&back) {
        assert_eq!(forth, back, "at {t}");
    }
    assert_ne!(forth[2], forth[3]);
    assert_eq!(forth[0].0, CloudModel::default());
    // Another machine that is told late.
    let mut other = bare_app();
    at(&mut other, 4000.0);
    let mut weather = other.world_mut().resource_mut::<CloudWeather>();
    weather.transition_at(&preset("Storm"), 1000.0, 60.0).expect("a good preset");
    weather.transition_at(&preset("MackerelSky"), 1030.0, 100.0).expect("a good preset");
    at(&mut other, 4000.0);
    for (t, forth) in times.iter().zip(&forth) {
        assert_eq!(*forth, at(&mut other, *t), "at {t}");
    }
}

#[test]
fn a_change_by_hand_takes_over_and_a_floating_origin_does_not() {
    let mut app = bare_app();
    at(&mut app, 0.0);
    to(&mut app, "Overcast", 10.0);
    at(&mut app, 0.0);
    app.world_mut().resource_mut::<CloudModel>().world_offset = DVec3::X;
    let (moved, ..) = at(&mut app, 5.0);
    assert_eq!(moved.world_offset, DVec3::X);
    assert_ne!(moved.coverage, CloudModel::default().coverage, "the transition stands still");
    assert_eq!(app.world().resource::<CloudWeather>().progress(5.0), Some(0.5));
    app.world_mut().resource_mut::<CloudModel>().density = 0.123;
    let (taken, ..) = at(&mut app, 7.0);
    assert_eq!((taken.density, taken.coverage), (0.123, moved.coverage));
    assert_eq!(app.world().resource::<CloudWeather>().progress(7.0), None);
    // What cannot be is refused with its name.
    let weather = &mut *app.world_mut().resource_mut::<CloudWeather>();
    let mut bad = preset("Cumulus");
    bad.layers.0[0].coverage = 3.0;
    let error = weather.transition_to(&bad, 10.0).expect_err("it is out of range");
    assert!(error.to_string().starts_with("layers.0.coverage = 3 is outside its range -1 to 1"), "{error}");
    for seconds in [-1.0, f64::NAN, f64::INFINITY] {
        let error = weather.transition_to(&preset("Cumulus"), seconds).expect_err("no duration");
        assert!(matches!(error, SettingsError::OutOfRange { .. }) && error.to_string().starts_with("weather.seconds"));
    }
    assert!(weather.transition_at(&preset("Cumulus"), f64::NAN, 1.0).is_err());
}

/// Frames in which the weather did something.
#[derive(Resource, Default)]
struct Busy(u32);

#[test]
fn a_transition_that_is_over_costs_nothing() {
    let mut app = bare_app();
    app.init_resource::<Busy>();
    // Sees what the frame before did at its end.
    app.add_systems(First, |weather: Res<CloudWeather>, mut busy: ResMut<Busy>| {
        busy.0 += u32::from(weather.is_changed());
    });
    let busy = |app: &mut App, from: f64| {
        at(app, from);
        let before = app.world().resource::<Busy>().0;
        (1..=20).for_each(|k| _ = at(app, from + f64::from(k)));
        app.world().resource::<Busy>().0 - before
    };
    at(&mut app, 0.0);
    to(&mut app, "Storm", 60.0);
    at(&mut app, 0.0);
    assert_eq!(busy(&mut app, 10.0), 20, "it stands still");
    at(&mut app, 60.0);
    at(&mut app, 61.0);
    assert_eq!(busy(&mut app, 70.0), 0, "the end is written again and again");
    let end = at(&mut app, 100.0);
    // It goes on all the same: back in time, with a shifted origin, or to another sky.
    let half = at(&mut app, 30.0);
    assert_ne!(half, end);
    assert_eq!(at(&mut app, 100.0), end);
    at(&mut app, 101.0);
    app.world_mut().resource_mut::<CloudModel>().world_offset = DVec3::Z;
    let (shifted, layers, _) = at(&mut app, 102.0);
    assert_eq!((shifted.world_offset, &layers), (DVec3::Z, &end.1));
    assert_eq!(app.world().resource::<CloudWeather>().progress(102.0), Some(1.0));
    at(&mut app, 103.0);
    assert_eq!(busy(&mut app, 104.0), 0);
    to(&mut app, "Cumulus", 60.0);
    at(&mut app, 130.0);
    assert_ne!(at(&mut app, 150.0).1, end.1);
    at(&mut app, 300.0);
    at(&mut app, 301.0);
    app.world_mut().resource_mut::<CloudLayers>().0[0].coverage = 0.07;
    assert_eq!(at(&mut app, 302.0).1.0[0].coverage, 0.07, "a change by hand is undone");
    assert_eq!(app.world().resource::<CloudWeather>().progress(302.0), None);
}

fn drawn(app: &mut App, looking: Transform, window: u32) -> View {
    app.insert_resource(quality(window));
    spawn_sun(app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_view(app, SIZE, looking, Sky::Black);
    until_drawn(app);
    run_updates(app, 3);
    run_until(app, "the textures are there", 600, |app| !app.world().resource::<CloudTextureStatus>().baking);
    run_updates(app, 10);
    view
}

fn quality(window: u32) -> CloudQuality {
    CloudQuality {
        resolution: MarchResolution::Full,
        step: 160.0,
        step_growth: 0.012,
        light_steps: 3,
        window,
        ..default()
    }
}

fn up() -> Transform {
    Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 0.4, -1.0), Vec3::Y)
}

/// Luminance of what is seen before a grey sky, in units of that sky's.
fn luminances(app: &App, view: &View) -> Vec<f64> {
    const GREY: f32 = 4000.0;
    let seen = |p: &Vec4| f64::from((p.truncate().dot(Vec3::new(0.2126, 0.7152, 0.0722)) + p.w * GREY) / GREY);
    cloud_pixels(app, view).iter().map(seen).collect()
}

fn mean(picture: &[f64]) -> f64 {
    picture.iter().sum::<f64>() / picture.len() as f64
}

/// Whether what is shown is one frame alone: the history began with it.
fn began_anew(app: &App, view: &View, frame: &Handle<Image>) -> bool {
    let halves: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(app, frame));
    let shown = cloud_pixels(app, view);
    halves.iter().zip(&shown).all(|(half, shown)| (from_half(half[3]) - f64::from(shown.w)).abs() < 2e-3)
}

/// Runs cloud time to `end` in steps; each frame's luminances, and how many frames began anew.
fn film(app: &mut App, view: &View, frame: &Handle<Image>, end: f64, step: f64) -> (Vec<Vec<f64>>, usize) {
    let (mut all, mut anew) = (Vec::new(), 0);
    while app.world().resource::<CloudClock>().seconds < end {
        app.world_mut().resource_mut::<CloudClock>().seconds += step;
        run_updates(app, 1);
        all.push(luminances(app, view));
        anew += usize::from(began_anew(app, view, frame));
    }
    (all, anew)
}

/// Frames that are shown as one.
const WINDOW: u32 = 8;

fn greatest_step(film: &[Vec<f64>]) -> f64 {
    film.windows(2).map(|pair| (mean(&pair[1]) - mean(&pair[0])).abs()).fold(0.0, f64::max)
}

/// What all but one in a hundred pixels change by less than, from each frame to the first one that has nothing of it: what is
/// shown is the mean of a window, so that a jump takes that long to be whole.
fn changes(film: &[Vec<f64>]) -> Vec<f64> {
    let of = |(before, now): (&Vec<f64>, &Vec<f64>)| {
        let mut all: Vec<f64> = before.iter().zip(now).map(|(a, b)| (a - b).abs()).collect();
        all.sort_by(f64::total_cmp);
        all[(all.len() - 1) * 99 / 100]
    };
    film.iter().zip(&film[WINDOW as usize..]).map(of).collect()
}

/// The greatest of these, as a multiple of the median of those in which something changes, and where it is.
fn greatest_change(changes: &[f64]) -> (f64, usize) {
    let (at, most) = changes.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).expect("there are frames");
    let mut sorted: Vec<f64> = changes.iter().copied().filter(|change| *change > 0.05 * most).collect();
    sorted.sort_by(f64::total_cmp);
    (most / sorted[sorted.len() / 2].max(1e-4), at)
}

/// Most that a window may change by, in medians. Speed is eased to one and a half times its mean, and clouds do not form
/// evenly: 2.6 to 4.1 were measured.
const NO_JUMP: f64 = 5.0;

/// Waits for the maps of what was asked for; the clock stands.
fn wait_for_maps(app: &mut App) {
    run_updates(app, 10);
    std::thread::sleep(std::time::Duration::from_secs(3));
    run_updates(app, 10);
}

#[test]
fn a_transition_keeps_the_history_and_no_frame_jumps() {
    const STEP: f64 = 0.08;
    let mut app = clouds_app();
    let view = drawn(&mut app, up(), WINDOW);
    let frame = app.world_mut().resource_mut::<Assets<Image>>().add(CloudFrame::image(SIZE.x, SIZE.y));
    app.world_mut().entity_mut(view.camera).insert(CloudFrame(frame.clone()));
    run_updates(&mut app, 9);
    let mut pictures = vec![luminances(&app, &view)];
    // From the thesis's layer to weather maps, and before that is done on to a closed sky.
    to(&mut app, "Cumulus", 20.0);
    let mut anew = 0;
    for (end, next) in [(12.0, "Overcast"), (34.0, "Cumulus")] {
        wait_for_maps(&mut app);
        let (all, began) = film(&mut app, &view, &frame, end, STEP);
        pictures.extend(all);
        anew += began;
        to(&mut app, next, 20.0);
    }
    let means: Vec<f64> = pictures.iter().map(|picture| mean(picture)).collect();
    let (least, most) = means.iter().fold((f64::MAX, 0.0_f64), |(l, m), x| (x.min(l), x.max(m)));
    println!(
        "mean luminance {least:.3} to {most:.3}, greatest step {:.4}, {anew} began anew",
        greatest_step(&pictures)
    );
    let (ratio, worst) = greatest_change(&changes(&pictures));
    println!("by pixel at most {ratio:.2} medians, at {worst} of {} frames", pictures.len());
    println!("{means:.3?}");
    assert!(most - least > 0.3, "nothing changes");
    assert_eq!(anew, 0, "frames held were dropped");
    assert!(greatest_step(&pictures) < 0.05 * (most - least), "a frame jumps by {}", greatest_step(&pictures));
    assert!(ratio < NO_JUMP, "frame {worst} jumps by {ratio} medians");
    // A change by hand does begin anew.
    app.world_mut().resource_mut::<CloudModel>().density = 0.7;
    run_updates(&mut app, 1);
    assert!(began_anew(&app, &view, &frame), "a change of settings keeps frames of another sky");
}

/// Rain sets in over a low layer, one that is ten kilometres thick joins what were two decks, a sheet of ice with a phase
/// function of its own comes high above, and is seen much farther than what was there.
#[test]
fn storms_and_high_sheets_come_without_a_jump() {
    const STEP: f64 = 0.1;
    for (from, to_name) in [("Cumulus", "Storm"), ("ClearDay", "Cirrostratus")] {
        let mut app = clouds_app();
        let preset = preset(from);
        app.insert_resource(preset.model).insert_resource(preset.layers).insert_resource(preset.lighting);
        let view = drawn(&mut app, up(), WINDOW);
        let frame = app.world_mut().resource_mut::<Assets<Image>>().add(CloudFrame::image(SIZE.x, SIZE.y));
        app.world_mut().entity_mut(view.camera).insert(CloudFrame(frame.clone()));
        run_updates(&mut app, 9);
        let mut pictures = vec![luminances(&app, &view)];
        to(&mut app, to_name, 20.0);
        wait_for_maps(&mut app);
        let (all, anew) = film(&mut app, &view, &frame, 21.0, STEP);
        pictures.extend(all);
        let changes = changes(&pictures);
        let (ratio, worst) = greatest_change(&changes);
        println!("{from} to {to_name}: at most {ratio:.2} medians, at {worst} of {} frames", pictures.len());
        println!("{changes:.3?}");
        assert_eq!(anew, 0, "{from} to {to_name}: frames held were dropped");
        assert!(ratio < NO_JUMP, "{from} to {to_name}: frame {worst} jumps by {ratio} medians: {changes:.4?}");
        let whole = pictures[0].iter().zip(pictures.last().expect("a film")).map(|(a, b)| (a - b).abs());
        assert!(whole.fold(0.0, f64::max) > 0.2, "{from} to {to_name}: nothing changes");
        // A jump that there is would be seen: in the middle, half of what is shown from then on.
        let middle = pictures.len() / 2;
        pictures[middle..].iter_mut().flatten().for_each(|x| *x *= 0.5);
        let (jumps, _) = greatest_change(&self::changes(&pictures));
        println!("{from} to {to_name}: {jumps:.2} medians with a jump");
        assert!(jumps > 1.3 * ratio, "{from} to {to_name}: a jump is not seen, {jumps} for {ratio}");
    }
}

#[test]
fn a_day_of_wind_jumps_nowhere_and_shapes_evolve() {
    let mut app = clouds_app();
    let cumulus = preset("Cumulus");
    app.insert_resource(cumulus.model).insert_resource(cumulus.layers);
    let view = drawn(&mut app, up(), 1);
    let picture = |app: &mut App, seconds: f64| {
        app.world_mut().resource_mut::<CloudClock>().seconds = seconds;
        app.world_mut().get_mut::<CloudView>(view.camera).expect("a view").reset += 1;
        run_updates(app, 1);
        cloud_pixels(app, &view)
    };
    let difference =
        |a: &[Vec4], b: &[Vec4]| a.iter().zip(b).map(|(a, b)| (a.w - b.w).abs()).sum::<f32>() / a.len() as f32;
    // The map of 36 km passes more than twenty times in a day of 8 m/s.
    let (mut worst, mut least) = (0.0_f32, f32::MAX);
    for k in 0..6 {
        let t = 14_400.0 * f64::from(k) + 123.4;
        let now = picture(&mut app, t);
        worst = worst.max(difference(&now, &picture(&mut app, t + 0.1)));
        least = least.min(difference(&now, &picture(&mut app, t + 7200.0)));
    }
    println!("in 0.1 s at most {worst:.4}, in two hours at least {least:.4} of the transmittance");
    assert!(worst < 0.01 && least > 0.02, "{worst} and {least}");
    // The same time again is the same picture.
    let a = picture(&mut app, 40_000.0);
    picture(&mut app, 3.0);
    assert_eq!(a, picture(&mut app, 40_000.0));
    // With the wind followed, what is left of the change is the shapes' own.
    let still = |layers: &CloudLayers| {
        let mut layers = layers.clone();
        layers.0.iter_mut().for_each(|layer| layer.wind = Vec3::ZERO);
        layers
    };
    let layers = still(app.world().resource::<CloudLayers>());
    app.insert_resource(layers.clone());
    let (now, later) = (picture(&mut app, 0.0), picture(&mut app, 600.0));
    let evolved = difference(&now, &later);
    let mut frozen = layers;
    frozen.0.iter_mut().for_each(|layer| (layer.evolution, layer.renewal) = (0.0, 0.0));
    app.insert_resource(frozen);
    assert_eq!(picture(&mut app, 0.0), picture(&mut app, 600.0), "what does not move changes");
    println!("evolution alone changes {evolved:.4} in ten minutes");
    assert!(evolved > 0.01, "{evolved}");
}
