//! Texture sampling as `textureSampleLevel` does it, linear in every axis and between levels, with exact weights.
//!
//! GPUs give the weights 8 bits or so; their answer is that of a point within 1/256 of a texel.

use bevy::math::{DVec2, DVec3, DVec4, UVec3};

/// What lies beyond the edge.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Address {
    /// The texture again.
    Repeat,
    /// The texel at the edge.
    Clamp,
}

/// One channel of a 2D or 3D texture, with its mip levels.
#[derive(Clone, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
    address: Address,
}

#[derive(Clone, PartialEq)]
struct Level {
    size: [usize; 3],
    texels: Vec<f32>,
}

impl std::fmt::Debug for Texture {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "Texture {{ size: {}, levels: {}, address: {:?} }}", self.size(), self.levels.len(), self.address)
    }
}

impl Texture {
    /// A texture of these levels, the finest first: size and texels in the order x, y, z; a 2D texture has a depth of 1.
    /// `None` where there is no level or the texels of one are not as many as its size says.
    pub fn new(levels: Vec<(UVec3, Vec<f32>)>, address: Address) -> Option<Self> {
        let levels: Vec<Level> = levels
            .into_iter()
            .map(|(size, texels)| Level { size: size.to_array().map(|n| n as usize), texels })
            .collect();
        let fits = |l: &Level| !l.texels.is_empty() && l.size.iter().product::<usize>() == l.texels.len();
        (!levels.is_empty() && levels.iter().all(fits)).then_some(Self { levels, address })
    }

    /// A texture of one texel.
    pub fn uniform(value: f32) -> Self {
        Self { levels: vec![Level { size: [1; 3], texels: vec![value] }], address: Address::Repeat }
    }

    /// Width, height and depth of the finest level in texels.
    pub fn size(&self) -> UVec3 {
        UVec3::from_array(self.levels[0].size.map(|n| n as u32))
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// Memory that the texels take (bytes).
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|l| l.texels.len() * size_of::<f32>()).sum()
    }

    /// The texture at `at`, in repeats (0..1 is the texture once), between the levels around `level`.
    pub fn sample(&self, at: DVec3, level: f64) -> f64 {
        let level = level.clamp(0.0, (self.levels.len() - 1) as f64);
        let (fine, between) = (level.floor(), level.fract());
        let value = self.levels[fine as usize].sample(at, self.address);
        if between > 0.0 {
            let coarse = self.levels[fine as usize + 1].sample(at, self.address);
            return value + between * (coarse - value);
        }
        value
    }
}

impl Level {
    fn sample(&self, at: DVec3, address: Address) -> f64 {
        let [width, height, depth] = self.size;
        let x = neighbours(at.x, width, address);
        let y = neighbours(at.y, height, address);
        let row = |y: usize, z: usize| {
            let start = (z * height + y) * width;
            mix(self.texels[start + x.0].into(), self.texels[start + x.1].into(), x.2)
        };
        let slice = |z: usize| mix(row(y.0, z), row(y.1, z), y.2);
        if depth == 1 {
            return slice(0);
        }
        let z = neighbours(at.z, depth, address);
        mix(slice(z.0), slice(z.1), z.2)
    }
}

/// A square of 2ⁿ texels a side of four bytes each, repeated, with all its mip levels: as [`Texture::sample`] does.
pub(crate) fn sample_bytes(levels: &[Vec<[u8; 4]>], at: DVec2, level: f64) -> DVec4 {
    let last = levels.len() - 1;
    let level = level.clamp(0.0, last as f64);
    let (fine, between) = (level.floor() as usize, level.fract());
    let read = |i: usize| {
        let (side, texels) = (1 << (last - i), &levels[i]);
        let [x, y] = [at.x, at.y].map(|at| neighbours(at, side, Address::Repeat));
        let texel = |x: usize, y: usize| DVec4::from_array(texels[y * side + x].map(f64::from));
        let row = |y: usize| texel(x.0, y).lerp(texel(x.1, y), x.2);
        row(y.0).lerp(row(y.1), y.2) / 255.0
    };
    let value = read(fine);
    if between > 0.0 { value.lerp(read(fine + 1), between) } else { value }
}

/// The texels to either side and the weight of the second. Any number gives texels that are there.
fn neighbours(at: f64, count: usize, address: Address) -> (usize, usize, f64) {
    let n = count as f64;
    match address {
        Address::Repeat => {
            let x = (at - at.floor()) * n - 0.5;
            let low = x.floor();
            let first = (low as i64).rem_euclid(count as i64) as usize;
            (first, (first + 1) % count, x - low)
        }
        Address::Clamp => {
            let x = (at * n - 0.5).clamp(0.0, n - 1.0);
            let low = x.floor();
            let first = (low as usize).min(count - 1);
            (first, (first + 1).min(count - 1), x - low)
        }
    }
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + share * (b - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(texels: &[f32], address: Address) -> Texture {
        Texture::new(vec![(UVec3::new(texels.len() as u32, 1, 1), texels.to_vec())], address).unwrap()
    }

    #[test]
    fn texels_are_met_at_their_centres_and_lines_join_them() {
        for address in [Address::Repeat, Address::Clamp] {
            let t = line(&[1.0, 3.0, 7.0, 5.0], address);
            let at = |x: f64| t.sample(DVec3::new(x, 0.3, 0.9), 0.0);
            assert_eq!([at(0.125), at(0.375), at(0.625), at(0.875)], [1.0, 3.0, 7.0, 5.0]);
            assert_eq!([at(0.25), at(0.4375)], [2.0, 4.0]);
            let edge = if address == Address::Repeat { [3.0, 3.0, 2.0] } else { [1.0, 5.0, 5.0] };
            assert_eq!([at(0.0), at(1.0), at(1.0625)], edge, "{address:?}");
            assert_eq!(at(0.625 - 3.0) == 7.0, address == Address::Repeat);
        }
    }

    #[test]
    fn a_volume_is_linear_in_each_axis_and_between_levels() {
        let plane = |x: u32, y: u32, z: u32| (x + 10 * y + 100 * z) as f32;
        let texels = (0..64).map(|i| plane(i % 4, i / 4 % 4, i / 16)).collect();
        let levels = vec![(UVec3::splat(4), texels), (UVec3::splat(2), vec![1000.0; 8])];
        let t = Texture::new(levels, Address::Repeat).unwrap();
        let (at, value) = (DVec3::new(0.3, 0.5, 0.7), 0.7 + 15.0 + 230.0);
        assert!((t.sample(at, 0.0) - value).abs() < 1e-9);
        assert!((t.sample(at, -3.0) - value).abs() < 1e-9);
        assert!((t.sample(at, 0.25) - (0.75 * value + 250.0)).abs() < 1e-9);
        assert_eq!([t.sample(at, 1.0), t.sample(at, 9.0)], [1000.0; 2]);
    }

    #[test]
    fn bytes_are_read_as_textures_are() {
        let byte = |i: usize, k: usize| (i * 37 + k * 91) as u8;
        let levels: Vec<Vec<[u8; 4]>> =
            [64, 16, 4, 1].map(|n| (0..n).map(|i| [0, 1, 2, 3].map(|k| byte(i + n, k))).collect()).to_vec();
        let channel = |k: usize| {
            let float = |level: &Vec<[u8; 4]>| {
                let side = level.len().isqrt() as u32;
                (UVec3::new(side, side, 1), level.iter().map(|t| f32::from(t[k]) / 255.0).collect())
            };
            Texture::new(levels.iter().map(float).collect(), Address::Repeat).unwrap()
        };
        for i in 0..500 {
            let at = DVec2::new(0.0137 * f64::from(i) - 3.0, 0.0291 * f64::from(i) - 5.0);
            let level = 0.009 * f64::from(i) - 0.5;
            let found = sample_bytes(&levels, at, level);
            for k in 0..4 {
                let exact = channel(k).sample(at.extend(0.0), level);
                assert!((found[k] - exact).abs() < 1e-6, "{at} level {level}: {found}, not {exact}");
            }
        }
        for x in [f64::NAN, f64::INFINITY, -1e300] {
            let _ = sample_bytes(&levels, DVec2::splat(x), x);
        }
    }

    #[test]
    fn no_number_reaches_past_the_texels() {
        for address in [Address::Repeat, Address::Clamp] {
            let t = line(&[1.0, 2.0, 3.0], address);
            for x in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, -1e300, -1e-300, 1.0 - 1e-17] {
                let _ = t.sample(DVec3::splat(x), x);
            }
        }
        assert!(Texture::new(Vec::new(), Address::Clamp).is_none());
        assert!(Texture::new(vec![(UVec3::splat(2), vec![0.0; 7])], Address::Clamp).is_none());
    }
}
