//! The shaders' maths against the CPU's, over many random inputs.
//!
//! Inputs are f32 and taken as exact, so what is compared is the arithmetic. `U` is the unit roundoff of f32: an exact
//! operation, rounded, is wrong by one U relatively; WGSL allows a division or square root about five.

use bevy::{
    app::App,
    math::{DVec2, DVec3, Vec3},
};
use bevy_cumulus::reference::{
    integrate::{mean_transmittance, step_energy_conserving},
    planet::{PLANET_RADIUS, altitude, map_position, shell_roots},
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::gpu::{run_compute, shader_app};

/// Unit roundoff of f32.
pub const U: f64 = 5.960_464_5e-8;
pub const COUNT: usize = 20_000;
const R: f32 = PLANET_RADIUS as f32;

/// Runs `body` for each item: it reads `values[i..]` (`N` floats) and writes `results[o..]` (`M` floats).
pub fn on_gpu<const N: usize, const M: usize>(
    app: &mut App,
    imports: &str,
    body: &str,
    inputs: &[[f32; N]],
) -> Vec<[f32; M]> {
    let shader = format!(
        "{imports}
@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    let i = id.x * {N}u;
    let o = id.x * {M}u;
    if i >= arrayLength(&values) {{
        return;
    }}
    {body}
}}
"
    );
    let count = inputs.len();
    let written = run_compute(app, &shader, inputs.as_flattened(), count * M, count as u32);
    written.as_chunks().0.to_vec()
}

/// The largest value, with the input that gave it; a NaN counts as largest.
pub fn worst<T>(errors: impl Iterator<Item = (f64, T)>) -> (f64, T) {
    errors
        .reduce(|a, b| if a.0.is_nan() || a.0 >= b.0 { a } else { b })
        .expect("nothing was compared")
}

fn intervals_on_gpu(app: &mut App, rays: &[[f32; 5]]) -> Vec<[f32; 4]> {
    on_gpu(
        app,
        "import bevy_cumulus::model::planet::shell_intervals;",
        &format!(
            "let found = shell_intervals(values[i], values[i + 1u], values[i + 2u], values[i + 3u], {R}, values[i + 4u]);
    results[o] = found.x;
    results[o + 1u] = found.y;
    results[o + 2u] = found.z;
    results[o + 3u] = found.w;"
        ),
        rays,
    )
}

#[test]
fn altitude_is_within_two_centimetres_up_to_60_km_away() {
    let mut rng = StdRng::seed_from_u64(1);
    let points: Vec<[f32; 3]> = (0..COUNT)
        .map(|_| {
            let camera: f32 = rng.random_range(-100.0..30_000.0);
            let away = loop {
                let p = Vec3::from_array([(); 3].map(|()| rng.random_range(-60_000.0..60_000.0)));
                if p.length() < 60_000.0 {
                    break p;
                }
            };
            [away.x, camera + away.y, away.z]
        })
        .collect();
    let found = altitudes_on_gpu(&mut shader_app(), &points);
    let error = |(p, [h]): (&[f32; 3], &[f32; 1])| ((altitude(double(*p), PLANET_RADIUS) - f64::from(*h)).abs(), *p);
    let (error, p) = worst(points.iter().zip(&found).map(error));
    println!("altitude: worst {error} m at {p:?}");
    assert!(error < 0.02, "{error} m at {p:?}");
}

#[test]
fn altitude_stays_good_a_thousand_kilometres_away_and_finite_everywhere() {
    let mut rng = StdRng::seed_from_u64(2);
    let mut points: Vec<[f32; 3]> =
        (0..COUNT).map(|_| [1e6, 3e5, 1e6].map(|size: f32| rng.random_range(-size..size))).collect();
    points.extend([[0.0; 3], [0.0, -R, 0.0], [0.0, -2.0 * R, 0.0], [0.0, -3.0 * R, 1.0], [5e7, 1e8, 1.0]]);
    let found = altitudes_on_gpu(&mut shader_app(), &points);
    for (p, [h]) in points.iter().zip(found) {
        let exact = altitude(double(*p), PLANET_RADIUS);
        // One rounding of y and of the lift, each at most |y| + |h| in size, and the lift's own eight.
        let lift = exact - f64::from(p[1]);
        let allowed = 2.0 * U * (exact.abs() + f64::from(p[1]).abs()) + 8.0 * U * lift.abs();
        // Behind the planet's centre the distance to it is what gets rounded.
        let allowed = if p[1] <= -R { allowed.max(2.0) } else { allowed };
        assert!((exact - f64::from(h)).abs() <= allowed, "{h} m, not {exact} m, at {p:?}");
    }
}

fn altitudes_on_gpu(app: &mut App, points: &[[f32; 3]]) -> Vec<[f32; 1]> {
    on_gpu(
        app,
        "import bevy_cumulus::model::planet::altitude;",
        &format!("results[o] = altitude(vec3<f32>(values[i], values[i + 1u], values[i + 2u]), {R});"),
        points,
    )
}

fn double(p: [f32; 3]) -> DVec3 {
    Vec3::from_array(p).as_dvec3()
}

/// How far a root of `shell_roots` may lie from the true one. In f32 b² is wrong by 5 U, c by 4 U and their
/// difference by one more: that moves the root by what it moves the square root of the discriminant. Rounding of the square
/// root, q and c/q adds 16 U of the root. `None` where those errors decide whether the ray hits at all.
fn root_tolerance([h0, mu, ..]: [f64; 5], shell: f64, root: f64) -> Option<f64> {
    let b = (PLANET_RADIUS + h0) * mu;
    let c = (h0 - shell) * (2.0 * PLANET_RADIUS + h0 + shell);
    let discriminant = b * b - c;
    let error = 6.0 * U * (b * b + c.abs());
    let moved = (discriminant + error).max(0.0).sqrt() - (discriminant - error).max(0.0).sqrt();
    (discriminant.abs() > error).then_some(moved + 16.0 * U * root.abs())
}

/// A ray that starts anywhere, from below sea level to space, and looks anywhere, often along a shell.
fn random_ray(rng: &mut StdRng) -> [f32; 5] {
    let bottom: f32 = rng.random_range(-300.0..4000.0);
    let top = bottom + rng.random_range(100.0..10_000.0);
    let h0 = match rng.random_range(0..5) {
        0 => rng.random_range(-100.0..0.0),
        1 => rng.random_range(0.0..bottom.max(1.0)),
        2 => rng.random_range(bottom..top),
        3 => rng.random_range(top..30_000.0_f32.max(top + 1.0)),
        _ => rng.random_range(30_000.0..1e7),
    };
    let mu = match rng.random_range(0..4) {
        0 => rng.random_range(-1.0..=1.0),
        1 => rng.random_range(-0.05..0.05),
        _ => {
            // Near a tangent of one of the shells or the ground.
            let shell = [bottom, top, 0.0][rng.random_range(0..3)];
            let sine = (f64::from(R + shell) / f64::from(R + h0)).min(1.0);
            let tangent = -(1.0 - sine * sine).sqrt() as f32;
            tangent + rng.random_range(-1e-3_f32..1e-3)
        }
    };
    let t_max = [1e5, 1e6, 3e7][rng.random_range(0..3)];
    [h0, mu.clamp(-1.0, 1.0), bottom, top, t_max]
}

#[test]
fn intervals_agree_with_the_reference_from_every_viewpoint() {
    let mut rng = StdRng::seed_from_u64(3);
    let rays: Vec<[f32; 5]> = (0..3 * COUNT).map(|_| random_ray(&mut rng)).collect();
    let found = intervals_on_gpu(&mut shader_app(), &rays);
    let (mut undecided, mut twice) = (0, 0);
    for (ray, found) in rays.iter().zip(&found) {
        let ray = ray.map(f64::from);
        let [h0, mu, bottom, top, t_max] = ray;
        let shells = [bottom, top, 0.0];
        if shells.iter().any(|&shell| root_tolerance(ray, shell, 0.0).is_none()) {
            assert!(found.iter().all(|t| t.is_finite()), "{ray:?}: {found:?}");
            undecided += 1;
            continue;
        }
        // What may be off, at an end that lies on a shell; ends at 0 and t_max are exact.
        let tolerance = |t: f64| {
            let on = |shell: &&f64| {
                shell_roots(h0, mu, **shell, PLANET_RADIUS).is_some_and(|roots| roots.contains(&t))
            };
            shells.iter().find(on).map_or(0.0, |&shell| root_tolerance(ray, shell, t).unwrap_or(f64::INFINITY))
        };
        let mut expected =
            bevy_cumulus::reference::planet::shell_intervals(h0, mu, bottom, top, PLANET_RADIUS, t_max);
        let mut found: Vec<[f64; 2]> =
            found.as_chunks::<2>().0.iter().map(|i| i.map(f64::from)).filter(|i| *i != [0.0; 2]).collect();
        twice += u32::from(expected.len() == 2);
        if found.len() != expected.len() {
            // A sliver may be lost or found; nothing longer.
            let slack = expected.iter().flatten().map(|&t| tolerance(t)).fold(16.0 * U * t_max, f64::max);
            expected.retain(|[a, b]| b - a > 2.0 * slack);
            found.retain(|[a, b]| b - a > 2.0 * slack);
        }
        assert_eq!(found.len(), expected.len(), "{ray:?}: {found:?}, not {expected:?}");
        for (&t, &exact) in found.iter().flatten().zip(expected.iter().flatten()) {
            let (error, allowed) = ((t - exact).abs(), tolerance(exact));
            assert!(error <= allowed, "{ray:?}: {t}, not {exact}: {error} m off, {allowed} m allowed");
        }
    }
    println!("intervals: {undecided} rays too near a tangent for f32, {twice} cross the shell twice");
    assert!(undecided < rays.len() / 10 && twice > 500, "{undecided} undecided, {twice} twice");
}

#[test]
fn level_rays_are_not_lost() {
    // b = 0 exactly: from the ground, below, at the lower shell, inside, at the upper shell, above.
    let heights = [0.0_f32, 500.0, 1500.0, 2500.0, 4000.0, 9000.0];
    let rays: Vec<[f32; 5]> =
        heights.iter().flat_map(|&h| [0.0, -0.0].map(|mu| [h, mu, 1500.0, 4000.0, 1e6])).collect();
    let found = intervals_on_gpu(&mut shader_app(), &rays);
    let reach = |h0: f64, shell: f64| ((shell - h0) * (2.0 * PLANET_RADIUS + h0 + shell)).max(0.0).sqrt();
    for (ray, found) in rays.iter().zip(&found) {
        let h0 = f64::from(ray[0]);
        let expected = if h0 >= 4000.0 { [0.0; 4] } else { [reach(h0, 1500.0), reach(h0, 4000.0), 0.0, 0.0] };
        for (t, expected) in found.iter().zip(expected) {
            assert!((f64::from(*t) - expected).abs() <= 1e-6 * expected, "{ray:?}: {found:?}");
        }
    }
}

#[test]
fn rays_that_dip_below_the_layer_and_come_out_again_have_both_intervals() {
    let (bottom, top) = (1500.0_f32, 4000.0_f32);
    // From between, from above and from space, past a point 700 m above the sea.
    let heights = [2000.0_f32, 3900.0, 4500.0, 12_000.0, 400_000.0, 5e6];
    let rays: Vec<[f32; 5]> = heights
        .iter()
        .map(|&h0| {
            let sine = (PLANET_RADIUS + 700.0) / (PLANET_RADIUS + f64::from(h0));
            [h0, -(1.0 - sine * sine).sqrt() as f32, bottom, top, 3e7]
        })
        .collect();
    for (ray, found) in rays.iter().zip(intervals_on_gpu(&mut shader_app(), &rays)) {
        let [a, b, c, d] = found;
        assert!(a < b && b < c && c < d, "{ray:?}: {found:?}");
        assert_eq!(a == 0.0, ray[0] < top, "{ray:?}: {found:?}");
        let along = |t: f32| {
            let (t, mu) = (f64::from(t), f64::from(ray[1]));
            altitude(DVec3::new(t * (1.0 - mu * mu).sqrt(), f64::from(ray[0]) + t * mu, 0.0), PLANET_RADIUS)
        };
        for (t, shell) in [(b, bottom), (c, bottom), (d, top)] {
            assert!((along(t) - f64::from(shell)).abs() < 20.0, "{ray:?}: {found:?}: {}", along(t));
        }
        assert!((along(0.5 * (b + c)) - 700.0).abs() < 20.0, "{ray:?}: {found:?}");
    }
}

#[test]
fn the_planet_ends_rays_from_above_it_only() {
    let cases: [([f32; 5], bool); 8] = [
        ([500.0, -0.5, 1500.0, 4000.0, 1e6], false),
        ([500.0, 0.5, 1500.0, 4000.0, 1e6], true),
        // Below sea level: up and level see the layer, down does not.
        ([-50.0, 0.3, 1500.0, 4000.0, 1e6], true),
        ([-50.0, 0.0, 1500.0, 4000.0, 1e6], true),
        ([-50.0, -1e-3, 1500.0, 4000.0, 1e6], false),
        // The layer reaches below the sea: only what is above it counts.
        ([2000.0, -1.0, -300.0, 1000.0, 1e6], true),
        // Out of reach, and cut off by the surface in front of the far side.
        ([500.0, 0.5, 1500.0, 4000.0, 900.0], false),
        ([100.0, -1e-2, 1500.0, 4000.0, 1e6], false),
    ];
    let rays = cases.map(|(ray, _)| ray);
    let found = intervals_on_gpu(&mut shader_app(), &rays);
    for ((ray, sees), found) in cases.iter().zip(&found) {
        assert_eq!(found[1] > found[0], *sees, "{ray:?}: {found:?}");
    }
    assert!((found[5][0] - 1000.0).abs() < 0.01 && (found[5][1] - 2000.0).abs() < 0.01, "{:?}", found[5]);
}

#[test]
fn map_coordinates_agree_with_the_reference() {
    let mut rng = StdRng::seed_from_u64(4);
    let mut points: Vec<[f32; 3]> = (0..COUNT)
        .map(|k| {
            let size = [100.0_f32, 60_000.0, 1e6, 6e6][k % 4];
            // Both sides of where the polynomial gives way to half angles.
            let x = if k % 40 == 3 { 0.2 * R } else { rng.random_range(-size..size) };
            let z = if k % 40 == 3 { rng.random_range(-10.0..10.0) } else { rng.random_range(-size..size) };
            [x, rng.random_range(-size.min(3e4)..3e4), z]
        })
        .collect();
    points.extend([[0.0, 2000.0, 0.0], [1e-20, 0.0, 0.0], [0.0, -R, 0.0], [0.0, -3.0 * R, 0.0], [0.0, -R, 1.0]]);
    let found: Vec<[f32; 2]> = on_gpu(
        &mut shader_app(),
        "import bevy_cumulus::model::planet::map_position;",
        &format!(
            "let found = map_position(vec3<f32>(values[i], values[i + 1u], values[i + 2u]), {R});
    results[o] = found.x;
    results[o + 1u] = found.y;"
        ),
        &points,
    );
    let (error, p) = worst(points.iter().zip(&found).map(|(p, [x, z])| {
        let exact = map_position(double(*p), PLANET_RADIUS);
        let error = (exact - DVec2::new((*x).into(), (*z).into())).length();
        (error / exact.length().max(1e-3), *p)
    }));
    println!("map position: worst {error} of its length, at {p:?}");
    // Some 16 roundings, divisions and roots among them: 1 m at 1000 km.
    assert!(error < 1e-6, "{error} of its length, at {p:?}");
}

#[test]
fn a_step_of_the_march_agrees_with_the_reference() {
    let mut rng = StdRng::seed_from_u64(5);
    let mut steps: Vec<[f32; 3]> = (0..COUNT)
        .map(|_| {
            let depth = 10_f64.powf(rng.random_range(-12.0..2.0));
            let dt: f32 = rng.random_range(0.5..5000.0);
            [rng.random_range(0.0..1e5), (depth / f64::from(dt)) as f32, dt]
        })
        .collect();
    steps.extend([[3.0, 0.0, 90.0], [0.0, 0.1, 90.0], [1.0, 1.0, 1e4], [1.0, 0.5, 1.0], [1.0, 0.499_999_97, 1.0]]);
    let found: Vec<[f32; 3]> = on_gpu(
        &mut shader_app(),
        "import bevy_cumulus::render::march::integrate::{step_energy_conserving, step_naive};",
        "let source = values[i] * vec3<f32>(1.0, 0.5, 0.25);
    let step = step_energy_conserving(source, values[i + 1u], values[i + 2u]);
    results[o] = step.x;
    results[o + 1u] = step.z;
    results[o + 2u] = step_naive(source, values[i + 1u], values[i + 2u]).y;",
        &steps,
    );
    for (step, found) in steps.iter().zip(&found) {
        let [source, sigma_t, dt] = step.map(f64::from);
        let exact = step_energy_conserving(source * DVec3::new(1.0, 0.5, 0.25), sigma_t, dt);
        // WGSL allows exp(−x) 3 + 2x units of 2 U; 1 − exp(−x) divides that by at least 0.39.
        let allowed = 2e-6 * exact;
        assert!((f64::from(found[0]) - exact.x).abs() <= allowed.x, "{step:?}: {found:?}, not {exact}");
        assert!((f64::from(found[1]) - exact.z).abs() <= allowed.z, "{step:?}: {found:?}, not {exact}");
        assert!((f64::from(found[2]) - 0.5 * source * dt).abs() <= 4.0 * U * source * dt, "{step:?}: {found:?}");
    }
    assert!(mean_transmittance(1e-30) == 1.0);
}
