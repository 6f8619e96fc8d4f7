//! Light along a ray: Beer–Lambert, one step of the march, the multiple-scattering sum. Twin of
//! `render/march/integrate.wesl`.

use bevy::math::DVec3;

use super::phase::Phase;

/// Beer–Lambert: the share of light that passes an optical depth `tau` ≥ 0.
pub fn transmittance(tau: f64) -> f64 {
    (-tau).exp()
}

/// `(1 − e^(−x)) / x` for x ≥ 0: mean transmittance over a step of optical depth `x`; 1 at 0.
pub fn mean_transmittance(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// Light that one step adds: `∫₀^dt source·e^(−sigma_t·s) ds = (S − S·e^(−σt·dt)) / σt`.
///
/// `source` is radiance scattered towards the camera per metre, `sigma_t` the extinction (1/m), `dt` the step (m).
/// Exact where both are constant over the step; `S·dt` where σt·dt → 0. To be weighted by the transmittance at the
/// step's start. Ford, equation 8 of the paper and 4.4 of the thesis, with the σt that both leave out.
pub fn step_energy_conserving(source: DVec3, sigma_t: f64, dt: f64) -> DVec3 {
    source * (dt * mean_transmittance(sigma_t * dt))
}

/// `S·dt·e^(−sigma_t·dt)`: all light of the step is weighted with the transmittance of the whole step, which makes long
/// steps in dense cloud too dark. Of the two simple forms in Ford's section 4.3 it is the "over-estimating" one, whose
/// result figure 5.11 shows; the other one, `S·dt`, is too bright.
pub fn step_naive(source: DVec3, sigma_t: f64, dt: f64) -> DVec3 {
    source * (dt * transmittance(sigma_t * dt))
}

/// Factors from one octave of multiple scattering to the next, each 0..=1 (Ford 3.8 and 3.9; Wrenninge).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Octaves {
    /// N, the number of terms: 1 is single scattering, 0 no sunlight.
    pub count: u32,
    /// a: on the optical depth.
    pub attenuation: f64,
    /// b: on the contribution; at most `attenuation` keeps energy bounded.
    pub contribution: f64,
    /// c: on the phase function's asymmetry.
    pub eccentricity: f64,
}

/// Sunlight scattered towards the camera, per unit of scattering coefficient:
/// `Σ_{i=0}^{N−1} bⁱ · p(cosθ; cⁱ) · sun · e^(−aⁱ·tau)` (Ford 3.8 and 3.9).
///
/// `sun` is its illuminance (lux gives cd/m² per unit of σs), `tau` the optical depth towards it, `cos_theta` as in
/// [`phase`](super::phase). σs comes in once, outside (Ford's program multiplies it in twice).
pub fn octave_sum(phase: &Phase, cos_theta: f64, sun: f64, tau: f64, octaves: Octaves) -> f64 {
    let (mut a, mut b, mut c) = (1.0, 1.0, 1.0);
    let mut sum = 0.0;
    for _ in 0..octaves.count {
        sum += b * phase.value(cos_theta, c) * sun * transmittance(a * tau);
        a *= octaves.attenuation;
        b *= octaves.contribution;
        c *= octaves.eccentricity;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_the_integral_over_it() {
        for sigma_t in [0.0, 1e-9, 1e-3, 0.05, 0.4] {
            for dt in [1.0, 90.0, 700.0] {
                let pieces = 200_000;
                let piece = dt / f64::from(pieces);
                let sum: f64 = (0..pieces).map(|i| transmittance(sigma_t * piece * (f64::from(i) + 0.5)) * piece).sum();
                let step = step_energy_conserving(DVec3::new(1.0, 2.0, 0.0), sigma_t, dt);
                assert!((step.x / sum - 1.0).abs() < 1e-6, "sigma_t {sigma_t} dt {dt}: {} {sum}", step.x);
                assert!((step.y - 2.0 * step.x).abs() < 1e-9 && step.z == 0.0);
                // Light of the whole step seen through none or through all of it: the integral lies between.
                let naive = step_naive(DVec3::ONE, sigma_t, dt).x;
                assert!(naive <= step.x && step.x <= dt && (naive < step.x) == (sigma_t > 0.0), "{naive} {}", step.x);
            }
        }
    }

    #[test]
    fn splitting_a_step_changes_nothing() {
        let (sigma_t, dt) = (0.03, 120.0);
        let whole = step_energy_conserving(DVec3::ONE, sigma_t, dt);
        let parts = step_energy_conserving(DVec3::ONE, sigma_t, 50.0)
            + transmittance(sigma_t * 50.0) * step_energy_conserving(DVec3::ONE, sigma_t, 70.0);
        assert!(whole.abs_diff_eq(parts, 1e-9));
    }

    #[test]
    fn octaves_add_up() {
        let phase = Phase::HenyeyGreenstein { g: 0.8 };
        let octaves = |count| Octaves { count, attenuation: 0.5, contribution: 0.4, eccentricity: 0.3 };
        let sum = |count| octave_sum(&phase, 0.2, 100.0, 3.0, octaves(count));
        assert_eq!(sum(0), 0.0);
        let single = 100.0 * phase.value(0.2, 1.0) * (-3.0_f64).exp();
        assert!((sum(1) / single - 1.0).abs() < 1e-12);
        let third = 100.0 * 0.16 * phase.value(0.2, 0.09) * (-0.75_f64).exp();
        assert!(((sum(3) - sum(2)) / third - 1.0).abs() < 1e-12);
    }
}
