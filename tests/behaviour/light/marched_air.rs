//! The air between clouds and the camera, and the sky above them, from where Bevy's tables do not reach.

use bevy::{
    pbr::{AtmosphereMode, AtmosphereSettings},
    prelude::*,
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{Sky, View, cloud_pixels, spawn_sun, spawn_view, until_drawn},
    gpu::needs_atmosphere,
    scene::{exact, settle},
    shared::SharedApp,
    uniform_slab::UniformSlab,
};

const SIZE: UVec2 = UVec2::new(24, 16);
const TOP: f32 = 1500.0;

/// An opaque deck of this albedo up to [`TOP`], under Bevy's atmosphere.
fn deck(albedo: f32, lighting: CloudLighting) -> (SharedApp, View) {
    let slab = UniformSlab { albedo: Vec3::splat(albedo), ..UniformSlab::new(500.0, TOP, 0.05) };
    let mut app = slab.app();
    app.insert_resource(CloudQuality { step: 20.0, ..exact(MarchResolution::Full) }).insert_resource(lighting);
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_view(&mut app, SIZE, Transform::default(), Sky::Atmosphere);
    until_drawn(&mut app);
    (app, view)
}

/// Mean radiance of the clouds, looking down by `pitch` degrees from this altitude.
fn seen_from(app: &mut App, view: &View, altitude: f32, pitch: f32) -> Vec3 {
    let down = Quat::from_rotation_x(-pitch.to_radians());
    app.world_mut().entity_mut(view.camera).insert(Transform::from_xyz(0.0, altitude, 0.0).with_rotation(down));
    settle(app);
    let pixels = cloud_pixels(app, view);
    assert!(pixels.iter().all(|p| p.is_finite() && p.w < 0.02), "the deck is not opaque from {altitude} m");
    pixels.iter().map(|p| p.truncate()).sum::<Vec3>() / pixels.len() as f32
}

#[test]
fn marched_air_is_what_bevys_table_holds() {
    needs_atmosphere();
    // A deck that sends no light of its own, within the table's 32 km.
    let (mut app, view) = deck(0.0, CloudLighting::default());
    for (altitude, pitch) in [(4000.0, 50.0), (8000.0, 60.0)] {
        let [table, marched] = [AtmosphereMode::LookupTexture, AtmosphereMode::Raymarched].map(|mode| {
            let mut air = app.world_mut().get_mut::<AtmosphereSettings>(view.camera).expect("it has an atmosphere");
            air.rendering_method = mode;
            seen_from(&mut app, &view, altitude, pitch)
        });
        println!("from {altitude} m: {table} in the table, {marched} marched");
        assert!(table.min_element() > 10.0, "there is no air: {table}");
        assert!(
            (marched / table - 1.0).abs().max_element() < 0.1,
            "from {altitude} m: {marched}, {table} in the table"
        );
    }
}

#[test]
fn from_space_there_is_blue_air_before_the_clouds() {
    needs_atmosphere();
    let (mut app, view) = deck(0.0, CloudLighting::default());
    let light = seen_from(&mut app, &view, 400_000.0, 50.0);
    println!("{light}");
    // As much as from below all of the air, where the table would do: some thousand cd/m², and blue.
    assert!(light.y > 500.0 && light.y < 10_000.0 && light.z > 1.5 * light.x, "{light}");
}

#[test]
fn from_space_clouds_are_lit_by_the_sky_that_is_over_them() {
    needs_atmosphere();
    // By sky and ground alone, through no air.
    let lighting = CloudLighting { octaves: 0, diffusion: 0.0, aerial_perspective: 0.0, ..default() };
    let (mut app, view) = deck(0.999, lighting);
    let near = seen_from(&mut app, &view, TOP + 50.0, 80.0);
    for altitude in [10_000.0, 400_000.0] {
        let far = seen_from(&mut app, &view, altitude, 80.0);
        println!("{near} from near, {far} from {altitude} m");
        // Bevy's sky table is made in 16 even steps, of which the first passes over half of the densest air.
        assert!((far / near - 1.0).abs().max_element() < 0.25, "{near} from near, {far} from {altitude} m");
    }
}
