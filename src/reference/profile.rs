//! Where cloud is: vertical profile, dimensional profile, erosion. Twin of the formulas in `model/model.wesl`.
//!
//! All quantities are 0..=1; `height` is 0 at the layer's base and 1 at its top.

use crate::settings::Erosion;

/// Carries `x` from the range `from` to the range `to`, linearly and unclamped.
///
/// A range of no width steps: `to.1` at and above it, `to.0` below.
pub fn remap(x: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    let width = from[1] - from[0];
    if width == 0.0 {
        return if x < from[0] { to[0] } else { to[1] };
    }
    to[0] + (x - from[0]) / width * (to[1] - to[0])
}

/// `remap`, kept within 0..=1.
fn remap_saturated(x: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    remap(x, from, to).clamp(0.0, 1.0)
}

/// The heights between which a type of cloud lives (Ford 4.2.1, after Schneider), 0 ≤ `full` and `thins` ≤ `top` ≤ 1.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HeightRange {
    /// a: height at which the base, which begins at 0, is full.
    pub full: f64,
    /// b: height at which the cloud begins to thin.
    pub thins: f64,
    /// c: height at which it ends.
    pub top: f64,
}

impl From<[f32; 3]> for HeightRange {
    /// From (a, b, c), as in [`STRATUS_PROFILE`](crate::textures::STRATUS_PROFILE).
    fn from([a, b, c]: [f32; 3]) -> Self {
        Self { full: a.into(), thins: b.into(), top: c.into() }
    }
}

impl HeightRange {
    /// The range of a type between stratus (`cloud_type` 0) and cumulus (1), blended by a square root (Ford 4.2.1).
    /// A type outside 0..=1 counts as the nearer end.
    pub fn of_type(stratus: Self, cumulus: Self, cloud_type: f64) -> Self {
        let t = cloud_type.clamp(0.0, 1.0).sqrt();
        let blend = |a: f64, b: f64| a + (b - a) * t;
        Self {
            full: blend(stratus.full, cumulus.full),
            thins: blend(stratus.thins, cumulus.thins),
            top: blend(stratus.top, cumulus.top),
        }
    }

    /// Vertical profile: `remap(h, 0, a, 0, 1) · remap(h, b, c, 1, 0)`, each kept within 0..=1 (Ford 4.2.1).
    pub fn vertical_profile(&self, height: f64) -> f64 {
        remap_saturated(height, [0.0, self.full], [0.0, 1.0])
            * remap_saturated(height, [self.thins, self.top], [1.0, 0.0])
    }
}

/// `d = coverage · vertical` (Ford 3.1).
pub fn dimensional_profile(coverage: f64, vertical: f64) -> f64 {
    coverage * vertical
}

/// What noise `n` leaves of the dimensional profile `d`, before the global density ρc is multiplied in.
///
/// [`Erosion::Subtract`] is `saturate(n − (1 − d))` (Ford 3.2); [`Erosion::Remap`] is `remap(d, 1 − n, 1, 0, 1)`, kept within
/// 0..=1 (Schneider), that is the former over `n`, here as in the shader over 1e-4 at least. Both are 0 where `d` is 0,
/// and at most `d`.
pub fn erode(d: f64, n: f64, erosion: Erosion) -> f64 {
    if d <= 0.0 {
        return 0.0;
    }
    let subtracted = d - (1.0 - n);
    match erosion {
        Erosion::Subtract => subtracted.clamp(0.0, 1.0),
        Erosion::Remap => (subtracted / n.max(1e-4)).clamp(0.0, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textures::{CUMULUS_PROFILE, STRATUS_PROFILE, vertical_profile};

    const CUMULUS: HeightRange = HeightRange { full: 0.1, thins: 0.4, top: 1.0 };
    const STRATUS: HeightRange = HeightRange { full: 0.05, thins: 0.1, top: 0.2 };

    #[test]
    fn remap_is_linear_between_the_ends() {
        assert_eq!(remap(3.0, [2.0, 4.0], [10.0, 20.0]), 15.0);
        assert_eq!(remap(2.0, [2.0, 4.0], [1.0, 0.0]), 1.0);
        assert_eq!(remap(5.0, [2.0, 4.0], [1.0, 0.0]), -0.5);
        assert_eq!([remap(0.9, [1.0; 2], [0.0, 1.0]), remap(1.0, [1.0; 2], [0.0, 1.0])], [0.0, 1.0]);
    }

    #[test]
    fn the_profile_rises_holds_and_falls() {
        let at = |h| CUMULUS.vertical_profile(h);
        assert_eq!([at(-0.1), at(0.0), at(0.1), at(0.4), at(1.0), at(1.2)], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        assert!((at(0.05) - 0.5).abs() < 1e-12 && (at(0.7) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn types_blend_by_a_square_root() {
        let blended = |t| HeightRange::of_type(STRATUS, CUMULUS, t);
        assert_eq!((blended(-1.0), blended(0.0)), (STRATUS, STRATUS));
        let ends = [(1.0, 1.0), (0.25, 0.6)];
        for (t, top) in ends {
            assert!((blended(t).top - top).abs() < 1e-12);
        }
    }

    #[test]
    fn the_baked_gradient_follows_the_same_formula() {
        for t in 0..=20_u8 {
            for h in 0..=100_u8 {
                let (t, h) = (f32::from(t) / 20.0, f32::from(h) / 100.0);
                let range = HeightRange::of_type(STRATUS_PROFILE.into(), CUMULUS_PROFILE.into(), t.into());
                let (baked, exact) = (vertical_profile(t, h), range.vertical_profile(h.into()));
                assert!((f64::from(baked) - exact).abs() < 1e-5, "type {t} height {h}: {baked}, not {exact}");
            }
        }
    }

    #[test]
    fn erosion_only_takes_away() {
        for erosion in [Erosion::Subtract, Erosion::Remap] {
            for i in 0..=50 {
                for j in 0..=50 {
                    let (d, n) = (f64::from(i) / 50.0, f64::from(j) / 50.0);
                    let left = erode(d, n, erosion);
                    assert!((0.0..=d + 1e-12).contains(&left), "{erosion:?} d {d} n {n}: {left}");
                }
            }
            assert_eq!(erode(0.0, 1.0, erosion), 0.0);
            assert_eq!(erode(1.0, 1.0, erosion), 1.0);
        }
        assert!((erode(0.7, 0.5, Erosion::Subtract) - 0.2).abs() < 1e-12);
        assert!((erode(0.7, 0.5, Erosion::Remap) - 0.4).abs() < 1e-12);
    }
}
