//! Light in a plane-parallel slab by adding and doubling (van de Hulst, "Multiple Light Scattering", chapter 4), in f64.
//!
//! Layers are matrices over the nodes of a quadrature: what leaves in direction i for what comes in by direction j.
//! Only the azimuthal mean is kept, which is all there is where the light or the camera is vertical or uniform.

use std::f64::consts::PI;

/// Nodes and weights of Gauss and Legendre on 0..1.
pub fn gauss(n: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 0.0;
        for _ in 0..100 {
            let [last, before] = legendre(n, x)[n - 1..].iter().rev().copied().collect::<Vec<_>>()[..] else {
                unreachable!()
            };
            slope = n as f64 * (x * last - before) / (x * x - 1.0);
            let step = last / slope;
            x -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

/// P_0 to P_n at x.
fn legendre(n: usize, x: f64) -> Vec<f64> {
    let mut p = vec![1.0, x];
    for l in 1..n {
        let l_f = l as f64;
        p.push(((2.0 * l_f + 1.0) * x * p[l] - l_f * p[l - 1]) / (l_f + 1.0));
    }
    p
}

/// The first `count` Legendre moments of a phase function (1/sr) of cosθ; the first is 1.
pub fn moments(count: usize, phase: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; count];
    for (x, w) in gauss(4 * count) {
        // A narrow peak is resolved by nodes that crowd towards it.
        let versine = 2.0 * x.powi(6);
        let density = 2.0 * 6.0 * x.powi(5) * w * 2.0 * PI * phase(1.0 - versine);
        for (sum, p) in sums.iter_mut().zip(legendre(count, 1.0 - versine)) {
            *sum += density * p;
        }
    }
    sums
}

/// Chandrasekhar's H for isotropic scattering of this albedo.
pub fn h_function(albedo: f64) -> impl Fn(f64) -> f64 {
    let nodes = gauss(64);
    let mut h = vec![1.0; nodes.len()];
    let at = move |mu: f64, nodes: &[(f64, f64)], h: &[f64]| {
        let sum: f64 = nodes.iter().zip(h).map(|((x, w), h)| w * x * h / (mu + x)).sum();
        1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * sum)
    };
    for _ in 0..400 {
        h = nodes.iter().map(|(mu, _)| at(*mu, &nodes, &h)).collect();
    }
    move |mu| at(mu, &nodes, &h)
}

type Matrix = Vec<Vec<f64>>;

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let n = b.len();
    a.iter()
        .map(|row| {
            let mut out = vec![0.0; n];
            for (x, b_row) in row.iter().zip(b) {
                for (o, y) in out.iter_mut().zip(b_row) {
                    *o += x * y;
                }
            }
            out
        })
        .collect()
}

/// a⁻¹ b, by elimination with pivots.
fn solve(mut a: Matrix, mut b: Matrix) -> Matrix {
    let n = a.len();
    for column in 0..n {
        let pivot = (column..n).max_by(|i, j| a[*i][column].abs().total_cmp(&a[*j][column].abs())).unwrap();
        a.swap(column, pivot);
        b.swap(column, pivot);
        let (a_row, b_row) = (a[column].clone(), b[column].clone());
        for i in (0..n).filter(|i| *i != column) {
            let f = a[i][column] / a_row[column];
            if f != 0.0 {
                a[i].iter_mut().zip(&a_row).for_each(|(x, y)| *x -= f * y);
                b[i].iter_mut().zip(&b_row).for_each(|(x, y)| *x -= f * y);
            }
        }
    }
    for (i, row) in b.iter_mut().enumerate() {
        row.iter_mut().for_each(|x| *x /= a[i][i]);
    }
    b
}

/// A homogeneous slab.
pub struct Slab {
    /// Cosines to the vertical and quadrature weights; the last two, the direction asked for and the vertical itself,
    /// weigh nothing to speak of.
    nodes: Vec<(f64, f64)>,
    reflection: Matrix,
    transmission: Matrix,
    depth: f64,
}

impl Slab {
    /// Of this vertical optical depth, albedo and Legendre moments, over `n` nodes and the direction `mu`.
    pub fn new(depth: f64, albedo: f64, moments: &[f64], n: usize, mu: f64) -> Self {
        let mut nodes = gauss(n);
        nodes.extend([(mu, 1e-12), (1.0, 1e-12)]);
        let polynomials: Vec<Vec<f64>> = nodes.iter().map(|(mu, _)| legendre(moments.len(), *mu)).collect();
        let scatter = |i: usize, j: usize, sign: f64| -> f64 {
            let mut s = 1.0;
            moments
                .iter()
                .enumerate()
                .map(|(l, moment)| {
                    let term = s * (2.0 * l as f64 + 1.0) * moment * polynomials[i][l] * polynomials[j][l];
                    s *= sign;
                    term
                })
                .sum()
        };
        let doublings = (depth / 1e-7).log2().ceil() as u32;
        let thin = depth / f64::from(doublings).exp2();
        let layer = |sign: f64| -> Matrix {
            (0..nodes.len())
                .map(|i| {
                    let row =
                        (0..nodes.len()).map(|j| albedo * scatter(i, j, sign) * nodes[j].1 * thin / (2.0 * nodes[i].0));
                    row.collect()
                })
                .collect()
        };
        let (mut r, mut t) = (layer(-1.0), layer(1.0));
        // A thin layer's own scattering is at most so much of what it takes away: without this, what the quadrature
        // gets wrong in the peak would be made or lost in every one of the doublings.
        for j in 0..n {
            let gained: f64 = (0..n).map(|i| nodes[i].0 * nodes[i].1 * (r[i][j] + t[i][j])).sum();
            t[j][j] += (albedo * thin * nodes[j].1 - gained) / (nodes[j].0 * nodes[j].1);
        }
        for (i, (mu, _)) in nodes.iter().enumerate() {
            t[i][i] += (-thin / mu).exp();
        }
        for _ in 0..doublings {
            let mut rest = product(&r, &r);
            rest.iter_mut().enumerate().for_each(|(i, row)| {
                row.iter_mut().for_each(|x| *x = -*x);
                row[i] += 1.0;
            });
            let between = solve(rest, t.clone());
            let up = product(&t, &product(&r, &between));
            r.iter_mut().zip(&up).for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(x, y)| *x += y));
            t = product(&t, &between);
        }
        Self { nodes, reflection: r, transmission: t, depth }
    }

    /// Radiance that the direction sees from above, under a sky of radiance 1.
    pub fn sky_reflected(&self) -> f64 {
        self.reflection[self.nodes.len() - 2].iter().sum()
    }

    /// Radiance that the direction sees from below, but for what comes straight through.
    pub fn sky_scattered_through(&self) -> f64 {
        let i = self.nodes.len() - 2;
        self.transmission[i].iter().sum::<f64>() - (-self.depth / self.nodes[i].0).exp()
    }

    /// Vertical radiance for a sun of illuminance 1 (across its rays) in the direction: from above, from below.
    pub fn sun_seen_vertically(&self) -> [f64; 2] {
        let (j, last) = (self.nodes.len() - 2, self.nodes.len() - 1);
        [&self.reflection, &self.transmission].map(|m| m[last][j] / (2.0 * PI * self.nodes[j].1))
    }
}
