//! Scattering by the crystals of cirrus.

use glam::DVec3;

use super::{
    mie::WAVELENGTHS,
    phase::{HgDraine, hg},
    phase_table::PhaseTable,
};

/// Diffraction around the crystals, half of what they scatter (their size hardly shows beyond a degree).
const PEAK: f64 = 0.5;
const PEAK_ASYMMETRY: f64 = 0.995;
/// Light that goes through or is reflected: rough crystals show neither halo nor rainbow in it.
const FORWARD_ASYMMETRY: f64 = 0.57;
const BACK: f64 = 0.05;
const BACK_ASYMMETRY: f64 = -0.4;
/// Share of the light through the crystals that a full halo takes: it is twice as bright as what lies within it.
const RING: f64 = 0.2;

/// Peak and smooth rest alone, as two lobes.
pub fn stand_in() -> HgDraine {
    let rest = (1.0 - BACK) * FORWARD_ASYMMETRY + BACK * BACK_ASYMMETRY;
    HgDraine { g_hg: PEAK_ASYMMETRY, g_d: rest, alpha: 0.0, w: 1.0 - PEAK }
}

/// Refractive index of ice at the [`WAVELENGTHS`]: Warren and Brandt (2008).
pub const ICE_INDEX: [f64; WAVELENGTHS.len()] = [1.3090, 1.3112, 1.3151];

/// Angle of least deviation through two faces at 60° (rad), where the 22° halo begins.
pub fn halo_angle(index: f64) -> f64 {
    2.0 * (0.5 * index).asin() - 2.0 * 0.5_f64.asin()
}

/// The phase function of ice crystals, with a 22° halo of this strength (0..=1).
///
/// Rough crystals, as most of cirrus is found to be, have a smooth phase function without halo and an asymmetry of 0.75 to
/// 0.8 (Baran 2009; Yang et al. 2013; van Diedenhoven et al. 2013): here diffraction's peak, a broad forward lobe and a
/// weak backward one, 0.76 together. Smooth prisms bend light by no less than [`halo_angle`], and most of it by little
/// more: the halo's edge is sharp and red on its inner side, where blue is not yet bent.
pub fn table(halo: f64) -> PhaseTable {
    let ring = RING * halo.clamp(0.0, 1.0);
    let rings = ICE_INDEX.map(|index| Ring::new(halo_angle(index)));
    PhaseTable::from_fn(|angle| {
        let cosine = angle.cos();
        let smooth = (1.0 - BACK) * hg(FORWARD_ASYMMETRY, cosine) + BACK * hg(BACK_ASYMMETRY, cosine);
        let bent = DVec3::from_array(std::array::from_fn(|i| rings[i].value(angle)));
        let peak = DVec3::splat(PEAK * hg(PEAK_ASYMMETRY, cosine));
        peak + (1.0 - PEAK) * ((1.0 - ring) * DVec3::splat(smooth) + ring * bent)
    })
}

/// The halo in one colour.
struct Ring {
    edge: f64,
    scale: f64,
}

impl Ring {
    fn new(edge: f64) -> Self {
        let ring = Self { edge, scale: 1.0 };
        // Normalised over the sphere by the midpoint rule.
        let step = 1e-4;
        let sum: f64 = (0..31_415)
            .map(|k| step * (f64::from(k) + 0.5))
            .map(|angle| std::f64::consts::TAU * angle.sin() * ring.value(angle) * step)
            .sum();
        Self { scale: 1.0 / sum, ..ring }
    }

    /// Rises over half a degree, the sun's width, and falls off over a few, then over tens of degrees.
    fn value(&self, angle: f64) -> f64 {
        let beyond = (angle - self.edge).to_degrees();
        let rise = ((beyond + 0.25) / 0.5).clamp(0.0, 1.0);
        let fall = 0.8 * (-beyond.max(0.0) / 2.0).exp() + 0.2 * (-beyond.max(0.0) / 9.0).exp();
        self.scale * rise * rise * (3.0 - 2.0 * rise) * fall
    }
}
