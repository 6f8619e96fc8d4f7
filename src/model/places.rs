//! Which places of its map the thesis's layer is read at, as `places.wesl` and `profile.wesl` have it.

use std::f64::consts::TAU;

use bevy::prelude::*;
use glam::{DVec2, DVec3};

/// From one place of a map to the next (repeats): those of `places.wesl`.
pub(crate) const NEXT: DVec2 = DVec2::new(0.754_877_7, 0.569_840_3);

/// Wave vectors of the choice between places of a map, per repeat: those of `places.wesl`.
pub(crate) const WAVES: [DVec2; 3] =
    [DVec2::new(2.4049, 0.8341), DVec2::new(-1.1823, 1.7329), DVec2::new(0.3719, -2.1317)];

/// Places that are passed, in the mean, while the wind carries the map on by a repeat.
const PACE: f64 = 1.618_034;
/// Phase that each wave gains meanwhile (rad), and how far it moves the number.
const TURNS: DVec3 = DVec3::new(2.1, 3.3, 4.7);
const SWING: f64 = 0.7;

/// Phases of the waves; their amplitudes and the number's mean; and the place that numbers count from (repeats).
///
/// The number is `PACE·d + SWING·Σ (sin(w·q + φ + d·turn) − sin(w·q + φ))` after `d` repeats of wind, where q goes with the
/// clouds: 0 at first, so that the map is whole, and after a repeat another at any place of it. A difference of sines is one
/// cosine.
pub(super) fn places(at: DVec2, gone: DVec2, scale: f64) -> (Vec4, Vec4, DVec2) {
    // Unlike `length`, which squares, this holds for any time that is a number.
    let repeats = (gone.x / scale).hypot(gone.y / scale);
    let half = 0.5 * TURNS * repeats;
    let phase = |k: usize| (WAVES[k].dot(at) / scale + half[k]).rem_euclid(TAU) as f32;
    let amplitude = |k: usize| (2.0 * SWING * half[k].rem_euclid(TAU).sin()) as f32;
    let mean = PACE * repeats;
    let whole = mean.floor();
    (
        Vec4::new(phase(0), phase(1), phase(2), 0.0),
        Vec4::new(amplitude(0), amplitude(1), amplitude(2), (mean - whole) as f32),
        DVec2::new((whole * NEXT.x).rem_euclid(1.0), (whole * NEXT.y).rem_euclid(1.0)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_jumps_where_the_place_is_counted_anew() {
        let scale = 26_000.0;
        let (_, still, from) = places(DVec2::new(1e5, -3e4), DVec2::ZERO, scale);
        assert_eq!((still, from), (Vec4::ZERO, DVec2::ZERO), "the map is not whole before there is wind");
        // Where the mean passes a whole number, the place that numbers count from is one farther.
        for k in 1..50 {
            let [before, after] = [-1e-6, 1e-6].map(|e| {
                let gone = (f64::from(k) / PACE + e) * scale;
                places(DVec2::ZERO, DVec2::new(gone, 0.0), scale)
            });
            assert!(before.1.w > 0.99 && after.1.w < 0.01);
            let step = after.2 - before.2 - NEXT;
            assert!((step - step.round()).abs().max_element() < 1e-9, "{step}");
            assert!((before.1 - after.1).truncate().abs().max_element() < 1e-4);
        }
    }
}
