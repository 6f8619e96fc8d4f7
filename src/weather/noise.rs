//! Noise on [`Lattice`]s. Only `+ − × ÷ √ floor`, which IEEE 754 rounds the same everywhere, so that a seed makes the same
//! map on every machine.

use super::lattice::Lattice;

/// A hash of a cell (PCG's output function, O'Neill 2014, over a product of primes).
pub(super) fn hash(key: u32, i: u32, j: u32) -> u32 {
    let mut x = key ^ i.wrapping_mul(0x9e37_79b1) ^ j.wrapping_mul(0x85eb_ca77).rotate_left(13);
    for _ in 0..2 {
        x = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        x = ((x >> ((x >> 28) + 4)) ^ x).wrapping_mul(277_803_737);
        x = (x >> 22) ^ x;
    }
    x
}

/// 16 bits of a hash as a number in [0, 1).
fn unit(bits: u32) -> f32 {
    (bits & 0xffff) as f32 / 65536.0
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(super) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A wave of period 1 and height ±1, crest at 0: nearly a cosine.
pub(super) fn wave(phase: f32) -> f32 {
    let x = ((phase - phase.floor()) - 0.5).abs() * 4.0 - 1.0;
    x * (1.5 - 0.5 * x * x)
}

/// Gradient noise (Perlin 2002) on a lattice, about −1 to 1. Keeps the corners of the cell that it was last asked for: texels
/// of a row come one after the other.
pub(super) struct Gradient<'a> {
    lattice: &'a Lattice,
    key: u32,
    at: Option<(i32, i32)>,
    corners: [[f32; 2]; 4],
}

/// Eight directions and eight between them, all of about unit length.
const DIRECTIONS: [[f32; 2]; 16] = [
    [1.0, 0.0],
    [0.92, 0.38],
    [0.71, 0.71],
    [0.38, 0.92],
    [0.0, 1.0],
    [-0.38, 0.92],
    [-0.71, 0.71],
    [-0.92, 0.38],
    [-1.0, 0.0],
    [-0.92, -0.38],
    [-0.71, -0.71],
    [-0.38, -0.92],
    [0.0, -1.0],
    [0.38, -0.92],
    [0.71, -0.71],
    [0.92, -0.38],
];

impl<'a> Gradient<'a> {
    pub fn new(lattice: &'a Lattice, key: u32) -> Self {
        Self { lattice, key, at: None, corners: [[0.0; 2]; 4] }
    }

    pub fn at(&mut self, place: [f32; 2]) -> f32 {
        let [x, y] = self.lattice.cell(place);
        let (fx, fy) = (x.floor(), y.floor());
        let (i, j) = (fx as i32, fy as i32);
        if self.at != Some((i, j)) {
            self.at = Some((i, j));
            for (n, corner) in self.corners.iter_mut().enumerate() {
                let (wi, wj) = self.lattice.wrap(i + (n as i32 & 1), j + (n as i32 >> 1));
                *corner = DIRECTIONS[(hash(self.key, wi, wj) >> 28) as usize];
            }
        }
        let (x, y) = (x - fx, y - fy);
        let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let dot = |[gx, gy]: [f32; 2], x: f32, y: f32| gx * x + gy * y;
        let [a, b, c, d] = self.corners;
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let low = mix(dot(a, x, y), dot(b, x - 1.0, y), fade(x));
        let high = mix(dot(c, x, y - 1.0), dot(d, x - 1.0, y - 1.0), fade(x));
        1.5 * mix(low, high, fade(y))
    }
}

/// Lattices of one noise, each finer and turned against the one before, so that no axis shows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Octaves {
    lattices: Vec<Lattice>,
    key: u32,
}

impl Octaves {
    /// As many octaves as have cells of two texels at least, `most` at most; always one. `cells` is cells a repeat.
    pub fn new(key: u32, cells: f64, degrees: f64, size: u32, most: u32) -> Self {
        Self::made(key, size, most, cells, |scale, turn| Lattice::square(cells * scale, degrees + turn))
    }

    /// Of stretched cells. They are not turned.
    pub fn stretched(key: u32, along: f64, across: f64, degrees: f64, size: u32, most: u32) -> Self {
        Self::made(key, size, most, across, |scale, _| Lattice::stretched(along * scale, across * scale, degrees))
    }

    fn made(key: u32, size: u32, most: u32, finest: f64, make: impl Fn(f64, f64) -> Lattice) -> Self {
        let scale = |n: u32| (0..n).fold(1.0, |s, _| s * 2.03);
        let fits = |n: &u32| *n == 0 || finest * scale(*n) * 2.0 <= f64::from(size);
        let lattices = (0..most).take_while(fits).map(|n| make(scale(n), 37.0 * f64::from(n))).collect();
        Self { lattices, key }
    }

    pub fn reader(&self) -> Fractal<'_> {
        let octave = |(n, lattice)| Gradient::new(lattice, hash(self.key, n, 0));
        Fractal((0..).zip(&self.lattices).map(octave).collect())
    }
}

/// Sum of octaves, each half as strong as the one before (fractional Brownian motion), about −1 to 1.
pub(super) struct Fractal<'a>(Vec<Gradient<'a>>);

impl Fractal<'_> {
    pub fn at(&mut self, place: [f32; 2]) -> f32 {
        let (mut sum, mut weight) = (0.0, 1.0);
        for octave in &mut self.0 {
            sum += weight * octave.at(place);
            weight *= 0.5;
        }
        sum
    }
}

/// What is known of the cells around a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cells {
    /// Distance to the nearest centre, in cells.
    pub nearest: f32,
    /// Distance to the second nearest.
    pub second: f32,
    /// Bump of the cell that rises highest here: 1 at the centre of a full-grown cell, 0 a cell's side away.
    pub bump: f32,
    /// How far the cells around have grown, smooth from one to the next (0..1).
    pub growth: f32,
}

/// Places of neighbours whose centres can matter: within two steps of the hexagonal lattice.
const NEIGHBOURS: [(i32, i32); 19] = [
    (0, 0),
    (1, 0),
    (0, 1),
    (-1, 1),
    (-1, 0),
    (0, -1),
    (1, -1),
    (2, 0),
    (1, 1),
    (0, 2),
    (-1, 2),
    (-2, 2),
    (-2, 1),
    (-2, 0),
    (-1, -1),
    (0, -2),
    (1, -2),
    (2, -2),
    (2, -1),
];

/// Cellular noise (Worley 1996) whose cells differ in strength.
pub(super) struct Cellular<'a> {
    lattice: &'a Lattice,
    key: u32,
    /// How far centres stray from the lattice, in cells.
    jitter: f32,
    /// How much weaker a cell may be than the strongest (0..1).
    spread: f32,
    at: Option<(i32, i32)>,
    /// Centre in cells from the corner of the cell, and growth.
    centres: [[f32; 3]; 19],
}

impl<'a> Cellular<'a> {
    pub fn new(lattice: &'a Lattice, key: u32, jitter: f32, spread: f32) -> Self {
        Self { lattice, key, jitter, spread, at: None, centres: [[0.0; 3]; 19] }
    }

    pub fn at(&mut self, place: [f32; 2]) -> Cells {
        let [x, y] = self.lattice.cell(place);
        let (fx, fy) = (x.floor(), y.floor());
        self.gather(fx as i32, fy as i32);
        let (x, y) = (x - fx, y - fy);
        let [[m00, m01], [m10, m11]] = self.lattice.metric;
        let (mut first, mut second, mut bump) = (9.0_f32, 9.0_f32, 0.0_f32);
        let (mut weights, mut growth) = (1e-6, 0.5e-6);
        for [cx, cy, grown] in self.centres {
            let (dx, dy) = (cx - x, cy - y);
            let (mx, my) = (m00 * dx + m01 * dy, m10 * dx + m11 * dy);
            let d2 = mx * mx + my * my;
            second = second.min(d2.max(first));
            first = first.min(d2);
            let near = (1.0 - d2 * 0.8).max(0.0);
            bump = bump.max((1.0 - self.spread * (1.0 - grown)) * near);
            // Reaches further, so that some cell is always near enough.
            let weight = (1.0 - d2 * 0.35).max(0.0);
            let weight = weight * weight * weight;
            weights += weight;
            growth += weight * grown;
        }
        Cells { nearest: first.sqrt(), second: second.sqrt(), bump, growth: growth / weights }
    }

    fn gather(&mut self, i: i32, j: i32) {
        if self.at == Some((i, j)) {
            return;
        }
        self.at = Some((i, j));
        for (centre, (di, dj)) in self.centres.iter_mut().zip(NEIGHBOURS) {
            let (wi, wj) = self.lattice.wrap(i + di, j + dj);
            let place = hash(self.key, wi, wj);
            let stray = |bits| 0.5 + self.jitter * (unit(bits) - 0.5);
            let grown = unit(hash(place, wj, wi));
            *centre = [di as f32 + stray(place), dj as f32 + stray(place >> 16), grown];
        }
    }
}
