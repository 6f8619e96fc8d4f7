//! Blue noise by void and cluster: neighbouring pixels get values far apart, so the grain of a few
//! samples is fine and even.
//!
//! Three channels: the first two offset the sample within its pixel, the third along the ray
//! (thesis 4.4 \[Ford\]). The algorithm is R. Ulichney, "The void-and-cluster method for dither
//! array generation", Proc. SPIE 1913 (1993). It ranks all pixels of a tile that repeats without
//! seams, such that the first `k` ranks are evenly spread for every `k`.
//!
//! The shipped tile, `assets/textures/blue_noise.png`, is [`generate`] with the default parameters;
//! `examples/make_blue_noise.rs` wrote it. Load it as linear data (`is_srgb = false`), repeat it,
//! and do not filter it.

use thiserror::Error;

/// What to generate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlueNoiseParams {
    /// Width and height of the tile, in pixels: a power of two, 8 ..= 256. Default 128.
    ///
    /// Cost: three channels of 128 take about 0.3 s, of 256 about 3 s; time grows with `size³`.
    pub size: u32,
    /// Any number; another seed gives another tile of the same quality. Default 1.
    pub seed: u64,
    /// Standard deviation of the Gaussian that measures crowding, in pixels, 1.0 ..= 3.0. Default
    /// 1.9.
    ///
    /// Smaller pushes the energy to higher frequencies, until checkerboards appear towards 1.0;
    /// larger flattens the spectrum above a lower cut-off, a coarser and rounder grain. Ulichney
    /// uses 1.5. Cost: grows with `sigma²`.
    pub sigma: f32,
}

impl Default for BlueNoiseParams {
    fn default() -> Self {
        Self { size: 128, seed: 1, sigma: 1.9 }
    }
}

/// A parameter outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum BlueNoiseError {
    /// [`BlueNoiseParams::size`] is not one of the sizes allowed.
    #[error("blue noise: `size` is {0}; it must be a power of two from 8 to 256")]
    Size(u32),
    /// [`BlueNoiseParams::sigma`] is out of range, or not a number.
    #[error("blue noise: `sigma` is {0}; it must be from 1.0 to 3.0 pixels")]
    Sigma(f32),
}

/// Three independent channels as RGBA8, row by row, alpha 255: `4 · size²` bytes, ready for a
/// linear `rgba8unorm` texture.
///
/// Ranks are spread evenly over the bytes: where `size²` is a multiple of 256 (from 16 × 16) each
/// byte occurs equally often. Read a byte as the middle of its step, `(byte + 0.5) / 256` = `texel
/// · 255/256 + 0.5/256`, which lies in \[0, 1) with mean 0.5.
///
/// The same parameters always give the same bytes. Cost: see [`BlueNoiseParams::size`].
///
/// # Errors
/// [`BlueNoiseError`] names the parameter that is out of range.
pub fn generate(params: BlueNoiseParams) -> Result<Vec<u8>, BlueNoiseError> {
    params.validate()?;
    let pixels = (params.size as usize).pow(2);
    let mut seeds = SplitMix(params.seed);
    let mut rgba = vec![255; 4 * pixels];
    for channel in 0..3 {
        let ranks = void_and_cluster(BlueNoiseParams { seed: seeds.next(), ..params })?;
        for (pixel, rank) in rgba.chunks_exact_mut(4).zip(ranks) {
            pixel[channel] = (rank as usize * 256 / pixels) as u8;
        }
    }
    Ok(rgba)
}

/// The rank of each pixel, row by row: every number from 0 to `size² − 1` once. `seed` is used as
/// it is, not split into channels.
///
/// Pixels of rank below `k` form a blue-noise point set for every `k`, on a torus. Cost: a third of
/// [`generate`].
///
/// # Errors
/// [`BlueNoiseError`] names the parameter that is out of range.
pub fn void_and_cluster(params: BlueNoiseParams) -> Result<Vec<u32>, BlueNoiseError> {
    params.validate()?;
    let mut field = Field::new(params);
    let count = field.spread_initial_points(&mut SplitMix(params.seed ^ INITIAL_POINTS));
    let mut ranks = vec![0; field.on.len()];

    // Ulichney's phase 1: the initial points, last rank first, the most crowded leaving first.
    let mut thinning = field.clone();
    for rank in (0..count).rev() {
        let pixel = thinning.tightest_cluster();
        thinning.set(pixel, false);
        ranks[pixel] = rank as u32;
    }
    // Phases 2 and 3 in one. Phase 3 looks for the tightest cluster of empty pixels; as the
    // energies of the empty and of the full pixels add up to a constant, that is the largest void
    // again.
    for rank in count..ranks.len() {
        let pixel = field.largest_void();
        field.set(pixel, true);
        ranks[pixel] = rank as u32;
    }
    Ok(ranks)
}

impl BlueNoiseParams {
    /// Checks every range; the generators do this first.
    ///
    /// # Errors
    /// [`BlueNoiseError`] names the parameter that is out of range.
    pub fn validate(&self) -> Result<(), BlueNoiseError> {
        if !self.size.is_power_of_two() || !(8..=256).contains(&self.size) {
            return Err(BlueNoiseError::Size(self.size));
        }
        if !(1.0..=3.0).contains(&self.sigma) {
            return Err(BlueNoiseError::Sigma(self.sigma));
        }
        Ok(())
    }
}

/// Keeps the points' random numbers apart from the tie-breaking ones.
const INITIAL_POINTS: u64 = 0x5851_F42D_4C95_7F2D;

/// Energies are integers, so that removing a point undoes adding it exactly: a Gaussian of height
/// 2⁴⁰ in the upper bits (its sum is below 2⁴⁶, as `sigma` ≤ 3) and, in the lowest, a constant
/// random number that decides ties without favouring a direction.
const HEIGHT: f64 = (1u64 << 40) as f64;
const TIE_BITS: u32 = 8;

/// A point set on a toroidal tile, with the energy (crowding) it causes at every pixel.
#[derive(Clone)]
struct Field {
    size: usize,
    /// Rows of the Gaussian; the centre is at (`radius`, `radius`).
    kernel: Vec<Vec<u64>>,
    radius: usize,
    on: Vec<bool>,
    energy: Vec<u64>,
    /// Per row, the fullest point and the emptiest gap if known: a change only touches the rows the
    /// Gaussian reaches.
    clusters: Vec<Option<(u64, usize)>>,
    voids: Vec<Option<(u64, usize)>>,
}

impl Field {
    fn new(params: BlueNoiseParams) -> Self {
        let size = params.size as usize;
        let sigma = f64::from(params.sigma);
        // Where the Gaussian falls below half a unit: √(2 ln 2⁴¹) σ. On a small tile it wraps
        // around more than once, as it should.
        let radius = (7.54 * sigma).ceil() as usize;
        let squared = |i: usize| (i as f64 - radius as f64).powi(2);
        let gaussian = |x, y| ((-(squared(x) + squared(y)) / (2.0 * sigma * sigma)).exp() * HEIGHT).round() as u64;
        let width = 2 * radius + 1;
        let mut ties = SplitMix(params.seed);
        Self {
            size,
            kernel: (0..width).map(|y| (0..width).map(|x| gaussian(x, y) << TIE_BITS).collect()).collect(),
            radius,
            on: vec![false; size * size],
            energy: (0..size * size).map(|_| ties.next() >> (64 - TIE_BITS)).collect(),
            clusters: vec![None; size],
            voids: vec![None; size],
        }
    }

    /// Adds or removes a point. `on` must differ from what the pixel holds.
    fn set(&mut self, pixel: usize, on: bool) {
        self.on[pixel] = on;
        let wrap = self.size - 1;
        // Adding a multiple of the size keeps the difference positive.
        let [x, y] = [pixel % self.size, pixel / self.size].map(|c| c + 64 * self.size - self.radius);
        for (j, weights) in self.kernel.iter().enumerate() {
            let row = (y + j) & wrap;
            let energies = &mut self.energy[row * self.size..][..self.size];
            for (i, weight) in weights.iter().enumerate() {
                let energy = &mut energies[(x + i) & wrap];
                *energy = if on { *energy + weight } else { *energy - weight };
            }
            self.clusters[row] = None;
            self.voids[row] = None;
        }
    }

    /// The point with the most energy.
    fn tightest_cluster(&mut self) -> usize {
        let Self { size, on, energy, clusters, .. } = self;
        let rows = clusters.iter_mut().enumerate().filter_map(|(row, known)| {
            if known.is_none() {
                *known = (row * *size..(row + 1) * *size).filter(|&i| on[i]).map(|i| (energy[i], i)).max();
            }
            *known
        });
        rows.max().map_or(0, |(_, pixel)| pixel)
    }

    /// The empty pixel with the least energy.
    fn largest_void(&mut self) -> usize {
        let Self { size, on, energy, voids, .. } = self;
        let rows = voids.iter_mut().enumerate().filter_map(|(row, known)| {
            if known.is_none() {
                *known = (row * *size..(row + 1) * *size).filter(|&i| !on[i]).map(|i| (energy[i], i)).min();
            }
            *known
        });
        rows.min().map_or(0, |(_, pixel)| pixel)
    }

    /// Ulichney's initial pattern: a tenth of the pixels at random, then the most crowded point
    /// moves to the largest void until that no longer helps. Returns the number of points.
    fn spread_initial_points(&mut self, random: &mut SplitMix) -> usize {
        let pixels = self.on.len();
        let count = pixels / 10;
        let mut placed = 0;
        while placed < count {
            // `pixels` is a power of two, so this is unbiased.
            let pixel = random.next() as usize & (pixels - 1);
            if !self.on[pixel] {
                self.set(pixel, true);
                placed += 1;
            }
        }
        loop {
            let cluster = self.tightest_cluster();
            self.set(cluster, false);
            let void = self.largest_void();
            // Every move lowers the sum of all energies, so this ends.
            let better = self.energy[void] < self.energy[cluster];
            self.set(if better { void } else { cluster }, true);
            if !better {
                return count;
            }
        }
    }
}

/// The generator of Steele, Lea and Flood, "Fast splittable pseudorandom number generators" (2014).
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}
