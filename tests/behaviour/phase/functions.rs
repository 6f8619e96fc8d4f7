//! Phase functions: the shader's against the CPU's, their normalisation, and the published fit.

use std::f64::consts::PI;

use bevy::app::App;
use bevy_cumulus::{
    reference::phase::{HgDraine, Phase, cornette_shanks, draine, hg, rayleigh, schlick_k},
    settings::{CloudLighting, PhaseFunction, SettingsError},
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::support::{
    evaluate::{COUNT, on_gpu, worst},
    gpu::shader_app,
};

/// Diameter; g_HG, g_D, α, w; p at cosθ = 1, .99, .5, 0, −1; mean cosine. From the fit's authors' formulas.
const TABLE: [[f64; 11]; 4] = [
    [5.0, 0.970678, 0.508342, 17.0681, 0.447829, 101.131, 1.26445, 0.0249032, 0.00288214, 0.0147816, 0.84342],
    [10.0, 0.988177, 0.555671, 21.9955, 0.481955, 586.86, 0.833431, 0.0214863, 0.00172563, 0.012715, 0.86416],
    [20.0, 0.994610, 0.593791, 27.1137, 0.498159, 2742.51, 0.732359, 0.0188364, 0.00114718, 0.010914, 0.87931],
    [50.0, 0.997952, 0.625084, 32.3154, 0.507618, 18673.4, 0.721923, 0.0166804, 0.000800114, 0.00948307, 0.89119],
];
const COSINES: [f32; 5] = [1.0, 0.99, 0.5, 0.0, -1.0];

/// (phase function, cosθ, eccentricity) on the GPU.
fn phases_on_gpu(app: &mut App, inputs: &[(Phase, f32, f32)]) -> Vec<f32> {
    let inputs: Vec<[f32; 7]> = inputs
        .iter()
        .map(|(phase, cosine, eccentricity)| {
            let (kind, [x, y, z, w]) = phase.shader_parameters();
            [kind as f32, x, y, z, w, *cosine, *eccentricity]
        })
        .collect();
    let found: Vec<[f32; 1]> = on_gpu(
        app,
        "import bevy_cumulus::render::march::phase::phase;",
        "let params = vec4<f32>(values[i + 1u], values[i + 2u], values[i + 3u], values[i + 4u]);
    results[o] = phase(u32(values[i]), params, values[i + 5u], values[i + 6u]);",
        &inputs,
    );
    found.into_iter().flatten().collect()
}

/// The same phase function with its parameters rounded as the GPU gets them.
fn rounded(phase: Phase) -> Phase {
    let [x, y, z, w] = phase.shader_parameters().1.map(f64::from);
    match phase {
        Phase::Isotropic => phase,
        Phase::HenyeyGreenstein { .. } => Phase::HenyeyGreenstein { g: x },
        Phase::TwoLobe { .. } => Phase::TwoLobe { g: x, g_back: y, mix: z },
        Phase::HgDraine(_) => Phase::HgDraine(HgDraine { g_hg: x, g_d: y, alpha: z, w }),
        Phase::Rayleigh => phase,
        Phase::CornetteShanks { .. } => Phase::CornetteShanks { g: x },
        Phase::Schlick { .. } => Phase::Schlick { k: x },
    }
}

fn random_phase(rng: &mut StdRng) -> Phase {
    match rng.random_range(0..7) {
        0 => Phase::Isotropic,
        1 => Phase::HenyeyGreenstein { g: rng.random_range(-0.998..0.998) },
        2 => Phase::TwoLobe {
            g: rng.random_range(-0.99..0.99),
            g_back: rng.random_range(-0.99..0.99),
            mix: rng.random_range(0.0..=1.0),
        },
        3 => Phase::Rayleigh,
        4 => Phase::CornetteShanks { g: rng.random_range(-0.99..0.99) },
        5 => Phase::Schlick { k: schlick_k(rng.random_range(-0.99..0.99)) },
        _ => Phase::HgDraine(HgDraine::from_diameter(rng.random_range(5.0..=50.0)).unwrap()),
    }
}

/// One of each kind, the narrowest peaks among them.
fn every_phase() -> Vec<Phase> {
    let droplets = |d| Phase::HgDraine(HgDraine::from_diameter(d).unwrap());
    vec![
        Phase::Isotropic,
        Phase::HenyeyGreenstein { g: 0.0 },
        Phase::HenyeyGreenstein { g: 0.8 },
        Phase::HenyeyGreenstein { g: -0.6 },
        Phase::HenyeyGreenstein { g: 0.998 },
        Phase::HenyeyGreenstein { g: -0.99 },
        Phase::TwoLobe { g: 0.8, g_back: -0.3, mix: 0.3 },
        Phase::TwoLobe { g: 0.99, g_back: -0.99, mix: 0.5 },
        droplets(5.0),
        droplets(12.0),
        droplets(50.0),
        Phase::Rayleigh,
        Phase::CornetteShanks { g: 0.0 },
        Phase::CornetteShanks { g: 0.8 },
        Phase::CornetteShanks { g: -0.99 },
        Phase::Schlick { k: schlick_k(0.8) },
        Phase::Schlick { k: schlick_k(-0.5) },
        Phase::Schlick { k: schlick_k(0.99) },
    ]
}

/// ∫ over the sphere of p·f(cosθ) dω. Peaks lie at either end: 1 ∓ cosθ = s⁴ gathers the nodes there.
fn over_sphere(phase: &Phase, eccentricity: f64, f: impl Fn(f64) -> f64) -> f64 {
    let nodes = 20_000;
    let mut sum = 0.0;
    for k in 0..nodes {
        let s = (f64::from(k) + 0.5) / f64::from(nodes);
        let weight = 2.0 * PI * 4.0 * s.powi(3) / f64::from(nodes);
        for cosine in [1.0 - s.powi(4), s.powi(4) - 1.0] {
            sum += phase.value(cosine, eccentricity) * f(cosine) * weight;
        }
    }
    sum
}

#[test]
fn the_shader_agrees_with_the_reference() {
    let mut rng = StdRng::seed_from_u64(11);
    let inputs: Vec<(Phase, f32, f32)> = (0..2 * COUNT)
        .map(|_| {
            let cosine: f64 = match rng.random_range(0..4) {
                0 => 1.0,
                1 => 1.0 - 10_f64.powf(rng.random_range(-7.0..0.0)),
                2 => 10_f64.powf(rng.random_range(-7.0..0.0)) - 1.0,
                _ => rng.random_range(-1.0..=1.0),
            };
            let eccentricity = match rng.random_range(0..3) {
                0 => 1.0,
                1 => 0.5_f32.powi(rng.random_range(1..16)),
                _ => rng.random_range(0.0..=1.0),
            };
            (random_phase(&mut rng), cosine as f32, eccentricity)
        })
        .collect();
    let found = phases_on_gpu(&mut shader_app(), &inputs);
    let (error, input) = worst(inputs.iter().zip(&found).map(|(input, p)| {
        let (phase, cosine, eccentricity) = *input;
        let exact = rounded(phase).value(cosine.into(), eccentricity.into());
        ((f64::from(*p) / exact - 1.0).abs(), *input)
    }));
    println!("phase: worst {error} of the value, at {input:?}");
    // c·g is rounded by 6e-8, a 30 000th of the 0.002 that 1 − g may be; its square divides the peak.
    assert!(error < 1e-4, "{error} of the value, at {input:?}");
}

#[test]
fn a_cosine_just_beyond_one_is_harmless() {
    let inputs: Vec<(Phase, f32, f32)> =
        every_phase().into_iter().flat_map(|p| [(p, 1.000_001, 1.0), (p, -1.000_001, 1.0)]).collect();
    for (input, p) in inputs.iter().zip(phases_on_gpu(&mut shader_app(), &inputs)) {
        let peak = rounded(input.0).value(input.1.clamp(-1.0, 1.0).into(), 1.0);
        // In the direction away from the peak the overshoot counts, by what it is.
        assert!((f64::from(p) / peak - 1.0).abs() < 1e-4, "{input:?}: {p}, not {peak}");
    }
}

#[test]
fn every_phase_function_integrates_to_one() {
    for phase in every_phase() {
        for eccentricity in [1.0, 0.5, 0.125] {
            let total = over_sphere(&phase, eccentricity, |_| 1.0);
            assert!((total - 1.0).abs() < 1e-3, "{phase:?}, eccentricity {eccentricity}: {total}");
        }
    }
}

#[test]
fn every_phase_function_integrates_to_one_on_the_gpu() {
    let nodes = 20_000;
    // Cosines as f32 can tell them apart, dense at both ends.
    let near: Vec<f32> = (0..=nodes).map(|k| 1.0 - (f64::from(k) / f64::from(nodes)).powi(4) as f32).collect();
    let cosines: Vec<f32> = near.iter().map(|c| -c).chain(near.iter().rev().copied()).collect();
    let phases = every_phase();
    let inputs: Vec<(Phase, f32, f32)> =
        phases.iter().flat_map(|&phase| cosines.iter().map(move |&c| (phase, c, 1.0))).collect();
    let found = phases_on_gpu(&mut shader_app(), &inputs);
    for (phase, values) in phases.iter().zip(found.chunks(cosines.len())) {
        let trapezoids = cosines.windows(2).zip(values.windows(2));
        let total: f64 =
            trapezoids.map(|(c, p)| PI * f64::from(p[0] + p[1]) * (f64::from(c[1]) - f64::from(c[0]))).sum();
        assert!((total - 1.0).abs() < 1e-3, "{phase:?}: {total}");
    }
}

#[test]
fn droplets_scatter_as_published() {
    let agrees = |what: &str, d: f64, found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 1e-4, "{what} at {d} µm: {found}, not {expected}");
    };
    let droplets = |d| HgDraine::from_diameter(d).unwrap();
    for [d, g_hg, g_d, alpha, w, rest @ ..] in TABLE {
        let fit = droplets(d);
        agrees("g_HG", d, fit.g_hg, g_hg);
        agrees("g_D", d, fit.g_d, g_d);
        agrees("alpha", d, fit.alpha, alpha);
        agrees("w", d, fit.w, w);
        for (cosine, expected) in COSINES.iter().zip(rest) {
            // As decimals: 0.99 in f32 is another angle.
            let cosine = (f64::from(*cosine) * 100.0).round() / 100.0;
            agrees("p", d, fit.value(cosine), expected);
        }
        agrees("mean cosine", d, over_sphere(&Phase::HgDraine(fit), 1.0, |cosine| cosine), rest[5]);
    }
    let inputs: Vec<(Phase, f32, f32)> =
        TABLE.iter().flat_map(|row| COSINES.map(|cosine| (Phase::HgDraine(droplets(row[0])), cosine, 1.0))).collect();
    let found = phases_on_gpu(&mut shader_app(), &inputs);
    for (row, found) in TABLE.iter().zip(found.as_chunks::<5>().0) {
        for (expected, found) in row[5..].iter().zip(found) {
            agrees("p on the GPU", row[0], f64::from(*found), *expected);
        }
    }
}

#[test]
fn droplets_outside_the_fit_are_refused() {
    for d in [0.0, 4.99, 50.01, -12.0, f64::NAN, f64::INFINITY] {
        let Err(SettingsError::OutOfRange { field, min, max, .. }) = HgDraine::from_diameter(d) else {
            panic!("{d} µm was taken");
        };
        assert_eq!([field, min, max], ["lighting.droplet_diameter", "5", "50"]);
    }
    let lighting = CloudLighting { droplet_diameter: 3.0, ..Default::default() };
    assert!(Phase::from_settings(&lighting).is_err());
    let lighting = CloudLighting { phase: PhaseFunction::HenyeyGreenstein, ..lighting };
    assert_eq!(Phase::from_settings(&lighting), Ok(Phase::HenyeyGreenstein { g: 0.8_f32.into() }));
}

#[test]
fn draine_spans_the_classic_phase_functions() {
    for step in -10..=10 {
        let cosine = f64::from(step) / 10.0;
        let (g, square) = (0.7_f64, cosine * cosine);
        let by_hand = 3.0 * (1.0 - g * g) * (1.0 + square)
            / (8.0 * PI * (2.0 + g * g) * (1.0 + g * g - 2.0 * g * cosine).powf(1.5));
        for (found, expected) in [
            (draine(g, 0.0, cosine), hg(g, cosine)),
            (cornette_shanks(g, cosine), by_hand),
            (rayleigh(cosine), 3.0 * (1.0 + square) / (16.0 * PI)),
        ] {
            assert!((found / expected - 1.0).abs() < 1e-12, "cosθ {cosine}: {found}, not {expected}");
        }
    }
}
