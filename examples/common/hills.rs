//! Hills up to 2 km high around a valley: a height field of ridged noise.

use bevy::{
    asset::RenderAssetUsages,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};

use super::ground::on_planet;

/// Half the side of the height field (m), and its cells along a side.
const REACH: f32 = 26_000.0;
const CELLS: u32 = 360;
/// Highest ground (m).
const TOP: f32 = 2000.0;

/// Altitude of the land at x, z (m); below 0 where the plain covers it.
pub fn altitude(x: f32, z: f32) -> f32 {
    // A valley along the view, winding a little, and closed by a mountain 12 km ahead.
    let side = (x - 700.0 * (z / 3_900.0).sin()).abs();
    let walls = smoothstep(500.0, 5_200.0, side);
    let peak = 1.0 - smoothstep(0.0, 5_000.0, Vec2::new(x + 1_800.0, z + 12_500.0).length());
    let edge = 1.0 - smoothstep(0.72 * REACH, 0.97 * REACH, Vec2::new(x, z).length());
    let shape = walls.max(peak) * edge;
    let plain = 70.0 * (value_noise(x / 900.0, z / 900.0, 9) - 0.3) * edge;
    let hills = TOP * shape * (0.15 + 0.95 * ridges(x, z));
    (plain + hills).min(TOP) - 30.0 * (1.0 - edge)
}

/// Ridged fractal noise, 0 to 1: octaves of `(1 − |2·N − 1|)²`.
fn ridges(x: f32, z: f32) -> f32 {
    let (mut sum, mut weight, mut total, mut side) = (0.0, 1.0, 0.0, 5_600.0);
    for octave in 0..6 {
        let n = 1.0 - (2.0 * value_noise(x / side, z / side, octave) - 1.0).abs();
        sum += weight * n * n;
        total += weight;
        weight *= 0.46;
        side *= 0.48;
    }
    (1.25 * sum / total).min(1.0)
}

/// Smooth noise on the unit lattice, 0 to 1.
fn value_noise(x: f32, z: f32, seed: u32) -> f32 {
    let (cell_x, cell_z) = (x.floor(), z.floor());
    let (u, v) = (smoothstep(0.0, 1.0, x - cell_x), smoothstep(0.0, 1.0, z - cell_z));
    let at = |i: i32, j: i32| hash(cell_x as i32 + i, cell_z as i32 + j, seed);
    let near = at(0, 0) + (at(1, 0) - at(0, 0)) * u;
    let far = at(0, 1) + (at(1, 1) - at(0, 1)) * u;
    near + (far - near) * v
}

/// A number from 0 to 1 for each lattice point: rounds of multiply and xor-shift.
fn hash(x: i32, z: i32, seed: u32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x8da6_b343) ^ (z as u32).wrapping_mul(0xd816_3841);
    h ^= seed.wrapping_mul(0xcb1a_b31f);
    for _ in 0..2 {
        h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    }
    ((h ^ (h >> 16)) >> 8) as f32 / (1 << 24) as f32
}

fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The point of the planet's surface at map position x, z, raised by `lift` (m) over the land.
pub fn on_land(x: f32, z: f32, lift: f32) -> Vec3 {
    let h = altitude(x, z).max(0.0) + lift;
    on_planet(f64::from(x.hypot(z)), f64::from(x).atan2(f64::from(-z)), f64::from(h)).0
}

fn surface(x: f32, z: f32) -> Vec3 {
    on_planet(f64::from(x.hypot(z)), f64::from(x).atan2(f64::from(-z)), altitude(x, z).into()).0
}

/// Grass below, rock where it is steep, snow on the tops; linear RGB.
fn colour(altitude: f32, normal: Vec3) -> [f32; 4] {
    let grass = Vec3::new(0.07, 0.11, 0.03).lerp(Vec3::new(0.2, 0.2, 0.18), smoothstep(8.0, 0.0, altitude));
    let rock = Vec3::new(0.20, 0.18, 0.16);
    let snow = smoothstep(1_350.0, 1_650.0, altitude) * smoothstep(0.6, 0.8, normal.y);
    let bare = smoothstep(0.9, 0.78, normal.y).max(smoothstep(700.0, 1_400.0, altitude));
    grass.lerp(rock, bare).lerp(Vec3::splat(0.75), snow).extend(1.0).to_array()
}

fn mesh() -> Mesh {
    let (mut positions, mut normals, mut colours) = (Vec::new(), Vec::new(), Vec::new());
    let mut heights = Vec::new();
    let step = 2.0 * REACH / CELLS as f32;
    for row in 0..=CELLS {
        for column in 0..=CELLS {
            let (x, z) = (column as f32 * step - REACH, row as f32 * step - REACH);
            let across = surface(x + 40.0, z) - surface(x - 40.0, z);
            let along = surface(x, z + 40.0) - surface(x, z - 40.0);
            let normal = along.cross(across).normalize_or(Vec3::Y);
            let height = altitude(x, z);
            positions.push(surface(x, z));
            normals.push(normal);
            colours.push(colour(height, normal));
            heights.push(height);
        }
    }
    let mut indices = Vec::new();
    for row in 0..CELLS {
        for column in 0..CELLS {
            let a = row * (CELLS + 1) + column;
            let [b, c, d] = [a + 1, a + CELLS + 1, a + CELLS + 2];
            // The plain hides what lies below it.
            if [a, b, c, d].iter().any(|&i| heights[i as usize] > -5.0) {
                indices.extend([a, c, b, b, c, d]);
            }
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colours)
        .with_inserted_indices(Indices::U32(indices))
}

/// Spawns the hills.
pub fn spawn(world: &mut World) {
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh());
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        perceptual_roughness: 1.0,
        reflectance: 0.1,
        ..default()
    });
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material)));
}
