//! Whether what came out is numbers. An 8-bit picture hides NaN, so the floats behind it are looked at.

use image::{Rgba, Rgba32FImage};

/// How many pixels of `what` are not finite, and the first of them; `None` where all are.
pub fn flaw(what: &str, image: &Rgba32FImage) -> Option<String> {
    let bad = |p: &Rgba<f32>| p.0.iter().any(|v| !v.is_finite());
    let count = image.pixels().filter(|p| bad(p)).count();
    let (x, y, pixel) = image.enumerate_pixels().find(|(_, _, p)| bad(p))?;
    Some(format!("{what} is not finite in {count} pixels, the first at {x},{y}: {:?}", pixel.0))
}
