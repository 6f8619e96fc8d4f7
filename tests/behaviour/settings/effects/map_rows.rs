//! What a recipe makes, by the map's own texels.

use bevy_cumulus::prelude::*;

use super::{
    Expect::{By, Over, Times, Under},
    Row, both, each,
    scene::Scene,
};

/// Texels of a block along each side.
const BLOCK: usize = 16;

fn of(map: WeatherRecipe) -> Scene {
    let layer = CloudLayer { map, ..Default::default() };
    let settings = CloudSettings { layers: CloudLayers(vec![layer]), ..Default::default() };
    Scene { settings, ..Default::default() }
}

/// 128 texels of 200 m, half of them cloud that is spread evenly.
fn even() -> WeatherRecipe {
    WeatherRecipe { size: 128, scale: 25_600.0, cover: 4.0, clumping: 0.0, raggedness: 0.2, ..Default::default() }
}

fn plain() -> Scene {
    of(even())
}

fn small_cells() -> Scene {
    of(WeatherRecipe { cell_size: 1200.0, ..even() })
}

fn clumps() -> Scene {
    of(WeatherRecipe { clumping: 1.0, cell_size: 1200.0, ..even() })
}

fn streets() -> Scene {
    of(WeatherRecipe { streets: 1.0, ..even() })
}

fn front() -> Scene {
    of(WeatherRecipe { front: 1.0, front_width: 4000.0, cover: 2.0, ..even() })
}

fn clearings() -> Scene {
    of(WeatherRecipe { clearings: 1.0, cell_size: 1200.0, ..even() })
}

/// Ripples whose crests lie along z.
fn ripples() -> Scene {
    of(WeatherRecipe { ripples: 1.0, ripple_wavelength: 2000.0, ..even() })
}

fn streaks() -> Scene {
    of(WeatherRecipe { streaks: 1.0, ..even() })
}

fn open_cells() -> Scene {
    of(WeatherRecipe { regularity: 1.0, raggedness: 0.0, cell_size: 3200.0, ..even() })
}

fn map(scene: &Scene) -> WeatherMap {
    scene.settings.layers.0[0].map.generate().expect("a good recipe")
}

fn channel(map: &WeatherMap, n: usize) -> Vec<f32> {
    map.texels().iter().map(|texel| f32::from(texel[n]) / 255.0).collect()
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

fn spread(values: &[f32]) -> f32 {
    let mean = mean(values);
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / values.len() as f32).sqrt()
}

/// Places where cloud begins or ends from one texel of a row to the next, and of a column.
fn edges(scene: &Scene) -> [f32; 2] {
    let map = map(scene);
    let (size, red) = (map.size().x as usize, channel(&map, 0));
    let cloud = |x: usize, y: usize| red[(y % size) * size + x % size] > 0.0;
    let count =
        |dx, dy| (0..size * size).filter(|n| cloud(n % size, n / size) != cloud(n % size + dx, n / size + dy)).count();
    [count(1, 0) as f32, count(0, 1) as f32]
}

fn all_edges(scene: &Scene) -> f32 {
    edges(scene).iter().sum()
}

/// Edges that are met along x, in shares of those along z.
fn along_x(scene: &Scene) -> f32 {
    let [x, z] = edges(scene);
    x / z
}

/// Mean step of a channel from one texel to the next, in shares of its spread.
fn roughness(scene: &Scene, n: usize) -> f32 {
    let map = map(scene);
    let (size, values) = (map.size().x as usize, channel(&map, n));
    let step = |k: usize| (values[k] - values[k - k % size + (k + 1) % size]).abs();
    (0..values.len()).map(step).sum::<f32>() / values.len() as f32 / spread(&values)
}

/// Share of cloud in each block of the map.
fn blocks(scene: &Scene) -> Vec<f32> {
    let map = map(scene);
    let (size, red) = (map.size().x as usize, channel(&map, 0));
    let mut blocks = vec![0.0; (size / BLOCK).pow(2)];
    for (n, _) in red.iter().enumerate().filter(|(_, c)| **c > 0.0) {
        blocks[(n / size / BLOCK) * (size / BLOCK) + n % size / BLOCK] += 1.0 / BLOCK.pow(2) as f32;
    }
    blocks
}

/// How unevenly cloud lies over the map.
fn unevenness(scene: &Scene) -> f32 {
    spread(&blocks(scene))
}

/// Share of cloud in each column, in each row.
fn columns_and_rows(scene: &Scene) -> [Vec<f32>; 2] {
    let map = map(scene);
    let (size, red) = (map.size().x as usize, channel(&map, 0));
    let cloud = |x: usize, y: usize| f32::from(red[y * size + x] > 0.0);
    let line = |of: &dyn Fn(usize, usize) -> f32| {
        (0..size).map(|a| (0..size).map(|b| of(a, b)).sum::<f32>() / size as f32).collect()
    };
    [line(&|a, b| cloud(a, b)), line(&|a, b| cloud(b, a))]
}

/// Where along x the middle of the band of cloud is (repeats).
fn middle_of_band(scene: &Scene) -> f32 {
    let [columns, _] = columns_and_rows(scene);
    let size = columns.len();
    let sum = |k: usize| (0..BLOCK).map(|i| columns[(k + i) % size]).sum::<f32>();
    let best = (0..size).max_by(|a, b| sum(*a).total_cmp(&sum(*b))).expect("a map has columns");
    ((best + BLOCK / 2) % size) as f32 / size as f32
}

/// The farthest that a texel can be from the other kind, but for the hundredth that is farther (texels).
fn deepest(scene: &Scene, cloudy: bool) -> f32 {
    let map = map(scene);
    let (size, red) = (map.size().x as i32, channel(&map, 0));
    let is = |x: i32, y: i32| (red[(y.rem_euclid(size) * size + x.rem_euclid(size)) as usize] > 0.0) == cloudy;
    let ring = |x: i32, y: i32, d: i32| {
        (-d..=d).all(|k| is(x + k, y + d) && is(x + k, y - d) && is(x + d, y + k) && is(x - d, y + k))
    };
    let clear_to = |x, y| (0..40).find(|&d| !ring(x, y, d)).unwrap_or(40);
    let mut all: Vec<i32> = (0..size * size).map(|n| clear_to(n % size, n / size)).collect();
    all.sort_unstable();
    all[all.len() * 99 / 100] as f32
}

/// Mean coverage of what is cloud.
fn fullness(scene: &Scene) -> f32 {
    let cloudy: Vec<f32> = channel(&map(scene), 0).into_iter().filter(|c| *c > 0.0).collect();
    mean(&cloudy)
}

/// Share of texels that differ from those of the same recipe made again, and of another.
fn differing(a: &Scene, b: &Scene) -> [f32; 2] {
    let [a, again, b] = [a, a, b].map(map);
    let share = |b: &WeatherMap| {
        let count = a.texels().iter().zip(b.texels()).filter(|(a, b)| a != b).count();
        count as f32 / a.texels().len() as f32
    };
    [share(&again), share(&b)]
}

#[rustfmt::skip]
pub fn rows() -> Vec<Row<()>> {
    vec![
        both("layers.0.map.seed", plain, ["1", "2"], |(), a, b| differing(a, b), By(0.5, 1.0)),
        each("layers.0.map.size", plain, ["128", "256"], |(), s| map(s).size().x as f32, Times(2.0, 1e-6)),
        // The more cells fit into a repeat.
        each("layers.0.map.scale", plain, ["12800", "25600"], |(), s| all_edges(s), Over(1.5)),
        each("layers.0.map.cover", plain, ["3", "6"], |(), s| map(s).cover(), Times(2.0, 2e-3)),
        each("layers.0.map.cell_size", plain, ["1500", "4000"], |(), s| all_edges(s), Under(0.6)),
        each("layers.0.map.regularity", small_cells, ["0", "1"], |(), s| unevenness(s), Under(0.8)),
        each("layers.0.map.open_cells", open_cells, ["0", "1"],
            |(), s| deepest(s, false) / deepest(s, true), Over(1.5)),
        each("layers.0.map.raggedness", plain, ["0", "1"], |(), s| all_edges(s), Over(1.3)),
        each("layers.0.map.softness", plain, ["0", "1"], |(), s| fullness(s), Under(0.8)),
        each("layers.0.map.streets", plain, ["0", "1"], |(), s| along_x(s), Under(0.8)),
        each("layers.0.map.street_direction", streets, ["0", "90"], |(), s| along_x(s), Over(1.6)),
        each("layers.0.map.street_spacing", streets, ["2000", "8000"], |(), s| edges(s)[1], Under(0.8)),
        each("layers.0.map.clumping", small_cells, ["0", "1"], |(), s| unevenness(s), Over(1.4)),
        each("layers.0.map.clump_size", clumps, ["2000", "12000"], |(), s| unevenness(s), Over(1.2)),
        each("layers.0.map.front", small_cells, ["0", "1"], |(), s| unevenness(s), Over(1.4)),
        each("layers.0.map.front_position", front, ["0.25", "0.6"], |(), s| middle_of_band(s), By(0.3, 0.4)),
        each("layers.0.map.front_direction", front, ["0", "90"], |(), s| {
            let [columns, rows] = columns_and_rows(s);
            spread(&columns) / spread(&rows)
        }, Under(0.5)),
        each("layers.0.map.front_width",
            || of(WeatherRecipe { cover: 4.0, ..front().settings.layers.0[0].map.clone() }), ["2000", "6000"],
            |(), s| columns_and_rows(s)[0].iter().filter(|share| **share > 0.8).count() as f32, Over(1.5)),
        each("layers.0.map.clearings", small_cells, ["0", "1"], |(), s| unevenness(s), Over(1.4)),
        each("layers.0.map.clearing_size", clearings, ["4000", "12800"], |(), s| unevenness(s), Over(1.2)),
        each("layers.0.map.height_variation", plain, ["0.2", "0.8"], |(), s| spread(&channel(&map(s), 1)), Over(2.0)),
        each("layers.0.map.height_size", || of(WeatherRecipe { height_variation: 1.0, ..even() }), ["2000", "12000"],
            |(), s| roughness(s, 1), Under(0.9)),
        each("layers.0.map.base_variation", plain, ["0.2", "0.8"], |(), s| spread(&channel(&map(s), 2)), Over(2.0)),
        each("layers.0.map.base_size", || of(WeatherRecipe { base_variation: 1.0, ..even() }), ["3000", "12000"],
            |(), s| roughness(s, 2), Under(0.7)),
        each("layers.0.map.ripples", plain, ["0", "1"], |(), s| along_x(s), Over(1.3)),
        each("layers.0.map.ripple_wavelength", ripples, ["1600", "4800"], |(), s| edges(s)[0], Under(0.7)),
        each("layers.0.map.ripple_direction", ripples, ["0", "90"], |(), s| along_x(s), Under(0.6)),
        each("layers.0.map.streaks", plain, ["0", "1"], |(), s| along_x(s), Under(0.8)),
        each("layers.0.map.streak_width", streaks, ["1000", "3000"], |(), s| edges(s)[1], Under(0.7)),
        each("layers.0.map.streak_length", streaks, ["4000", "16000"], |(), s| edges(s)[0], Under(0.7)),
        each("layers.0.map.streak_direction", streaks, ["0", "90"], |(), s| along_x(s), Over(1.6)),
    ]
}
