//! Which places a map is read at. Twin of `model/places.wesl`, function for function.

use bevy::math::DVec2;

use super::field::smoothstep;
use crate::model::{NEXT, WAVES};

const BLEND: [f64; 2] = [0.4, 0.6];

/// Phases of the waves at `q`, in repeats of the map.
pub(super) fn waves_at(q: DVec2) -> [f64; 3] {
    WAVES.map(|wave| q.dot(wave))
}

/// Lengths of the wave vectors.
const LENGTHS: [f64; 3] = [2.5455, 2.0978, 2.1640];

/// The most that a number changes in a repeat, for these amplitudes of its waves.
pub(super) fn steepest(amplitudes: [f64; 3]) -> f64 {
    amplitudes.iter().zip(LENGTHS).map(|(amplitude, length)| amplitude.abs() * length).sum()
}

/// A reading of a map at the places that a number stands for; `read` is given what to add, in repeats.
pub(super) fn read_at<T>(number: f64, read: impl Fn(DVec2) -> T, blend: impl Fn(T, T, f64) -> T) -> T {
    let low = number.floor();
    let share = smoothstep(BLEND[0], BLEND[1], number - low);
    if share <= 0.0 {
        read(place_of(low))
    } else if share >= 1.0 {
        read(place_of(low + 1.0))
    } else {
        blend(read(place_of(low)), read(place_of(low + 1.0)), share)
    }
}

/// The largest of bounds at all places that are read where the number is within `change` of this one; `whole` is the whole
/// map's.
pub(super) fn bound_at(number: f64, change: f64, read: impl Fn(DVec2) -> f64, whole: impl Fn() -> f64) -> f64 {
    let first = (number - change - BLEND[1] - 0.01).ceil();
    let last = (number + change + 1.0 - BLEND[0] + 0.01).floor();
    if last - first > 3.0 {
        return whole();
    }
    (first as i32..=last as i32).map(|place| read(place_of(place.into()))).fold(0.0, f64::max)
}

fn place_of(number: f64) -> DVec2 {
    let place = number * NEXT;
    place - place.floor()
}
