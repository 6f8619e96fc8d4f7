//! Integrals of a density along a line: deterministic, in order, with empty stretches skipped by their bound.

use super::planet::Interval;

/// How finely to look.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Accuracy {
    /// Longest stretch that is judged by five samples (m). What is narrower than a quarter of it can be missed.
    pub panel: f64,
    /// Largest difference between two estimates of a stretch, as a share of the value. The finer one is kept, which is
    /// several times as good.
    pub relative: f64,
    /// Shortest stretch (m): taken as it is.
    pub shortest: f64,
    /// The integral beyond which the rest no longer matters.
    pub enough: f64,
}

/// Stretches of one integral that are tried at most, so that no length can take for ever.
const MOST_PANELS: f64 = 1_048_576.0;

/// `∫ f` over `interval`, no further than to [`Accuracy::enough`] (then more than that).
///
/// `bound(middle, half)` is at least `f` within `half` of `middle`; where it is 0, `f` is never asked. Adaptive Simpson's
/// rule: a stretch is halved until its halves agree with the whole.
pub fn integrate(
    f: impl Fn(f64) -> f64,
    bound: impl Fn(f64, f64) -> f64,
    interval: Interval,
    accuracy: Accuracy,
) -> f64 {
    let length = interval[1] - interval[0];
    if length.is_nan() || length <= 0.0 || length.is_infinite() {
        return 0.0;
    }
    let panel = accuracy.panel.max(length / MOST_PANELS);
    let mut sum = 0.0;
    // The nearest stretch is on top.
    let mut left = vec![interval];
    while let Some([a, b]) = left.pop() {
        let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
        if bound(middle, half) <= 0.0 {
            continue;
        }
        if b - a > panel {
            left.extend([[middle, b], [a, middle]]);
            continue;
        }
        sum += simpson(&f, [a, b], [f(a), f(middle), f(b)], &accuracy);
        if sum > accuracy.enough {
            break;
        }
    }
    sum
}

/// The integral over a stretch whose ends and middle are known.
fn simpson(f: &impl Fn(f64) -> f64, [a, b]: Interval, [fa, fm, fb]: [f64; 3], accuracy: &Accuracy) -> f64 {
    let (middle, length) = (0.5 * (a + b), b - a);
    let quarters = [f(0.5 * (a + middle)), f(0.5 * (middle + b))];
    let whole = length / 6.0 * (fa + 4.0 * fm + fb);
    let halves = length / 12.0 * (fa + 4.0 * quarters[0] + 2.0 * fm + 4.0 * quarters[1] + fb);
    if (halves - whole).abs() <= accuracy.relative * halves || length <= accuracy.shortest {
        return halves;
    }
    simpson(f, [a, middle], [fa, quarters[0], fm], accuracy) + simpson(f, [middle, b], [fm, quarters[1], fb], accuracy)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    const FINE: Accuracy = Accuracy { panel: 10.0, relative: 1e-3, shortest: 0.25, enough: f64::INFINITY };

    #[test]
    fn cubics_are_exact_and_kinks_are_found() {
        let cubic = |x: f64| 1.0 + x * x * x;
        let sum = integrate(cubic, |_, _| 1.0, [0.0, 8.0], FINE);
        assert!((sum - 1032.0).abs() < 1e-9, "{sum}");
        // A cloud with soft and hard edges at no round place.
        let cloud = |x: f64| if (101.3..250.7).contains(&x) { ((x - 101.3) / 40.0).min(1.0) } else { 0.0 };
        let sum = integrate(cloud, |_, _| 1.0, [0.0, 1000.0], FINE);
        let exact = 20.0 + 250.7 - 141.3;
        assert!((sum - exact).abs() < 1e-3 * exact, "{sum}, not {exact}");
    }

    #[test]
    fn empty_air_is_skipped_and_enough_is_enough() {
        let asked = Cell::new(0);
        let f = |x: f64| {
            asked.set(asked.get() + 1);
            assert!((4990.0..5110.0).contains(&x), "{x} is where nothing is");
            if (5000.0..5100.0).contains(&x) { 1.0 } else { 0.0 }
        };
        let bound = |m: f64, half: f64| if m + half > 5000.0 && m - half < 5100.0 { 1.0 } else { 0.0 };
        let sum = integrate(f, bound, [0.0, 1e5], FINE);
        assert!((sum - 100.0).abs() < 0.2, "{sum}");
        let all = asked.replace(0);
        let part = integrate(f, bound, [0.0, 1e5], Accuracy { enough: 20.0, ..FINE });
        assert!((20.0..35.0).contains(&part), "{part}");
        assert!(asked.get() < all / 2, "{} of {all}", asked.get());
    }

    #[test]
    fn no_interval_hangs() {
        for interval in [[0.0, f64::NAN], [0.0, f64::INFINITY], [1.0, 0.0], [0.0, 0.0]] {
            assert_eq!(integrate(|_| 1.0, |_, _| 1.0, interval, FINE), 0.0);
        }
        let far = integrate(|_| 1.0, |_, _| 1.0, [0.0, 1e15], FINE);
        assert!((far / 1e15 - 1.0).abs() < 1e-9, "{far}");
    }
}
