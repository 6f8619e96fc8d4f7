//! N-rooks patterns: where in its pixel each frame of the temporal window samples.
//!
//! Frame `f` of a window of `n` frames samples its pixel at `fract(b12 + rook[f mod n])`, `b12`
//! being the pixel's own blue noise (thesis 4.5.2 \[Ford\]; n-rooks sampling after Shirley,
//! "Discrepancy as a Quality Measure for Sample Distributions", 1991). A pattern of `n` points hits
//! each of the `n` columns and each of the `n` rows of the pixel exactly once, so `n` frames see
//! `n` different horizontal and `n` different vertical positions whether or not `n` is a square.
//!
//! Because depth segment `f mod n` belongs to the same slot, (x, y, depth) together form a Latin
//! hypercube: no axis repeats.
//!
//! `fract` puts the pattern on a torus, so every distance here is toroidal and shifting a whole
//! pattern changes nothing.

/// Longest window that has a pattern, in frames. Windows are 1 ..= 16 frames long.
pub const MAX_WINDOW: usize = 16;

/// The pattern for a window of `n` frames: entry `f mod n` is the offset of frame `f`, in pixels,
/// each coordinate in \[0, 1).
///
/// `n` outside 1 ..= [`MAX_WINDOW`] is clamped into it; a window of one samples the centre, (0.5,
/// 0.5). Coordinates are the centres of the strata, `(i + 0.5) / n`, so the mean of a pattern is
/// exactly the pixel's centre. Cost: a table look-up. The tables are what [`search`] finds; a test
/// compares them.
///
/// ```
/// use bevy_cumulus::textures::n_rooks::n_rooks;
/// assert_eq!(n_rooks(1), [[0.5, 0.5]]);
/// assert_eq!(n_rooks(5).len(), 5);
/// ```
#[must_use]
pub fn n_rooks(n: usize) -> &'static [[f32; 2]] {
    PATTERNS[n.clamp(1, MAX_WINDOW) - 1]
}

/// Finds the pattern for `n` points (clamped to 1 ..= [`MAX_WINDOW`]) as cells (column, row), each
/// in 0 .. `n`, in frame order.
///
/// 1. *Where*: the permutation whose closest two points, on the torus, are as far apart as any
///    permutation allows. This is exhaustive (translations aside). Of equally good ones, that with
///    the least energy `Σ 1/d²` over all pairs, then the first in lexical order.
/// 2. *When*: the order with the least `Σ 1/(lag · d²) + 1/4(dx² + lag²) + 1/4(dy² + lag²)`, `lag`
///    being the slots between two points around the cycle. By the first term neighbours in time are
///    far apart and any run of frames is spread out, so a window that is still filling looks as
///    even as it can, from whatever frame it starts. The others keep x and y from running in step
///    with the depth segments, which do not wrap around; a tie goes to the least correlated. A
///    descent by swaps from many fixed starts; integers only, so the same everywhere.
///
/// Cost: under a second for the largest `n`, so use [`n_rooks`] for anything but deriving the
/// table.
#[must_use]
pub fn search(n: usize) -> Vec<[usize; 2]> {
    let n = n.clamp(1, MAX_WINDOW);
    let rows = best_permutation(n);
    let cells: Vec<[usize; 2]> = rows.iter().enumerate().map(|(x, &y)| [x, y]).collect();
    best_order(n, cells)
}

/// Steps between `a` and `b` around a cycle of `n`, the short way.
fn toroidal(a: usize, b: usize, n: usize) -> u64 {
    let d = a.abs_diff(b);
    d.min(n - d) as u64
}

/// Squared toroidal distance between two cells of an `n` × `n` grid, in strata² (1 stratum = 1/n
/// pixel).
fn distance_squared(a: [usize; 2], b: [usize; 2], n: usize) -> u64 {
    toroidal(a[0], b[0], n).pow(2) + toroidal(a[1], b[1], n).pow(2)
}

/// Step 1 of [`search`]: the row of each column.
fn best_permutation(n: usize) -> Vec<usize> {
    // The densest packing of discs gives n points on an n × n torus no more than d² = 2n/√3; every
    // n-rooks pattern has d² ≥ 2.
    let bound = (2.0 * n as f64 / 3f64.sqrt()) as u64;
    (2..=bound.max(2))
        .rev()
        .find_map(|at_least| {
            let mut walk = PermutationWalk { n, at_least, rows: vec![0], best: None };
            walk.descend();
            walk.best
        })
        .map_or_else(|| (0..n).collect(), |(_, rows)| rows)
}

/// Depth-first walk of all permutations whose points keep a least distance.
struct PermutationWalk {
    n: usize,
    /// Least squared distance allowed, in strata².
    at_least: u64,
    /// Rows of the columns placed so far. The first is 0: other patterns are translations.
    rows: Vec<usize>,
    /// Energy and rows of the best whole permutation so far.
    best: Option<(u64, Vec<usize>)>,
}

impl PermutationWalk {
    fn descend(&mut self) {
        let column = self.rows.len();
        if column == self.n {
            let energy = self.energy();
            if self.best.as_ref().is_none_or(|(least, _)| energy < *least) {
                self.best = Some((energy, self.rows.clone()));
            }
            return;
        }
        for row in 0..self.n {
            if self.fits(column, row) {
                self.rows.push(row);
                self.descend();
                self.rows.pop();
            }
        }
    }

    fn fits(&self, column: usize, row: usize) -> bool {
        let cell = [column, row];
        self.cells().all(|c| c[1] != row && distance_squared(c, cell, self.n) >= self.at_least)
    }

    fn cells(&self) -> impl Iterator<Item = [usize; 2]> {
        self.rows.iter().enumerate().map(|(x, &y)| [x, y])
    }

    /// Σ 1/d² over all pairs, in units of 2⁻³².
    fn energy(&self) -> u64 {
        let pairs = self.cells().enumerate().flat_map(|(i, a)| self.cells().take(i).map(move |b| (a, b)));
        pairs.map(|(a, b)| (1 << 32) / distance_squared(a, b, self.n)).sum()
    }
}

/// Step 2 of [`search`]. The first cell stays first: the cost is the same whichever slot the cycle
/// starts at.
fn best_order(n: usize, cells: Vec<[usize; 2]>) -> Vec<[usize; 2]> {
    const STARTS: usize = 200;
    let mut state = 1u64;
    let mut order = cells;
    let mut best = ((u64::MAX, 0), order.clone());
    for _ in 0..STARTS {
        let cost = (descend_by_swaps(n, &mut order), depth_alignment(n, &order));
        if cost < best.0 {
            best = (cost, order.clone());
        }
        for i in (2..n).rev() {
            // Knuth's 64-bit linear congruential generator; its high bits are the good ones.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            order.swap(i, 1 + (state >> 33) as usize % i);
        }
    }
    best.1
}

/// Swaps slots while that lowers the cost; returns the cost.
fn descend_by_swaps(n: usize, order: &mut [[usize; 2]]) -> u64 {
    let mut cost = order_cost(n, order);
    loop {
        let before = cost;
        for i in 1..n {
            for j in i + 1..n {
                order.swap(i, j);
                let swapped = order_cost(n, order);
                if swapped < cost {
                    cost = swapped;
                } else {
                    order.swap(i, j);
                }
            }
        }
        if cost == before {
            return cost;
        }
    }
}

/// Σ 1/(lag · d²) + 1/4(dx² + lag²) + 1/4(dy² + lag²) over all pairs, in units of 2⁻³².
fn order_cost(n: usize, order: &[[usize; 2]]) -> u64 {
    const ONE: u64 = 1 << 32;
    let mut cost = 0;
    for (i, &a) in order.iter().enumerate() {
        for (j, &b) in order[..i].iter().enumerate() {
            let lag = toroidal(i, j, n);
            let [dx, dy] = [toroidal(a[0], b[0], n), toroidal(a[1], b[1], n)];
            cost += ONE / (lag * (dx * dx + dy * dy))
                + ONE / (4 * (dx * dx + lag * lag))
                + ONE / (4 * (dy * dy + lag * lag));
        }
    }
    cost
}

/// How closely x and y rise or fall with the slot, and so with depth: 0 when neither does. Of
/// equally good orders the least wins.
fn depth_alignment(n: usize, order: &[[usize; 2]]) -> u64 {
    let centred = |i: usize| 2 * i as i64 - (n as i64 - 1);
    let along =
        |axis: usize| order.iter().enumerate().map(|(i, c)| centred(i) * centred(c[axis])).sum::<i64>().unsigned_abs();
    along(0) + along(1)
}

/// Cells, one hexadecimal digit each for column and row, to offsets within the pixel.
const fn centres<const N: usize>(cells: [u8; N]) -> [[f32; 2]; N] {
    let mut points = [[0.0; 2]; N];
    let mut i = 0;
    while i < N {
        let [x, y] = [cells[i] >> 4, cells[i] & 15];
        points[i] = [(x as f32 + 0.5) / N as f32, (y as f32 + 0.5) / N as f32];
        i += 1;
    }
    points
}

/// What [`search`] finds for 1, 2, … points.
static PATTERNS: [&[[f32; 2]]; MAX_WINDOW] = [
    &centres([0x00]),
    &centres([0x00, 0x11]),
    &centres([0x00, 0x22, 0x11]),
    &centres([0x00, 0x23, 0x11, 0x32]),
    &centres([0x00, 0x43, 0x24, 0x31, 0x12]),
    &centres([0x00, 0x45, 0x12, 0x53, 0x31, 0x24]),
    &centres([0x00, 0x53, 0x36, 0x12, 0x65, 0x41, 0x24]),
    &centres([0x00, 0x75, 0x31, 0x57, 0x13, 0x26, 0x62, 0x44]),
    &centres([0x00, 0x37, 0x73, 0x41, 0x86, 0x24, 0x68, 0x12, 0x55]),
    &centres([0x00, 0x84, 0x39, 0x55, 0x97, 0x71, 0x13, 0x68, 0x26, 0x42]),
    &centres([0x00, 0x26, 0x7a, 0x95, 0x41, 0xa8, 0x13, 0x67, 0x82, 0x39, 0x54]),
    &centres([0x00, 0x26, 0x82, 0xb8, 0x54, 0x9b, 0x39, 0x13, 0x77, 0x41, 0xa5, 0x6a]),
    &centres([0x00, 0x47, 0xab, 0x15, 0x79, 0xb3, 0x5c, 0x96, 0x32, 0xc8, 0x81, 0x2a, 0x64]),
    &centres([0x00, 0x84, 0x27, 0xac, 0x41, 0xc6, 0x69, 0x13, 0x7d, 0xda, 0x55, 0xb2, 0x3b, 0x98]),
    &centres([0x00, 0xaa, 0x55, 0x3c, 0x82, 0xd7, 0xbe, 0x69, 0x14, 0xeb, 0x41, 0x96, 0x7d, 0xc3, 0x28]),
    &centres([0x00, 0x7d, 0xb7, 0x2a, 0x52, 0xcf, 0xf8, 0x85, 0x3e, 0xd3, 0xab, 0x14, 0x69, 0x91, 0xec, 0x46]),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Least squared distance, in strata², of any two points and of any two that follow each other,
    /// by `n`.
    const LEAST: [[u64; 2]; MAX_WINDOW] = [
        [0, 0],
        [2, 2],
        [2, 2],
        [2, 5],
        [5, 5],
        [5, 5],
        [5, 13],
        [8, 8],
        [5, 13],
        [10, 20],
        [10, 29],
        [10, 40],
        [13, 52],
        [10, 45],
        [17, 50],
        [13, 50],
    ];

    fn cells(n: usize) -> Vec<[usize; 2]> {
        let cell = |c: f32| (c * n as f32 - 0.5).round() as usize;
        n_rooks(n).iter().map(|&point| point.map(cell)).collect()
    }

    #[test]
    fn the_table_is_what_the_search_finds() {
        for n in 1..=MAX_WINDOW {
            assert_eq!(cells(n), search(n), "window of {n}");
        }
    }

    #[test]
    fn every_row_and_every_column_is_hit_once() {
        for n in 1..=MAX_WINDOW {
            for axis in 0..2 {
                let mut hit: Vec<f32> = n_rooks(n).iter().map(|point| point[axis]).collect();
                hit.sort_by(f32::total_cmp);
                let centres: Vec<f32> = (0..n).map(|i| (i as f32 + 0.5) / n as f32).collect();
                assert_eq!(hit, centres, "window of {n}, axis {axis}");
            }
        }
    }

    #[test]
    fn points_keep_their_distance_in_space_and_in_time() {
        for n in 2..=MAX_WINDOW {
            let cells = cells(n);
            let distance = |i: usize, j: usize| distance_squared(cells[i], cells[j % n], n);
            let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
            let closest = pairs.map(|(i, j)| distance(i, j)).min();
            let closest_in_time = (0..n).map(|i| distance(i, i + 1)).min();
            assert_eq!(closest, Some(LEAST[n - 1][0]), "window of {n}");
            assert_eq!(closest_in_time, Some(LEAST[n - 1][1]), "window of {n}, frame to frame");
        }
    }

    /// A plain check of the search's first step, without its pruning, where all permutations can be
    /// tried.
    #[test]
    fn no_permutation_is_spread_further() {
        fn best(rows: &mut Vec<usize>, n: usize) -> u64 {
            if rows.len() == n {
                let cell = |i: usize| [i, rows[i]];
                let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
                return pairs.map(|(i, j)| distance_squared(cell(i), cell(j), n)).min().unwrap_or(0);
            }
            let mut most = 0;
            for row in 0..n {
                if !rows.contains(&row) {
                    rows.push(row);
                    most = most.max(best(rows, n));
                    rows.pop();
                }
            }
            most
        }
        for n in 2..=8 {
            assert_eq!(best(&mut Vec::new(), n), LEAST[n - 1][0], "window of {n}");
        }
    }

    #[test]
    fn windows_out_of_range_are_clamped() {
        assert_eq!(n_rooks(0), [[0.5, 0.5]]);
        assert_eq!(n_rooks(usize::MAX), n_rooks(MAX_WINDOW));
    }
}
