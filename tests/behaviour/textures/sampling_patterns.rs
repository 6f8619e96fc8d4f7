//! Where frames sample: n-rooks patterns and the shipped blue noise.

use std::ops::Range;

use bevy_cumulus::textures::{
    blue_noise::{self, BlueNoiseError, BlueNoiseParams},
    n_rooks::{MAX_WINDOW, n_rooks},
};
use rustfft::{FftPlanner, num_complex::Complex};

#[test]
fn a_window_of_frames_samples_every_row_and_every_column_of_the_pixel() {
    for n in 1..=MAX_WINDOW {
        let pattern = n_rooks(n);
        assert_eq!(pattern.len(), n);
        // Wherever the pixel's own noise shifts the pattern, by whole strata or parts of them.
        for shift in [0.0, 0.21, 0.5, 0.83] {
            for axis in 0..2 {
                let mut hits = vec![0; n];
                for point in pattern {
                    assert!((0.0..1.0).contains(&point[axis]), "window of {n}");
                    let position = (f64::from(point[axis]) + shift).fract();
                    hits[(position * n as f64 + 1e-6) as usize % n] += 1;
                }
                assert_eq!(hits, vec![1; n], "window of {n}, axis {axis}, shift {shift}");
            }
        }
    }
}

#[test]
fn consecutive_frames_sample_far_apart() {
    for n in 2..=MAX_WINDOW {
        let pattern = n_rooks(n);
        for (slot, &[x, y]) in pattern.iter().enumerate() {
            let [next_x, next_y] = pattern[(slot + 1) % n];
            let around = |d: f32| d.abs().min(1.0 - d.abs());
            let distance = around(next_x - x).hypot(around(next_y - y));
            assert!(distance > 0.35, "window of {n}, slot {slot}: {distance} pixels");
        }
    }
}

#[test]
fn the_shipped_blue_noise_has_no_low_frequencies() {
    for channel in shipped_channels() {
        let spectrum = Spectrum::of(&channel);
        let principal = spectrum.principal_frequency();
        assert!((0.3..0.6).contains(&principal), "principal frequency {principal} cycles/pixel");
        let low = spectrum.mean_power(0.0..principal / 4.0);
        assert!(low < 0.002, "{low} of white noise's energy below {}", principal / 4.0);
        let bias = spectrum.directional_bias();
        assert!(bias < 1.3, "one direction has {bias} times the mean energy");
    }
}

/// What sets void and cluster apart from white noise with its low frequencies taken out.
#[test]
fn the_darkest_pixels_of_the_shipped_blue_noise_are_spread_evenly() {
    for channel in shipped_channels() {
        for share in [1.0 / 16.0, 0.25, 0.5] {
            let points: Vec<f64> = channel.iter().map(|&v| f64::from(u8::from(v < share))).collect();
            // Ulichney's principal frequency of a dither pattern: one over the mean distance of its
            // points.
            let low = Spectrum::of(&points).mean_power(0.0..f64::sqrt(share) / 4.0);
            assert!(low < 0.06, "darkest {share}: {low} of white noise's energy");
        }
    }
}

/// The measures above would notice: white noise measures 1, and streaks show as directional bias.
#[test]
fn white_noise_and_streaks_measure_as_such() {
    let white = white_noise();
    let spectrum = Spectrum::of(&white);
    for band in [0.0..0.1, 0.1..0.3, 0.3..0.5] {
        let power = spectrum.mean_power(band.clone());
        assert!((0.8..1.2).contains(&power), "white noise at {band:?}: {power}");
    }
    assert!(spectrum.directional_bias() < 1.3);

    let streaks: Vec<f64> = (0..white.len()).map(|i| white[i] + white[(i + 1) % white.len()]).collect();
    assert!(Spectrum::of(&streaks).directional_bias() > 1.5);
}

#[test]
fn every_value_of_the_shipped_blue_noise_occurs_equally_often() {
    let (size, rgba) = shipped();
    assert_eq!(size, 128);
    for channel in 0..3 {
        let mut histogram = [0; 256];
        for pixel in rgba.chunks_exact(4) {
            histogram[usize::from(pixel[channel])] += 1;
        }
        assert_eq!(histogram, [64; 256], "channel {channel}");
    }
    assert!(rgba.chunks_exact(4).all(|pixel| pixel[3] == 255));
}

#[test]
fn the_channels_of_the_shipped_blue_noise_are_independent() {
    let [r, g, b] = shipped_channels();
    for (name, one, other) in [("RG", &r, &g), ("GB", &g, &b), ("BR", &b, &r)] {
        let product: f64 = one.iter().zip(other).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
        let correlation = product / one.len() as f64 * 12.0;
        assert!(correlation.abs() < 0.03, "{name}: {correlation}");
    }
}

#[test]
fn the_generator_makes_the_shipped_blue_noise() {
    let (_, rgba) = shipped();
    assert!(blue_noise::generate(BlueNoiseParams::default()) == Ok(rgba));
}

#[test]
fn every_size_and_sigma_gives_each_rank_once() {
    for (size, sigma) in [(8, 3.0), (8, 1.0), (16, 1.9), (64, 1.5), (64, 3.0)] {
        let params = BlueNoiseParams { size, seed: 7, sigma };
        let ranks = blue_noise::void_and_cluster(params).unwrap();
        let mut sorted = ranks.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..size * size), "{params:?}");
        let reseeded = BlueNoiseParams { seed: 8, ..params };
        assert_ne!(ranks, blue_noise::void_and_cluster(reseeded).unwrap(), "{params:?}");
    }
}

#[test]
fn blue_noise_parameters_out_of_range_are_named() {
    for size in [0, 4, 100, 512, u32::MAX] {
        let params = BlueNoiseParams { size, ..Default::default() };
        assert_eq!(blue_noise::generate(params), Err(BlueNoiseError::Size(size)));
    }
    for sigma in [0.0, -1.0, 0.99, 3.01, f32::INFINITY, f32::NAN] {
        let params = BlueNoiseParams { sigma, ..Default::default() };
        let error = blue_noise::void_and_cluster(params).unwrap_err().to_string();
        assert!(error.contains("`sigma`") && error.contains("1.0 to 3.0"), "{error}");
    }
}

/// Side and RGBA bytes of `assets/textures/blue_noise.png`.
fn shipped() -> (usize, Vec<u8>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/textures/blue_noise.png");
    let image = image::open(path).unwrap().into_rgba8();
    assert_eq!(image.width(), image.height());
    (image.width() as usize, image.into_raw())
}

/// Red, green and blue as numbers in 0..1.
fn shipped_channels() -> [Vec<f64>; 3] {
    let (_, rgba) = shipped();
    let value = |byte: u8| (f64::from(byte) + 0.5) / 256.0;
    [0, 1, 2].map(|c| rgba.chunks_exact(4).map(|pixel| value(pixel[c])).collect())
}

/// 128 × 128 numbers in 0..1 from a linear congruential generator (Knuth's constants).
fn white_noise() -> Vec<f64> {
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 32) as f64 / (1u64 << 32) as f64
    };
    (0..128 * 128).map(|_| next()).collect()
}

/// Power of a square tile by frequency, in multiples of white noise of the same variance.
struct Spectrum {
    /// Horizontal and vertical frequency (cycles per pixel, −0.5..0.5) and power, without the mean.
    modes: Vec<(f64, f64, f64)>,
}

impl Spectrum {
    fn of(tile: &[f64]) -> Self {
        let size = tile.len().isqrt();
        let mean = tile.iter().sum::<f64>() / tile.len() as f64;
        let energy: f64 = tile.iter().map(|v| (v - mean).powi(2)).sum();

        let mut rows: Vec<Complex<f64>> = tile.iter().map(|v| Complex::new(v - mean, 0.0)).collect();
        let fft = FftPlanner::new().plan_fft_forward(size);
        fft.process(&mut rows);
        let mut columns: Vec<_> = (0..tile.len()).map(|i| rows[i % size * size + i / size]).collect();
        fft.process(&mut columns);

        let frequency = |i: usize| (i as f64 / size as f64 + 0.5).fract() - 0.5;
        let mode = |i: usize| (frequency(i / size), frequency(i % size), columns[i].norm_sqr() / energy);
        Self { modes: (1..tile.len()).map(mode).collect() }
    }

    /// Mean power of the modes whose frequency, in any direction, lies in `band`.
    fn mean_power(&self, band: Range<f64>) -> f64 {
        mean(self.modes.iter().filter(|(x, y, _)| band.contains(&x.hypot(*y))).map(|mode| mode.2))
    }

    /// Frequency at which the radially averaged power peaks.
    fn principal_frequency(&self) -> f64 {
        let rings = (1..32).map(|i| f64::from(i) / 50.0);
        let power = |f: f64| self.mean_power(f - 0.01..f + 0.01);
        rings.max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap()
    }

    /// Power of the strongest of 8 directions, in multiples of the mean of all, at 0.2 to 0.5
    /// cycles per pixel.
    fn directional_bias(&self) -> f64 {
        let ring = || self.modes.iter().filter(|(x, y, _)| (0.2..0.5).contains(&x.hypot(*y)));
        let sector = |x: f64, y: f64| (y.atan2(x) / std::f64::consts::PI * 8.0).rem_euclid(8.0) as usize;
        let strongest = (0..8).map(|s| mean(ring().filter(|(x, y, _)| sector(*x, *y) == s).map(|mode| mode.2)));
        strongest.fold(0.0, f64::max) / mean(ring().map(|mode| mode.2))
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
    sum / f64::from(count)
}
