//! Buildings among the hills, up to 2 km high: edges against which a cloud's edge can be judged.

use bevy::prelude::*;

use super::hills::on_land;

/// Map position and height of each tower (m). The last ones reach into the clouds or through them.
const TOWERS: [(f32, f32, f32); 6] = [
    (-420.0, -1_700.0, 260.0),
    (-300.0, -1_900.0, 180.0),
    (650.0, -2_800.0, 420.0),
    (-1_500.0, -5_200.0, 900.0),
    (1_900.0, -7_500.0, 2_000.0),
    (-3_800.0, -11_500.0, 1_600.0),
];

/// Map position, altitude above the land and radius of each balloon (m).
const BALLOONS: [(f32, f32, f32, f32); 4] = [
    (250.0, -1_100.0, 220.0, 40.0),
    (-1_050.0, -3_600.0, 900.0, 120.0),
    (950.0, -4_800.0, 1_450.0, 200.0),
    (3_900.0, -13_000.0, 1_900.0, 450.0),
];

/// The line of pylons: from, to (map positions, m), count and height (m).
const PYLONS: (Vec2, Vec2, u32, f32) = (Vec2::new(170.0, -350.0), Vec2::new(-700.0, -6_000.0), 14, 75.0);

fn put(world: &mut World, mesh: &Handle<Mesh>, material: &Handle<StandardMaterial>, transform: Transform) {
    world.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()), transform));
}

/// Spawns towers, balloons and pylons.
pub fn spawn(world: &mut World) {
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let cuboid = meshes.add(Cuboid::from_length(1.0));
    let ball = meshes.add(Sphere::new(1.0).mesh().uv(48, 24));
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    let mut paint = |r: f32, g: f32, b: f32, roughness: f32| {
        materials.add(StandardMaterial {
            base_color: Color::linear_rgb(r, g, b),
            perceptual_roughness: roughness,
            ..default()
        })
    };
    let (concrete, steel) = (paint(0.42, 0.40, 0.37, 0.8), paint(0.12, 0.12, 0.13, 0.5));
    let (red, white) = (paint(0.55, 0.05, 0.03, 0.5), paint(0.75, 0.75, 0.72, 0.5));

    for (i, (x, z, height)) in TOWERS.into_iter().enumerate() {
        let width = 40.0 + height * 0.05;
        // Sunk a little, since land under a wide foot is not level.
        let centre = on_land(x, z, height / 2.0 - 30.0);
        let size = Vec3::new(width, height + 60.0, width);
        let turned =
            Transform::from_translation(centre).with_rotation(Quat::from_rotation_y(0.5 + i as f32)).with_scale(size);
        put(world, &cuboid, &concrete, turned);
    }
    for (i, (x, z, lift, radius)) in BALLOONS.into_iter().enumerate() {
        let place = Transform::from_translation(on_land(x, z, lift)).with_scale(Vec3::splat(radius));
        put(world, &ball, if i % 2 == 0 { &red } else { &white }, place);
    }
    let (from, to, count, height) = PYLONS;
    for i in 0..count {
        let at = from.lerp(to, i as f32 / (count - 1) as f32);
        let mast = Transform::from_translation(on_land(at.x, at.y, height / 2.0 - 5.0));
        put(world, &cuboid, &steel, mast.with_scale(Vec3::new(3.0, height + 10.0, 3.0)));
        for (lift, width) in [(0.72, 26.0), (0.92, 18.0)] {
            let arm = Transform::from_translation(on_land(at.x, at.y, height * lift));
            put(world, &cuboid, &steel, arm.with_scale(Vec3::new(width, 1.5, 1.5)));
        }
    }
}
