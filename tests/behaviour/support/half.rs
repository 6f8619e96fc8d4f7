//! Half floats, and how far pictures are apart.

/// The value of an IEEE 754 half.
///
/// # Panics
/// Where it is infinite or NaN: nothing of ours stores that.
pub fn from_half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    assert!(exponent < 31, "a half that is infinite or NaN: {bits:#x}");
    sign * if exponent == 0 { fraction * 2_f64.powi(-14) } else { (1.0 + fraction) * 2_f64.powi(exponent - 15) }
}

/// The largest difference between two lists, relative to the second's value or to `floor`, whichever is larger.
pub fn worst_relative(a: &[f64], b: &[f64], floor: f64) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / b.abs().max(floor)).fold(0.0, |worst, e| {
        // A NaN counts as the worst.
        if e > worst || e.is_nan() { e } else { worst }
    })
}
