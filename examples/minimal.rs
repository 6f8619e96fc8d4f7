//! A sky with clouds: one plugin, and one component on the camera.
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, CloudsPlugin)).add_systems(Startup, setup).run();
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
