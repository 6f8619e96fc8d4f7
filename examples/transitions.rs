//! One sky turning into another, over and over: `cargo run --example transitions`.
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::prelude::*;

/// Built-in presets, in turn. The app begins with the last.
const SKIES: [&str; 4] = ["Broken", "Storm", "AfterRain", "FairWeatherCumulus"];
/// How long one sky takes to become the next, in seconds of the clouds' clock. Afterwards it stays as long.
const CHANGE: f64 = 300.0;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, CloudsPlugin))
        // Twenty seconds of cloud time each second: transitions and wind follow this clock, and nothing else.
        .insert_resource(CloudClock { seconds: 0.0, speed: 20.0 })
        .add_systems(Startup, setup)
        .add_systems(Update, change)
        .run();
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    // A preset at once, without a transition.
    commands.queue(|world: &mut World| {
        CloudPreset::named(SKIES[SKIES.len() - 1]).expect("it is built in").apply(world);
    });
    commands.spawn(Atmosphere::earth(media.add(ScatteringMedium::earth(256, 256))));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.8, 0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 100.0, 0.0).looking_to(Vec3::new(0.0, 0.25, -1.0), Vec3::Y),
        Exposure { ev100: 13.5 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}

fn change(
    mut weather: ResMut<CloudWeather>,
    clock: Res<CloudClock>,
    mut window: Single<&mut Window>,
    mut begun: Local<usize>,
) -> Result {
    // How far the running transition is, from 0 to 1; none where none runs.
    if let Some(progress) = weather.progress(clock.seconds) {
        window.title = format!("{}: {:.0} %", SKIES[(*begun + SKIES.len() - 1) % SKIES.len()], 100.0 * progress);
    }
    if clock.seconds >= 2.0 * CHANGE * *begun as f64 {
        let next = CloudPreset::named(SKIES[*begun % SKIES.len()]).ok_or("there is no such preset")?;
        // It begins from what is shown, even in the midst of another transition.
        weather.transition_to(&next, CHANGE)?;
        *begun += 1;
    }
    Ok(())
}
