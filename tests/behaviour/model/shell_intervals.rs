//! Rays against the layer: the shader's intervals against the CPU's, from below the sea to space.

use bevy::{app::App, math::DVec3};
use bevy_cumulus::reference::planet::{PLANET_RADIUS, altitude, shell_intervals, shell_roots};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::support::{
    evaluate::{COUNT, R, U, on_gpu},
    gpu::shader_app,
};

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

/// How far a root of `shell_roots` may lie from the true one. In f32 b² is wrong by 5 U, c by 4 U and their difference by one
/// more: that moves the root of the discriminant, and by it q = |b| + √(b² − c). Rounding on the way to q and c/q is at
/// most 20 U. Both roots are wrong by the same share. `None` where the errors decide whether the ray hits at all.
fn root_tolerance([h0, mu, ..]: [f64; 5], shell: f64, root: f64) -> Option<f64> {
    let b = (PLANET_RADIUS + h0) * mu;
    let c = (h0 - shell) * (2.0 * PLANET_RADIUS + h0 + shell);
    let discriminant = b * b - c;
    let error = 6.0 * U * (b * b + c.abs());
    let moved = (discriminant + error).max(0.0).sqrt() - (discriminant - error).max(0.0).sqrt();
    let q = b.abs() + discriminant.max(0.0).sqrt();
    (discriminant.abs() > error).then(|| root.abs() * (20.0 * U + moved / q))
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
            let on = |shell: &&f64| shell_roots(h0, mu, **shell, PLANET_RADIUS).is_some_and(|roots| roots.contains(&t));
            shells.iter().find(on).map_or(0.0, |&shell| root_tolerance(ray, shell, t).unwrap_or(f64::INFINITY))
        };
        let mut expected = shell_intervals(h0, mu, bottom, top, PLANET_RADIUS, t_max);
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
