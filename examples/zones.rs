//! Clouds placed by hand: a patch of sky that stays clear, and a cell of cloud that an entity carries across it.
//!
//! `cargo run --example zones`
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::prelude::*;

/// The entity whose clouds move.
#[derive(Component)]
struct Storm;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, CloudsPlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, circle)
        .run();
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    // −1 clears the sky whatever its coverage: free sight over an airfield. Only the place counts, not the height.
    commands
        .spawn((CloudZone { radius: 9000.0, edge: 3000.0, strength: -1.0 }, Transform::from_xyz(0.0, 0.0, -16_000.0)));
    // Above 0 there is more cloud. It forms and dissolves as its entity passes.
    commands.spawn((
        Storm,
        CloudZone { radius: 3500.0, edge: 2500.0, strength: 0.8 },
        Transform::from_xyz(0.0, 0.0, -16_000.0),
    ));
    commands.spawn(Atmosphere::earth(media.add(ScatteringMedium::earth(256, 256))));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.8, 0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        // From above, with both in view.
        Transform::from_xyz(0.0, 7000.0, 0.0).looking_to(Vec3::new(0.0, -0.35, -1.0), Vec3::Y),
        Exposure { ev100: 14.5 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}

fn circle(mut storm: Single<&mut Transform, With<Storm>>, time: Res<Time>) {
    let angle = 0.1 * time.elapsed_secs();
    storm.translation = Vec3::new(6500.0 * angle.sin(), 0.0, -16_000.0 + 6500.0 * angle.cos());
}
