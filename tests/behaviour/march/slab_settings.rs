//! Each setting of light and march on the uniform slab: against its closed form, or the integral that the march stands for.

use std::f64::consts::PI;

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::{
    prelude::*,
    reference::{
        phase::hg,
        planet::{PLANET_RADIUS, shell_intervals},
    },
};

use crate::support::{
    app::{View, until_drawn},
    slab::{
        BOTTOM, STORED, TOP, exact_march, full_radiance, gathered, length_in_slab, plain_light, seen_from, slab,
        slab_app, view_of,
    },
    uniform_slab::UniformSlab,
};

/// 1/m: straight through the slab an optical depth of 1.
const EXTINCTION: f64 = 1e-3;
const STEP: f32 = 20.0;
/// From below, inside (up and down) and above.
const VIEWPOINTS: [(f32, f32); 4] = [(10.0, 60.0), (1900.0, 50.0), (1900.0, -40.0), (6000.0, -75.0)];
/// The longest way to the sun is 1000 m over the sun's height, some more for points that see it lower.
const FARTHEST: f64 = 1000.0 * 1.06;
/// How much light changes within a step of the view beside its mean slope: (k σt · step)² / 24 of it, with k up to 4 (the
/// powder term's e^(−3τ), towards a sun that is not overhead).
const WITHIN_STEP: f64 = 3e-4;

fn sun() -> Vec3 {
    Vec3::new(0.5, 1.0, -0.3).normalize()
}

/// 64 uniform steps towards the sun, to the slab's end from anywhere in it.
fn shadowed_march() -> CloudQuality {
    CloudQuality { light_steps: 64, light_step: uniform_step() as f32, ..exact_march(STEP) }
}

fn uniform_step() -> f64 {
    FARTHEST / f64::from(sun().y) / 64.0
}

/// Compares all viewpoints' light with the integral of `source(cosθ, τ towards the sun)` (1/sr). A light step counts whole
/// or not at all, which moves τ by up to `off(τ)`. Returns the mean relative error, and that of half the range allowed.
fn compare(
    app: &mut App,
    view: &View,
    what: &str,
    off: impl Fn(f64) -> f64,
    source: impl Fn(f64, f64) -> f64,
) -> [f64; 2] {
    let toward = sun().as_dvec3();
    let (mut worst, mut mean, mut range, mut count) = (0.0_f64, 0.0, 0.0, 0.0);
    for viewpoint in VIEWPOINTS {
        for (seen, ray) in seen_from(app, view, viewpoint) {
            let height = f64::from(viewpoint.0);
            let cos_theta = ray.dot(toward);
            let near = |depth: f64| {
                let off = off(depth);
                [(depth - off).max(0.0), depth, depth + off].map(|depth| source(cos_theta, depth))
            };
            let gather = |source: &dyn Fn(f64) -> f64| gathered(height, ray, toward, EXTINCTION, source);
            let exact = gather(&|depth| source(cos_theta, depth));
            let least = gather(&|depth| near(depth).into_iter().fold(f64::INFINITY, f64::min));
            let most = gather(&|depth| near(depth).into_iter().fold(0.0, f64::max));
            if exact == 0.0 {
                assert_eq!(seen.xyz(), Vec3::ZERO, "{what}, {viewpoint:?} {ray}");
                continue;
            }
            for (channel, value) in seen.xyz().to_array().into_iter().enumerate() {
                let share = f64::from(value) / (4.0 * PI * full_radiance(channel));
                let allowed = [least * (1.0 - STORED - WITHIN_STEP), most * (1.0 + STORED + WITHIN_STEP)];
                assert!(
                    (allowed[0]..=allowed[1]).contains(&share),
                    "{what}, {viewpoint:?} {ray}: {share} /sr, not {exact} ({allowed:?})"
                );
                worst = worst.max((share / exact - 1.0).abs());
                mean += share / exact - 1.0;
                range += 0.5 * (most - least) / exact;
                count += 1.0;
            }
        }
    }
    let [mean, range] = [mean, range].map(|sum| sum / f64::max(count, 1.0));
    println!("{what}: worst {worst:.2e}, mean {mean:.2e}, half of what is allowed {range:.2e}, {count} values");
    [mean, range]
}

/// Light steps too many and too few cancel: in the mean what f16 cuts off is left, and little more.
fn assert_cancels(what: &str, [mean, range]: [f64; 2]) {
    let allowed = 0.5 * STORED + WITHIN_STEP + 0.1 * range;
    assert!(mean.abs() < allowed, "{what}: {mean:e} on average, {allowed:e} is allowed");
}

#[test]
fn octaves_are_their_sum() {
    let (mut app, view) = slab_app(EXTINCTION, sun());
    app.insert_resource(shadowed_march());
    until_drawn(&mut app);
    // b near 1 and c well below it: the sixteenth octave is 3 % of the sum, and each has a lobe of its own.
    let (a, b, c, g) = (0.6_f32, 0.9_f32, 0.7_f32, 0.6_f32);
    for octaves in [0, 1, 6, 16] {
        app.insert_resource(CloudLighting {
            octaves,
            attenuation: a,
            contribution: b,
            eccentricity: c,
            phase: PhaseFunction::HenyeyGreenstein,
            g,
            ..plain_light()
        });
        let source = |cos_theta: f64, depth: f64| {
            let power = |x: f32, i: u32| f64::from(x).powi(i as i32);
            let octave = |i| power(b, i) * hg(f64::from(g) * power(c, i), cos_theta) * (-power(a, i) * depth).exp();
            (0..octaves).map(octave).sum()
        };
        let what = format!("{octaves} octaves");
        let found = compare(&mut app, &view, &what, |_| 0.5 * EXTINCTION * uniform_step(), source);
        assert_cancels(&what, found);
    }
}

#[test]
fn powder_darkens_what_the_sun_meets_first() {
    let (mut app, view) = slab_app(EXTINCTION, sun());
    app.insert_resource(shadowed_march());
    until_drawn(&mut app);
    for powder in [0.4_f32, 1.0] {
        app.insert_resource(CloudLighting { powder, ..plain_light() });
        // Costa 2.20, mixed in.
        let source = |_, depth: f64| (-depth).exp() * (1.0 - f64::from(powder) * (-2.0 * depth).exp()) / (4.0 * PI);
        let what = format!("powder {powder}");
        let found = compare(&mut app, &view, &what, |_| 0.5 * EXTINCTION * uniform_step(), source);
        assert_cancels(&what, found);
    }
}

#[test]
fn growing_light_steps_reach_as_far_as_uniform_ones() {
    let (mut app, view) = slab_app(EXTINCTION, sun());
    until_drawn(&mut app);
    // Eleven steps from 10 m on make 1.7 km; uniform ones would make 110 m.
    for (growth, light_step, light_steps) in [(1.5_f32, 10.0_f32, 11), (1.2, 10.0, 19)] {
        let (g, first) = (f64::from(growth), f64::from(light_step));
        let reach = first * (g.powi(light_steps) - 1.0) / (g - 1.0);
        assert!(reach > FARTHEST / f64::from(sun().y), "{reach} m");
        let light_steps = light_steps as u32;
        app.insert_resource(CloudQuality { light_steps, light_step, light_growth: growth, ..exact_march(STEP) });
        // A step that ends past d metres is first + (growth − 1) · d long at most.
        let off = |depth: f64| 0.5 * (EXTINCTION * first + (g - 1.0) * depth);
        let what = format!("light steps that grow by {growth}");
        let found = compare(&mut app, &view, &what, off, |_, depth| (-depth).exp() / (4.0 * PI));
        assert_cancels(&what, found);
    }
}

#[test]
fn what_the_stop_leaves_is_opaque_and_lit_alike() {
    let (mut app, view) = slab_app(EXTINCTION, sun());
    until_drawn(&mut app);
    let (mut stopped, mut passed) = (0, 0);
    for stop in [0.075_f32, 0.3] {
        for viewpoint in [(10.0, 60.0), (10.0, 20.0), (1900.0, 0.0), (6000.0, -40.0)] {
            let [without, with] = [0.0, stop].map(|transmittance_stop| {
                app.insert_resource(CloudQuality { transmittance_stop, ..exact_march(STEP) });
                seen_from(&mut app, &view, viewpoint)
            });
            for ((seen, ray), (whole, _)) in with.into_iter().zip(without) {
                let through = (-EXTINCTION * length_in_slab(viewpoint.0.into(), ray.y).0).exp();
                let stop = f64::from(stop);
                let exact = ((through - stop) / (1.0 - stop)).max(0.0);
                (stopped, passed) = (stopped + u32::from(through < stop), passed + u32::from(exact > 0.0));
                // Unshadowed light is as strong everywhere, so that no part of the way there stands out.
                for (value, exact, whole) in [
                    (f64::from(seen.w), exact, f64::from(whole.w)),
                    (f64::from(seen.y) / full_radiance(1), 1.0 - exact, f64::from(whole.y) / full_radiance(1)),
                ] {
                    // 1e-4: what a last place of the ray's slope makes of a long way.
                    assert!(
                        (value - exact).abs() <= STORED * exact + 1e-4,
                        "{viewpoint:?} {ray}: {value}, not {exact}"
                    );
                    assert!((value - whole).abs() <= stop + STORED, "{viewpoint:?} {ray}: {value} for {whole}");
                }
            }
        }
    }
    assert!(stopped > 50 && passed > 50, "{stopped} rays stopped, {passed} passed");
}

#[test]
fn samples_below_the_density_skip_are_left_out() {
    const MIDDLE: f64 = 2000.0;
    // The same extinction above and below; only densities differ.
    let two = UniformSlab { densities: [0.2, 0.8], ..slab(EXTINCTION) };
    let (mut app, view) = view_of(&two, sun());
    until_drawn(&mut app);
    for (density_skip, bottom) in [(0.1, BOTTOM), (0.5, MIDDLE), (0.85, TOP)] {
        app.insert_resource(CloudQuality { density_skip, ..exact_march(STEP) });
        for viewpoint in [(10.0, 60.0), (6000.0, -70.0)] {
            for (seen, ray) in seen_from(&mut app, &view, viewpoint) {
                let spans = shell_intervals(viewpoint.0.into(), ray.y, bottom, TOP, PLANET_RADIUS, 1e7);
                let length: f64 = if bottom < TOP { spans.iter().map(|[a, b]| b - a).sum() } else { 0.0 };
                let exact = (-EXTINCTION * length).exp();
                // A step counts whole or not at all where the density changes.
                let allowed = 0.5 * EXTINCTION * f64::from(STEP) + STORED;
                let light = f64::from(seen.y) / full_radiance(1);
                for (value, exact) in [(f64::from(seen.w), exact), (light, 1.0 - exact)] {
                    assert!((value - exact).abs() <= allowed, "skip {density_skip}, {ray}: {value}, not {exact}");
                }
                assert!(length > 0.0 || seen == Vec4::W, "skip {density_skip}, {ray}: {seen}");
            }
        }
    }
}

#[test]
fn clouds_fade_before_the_cut_off_and_end_there() {
    const CUT_OFF: f64 = 5000.0;
    const FADE_START: f64 = 0.6;
    let (mut app, view) = slab_app(EXTINCTION, sun());
    app.insert_resource(CloudLighting { fade_start: FADE_START as f32, ..plain_light() })
        .insert_resource(CloudQuality { max_distance: CUT_OFF as f32, ..exact_march(STEP) });
    until_drawn(&mut app);
    let (mut whole, mut fading, mut beyond) = (0, 0, 0);
    for viewpoint in [(10.0, 25.0), (10.0, 35.0)] {
        for (seen, ray) in seen_from(&mut app, &view, viewpoint) {
            let [start, end] = span_before(viewpoint.0.into(), ray, CUT_OFF);
            if end <= start {
                beyond += 1;
                assert_eq!(seen, Vec4::W, "{viewpoint:?} {ray}: the cloud begins at {start} m");
                continue;
            }
            // Each part is shown by its own distance, and all of it hides what is behind.
            let dt = (end - start) / 2000.0;
            let opacity: f64 = (0..2000)
                .map(|k| {
                    let t = (f64::from(k) + 0.5) * dt;
                    let x = (((start + t) / CUT_OFF - FADE_START) / (1.0 - FADE_START)).clamp(0.0, 1.0);
                    EXTINCTION * dt * (-EXTINCTION * t).exp() * (1.0 - x * x * (3.0 - 2.0 * x))
                })
                .sum();
            let fade = opacity / (1.0 - (-EXTINCTION * (end - start)).exp());
            (whole, fading) = (whole + u32::from(fade > 0.99), fading + u32::from((0.02..0.98).contains(&fade)));
            // 4 per mille: the fade is that of a step's middle.
            let light = f64::from(seen.y) / full_radiance(1);
            for (value, exact) in [(f64::from(seen.w), 1.0 - opacity), (light, opacity)] {
                let allowed = STORED * exact + 4e-3;
                assert!((value - exact).abs() <= allowed, "{viewpoint:?} {ray}: {value}, not {exact}, {fade} shown");
            }
        }
    }
    println!("{whole} rays see whole clouds, {fading} fading ones, {beyond} none");
    assert!(whole > 5 && fading > 20 && beyond > 10, "{whole} whole, {fading} fading, {beyond} beyond");
}

/// Where a ray from below enters and leaves the slab, or what is seen of it.
fn span_before(height: f64, ray: DVec3, cut_off: f64) -> [f64; 2] {
    let [start, end] = shell_intervals(height, ray.y, BOTTOM, TOP, PLANET_RADIUS, 1e7)[0];
    [start, end.min(cut_off)]
}
