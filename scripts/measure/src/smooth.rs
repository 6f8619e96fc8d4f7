//! Takes the noise out of a reference without losing the detail of the cloud.
//!
//! The path tracer and the converged march see the same medium: they differ in what the light does, and that from place to
//! place slowly. So the difference is smoothed, not the picture.

use image::{Rgba, Rgba32FImage};

/// Standard deviation of the smoothing (pixels).
pub const RADIUS: f64 = 2.0;

/// `noisy` with the detail of `guide`: the guide, plus its difference from the noisy picture, per opacity, smoothed over
/// `RADIUS`. Clear sky stays clear, and nothing is taken from it.
pub fn smoothed(noisy: &Rgba32FImage, guide: &Rgba32FImage) -> Rgba32FImage {
    let opacity: Vec<f64> = guide.pixels().map(|p| f64::from(1.0 - p.0[3]).max(0.0)).collect();
    let width = guide.width() as usize;
    let spread = blur(&opacity, width);
    let channels: [Vec<f64>; 4] = std::array::from_fn(|i| {
        let apart = noisy.pixels().zip(guide.pixels()).zip(&opacity);
        // The noise where there is no cloud in the guide is no one's.
        let apart: Vec<f64> =
            apart.map(|((n, g), w)| if *w > 0.0 { f64::from(n.0[i]) - f64::from(g.0[i]) } else { 0.0 }).collect();
        blur(&apart, width)
    });
    let mut out = guide.clone();
    for (k, pixel) in out.pixels_mut().enumerate() {
        let share = opacity[k] / spread[k].max(1e-6);
        let value = |i: usize| (f64::from(pixel.0[i]) + share * channels[i][k]).max(0.0);
        *pixel = Rgba(std::array::from_fn(|i| if i == 3 { value(i).min(1.0) } else { value(i) } as f32));
    }
    out
}

/// A Gaussian over rows of `width`; what would reach beyond the picture is left out of the mean.
fn blur(values: &[f64], width: usize) -> Vec<f64> {
    let across = blur_rows(values, width);
    let height = values.len() / width.max(1);
    transposed(&blur_rows(&transposed(&across, width), height), height)
}

fn blur_rows(values: &[f64], width: usize) -> Vec<f64> {
    let reach = (3.0 * RADIUS).ceil() as usize;
    let weight = |d: usize| (-0.5 * (d as f64 / RADIUS).powi(2)).exp();
    let mut out = Vec::with_capacity(values.len());
    for row in values.chunks(width.max(1)) {
        out.extend((0..row.len()).map(|x| {
            let near = x.saturating_sub(reach)..(x + reach + 1).min(row.len());
            let (sum, total) =
                near.fold((0.0, 0.0), |(s, t), u| (s + weight(u.abs_diff(x)) * row[u], t + weight(u.abs_diff(x))));
            sum / total
        }));
    }
    out
}

fn transposed(values: &[f64], width: usize) -> Vec<f64> {
    (0..width).flat_map(|x| values.iter().skip(x).step_by(width).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half clear sky, half cloud with fine detail.
    fn guide() -> Rgba32FImage {
        Rgba32FImage::from_fn(32, 24, |x, y| {
            let light = 1000.0 + 300.0 * ((x + y) % 2) as f32;
            if x < 16 { Rgba([0.0, 0.0, 0.0, 1.0]) } else { Rgba([light, light, light, 0.0]) }
        })
    }

    #[test]
    fn noise_goes_and_detail_and_light_stay() {
        let guide = guide();
        // Light a fifth brighter, with noise of mean 0 that has nothing to do with the detail.
        let noise = |x: u32, y: u32| 150.0 * (((x + 2 * y) % 5) as f32 - 2.0);
        let mut truth = guide.clone();
        truth.pixels_mut().for_each(|p| p.0[0] *= 1.2);
        let mut noisy = truth.clone();
        noisy.enumerate_pixels_mut().filter(|(_, _, p)| p.0[3] < 1.0).for_each(|(x, y, p)| p.0[0] += noise(x, y));
        let found = smoothed(&noisy, &guide);
        for ((x, y, found), truth) in found.enumerate_pixels().zip(truth.pixels()) {
            if (4..20).contains(&y) {
                let apart = (found.0[0] - truth.0[0]).abs();
                assert!(apart < 80.0, "{x}, {y}: {} instead of {}", found.0[0], truth.0[0]);
            }
            if x < 16 {
                assert_eq!(found.0, [0.0, 0.0, 0.0, 1.0], "clear sky at {x}, {y}");
            }
        }
    }

    #[test]
    fn a_blur_keeps_what_is_even() {
        assert!(blur(&[3.0; 35], 7).iter().all(|v| (v - 3.0).abs() < 1e-12));
    }
}
