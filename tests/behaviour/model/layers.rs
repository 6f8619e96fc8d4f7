//! Weather-map layers: their bounds, their sum, their place in time, and what is wrong with them.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::{prelude::*, settings::LayerKind};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::robustness::bad_input::refuses;
use crate::support::{
    app::{View, cloud_pixels, clouds_app, is_baked, spawn_sun, until_drawn},
    density::{Answer, Question, ask, at, model_app, question},
    gpu::{run_until, run_updates, times_logged},
    scene::{exact, settle, spawn_linear, steps},
    shared::SharedApp,
};

/// A small map of this cover (oktas).
fn map(cover: f32) -> WeatherRecipe {
    WeatherRecipe { size: 64, scale: 20_000.0, cell_size: 2500.0, cover, ..default() }
}

fn cumulus() -> CloudLayer {
    CloudLayer { map: map(4.0), ..default() }
}

fn cirrus() -> CloudLayer {
    CloudLayer {
        kind: LayerKind::Sheet,
        map: WeatherRecipe { seed: 5, ..map(6.0) },
        base: 7000.0,
        thickness: 900.0,
        stretch: 8.0,
        stretch_angle: 20.0,
        extinction: 0.002,
        wispiness: 0.3,
        ..default()
    }
}

/// Layers of every kind, with what each of them is to show.
fn kinds() -> Vec<(&'static str, Vec<CloudLayer>)> {
    let one = |what, layer| (what, vec![layer]);
    vec![
        one("cumulus", cumulus()),
        // The density is the profile: the most there can be.
        one("no noise", CloudLayer { shape_strength: 0.0, detail_strength: 0.0, ..cumulus() }),
        one(
            "full gain",
            CloudLayer { shape_gain: 8.0, profile_strength: 4.0, density: 3.0, sharpness: 6.0, ..cumulus() },
        ),
        one("sheet", cirrus()),
        one("anvil", CloudLayer { anvil: 1.0, thickness: 9000.0, base_rise: 0.0, shape_strength: 0.2, ..cumulus() }),
        one("rain", CloudLayer { rain: 1.0, base: 1800.0, rain_depth: 1500.0, map: map(7.0), ..cumulus() }),
        one(
            "slant",
            CloudLayer {
                rain: 1.0,
                base: 2500.0,
                rain_depth: 2500.0,
                rain_slant: 3.0,
                wind_skew: -2000.0,
                map: map(6.0),
                ..cumulus()
            },
        ),
        one("more far", CloudLayer { far_coverage: 0.8, far_start: 3000.0, far_end: 30_000.0, ..cumulus() }),
        one(
            "less far",
            CloudLayer { far_coverage: -0.8, far_start: 3000.0, far_end: 30_000.0, map: map(7.0), ..cumulus() },
        ),
        one("lean", CloudLayer { wind_skew: 8000.0, thickness: 3000.0, base_rise: 0.0, ..cumulus() }),
        one("turbulence", CloudLayer { turbulence: 3000.0, turbulence_height: 10.0, base_to_top: 0.7, ..cumulus() }),
        one("coverage", CloudLayer { coverage: 0.3, map: map(1.0), ..cumulus() }),
        (
            "overlap",
            vec![cumulus(), CloudLayer { base: 1500.0, map: WeatherRecipe { seed: 9, ..map(5.0) }, ..cumulus() }],
        ),
        ("two decks", vec![cumulus(), cirrus()]),
    ]
}

/// The model with these layers alone; waits for their maps.
pub fn show(app: &mut App, layers: &[CloudLayer]) -> CloudModel {
    app.insert_resource(CloudLayers(layers.to_vec()));
    run_updates(app, 2);
    run_until(app, "the layers' maps", 600, |app| is_baked(app));
    // Where questions are asked: around all of the layers.
    let bottom = layers.iter().map(CloudLayer::bottom).fold(f32::INFINITY, f32::min);
    let top = layers.iter().map(CloudLayer::top).fold(f32::NEG_INFINITY, f32::max);
    CloudModel { enabled: false, bottom, top, ..default() }
}

#[test]
fn nothing_in_a_layer_is_denser_than_the_bound_around_it() {
    let mut app = model_app();
    for (k, (what, layers)) in (0..).zip(kinds()) {
        let model = show(&mut app, &layers);
        let mut rng = StdRng::seed_from_u64(500 + k);
        let questions: Vec<Question> = (0..30_000).map(|_| question(&mut rng, &model)).collect();
        let (mut empty, mut cloud, mut close) = (0, 0, 0.0_f32);
        for (question, answer) in questions.iter().zip(ask(&mut app, &model, &questions)) {
            let [bound, density, extinction, profile, extinction_bound] = answer;
            assert!(answer.iter().all(|v| v.is_finite() && *v >= 0.0), "{what}: {question:?}: {answer:?}");
            assert!(density <= bound * 1.00001 + 1e-5, "{what}: {question:?}: {density} > {bound}");
            let most = extinction_bound * 1.00001 + 1e-8;
            assert!(extinction <= most, "{what}: {question:?}: {extinction} > {extinction_bound} 1/m");
            assert!(bound > 0.0 || (density == 0.0 && profile == 0.0), "{what}: {question:?}: {answer:?}");
            empty += u32::from(bound == 0.0);
            cloud += u32::from(density > 0.0);
            if extinction_bound > 0.0 {
                close = close.max(extinction / extinction_bound);
            }
        }
        println!("{what}: {empty} certainly empty, {cloud} in cloud, up to {close} of the bound");
        // A bound that is never 0 would be true and of no use; so would one that is far above everything.
        assert!(
            empty > 3000 && cloud > 100 && close > 0.15,
            "{what}: {empty} empty, {cloud} cloud, {close} of the bound"
        );
    }
}

#[test]
fn overlapping_layers_add_up() {
    let mut app = model_app();
    let (a, b) = (cumulus(), CloudLayer { base: 1400.0, kind: LayerKind::Sheet, map: map(6.0), ..cirrus() });
    let both = [CloudLayer { base: 1300.0, ..a }, CloudLayer { thickness: 1500.0, ..b }];
    let model = show(&mut app, &both);
    let mut rng = StdRng::seed_from_u64(520);
    let questions: Vec<Question> = (0..20_000).map(|_| question(&mut rng, &model)).collect();
    let sums = ask(&mut app, &model, &questions);
    let [first, second] = both.map(|layer| {
        show(&mut app, &[layer]);
        ask(&mut app, &model, &questions)
    });
    let mut overlaps = 0;
    for (k, sum) in sums.iter().enumerate() {
        let parts = [first[k], second[k]];
        overlaps += u32::from(parts.iter().all(|part| part[2] > 0.0));
        // Bound, density, extinction, bound of the extinction; the profile is the larger.
        for i in [0, 1, 2, 4] {
            let expected = parts[0][i] + parts[1][i];
            assert!((sum[i] - expected).abs() <= 1e-6 + 1e-4 * expected, "{:?}: {sum:?} of {parts:?}", questions[k]);
        }
    }
    println!("{overlaps} points in both layers");
    assert!(overlaps > 50, "{overlaps} points are in both");
}

#[test]
fn shafts_of_rain_slant_as_a_whole() {
    let (slant, fall) = (1.5, 800.0);
    let (base, radius) = (2500.0, 6.36e6_f64);
    let layer = CloudLayer {
        rain: 1.0,
        base,
        base_rise: 0.0,
        rain_depth: 2500.0,
        rain_slant: slant,
        // Wide streaks, of 80 m a texel.
        turbulence_scale: 20_000.0,
        wind: Vec3::new(3.0, 0.0, 4.0),
        // Another way than the shafts.
        wind_skew: -3000.0,
        map: map(4.0),
        ..cumulus()
    };
    let mut app = model_app();
    let model = show(&mut app, &[layer]);
    let mut rng = StdRng::seed_from_u64(540);
    let mut within = |end: f32| rng.random_range(-end..end);
    let places: Vec<Vec2> = (0..4000).map(|_| Vec2::new(within(2000.0), within(2000.0))).collect();
    let below = |metres: f32, trail: f32| -> Vec<Question> {
        let behind = -Vec2::new(0.6, 0.8) * trail;
        let place = |m: &Vec2| {
            let (at, up) = ((*m + behind).as_dvec2(), radius + f64::from(base - metres));
            DVec3::new(at.x, (up * up - at.length_squared()).sqrt() - radius, at.y).as_vec3()
        };
        places.iter().map(|m| at(place(m), 0.0)).collect()
    };
    let mut density = |metres: f32, trail: f32| -> Vec<f32> {
        ask(&mut app, &model, &below(metres, trail)).iter().map(|answer| answer[1]).collect()
    };
    // Both above where shafts thin out, and a little below the base.
    let (high, low, straight) = (density(20.0, 20.0 * slant), density(fall, fall * slant), density(fall, 20.0 * slant));
    let off = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let wet = high.iter().filter(|density| **density > 0.05).count();
    println!("{wet} in rain; along the shaft off by {}, straight down by {}", off(&high, &low), off(&high, &straight));
    assert!(wet > 300, "{wet} places in rain");
    // The planet's curve moves places by up to half a metre over the fall, in streaks that change by 0.03 a metre at most.
    assert!(off(&high, &low) < 0.02, "the shaft is another {fall} m down: {}", off(&high, &low));
    assert!(off(&high, &straight) > 0.3, "shafts hang straight down");
}

#[test]
fn rain_hangs_from_the_tower_and_not_from_the_anvil() {
    let (base, thickness) = (1500.0, 8000.0);
    let layer = CloudLayer {
        anvil: 0.9,
        rain: 1.0,
        rain_depth: 1500.0,
        rain_slant: 0.0,
        wind_skew: 0.0,
        base,
        thickness,
        base_rise: 0.0,
        // Nothing but the profile, and height the same everywhere.
        shape_strength: 0.0,
        detail_strength: 0.0,
        turbulence: 0.0,
        map: WeatherRecipe { height_variation: 0.0, ..map(4.0) },
        ..cumulus()
    };
    let mut app = model_app();
    let model = show(&mut app, &[layer]);
    let mut rng = StdRng::seed_from_u64(550);
    let mut within = |end: f32| rng.random_range(-end..end);
    let places: Vec<Vec2> = (0..6000).map(|_| Vec2::new(within(2500.0), within(2500.0))).collect();
    // The planet's curve takes half a metre within 2.5 km.
    let mut density = |height: f32| -> Vec<f32> {
        let questions: Vec<Question> = places.iter().map(|m| at(Vec3::new(m.x, height, m.y), 0.0)).collect();
        ask(&mut app, &model, &questions).iter().map(|answer| answer[1]).collect()
    };
    let (anvil, tower, rain) =
        (density(base + 0.78 * thickness), density(base + 0.3 * thickness), density(base - 40.0));
    let (mut overhung, mut wet) = (0, 0);
    for ((anvil, tower), rain) in anvil.iter().zip(&tower).zip(&rain) {
        overhung += u32::from(*anvil > 0.1 && *tower == 0.0);
        wet += u32::from(*rain > 0.05);
        assert!(*tower > 0.0 || *rain == 0.0, "rain of {rain} where no tower stands");
    }
    println!("{overhung} places under the anvil alone, {wet} in rain");
    assert!(overhung > 200 && wet > 100, "{overhung} under the anvil alone, {wet} in rain");
}

/// Points within the layers, near enough that single clouds are told apart.
fn points(model: &CloudModel, count: usize) -> Vec<Question> {
    let mut rng = StdRng::seed_from_u64(530);
    let mut within = |end: f32| rng.random_range(-end..end);
    let height = model.top - model.bottom;
    let middle = 0.5 * (model.top + model.bottom);
    (0..count).map(|_| at(Vec3::new(within(9000.0), middle + 0.5 * within(height), within(9000.0)), 2.0)).collect()
}

fn at_time(app: &mut App, model: &CloudModel, seconds: f64, questions: &[Question]) -> Vec<Answer> {
    app.insert_resource(CloudClock { seconds, speed: 0.0 });
    ask(app, model, questions)
}

/// Mean and greatest difference of the densities.
fn differences(a: &[Answer], b: &[Answer]) -> (f32, f32) {
    let all = a.iter().zip(b).map(|(a, b)| (a[1] - b[1]).abs());
    (all.clone().sum::<f32>() / a.len() as f32, all.fold(0.0, f32::max))
}

#[test]
fn the_same_time_and_seed_give_the_same_layers() {
    let layers = [cumulus(), CloudLayer { base: 2000.0, thickness: 800.0, ..cirrus() }];
    let (time, other_time) = (123_456.789, 98_765.4);
    let mut app = model_app();
    let model = show(&mut app, &layers);
    let questions = points(&model, 4000);
    let first = at_time(&mut app, &model, time, &questions);
    assert!(first.iter().filter(|answer| answer[1] > 0.0).count() > 100, "there is no cloud");
    assert!(differences(&first, &at_time(&mut app, &model, other_time, &questions)).0 > 0.005, "time changes nothing");
    assert_eq!(first, at_time(&mut app, &model, time, &questions), "scrubbed back");
    // Another machine in the same game.
    let mut again = model_app();
    show(&mut again, &layers);
    assert_eq!(first, at_time(&mut again, &model, time, &questions), "another app");
    let other = layers.map(|layer| CloudLayer { map: WeatherRecipe { seed: 1000, ..layer.map.clone() }, ..layer });
    show(&mut app, &other);
    assert!(differences(&first, &at_time(&mut app, &model, time, &questions)).0 > 0.005, "the seed changes nothing");
}

#[test]
fn nothing_jumps_where_offsets_wrap_or_after_weeks() {
    // Every 2000 s the wind crosses the map, every 500 s the shapes, every 100 s the details.
    let wind = Vec3::new(10.0, 0.0, 0.0);
    let layer = CloudLayer { wind, shape_scale: 5000.0, detail_scale: 1000.0, evolution: 2.0, ..cumulus() };
    let sheet = CloudLayer { wind, base: 2000.0, thickness: 800.0, shape_scale: 5000.0, ..cirrus() };
    let mut app = model_app();
    for layers in [[layer], [sheet]] {
        let model = show(&mut app, &layers);
        let questions = points(&model, 4000);
        for seconds in [0.0, 100.0, 500.0, 2000.0, 4000.0, 86_400.0, 2_000_000.0, 30.0 * 86_400.0] {
            let before = at_time(&mut app, &model, seconds - 0.002, &questions);
            let (mean, worst) = differences(&before, &at_time(&mut app, &model, seconds + 0.002, &questions));
            assert!(mean < 2e-4 && worst < 0.03, "{seconds} s: {mean} in the mean, {worst} at most");
            let (mean, _) = differences(&before, &at_time(&mut app, &model, seconds + 30.0, &questions));
            assert!(mean > 0.002, "{seconds} s: nothing moves, {mean}");
        }
    }
}

const SIZE: UVec2 = UVec2::new(12, 8);

/// An app without the thesis's layer, and with a camera on the ground that looks up.
fn above_us(layers: &[CloudLayer]) -> (SharedApp, View) {
    let mut app = clouds_app();
    app.insert_resource(exact(MarchResolution::Full))
        .insert_resource(CloudModel { enabled: false, ..default() })
        .insert_resource(CloudLayers(layers.to_vec()));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(60_f32.to_radians()));
    let view = spawn_linear(&mut app, SIZE, up);
    until_drawn(&mut app);
    settle(&mut app);
    (app, view)
}

fn put(app: &mut App, layers: &[CloudLayer]) {
    app.insert_resource(CloudLayers(layers.to_vec()));
    run_updates(app, 2);
    until_drawn(app);
    settle(app);
}

#[test]
fn an_empty_gap_between_decks_costs_next_to_nothing() {
    let low = CloudLayer { map: map(7.0), coverage: 0.3, extinction: 0.002, base_rise: 0.0, ..cumulus() };
    let high = CloudLayer { base: 11_000.0, base_rise: 0.0, thickness: 1500.0, ..low.clone() };
    let (mut app, view) = above_us(&[low.clone(), high.clone()]);
    let of = |app: &mut App| (steps(app, &view), cloud_pixels(app, &view));
    let (both_steps, both) = of(&mut app);
    let [(low_steps, lower), (high_steps, higher)] = [low, high].map(|layer| {
        put(&mut app, &[layer]);
        of(&mut app)
    });
    let (mut in_both, mut most) = (0, 0.0_f32);
    for k in 0..both.len() {
        // Both sides are there: what passes one passes the other.
        let expected = lower[k].w * higher[k].w;
        assert!((both[k].w - expected).abs() < 0.01, "pixel {k}: {} passes, not {expected}", both[k].w);
        in_both += u32::from(lower[k].w < 0.9 && higher[k].w < 0.9);
        most = most.max(both_steps[k] - low_steps[k] - high_steps[k]);
    }
    let mean = |counts: &[f32]| counts.iter().sum::<f32>() / counts.len() as f32;
    let [low, high, both] = [&low_steps, &high_steps, &both_steps].map(|counts| mean(counts));
    println!("steps: {low} below, {high} above, {both} together; {most} more at most; {in_both} pixels see both");
    assert!(in_both > 10 && low > 5.0 && high > 5.0, "{in_both} pixels see both, {low} and {high} steps");
    // Of rounding, and a step into the gap.
    assert!(most < 4.0, "{most} steps in the gap of 8 km");
}

/// An app whose camera on the ground looks at the horizon; low clouds end at 40 km.
fn far_away(layers: &[CloudLayer]) -> (SharedApp, View) {
    let (mut app, view) = above_us(layers);
    app.insert_resource(CloudQuality { max_distance: 40_000.0, ..exact(MarchResolution::Full) });
    let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 0.06, -1.0), Vec3::Y);
    let narrow = PerspectiveProjection { fov: 0.15, ..default() };
    app.world_mut().entity_mut(view.camera).insert((looking, Projection::Perspective(narrow)));
    settle(&mut app);
    (app, view)
}

#[test]
fn how_far_a_layer_is_seen_is_its_own_affair() {
    let low = CloudLayer { map: map(5.0), ..cumulus() };
    let high = CloudLayer { map: map(8.0), coverage: 1.0, extinction: 0.01, ..cirrus() };
    let hidden = CloudLayer { coverage: -1.0, ..high.clone() };
    let (mut app, view) = far_away(std::slice::from_ref(&low));
    let alone = cloud_pixels(&app, &view);
    assert!(alone.iter().any(|p| p.w < 0.9) && alone.iter().any(|p| p.w == 1.0), "there is cloud and sky: {alone:?}");
    put(&mut app, &[low.clone(), hidden]);
    for (k, (alone, now)) in alone.iter().zip(cloud_pixels(&app, &view)).enumerate() {
        assert!((*alone - now).abs().max_element() <= 1e-4 * alone.max_element().max(1.0), "{k}: {alone} and {now}");
    }
    // The high one itself is there where the low one has ended: 3.4° up it is 110 km away.
    put(&mut app, &[high]);
    let [row, width] = [SIZE.y / 2, SIZE.x];
    let middle = &cloud_pixels(&app, &view)[(row * width) as usize..][..width as usize];
    assert!(middle.iter().all(|p| p.w < 0.5), "{middle:?}");
}

#[test]
fn a_layer_without_cloud_changes_no_light() {
    let clouds = [CloudLayer { map: map(6.0), ..cumulus() }, CloudLayer { extinction: 0.004, ..cirrus() }];
    // From the ground to over both, it joins them to one deck.
    let hidden = CloudLayer { base: 300.0, thickness: 10_000.0, coverage: -1.0, ..cumulus() };
    let (mut app, view) = above_us(&clouds);
    // So fine that it does not matter where steps begin.
    let fine =
        CloudQuality { step: 12.0, step_growth: 0.001, max_steps: 4000, long_step: 1, ..exact(MarchResolution::Full) };
    app.insert_resource(fine);
    settle(&mut app);
    let alone = cloud_pixels(&app, &view);
    put(&mut app, &[&clouds[..], &[hidden]].concat());
    let now = cloud_pixels(&app, &view);
    let light = |all: &[Vec4]| all.iter().map(|p| p.y).sum::<f32>() / all.len() as f32;
    let differs = alone.iter().zip(&now).map(|(a, b)| (a.y - b.y).abs()).sum::<f32>() / alone.len() as f32;
    println!("light {} and {}, pixels differ by {differs}", light(&alone), light(&now));
    assert!(light(&alone) > 500.0, "there is no cloud");
    assert!(differs < 0.01 * light(&alone), "light {} and {}, pixels differ by {differs}", light(&alone), light(&now));
}

#[test]
fn bad_layers_are_reported_and_change_nothing() {
    let (mut app, view) = above_us(&[cumulus(), cirrus()]);
    refuses::<CloudLayers>(
        &mut app,
        &view,
        &[
            ("layers.1.map.cover = 9.25 is outside its range 0 to 8", |l| l.0[1].map.cover = 9.25),
            ("layers.0.thickness = -700 is outside its range 10 to 20000", |l| l.0[0].thickness = -700.0),
            ("layers.0.base = NaN is outside", |l| l.0[0].base = f32::NAN),
            ("layers.1.far_end = 5500 must be above layers.1.far_start = 6500", |l| {
                (l.0[1].far_start, l.0[1].far_end) = (6500.0, 5500.0);
            }),
            ("layers.1.drift.y = inf is outside", |l| l.0[1].drift.y = f64::INFINITY),
            ("layers holds 9 layers, and 8 is the most", |l| l.0 = vec![CloudLayer::default(); 9]),
        ],
    );
}

#[test]
fn a_map_that_is_missing_leaves_the_last_good_one() {
    let (mut app, view) = above_us(&[cumulus()]);
    let picture = cloud_pixels(&app, &view);
    for (file, says) in [
        ("maps/nowhere.png", "layers.0.map_file did not load: "),
        ("../outside.png", "layers.0.map_file: ../outside.png lies outside the assets folder"),
        ("a#", "layers.0.map_file: \"a#\" is not an asset path"),
    ] {
        let logged = times_logged(says);
        app.world_mut().resource_mut::<CloudLayers>().0[0].map_file = file.to_owned();
        run_until(&mut app, says, 300, |_| times_logged(says) > logged);
        run_updates(&mut app, 10);
        assert_eq!(times_logged(says), logged + 1, "{file} is not reported once");
        assert!(cloud_pixels(&app, &view) == picture, "{file} changes the picture");
        assert!(app.world().resource::<CloudStatus>().is_ready(), "{file} is waited for without end");
    }
    // One that is there is taken, or the above would prove nothing.
    app.world_mut().resource_mut::<CloudLayers>().0[0].map_file = "textures/blue_noise.png".to_owned();
    run_updates(&mut app, 3);
    run_until(&mut app, "the file's map", 300, |app| app.world().resource::<CloudStatus>().is_ready());
    run_updates(&mut app, 3);
    assert!(cloud_pixels(&app, &view) != picture, "a map from a file changes nothing");
}
