//! A plane of noise for what has no volume: which way turbulence curls, and the fibres and cells of thin cloud.

use super::{
    lattice::Lattice,
    noise::{Cellular, Octaves},
};

/// Texels a side.
pub(crate) const SWIRL_SIZE: u32 = 256;

/// RG a curl field (0.5 is still), B fibres, A cells; it tiles.
pub(crate) struct Swirl(Vec<[u8; 4]>);

impl Swirl {
    /// The same on every machine.
    pub fn generate() -> Self {
        let size = SWIRL_SIZE as usize;
        let potential = Octaves::new(11, 4.0, 0.0, SWIRL_SIZE, 3);
        let fibres = Octaves::new(12, 6.0, 20.0, SWIRL_SIZE, 5);
        let lattice = Lattice::hexagonal(12.0, 10.0);
        let (mut potential, mut fibres) = (potential.reader(), fibres.reader());
        let mut cells = Cellular::new(&lattice, 13, 0.75, 0.5);
        let place = |i: usize| (i as f32 + 0.5) / SWIRL_SIZE as f32;
        let mut heights = vec![0.0_f32; size * size];
        let mut rest = vec![[0.0_f32; 2]; size * size];
        for y in 0..size {
            for x in 0..size {
                let at = [place(x), place(y)];
                heights[y * size + x] = potential.at(at);
                rest[y * size + x] = [0.5 + 0.9 * fibres.at(at), cells.at(at).bump];
            }
        }
        // The curl of a height field runs along its contours, so it neither gathers nor scatters.
        let at = |x: usize, y: usize| heights[(y % size) * size + x % size];
        let curl = |x: usize, y: usize| [at(x, y + 1) - at(x, y + size - 1), at(x + size - 1, y) - at(x + 1, y)];
        let longest = (0..size * size)
            .map(|i| curl(i % size, i / size).into_iter().fold(0.0_f32, |a, b| a.max(b.abs())))
            .fold(1e-6_f32, f32::max);
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        Self(
            (0..size * size)
                .map(|i| {
                    let [u, v] = curl(i % size, i / size).map(|c| byte(0.5 + 0.5 * c / longest));
                    let [fibre, cell] = rest[i].map(byte);
                    [u, v, fibre, cell]
                })
                .collect(),
        )
    }

    /// Levels of detail, each the mean of the one before, finest first.
    pub fn levels(self) -> Vec<Vec<[u8; 4]>> {
        let mut levels = vec![self.0];
        let mut side = SWIRL_SIZE as usize;
        while side > 1 {
            let fine = &levels[levels.len() - 1];
            let half = side / 2;
            let coarse = (0..half * half)
                .map(|i| {
                    let corner = 2 * (i / half) * side + 2 * (i % half);
                    let four = [corner, corner + 1, corner + side, corner + side + 1];
                    std::array::from_fn(|k| {
                        (four.iter().map(|&n| u16::from(fine[n][k])).sum::<u16>().div_ceil(4)) as u8
                    })
                })
                .collect();
            levels.push(coarse);
            side = half;
        }
        levels
    }
}
