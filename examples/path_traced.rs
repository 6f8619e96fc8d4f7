//! A still without the march's approximations: every path of the light is followed, one a pixel and frame.
//!
//! `cargo run --example path_traced` shows the picture as its noise falls and then writes it to path_traced.png.
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::render::view::screenshot::{Screenshot, save_to_disk};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::prelude::*;

/// Paths of each pixel. Noise falls with the square root of their number: four times as many halve it.
const PATHS: u32 = 256;

fn main() {
    let window = Window { resolution: (640, 360).into(), ..default() };
    App::new()
        .add_plugins((DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }), CloudsPlugin))
        .insert_resource(CloudQuality::reference())
        // Whatever moves starts the picture anew: the clouds must stand still, and so must camera and sun.
        .insert_resource(CloudClock { seconds: 0.0, speed: 0.0 })
        .add_systems(Startup, setup)
        .add_systems(Update, take)
        .run();
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    commands.spawn(Atmosphere::earth(media.add(ScatteringMedium::earth(256, 256))));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.7, -0.6).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 2.0, 0.0).looking_to(Vec3::new(0.3, 0.3, -1.0), Vec3::Y),
        Exposure { ev100: 14.0 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}

fn take(mut commands: Commands, status: Res<CloudStatus>, mut window: Single<&mut Window>, mut paths: Local<u32>) {
    // Before that textures are baked, shaders are compiled, and the sky is clear.
    if !status.is_ready() || *paths == PATHS {
        return;
    }
    *paths += 1;
    window.title = format!("{} of {PATHS} paths a pixel", *paths);
    if *paths == PATHS {
        commands.spawn(Screenshot::primary_window()).observe(save_to_disk("path_traced.png"));
    }
}
