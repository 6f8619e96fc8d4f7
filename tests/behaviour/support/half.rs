//! Half floats, and how far pictures are apart.

/// The value of an IEEE 754 half.
///
/// # Panics
/// Where it is infinite or NaN: nothing of ours stores that.
pub fn from_half(bits: u16) -> f64 {
    let half = ::half::f16::from_bits(bits);
    assert!(half.is_finite(), "a half that is infinite or NaN: {bits:#x}");
    half.to_f64()
}

/// The largest difference between two lists, relative to the second's value or to `floor`, whichever is larger.
pub fn worst_relative(a: &[f64], b: &[f64], floor: f64) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / b.abs().max(floor)).fold(0.0, |worst, e| {
        // A NaN counts as the worst.
        if e > worst || e.is_nan() { e } else { worst }
    })
}
