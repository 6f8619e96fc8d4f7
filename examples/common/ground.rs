//! The ground: a whole planet, fine near the world's origin and coarser the farther away.

use std::f64::consts::{PI, TAU};

use bevy::{
    asset::RenderAssetUsages,
    camera::visibility::NoFrustumCulling,
    light::NotShadowCaster,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};

use bevy_cumulus::reference::planet::PLANET_RADIUS;

const SECTORS: u32 = 160;
/// Arc length to the first ring (m), and the factor from a ring to the next: at 100 km the facets stay within
/// 1 m of the sphere.
const FIRST_RING: f64 = 20.0;
const GROWTH: f64 = 1.07;

/// The point at this arc length from the origin (m), in this direction (rad), at this altitude (m), and the
/// sphere's normal there.
///
/// In f64: `(R + h)·cos(s/R) − R` loses metres in f32.
pub fn on_planet(arc: f64, direction: f64, altitude: f64) -> (Vec3, Vec3) {
    let (sin, cos) = (arc / PLANET_RADIUS).sin_cos();
    let (side, ahead) = direction.sin_cos();
    let r = PLANET_RADIUS + altitude;
    // 1 − cos, without cancellation near the origin.
    let drop = 2.0 * (arc / PLANET_RADIUS / 2.0).sin().powi(2);
    let position = [r * sin * side, altitude - r * drop, -r * sin * ahead];
    let normal = [sin * side, cos, -sin * ahead];
    (Vec3::from(position.map(|v| v as f32)), Vec3::from(normal.map(|v| v as f32)))
}

fn mesh() -> Mesh {
    let mut arcs = vec![FIRST_RING];
    while let Some(&last) = arcs.last() {
        if last * GROWTH >= PI * PLANET_RADIUS {
            break;
        }
        arcs.push(last * GROWTH);
    }
    let (pole, up) = on_planet(0.0, 0.0, 0.0);
    let (mut positions, mut normals) = (vec![pole], vec![up]);
    for &arc in &arcs {
        for sector in 0..SECTORS {
            let (p, n) = on_planet(arc, TAU * f64::from(sector) / f64::from(SECTORS), 0.0);
            positions.push(p);
            normals.push(n);
        }
    }
    let mut indices = Vec::new();
    for sector in 0..SECTORS {
        let next = (sector + 1) % SECTORS;
        indices.extend([0, 1 + next, 1 + sector]);
        for ring in 1..arcs.len() as u32 {
            let (inner, outer) = (1 + (ring - 1) * SECTORS, 1 + ring * SECTORS);
            indices.extend([inner + sector, inner + next, outer + next]);
            indices.extend([inner + sector, outer + next, outer + sector]);
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_indices(Indices::U32(indices))
}

/// Spawns the ground. It casts no shadow, for it would only fall on itself.
pub fn spawn(world: &mut World) {
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh());
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        // `CloudLighting::ground_albedo`'s default.
        base_color: Color::linear_rgb(0.2, 0.2, 0.18),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    });
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), NotShadowCaster, NoFrustumCulling));
}
