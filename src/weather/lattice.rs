//! Integer lattices on a map that repeats: what makes noise of any direction and stretch tile exactly.
//!
//! A map's place is `(u, v)`, one repeat from 0 to 1. A lattice has cells `(i, j) = floor(m · (u, v))` with an integer matrix
//! `m`. One repeat further on is a whole number of cells away, so noise hashed by the cell tiles if cells that far apart get
//! the same hash: [`Lattice::wrap`].

use std::f64::consts::{PI, TAU};

/// Numbers of cells that tile the map.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lattice {
    /// Rows: how far cell coordinates i and j advance over one repeat along u and along v.
    rows: [[i32; 2]; 2],
    /// Cell coordinates to (u, v), in units of one cell's mean side.
    pub metric: [[f32; 2]; 2],
    /// The cells one repeat away, in Hermite form: (p, q) and (0, r) generate them all.
    p: i64,
    q: i64,
    r: i64,
}

impl Lattice {
    /// The tiling lattice nearest to square cells: `cells` a repeat, the first axis turned by `degrees`.
    pub fn square(cells: f64, degrees: f64) -> Self {
        Self::stretched(cells, cells, degrees)
    }

    /// `along` cells a repeat along `degrees`, `across` at a right angle to it.
    pub fn stretched(along: f64, across: f64, degrees: f64) -> Self {
        let (sin, cos) = sin_cos(degrees);
        Self::nearest([cos * along, sin * along], [-sin * across, cos * across])
    }

    /// Cells whose centres form equilateral triangles, `cells` of them a repeat: the packing that convection settles to.
    pub fn hexagonal(cells: f64, degrees: f64) -> Self {
        let (sin, cos) = sin_cos(degrees);
        // Rows of the inverse of the basis (1, 0), (1/2, √3/2).
        let (a, b) = ([1.0, -0.577_350_269_189_625_8], [0.0, 1.154_700_538_379_251_5]);
        let turn = |[x, y]: [f64; 2]| [cells * (cos * x - sin * y), cells * (sin * x + cos * y)];
        Self::nearest(turn(a), turn(b))
    }

    /// Rounds the rows to whole numbers that span the plane.
    fn nearest(a: [f64; 2], b: [f64; 2]) -> Self {
        let mut rows = [round(a), round(b)];
        if determinant(rows) == 0 {
            // So few cells that rounding lost one axis: the longer row stays.
            let length = |[x, y]: [i32; 2]| x * x + y * y;
            let long = usize::from(length(rows[1]) > length(rows[0]));
            let [x, y] = rows[long];
            rows[1 - long] = match (x, y) {
                (0, 0) => [1 - long as i32, long as i32],
                _ if x.abs() >= y.abs() => [0, 1],
                _ => [1, 0],
            };
            if (x, y) == (0, 0) {
                rows[long] = [long as i32, 1 - long as i32];
            }
        }
        Self::new(rows)
    }

    /// `rows` must span the plane.
    fn new(rows: [[i32; 2]; 2]) -> Self {
        let [[ax, ay], [bx, by]] = rows.map(|row| row.map(i64::from));
        let (p, s, t) = extended_gcd(ax, ay);
        let r = (ax * by - ay * bx).abs() / p;
        let q = (s * bx + t * by).rem_euclid(r);
        let det = (ax * by - ay * bx) as f64;
        let side = det.abs().sqrt() / det;
        let metric = [
            [(by as f64 * side) as f32, (-ay as f64 * side) as f32],
            [(-bx as f64 * side) as f32, (ax as f64 * side) as f32],
        ];
        Self { rows, metric, p, q, r }
    }

    /// Cell coordinates of a place.
    pub fn cell(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        self.rows.map(|[x, y]| x as f32 * u + y as f32 * v)
    }

    /// The one cell that stands for all that lie whole repeats away from (i, j).
    pub fn wrap(&self, i: i32, j: i32) -> (u32, u32) {
        let (i, j) = (i64::from(i), i64::from(j));
        let times = i.div_euclid(self.p);
        ((i - times * self.p) as u32, (j - times * self.q).rem_euclid(self.r) as u32)
    }
}

/// Whole number of waves a repeat along u and v, nearest to `waves` along `degrees`; never none.
pub(super) fn wave_vector(waves: f64, degrees: f64) -> [i32; 2] {
    let (sin, cos) = sin_cos(degrees);
    match round([cos * waves, sin * waves]) {
        [0, 0] if cos.abs() >= sin.abs() => [1, 0],
        [0, 0] => [0, 1],
        found => found,
    }
}

fn round([x, y]: [f64; 2]) -> [i32; 2] {
    [x.round() as i32, y.round() as i32]
}

fn determinant([[ax, ay], [bx, by]]: [[i32; 2]; 2]) -> i64 {
    i64::from(ax) * i64::from(by) - i64::from(ay) * i64::from(bx)
}

/// The greatest common divisor (positive), and the factors of a and b that add up to it.
fn extended_gcd(a: i64, b: i64) -> (i64, i64, i64) {
    if b == 0 {
        return (a.abs(), if a < 0 { -1 } else { 1 }, 0);
    }
    let (gcd, s, t) = extended_gcd(b, a.rem_euclid(b));
    (gcd, t, s - a.div_euclid(b) * t)
}

/// Sine and cosine of an angle in degrees by their series: the same on every machine, which the standard library's are not.
pub(super) fn sin_cos(degrees: f64) -> (f64, f64) {
    let turned = degrees - 360.0 * (degrees / 360.0).round();
    let x = turned / 360.0 * TAU;
    let sine = |x: f64| {
        // Into [-π/2, π/2], where 11 terms leave 1e-16.
        let x = if x > PI / 2.0 {
            PI - x
        } else if x < -PI / 2.0 {
            -PI - x
        } else {
            x
        };
        let (mut term, mut sum) = (x, x);
        for n in 1..=10 {
            let n = f64::from(n);
            term *= -x * x / (2.0 * n * (2.0 * n + 1.0));
            sum += term;
        }
        sum
    };
    let shifted = if x > PI / 2.0 { x - 1.5 * PI } else { x + PI / 2.0 };
    (sine(x), sine(shifted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_one_repeat_away_are_the_same_cell() {
        for lattice in [
            Lattice::square(7.0, 31.0),
            Lattice::stretched(3.0, 41.0, -77.0),
            Lattice::hexagonal(20.0, 11.0),
            Lattice::stretched(0.2, 9.0, 45.0),
            Lattice::square(0.1, 0.0),
            Lattice::square(0.1, 90.0),
        ] {
            let [[ax, ay], [bx, by]] = lattice.rows;
            for (i, j) in [(0, 0), (5, -3), (-40, 17), (1000, 999)] {
                let here = lattice.wrap(i, j);
                assert_eq!(here, lattice.wrap(i + ax, j + bx), "one repeat along u in {lattice:?}");
                assert_eq!(here, lattice.wrap(i - ay, j - by), "one repeat along v in {lattice:?}");
            }
        }
    }

    #[test]
    fn as_many_different_cells_as_the_area_holds() {
        let lattice = Lattice::stretched(3.0, 11.0, 20.0);
        let all: std::collections::HashSet<_> =
            (-40..40).flat_map(|i| (-40..40).map(move |j| (i, j))).map(|(i, j)| lattice.wrap(i, j)).collect();
        assert_eq!(all.len() as i64, determinant(lattice.rows).abs());
    }

    #[test]
    fn angles() {
        for degrees in -720..=720 {
            let (sin, cos) = sin_cos(f64::from(degrees));
            let (s, c) = f64::from(degrees).to_radians().sin_cos();
            assert!((sin - s).abs() < 1e-12 && (cos - c).abs() < 1e-12, "{degrees}: {sin} {cos}");
        }
    }
}
