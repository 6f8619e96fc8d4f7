//! A map as the model reads it: levels of detail, each with a bound of its coverage.

use std::sync::Arc;

use bevy::prelude::*;

use super::WeatherMap;

/// Levels of a map, RGBA8, finest first: R coverage, G height and B base, averaged; A the largest coverage that a filtered
/// reading within a texel of this level can give at this level or a finer one.
#[derive(Debug, PartialEq)]
pub(crate) struct WeatherPyramid {
    /// What it was made from.
    pub map: Arc<WeatherMap>,
    /// Side of the finest level (texels), a power of two.
    pub size: u32,
    pub levels: Vec<Vec<[u8; 4]>>,
}

impl WeatherPyramid {
    /// The pyramid over a map, brought to `size` texels a side (a power of two).
    pub fn new(map: &Arc<WeatherMap>, size: u32) -> Self {
        let side = UVec2::splat(size);
        let own = if map.size() == side { Arc::clone(map) } else { Arc::new(map.resized(side)) };
        let mut means: Vec<[f32; 3]> = own.texels().iter().map(|&[r, g, b, _]| [r, g, b].map(f32::from)).collect();
        let mut most: Vec<u8> = own.texels().iter().map(|t| t[0]).collect();
        let mut levels = Vec::new();
        let mut side = size as usize;
        loop {
            let bound = dilated(&most, side);
            levels
                .push(means.iter().zip(&bound).map(|(t, &a)| [t[0], t[1], t[2], f32::from(a)].map(to_byte)).collect());
            if side == 1 {
                return Self { map: Arc::clone(map), size, levels };
            }
            // Height and base of clouds count where there is coverage.
            means = halved(&means, side, |[a, b, c, d]| {
                let weight = [a, b, c, d].map(|t: [f32; 3]| t[0] + 1.0);
                let sum: f32 = weight.iter().sum();
                let mean = |k: usize| [a, b, c, d].iter().zip(weight).map(|(t, w)| t[k] * w).sum::<f32>() / sum;
                [(a[0] + b[0] + c[0] + d[0]) * 0.25, mean(1), mean(2)]
            });
            most = halved(&most, side, |of| of.into_iter().max().unwrap_or(0));
            side /= 2;
        }
    }
}

fn to_byte(x: f32) -> u8 {
    x.round().clamp(0.0, 255.0) as u8
}

/// Texels of the next level from the four under each.
fn halved<T: Copy>(fine: &[T], side: usize, join: impl Fn([T; 4]) -> T) -> Vec<T> {
    let half = side / 2;
    let mut out = Vec::with_capacity(half * half);
    for y in 0..half {
        for x in 0..half {
            let at = |dx: usize, dy: usize| fine[(2 * y + dy) * side + 2 * x + dx];
            out.push(join([at(0, 0), at(1, 0), at(0, 1), at(1, 1)]));
        }
    }
    out
}

/// The largest of the 3 × 3 texels around each, wrapping.
fn dilated(values: &[u8], side: usize) -> Vec<u8> {
    let around = |i: usize| [(i + side - 1) % side, i, (i + 1) % side];
    let rows: Vec<u8> = (0..side * side)
        .map(|i| around(i % side).into_iter().map(|x| values[i / side * side + x]).max().unwrap_or(0))
        .collect();
    (0..side * side)
        .map(|i| around(i / side).into_iter().map(|y| rows[y * side + i % side]).max().unwrap_or(0))
        .collect()
}
