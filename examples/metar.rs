//! The sky of an airport's weather report.
//!
//! `cargo run --example metar`, or with a report of your own and the airport's altitude in metres:
//! `cargo run --example metar -- "LSZH 231150Z 24008KT 9999 SCT035 BKN060 18/09 Q1015" 432`
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*};
use bevy_cumulus::{prelude::*, weather::metar::MetarSky};

const REPORT: &str = "EGLL 231150Z 24012KT 9999 FEW022 BKN048 12/07 Q1013";
/// Degrees north: at which altitudes clouds of a kind stand hangs on it.
const LATITUDE: f32 = 51.5;

fn main() -> Result {
    let mut arguments = std::env::args().skip(1);
    let report = arguments.next().unwrap_or_else(|| REPORT.to_owned());
    let elevation = arguments.next().map_or(Ok(25.0), |metres| metres.parse())?;
    // A report that cannot be read says which group is to blame.
    let sky = MetarSky::parse(&report, elevation)?;
    // Layers with map, altitude, wind and rain. Another seed gives other clouds of the same report.
    let preset = sky.sky(LATITUDE, 1);
    for layer in &preset.layers.0 {
        println!("{}: base {:.0} m, cover {:.1} eighths", layer.name, layer.base, layer.map.cover);
    }
    let window = Window { title: report, ..default() };
    let mut app = App::new();
    app.add_plugins((DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }), CloudsPlugin));
    preset.apply(app.world_mut());
    app.add_systems(Startup, setup).run();
    Ok(())
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    commands.spawn(Atmosphere::earth(media.add(ScatteringMedium::earth(256, 256))));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.8, -0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 30.0, 0.0).looking_to(Vec3::new(0.0, 0.3, -1.0), Vec3::Y),
        Exposure { ev100: 14.0 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}
