//! The settings in bevy-inspector-egui's windows: `cargo run --example resource_inspector --features inspector`.
//!
//! They are ordinary reflected resources, so whatever shows resources shows these. What is out of its range is reported
//! in the log, and the last good value stays.
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::prelude::*;
use bevy_inspector_egui::{bevy_egui::EguiPlugin, quick::ResourceInspectorPlugin};

fn main() {
    let title = "bevy_cumulus: resource inspector".to_owned();
    let window = Window { title, ..default() };
    App::new()
        .add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_plugins((CloudsPlugin, EguiPlugin::default()))
        .add_plugins((
            ResourceInspectorPlugin::<CloudModel>::default(),
            ResourceInspectorPlugin::<CloudLighting>::default(),
            ResourceInspectorPlugin::<CloudQuality>::default(),
            ResourceInspectorPlugin::<CloudTextures>::default(),
            ResourceInspectorPlugin::<CloudTextureSlots>::default(),
            ResourceInspectorPlugin::<CloudClock>::default(),
        ))
        .add_systems(Startup, setup)
        .run();
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    let earth = media.add(ScatteringMedium::earth(256, 256));
    commands.spawn(Atmosphere::earth(earth));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 1.0, -0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 2.0, 0.0).looking_to(Vec3::new(0.0, 0.3, -1.0), Vec3::Y),
        Exposure { ev100: 14.0 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}
