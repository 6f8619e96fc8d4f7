//! Takes the noise out of a reference without losing the detail of the cloud.
//!
//! The path tracer and the converged march see the same medium: they differ in what the light does, and that from place to
//! place slowly. So what they differ by is smoothed, not the picture.

use image::{Rgba, Rgba32FImage};

/// Standard deviation of the smoothing (pixels).
pub const RADIUS: f64 = 2.0;
/// What is darker than so much of the clouds' mean counts less, in the ratio of light, than its brightness would have it.
const DARK: f64 = 0.05;

/// `noisy` with the detail of `guide`: the guide's light times the ratio of both's light around it, and the guide's
/// transmittance plus what the noisy one's differs by around it, per opacity. Clear sky stays clear, and nothing is taken
/// from it.
///
/// Light is a ratio since it spans a hundredfold within a few pixels of a low sun, where a smoothed difference would take
/// away more than there is. The weights go by the guide alone, so noise of mean 0 adds nothing on average.
pub fn smoothed(noisy: &Rgba32FImage, guide: &Rgba32FImage) -> Rgba32FImage {
    let width = guide.width() as usize;
    let light: [Vec<f64>; 3] = std::array::from_fn(|i| {
        let guides = channel(guide, i);
        let cloud = guides.iter().filter(|g| **g > 0.0).count().max(1);
        let dark = DARK * guides.iter().sum::<f64>() / cloud as f64;
        let even = |values: &[f64]| {
            let even: Vec<f64> =
                values.iter().zip(&guides).map(|(v, g)| if *g > 0.0 { v / (g + dark) } else { 0.0 }).collect();
            blur(&even, width)
        };
        let (of_noisy, of_guide) = (even(&channel(noisy, i)), even(&guides));
        guides.iter().zip(of_noisy.iter().zip(of_guide)).map(|(g, (n, of))| g * (n / of.max(1e-9)).max(0.0)).collect()
    });
    let clear = channel(guide, 3);
    let opacity: Vec<f64> = clear.iter().map(|t| (1.0 - t).max(0.0)).collect();
    // The noise where there is no cloud in the guide is no one's.
    let apart: Vec<f64> = channel(noisy, 3)
        .iter()
        .zip(clear.iter().zip(&opacity))
        .map(|(n, (g, w))| if *w > 0.0 { n - g } else { 0.0 })
        .collect();
    let (apart, spread) = (blur(&apart, width), blur(&opacity, width));
    let mut out = guide.clone();
    for (k, pixel) in out.pixels_mut().enumerate() {
        let transmittance = clear[k] + opacity[k] / spread[k].max(1e-6) * apart[k];
        let [r, g, b] = [light[0][k], light[1][k], light[2][k]];
        *pixel = Rgba([r, g, b, transmittance.clamp(0.0, 1.0)].map(|v| v as f32));
    }
    out
}

fn channel(picture: &Rgba32FImage, i: usize) -> Vec<f64> {
    picture.pixels().map(|p| f64::from(p.0[i])).collect()
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
    fn dark_cloud_beside_bright_stays_lit() {
        // Next to the sun: three bright pixels in dark cloud. The truth has half of the bright light, and 1.2 of the dark.
        let of = |bright: f32, dark: f32| {
            Rgba32FImage::from_fn(24, 16, |x, _| {
                let light = if (8..11).contains(&x) { bright } else { dark };
                Rgba([light, light, light, 0.1])
            })
        };
        let (guide, truth) = (of(1e5, 1e3), of(5e4, 1.2e3));
        let found = smoothed(&truth, &guide);
        for ((x, y, found), truth) in found.enumerate_pixels().zip(truth.pixels()) {
            let ratio = found.0[0] / truth.0[0];
            // Where the two meet their ratios mix; a smoothed difference would leave the dark none of its light.
            assert!((0.4..2.0).contains(&ratio), "{x}, {y}: {ratio} of the truth");
        }
        assert!(found.pixels().all(|p| (p.0[3] - 0.1).abs() < 1e-6), "transmittance was right");
    }

    #[test]
    fn a_blur_keeps_what_is_even() {
        assert!(blur(&[3.0; 35], 7).iter().all(|v| (v - 3.0).abs() < 1e-12));
    }
}
