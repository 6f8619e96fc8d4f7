//! Asking about the clouds on the CPU: a camera flies through them, and the window's title says what is around it.
//!
//! `cargo run --example queries`
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::prelude::*;

/// Metres per second.
const SPEED: f32 = 250.0;

fn main() {
    App::new()
        // The second plugin of the crate's keeps the same clouds on the CPU. Without it nothing is read back.
        .add_plugins((DefaultPlugins, CloudsPlugin, CloudFieldPlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, (fly, tell))
        .run();
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    commands.spawn(Atmosphere::earth(media.add(ScatteringMedium::earth(256, 256))));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.8, -0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        // Among the clouds of the default sky, which lie between 1300 and 3300 m.
        Transform::from_xyz(0.0, 2000.0, 0.0).looking_to(Vec3::new(0.2, 0.0, -1.0), Vec3::Y),
        Exposure { ev100: 14.0 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}

fn fly(mut camera: Single<&mut Transform, With<CloudView>>, time: Res<Time>) {
    let forward = camera.forward();
    camera.translation += forward * SPEED * time.delta_secs();
}

fn tell(clouds: Res<CloudField>, camera: Single<&GlobalTransform, With<CloudView>>, mut window: Single<&mut Window>) {
    let sky = match clouds.get() {
        Ok(sky) => sky,
        // Not yet: textures are being baked and read back.
        Err(why) => {
            window.title = why.to_string();
            return;
        }
    };
    let here = camera.translation();
    let ahead = here + camera.forward() * 3000.0;
    window.title = format!(
        "{}; sunlight {:.0} %; a thing 3 km ahead {:.0} %; in a minute the density here is {:.2}",
        if sky.is_in_cloud(here) { "in cloud" } else { "in clear air" },
        100.0 * sky.sun_visibility(here),
        100.0 * sky.transmittance(here, ahead),
        sky.density(here, sky.seconds() + 60.0),
    );
}
