//! Between two settings: numbers by reflection, positions as integrals of what moves them.

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{PartialReflect, ReflectMut, ReflectRef},
};

/// Smooth from 0 to 1, flat at both ends: 3u² − 2u³.
pub(super) fn ease(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Its integral from 0 to u ≤ 1: u³ − u⁴/2.
fn eased_integral(u: f64) -> f64 {
    u * u * u * (1.0 - 0.5 * u)
}

/// Exact at both ends.
pub(super) fn between(a: f64, b: f64, s: f64) -> f64 {
    if s <= 0.0 {
        a
    } else if s >= 1.0 {
        b
    } else {
        a + (b - a) * s
    }
}

pub(super) fn between32(a: f32, b: f32, s: f64) -> f32 {
    between(a.into(), b.into(), s) as f32
}

/// Moves each field of the struct `value` from itself (s = 0) to that of `target` (s = 1): numbers evenly, whole ones
/// rounded, all else at half way.
pub(super) fn mix(value: &mut dyn PartialReflect, target: &dyn PartialReflect, s: f64) {
    let (ReflectMut::Struct(value), ReflectRef::Struct(target)) = (value.reflect_mut(), target.reflect_ref()) else {
        return;
    };
    for i in 0..value.field_len() {
        let (Some(a), Some(b)) = (value.field_at_mut(i), target.field_at(i)) else { continue };
        mix_field(a, b, s);
    }
}

fn mix_field(a: &mut dyn PartialReflect, b: &dyn PartialReflect, s: f64) {
    if let (Some(a), Some(b)) = (a.try_downcast_mut::<f32>(), b.try_downcast_ref::<f32>()) {
        *a = between32(*a, *b, s);
    } else if let (Some(a), Some(b)) = (a.try_downcast_mut::<f64>(), b.try_downcast_ref::<f64>()) {
        *a = between(*a, *b, s);
    } else if let (Some(a), Some(b)) = (a.try_downcast_mut::<u32>(), b.try_downcast_ref::<u32>()) {
        *a = between((*a).into(), (*b).into(), s).round() as u32;
    } else if let (Some(a), Some(b)) = (a.try_downcast_mut::<Vec3>(), b.try_downcast_ref::<Vec3>()) {
        *a = Vec3::from_array(std::array::from_fn(|k| between32(a[k], b[k], s)));
    } else if let (Some(a), Some(b)) = (a.try_downcast_mut::<DVec3>(), b.try_downcast_ref::<DVec3>()) {
        *a = DVec3::from_array(std::array::from_fn(|k| between(a[k], b[k], s)));
    } else if matches!(a.reflect_ref(), ReflectRef::Struct(_)) {
        mix(a, b, s);
    } else if s >= 0.5 && a.reflect_partial_eq(b) != Some(true) && a.try_apply(b).is_err() {
        // Both are of one type, so that this cannot be.
        debug_assert!(false, "a field of settings cannot be applied to itself");
    }
}

/// When a change of speed begins, and how long it takes (s of cloud time).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Span {
    pub begin: f64,
    pub seconds: f64,
}

impl Span {
    /// How much of it is over at `t`, 0 to 1.
    pub fn progress(self, t: f64) -> f64 {
        if t < self.begin {
            0.0
        } else if t >= self.begin + self.seconds {
            1.0
        } else {
            (t - self.begin) / self.seconds
        }
    }

    /// What must be added to `now · t` for the place that something has come to at `t`, which was at `drift + from · t`
    /// before, and whose speed is eased from `from` to `to`: `drift + from·t + (to − from) ∫ s dt − now·t`. `now` is the speed
    /// at `t` as it is rounded to be stored, so that no rounding is left that grows with t.
    pub fn drift(self, drift: f64, from: f64, to: f64, now: f64, t: f64) -> f64 {
        let u = self.progress(t);
        if u >= 1.0 {
            // The same at any t: the speed has stopped changing.
            return drift - (to - from) * (self.begin + 0.5 * self.seconds) + (to - now) * t;
        }
        drift + (from - now) * t + (to - from) * self.seconds * eased_integral(u)
    }

    /// As [`drift`](Self::drift), for each axis.
    pub fn drift3(self, drift: DVec3, [from, to, now]: [DVec3; 3], t: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|k| self.drift(drift[k], from[k], to[k], now[k], t)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_is_the_integral_of_the_speed() {
        // After a year of wind: what matters must not drown in t.
        let span = Span { begin: 3.2e7, seconds: 40.0 };
        let (drift, from, to) = (123.0, 12.5, -7.25);
        let speed = |t: f64| between(from, to, ease(span.progress(t)));
        let place = |t: f64| {
            let now = speed(t) as f32;
            span.drift(drift, from, to, now.into(), t) + f64::from(now) * t
        };
        let (mut t, step) = (span.begin - 5.0, 0.01);
        let mut walked = drift + from * t;
        for _ in 0..6000 {
            walked += speed(t + 0.5 * step) * step;
            t += step;
            assert!((place(t) - walked).abs() < 1e-3, "at {}: {} and {walked}", t - span.begin, place(t));
        }
        assert_eq!(span.drift(drift, from, to, from, span.begin - 1.0), drift);
        let [a, b] = [span.begin + 50.0, 9e9].map(|t| span.drift(drift, from, to, to, t));
        assert_eq!(a, b, "what is left over changes after the end");
    }

    #[test]
    fn numbers_meet_both_ends_exactly_and_choices_switch_half_way() {
        use crate::settings::{CloudLighting, PhaseFunction};
        let a = CloudLighting { octaves: 1, g: 0.1, ..default() };
        let b =
            CloudLighting { octaves: 4, g: 0.7, phase: PhaseFunction::Schlick, ambient_tint: Vec3::ZERO, ..default() };
        let at = |s: f64| {
            let mut mixed = a.clone();
            mix(&mut mixed, &b, s);
            mixed
        };
        assert_eq!((at(0.0), at(1.0)), (a.clone(), b.clone()));
        let half = at(0.49);
        assert_eq!((half.octaves, half.phase), (2, PhaseFunction::HgDraine));
        assert!((half.g - 0.394).abs() < 1e-6 && (half.ambient_tint.y - 0.51).abs() < 1e-6, "{half:?}");
        assert_eq!(at(0.5).phase, PhaseFunction::Schlick);
    }
}
