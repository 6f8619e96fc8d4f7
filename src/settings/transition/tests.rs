//! Transitions between the built-in skies, without a renderer.

use bevy::math::DVec3;

use super::{sky::Leg, *};
use crate::settings::{CloudPhase, MAX_LAYERS, PhaseFunction};

/// Cloud time at which the tests begin: months of wind have passed.
const BEGIN: f64 = 1.0e7;
const SECONDS: f64 = 60.0;

fn all() -> Vec<(&'static str, CloudPreset)> {
    CloudPreset::names().map(|name| (name, CloudPreset::named(name).expect("a built-in preset"))).collect()
}

fn sky(preset: &CloudPreset) -> Sky {
    preset.into()
}

/// Where a layer's shapes are at t, and its wave (m).
fn place(layer: &CloudLayer, t: f64) -> [f64; 4] {
    let wind =
        layer.drift + DVec3::new(layer.wind.x.into(), (layer.wind.y + layer.evolution).into(), layer.wind.z.into()) * t;
    [wind.x, wind.y, wind.z, layer.renewal_drift + f64::from(layer.renewal) * t]
}

fn is_gone(layer: &CloudLayer) -> bool {
    layer.density < 1e-3 || layer.coverage < -0.97 || !layer.enabled
}

/// What would make a layer jump.
fn jump(before: &CloudLayer, now: &CloudLayer, [t0, t1]: [f64; 2]) -> Option<String> {
    let moved = place(now, t1).into_iter().zip(place(before, t0)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let fastest = f64::from(now.wind.length().max(before.wind.length()) + 60.0) * (t1 - t0);
    if moved > fastest {
        return Some(format!("{} leaps by {moved} m", now.name));
    }
    for (what, a, b, most) in [
        ("coverage", now.coverage, before.coverage, 0.02),
        ("density", now.density, before.density, 0.05),
        ("rain", now.rain, before.rain, 0.02),
        ("extinction", now.extinction / before.extinction.max(1e-9), 1.0, 0.1),
        ("base", now.base, before.base, 40.0),
        ("thickness", now.thickness, before.thickness, 40.0),
    ] {
        if (a - b).abs() > most {
            return Some(format!("{}.{what} jumps from {b} to {a}", now.name));
        }
    }
    (now.own_phase != before.own_phase || (now.own_phase && now.phase != before.phase))
        .then(|| format!("{}: another phase function", now.name))
}

/// What would make the light jump: its numbers, its mixture of phase functions, its octaves.
fn light_jump(before: &Sky, now: &Sky) -> Option<String> {
    let shares = |sky: &Sky| sky.light.phases.iter().map(|(_, share)| share).sum::<f32>();
    if (shares(now) - 1.0).abs() > 1e-5 {
        return Some(format!("shares of phase functions sum up to {}", shares(now)));
    }
    let of = |sky: &Sky, phase: &CloudPhase| {
        let near = |other: &CloudPhase| {
            other.function == phase.function
                && (other.g - phase.g).abs() < 0.02
                && (other.g_back - phase.g_back).abs() < 0.02
                && (other.lobe_mix - phase.lobe_mix).abs() < 0.02
                && (other.halo - phase.halo).abs() < 0.02
                && (other.droplet_diameter - phase.droplet_diameter).abs() < 0.5
        };
        sky.light.phases.iter().filter(|(other, _)| near(other)).map(|(_, share)| share).sum::<f32>()
    };
    for (phase, _) in before.light.phases.iter().chain(&now.light.phases) {
        let [a, b] = [of(before, phase), of(now, phase)];
        if (a - b).abs() > 0.02 {
            return Some(format!("the share of {:?} jumps from {a} to {b}", phase.function));
        }
    }
    if !now.light.phases.iter().any(|(phase, _)| *phase == CloudPhase::from(&now.lighting)) {
        return Some(format!("the fields name {:?}, which is not there", now.lighting.phase));
    }
    let numbers = |sky: &Sky| {
        let l = &sky.lighting;
        let [tint, sky_light, ground] = [l.ambient_tint, l.sky_fallback, l.ground_albedo].map(|v| v.max_element());
        [
            ("octaves", sky.light.octaves, 0.05),
            ("attenuation", l.attenuation, 0.02),
            ("contribution", l.contribution, 0.02),
            ("eccentricity", l.eccentricity, 0.02),
            ("diffusion", l.diffusion, 0.2),
            ("diffusion_asymmetry", l.diffusion_asymmetry, 0.02),
            ("phase_limit", l.phase_limit / 100.0, 0.2),
            ("sun_strength", l.sun_strength, 0.05),
            ("ambient_strength", l.ambient_strength, 0.05),
            ("ambient_tint", tint, 0.05),
            ("ambient_desaturation", l.ambient_desaturation, 0.02),
            ("sky_fallback", sky_light, 0.01),
            ("ground_albedo", ground, 0.02),
            ("powder", l.powder, 0.02),
            ("aerial_perspective", l.aerial_perspective, 0.02),
            ("fade_start", l.fade_start, 0.02),
        ]
    };
    let mut pairs = numbers(before).into_iter().zip(numbers(now));
    pairs
        .find(|((_, a, most), (_, b, _))| (a - b).abs() > *most)
        .map(|((what, a, _), (_, b, _))| format!("lighting.{what} jumps from {a} to {b}"))
}

/// Walks through a change and fails at the first jump.
fn walk(name: &str, at: impl Fn(f64) -> Sky, [from, to]: [f64; 2]) {
    let step = SECONDS / 400.0;
    let (mut t, mut before) = (from, at(from));
    while t < to {
        let (earlier, sky) = (t, at(t + step));
        t += step;
        sky.layers.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
        sky.model.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
        sky.lighting.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(light_jump(&before, &sky), None, "{name} at {}", t - BEGIN);
        let (olds, news) = (&before.layers.0, &sky.layers.0);
        assert!(news.len() <= MAX_LAYERS, "{name}: {} layers", news.len());
        let mut left: Vec<&CloudLayer> = olds.iter().collect();
        for now in news {
            let same = |old: &&CloudLayer| {
                old.name == now.name
                    && old.map == now.map
                    && old.shape_scale == now.shape_scale
                    && old.stretch == now.stretch
            };
            // Two of one name may differ in what they are made of alone.
            let partner = (0..left.len()).find(|i| same(&left[*i]) && jump(left[*i], now, [earlier, t]).is_none());
            match partner.or_else(|| (0..left.len()).find(|i| !is_gone(now) && same(&left[*i]))) {
                Some(i) => assert_eq!(jump(left.remove(i), now, [earlier, t]), None, "{name} at {}", t - BEGIN),
                None => assert!(is_gone(now), "{name}: {} is there at once at {}: {now:?}", now.name, t - BEGIN),
            }
        }
        for gone in left {
            assert!(is_gone(gone), "{name}: {} is gone at once at {}", gone.name, t - BEGIN);
        }
        let (a, b) = (&before.model, &sky.model);
        let hidden = |m: &CloudModel| !m.enabled || m.density < 1e-3 || m.coverage < -0.97;
        if !hidden(a) || !hidden(b) {
            assert!(
                (a.coverage - b.coverage).abs() < 0.05 && (a.density - b.density).abs() < 0.05,
                "{name}: the own layer"
            );
            let at = |m: &CloudModel, t: f64| m.drift + m.wind.as_dvec3() * t;
            let moved = (at(b, t) - at(a, earlier)).length();
            assert!(moved < 20.0 * step + 1e-3, "{name}: the own layer leaps by {moved} m");
        }
        before = sky;
    }
}

#[test]
fn nothing_jumps_between_any_two_skies() {
    let all = all();
    for (i, (from, a)) in all.iter().enumerate() {
        for (to, b) in &all[i + 1..] {
            let leg = Leg { start: sky(a), target: sky(b), span: Span { begin: BEGIN, seconds: SECONDS } };
            walk(&format!("{from} to {to}"), |t| leg.at(t), [BEGIN - 1.0, BEGIN + SECONDS + 1.0]);
            let end = leg.at(BEGIN + 2.0 * SECONDS);
            let still = |layer: &CloudLayer| CloudLayer { drift: DVec3::ZERO, renewal_drift: 0.0, ..layer.clone() };
            assert_eq!(end.layers.0.iter().map(still).collect::<Vec<_>>(), b.layers.0, "{from} to {to}");
            assert_eq!(CloudModel { drift: DVec3::ZERO, ..end.model }, b.model, "{from} to {to}");
            assert_eq!(end.lighting, b.lighting);
        }
    }
}

#[test]
fn a_restart_midway_does_not_jump_and_holds_eight_layers() {
    let all = all();
    let mut weather = CloudWeather::default();
    let start = sky(&all[0].1);
    for (k, (_, preset)) in all.iter().enumerate().skip(1) {
        // Each cuts the last one short at another place.
        weather.transition_at(preset, BEGIN + 17.0 * k as f64, SECONDS).expect("a good preset");
    }
    weather.take_in(&start, BEGIN);
    assert_eq!(weather.legs.len(), REMEMBERED);
    let first = weather.legs[0].span.begin;
    let at = |t: f64| weather.leg(t).expect("a leg").at(t);
    walk("one after the other", at, [first - 1.0, BEGIN + 17.0 * all.len() as f64 + SECONDS]);
}

#[test]
fn phase_functions_and_octaves_change_by_degrees() {
    let light = |phase: PhaseFunction, octaves: u32, g: f32, halo: f32| {
        let lighting = CloudLighting { phase, octaves, g, halo, ..CloudLighting::default() };
        CloudPreset { lighting, ..all()[0].1.clone() }
    };
    let presets = [
        light(PhaseFunction::HgDraine, 3, 0.8, 0.0),
        light(PhaseFunction::Ice, 1, 0.8, 0.2),
        light(PhaseFunction::Ice, 5, 0.8, 0.9),
        light(PhaseFunction::HenyeyGreenstein, 2, 0.8, 0.0),
        light(PhaseFunction::HenyeyGreenstein, 4, -0.4, 0.0),
        light(PhaseFunction::Isotropic, 0, 0.0, 0.0),
    ];
    let mut weather = CloudWeather::default();
    for (k, preset) in presets.iter().enumerate().skip(1) {
        // Each cuts the last one short.
        weather.transition_at(preset, BEGIN + 40.0 * k as f64, SECONDS).expect("a good preset");
    }
    weather.take_in(&sky(&presets[0]), BEGIN);
    let at = |t: f64| weather.leg(t).expect("a leg").at(t);
    let end = BEGIN + 40.0 * presets.len() as f64 + SECONDS;
    walk("one light after the other", at, [BEGIN, end]);
    assert_eq!(at(end).lighting, presets[5].lighting);
    assert_eq!(at(end).light, LightMix::from(&presets[5].lighting));
    assert!(
        (0..400).any(|k| at(BEGIN + 0.5 * f64::from(k)).light.phases.len() > 2),
        "a restart forgets what was there"
    );
}

#[test]
fn too_many_layers_take_turns() {
    let many = |name: &str| {
        let layer = |k: u32| CloudLayer { name: format!("{name} {k}"), ..CloudLayer::default() };
        Sky { layers: CloudLayers((0..6).map(layer).collect()), ..Sky::default() }
    };
    let leg = Leg { start: many("a"), target: many("b"), span: Span { begin: BEGIN, seconds: SECONDS } };
    walk("six to six", |t| leg.at(t), [BEGIN - 1.0, BEGIN + SECONDS + 1.0]);
    let names =
        |u: f64| leg.at(BEGIN + u * SECONDS).layers.0.iter().map(|l| l.name[..1].to_owned()).collect::<String>();
    assert_eq!([0.0, 0.3, 0.7, 1.0].map(names), ["aaaaaa", "aaaaaa", "bbbbbb", "bbbbbb"]);
}

#[test]
fn layers_of_one_image_change_in_place_whatever_their_recipes() {
    use crate::weather::WeatherRecipe;
    let layer = |size: u32, coverage: f32| CloudLayer {
        map_file: "maps/painted.png".to_owned(),
        map: WeatherRecipe { size, cover: size as f32 / 256.0, ..WeatherRecipe::default() },
        coverage,
        ..CloudLayer::default()
    };
    let of = |layer| Sky { layers: CloudLayers(vec![layer]), ..Sky::default() };
    let span = Span { begin: BEGIN, seconds: SECONDS };
    let leg = Leg { start: of(layer(512, -0.1)), target: of(layer(1024, 0.2)), span };
    for k in 0..=100 {
        let sky = leg.at(BEGIN + SECONDS * f64::from(k) / 100.0);
        sky.layers.validate().unwrap_or_else(|error| panic!("at {k} %: {error}"));
        assert_eq!(sky.layers.0.len(), 1, "at {k} %: one does not become the other");
    }
    let half = &leg.at(BEGIN + 0.5 * SECONDS).layers.0[0];
    assert!((half.coverage - 0.05).abs() < 1e-6, "{}", half.coverage);
}
