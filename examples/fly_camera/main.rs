//! Flies over hills under clouds, in a window: `cargo run --example fly_camera --features inspector`.
//!
//! `keys` says what each key does, `overlay` draws help and timings, `watch` reads the preset's file again when it changes,
//! the panel comes from the crate's inspector.

#[path = "../common/mod.rs"]
mod common;
mod keys;
mod overlay;
mod presets;
#[path = "../common/start.rs"]
mod start;
mod watch;

use anyhow::Result;
use bevy::{
    camera_controller::free_camera::{FreeCamera, FreeCameraPlugin, FreeCameraState},
    diagnostic::FrameTimeDiagnosticsPlugin,
    input::InputSystems,
    pbr::AtmosphereSettings,
    prelude::*,
    render::diagnostic::RenderDiagnosticsPlugin,
};
use bevy_cumulus::{
    inspector::{CloudInspectorPlugin, CloudPresetChosen, InspectorWantsInput},
    prelude::*,
};
use bevy_egui::EguiPrimaryContextPass;
use clap::Parser;
use start::{Start, StartOptions};

/// Flies over hills under clouds, in a window.
#[derive(Parser, Debug)]
#[command(name = "fly_camera", version)]
struct Options {
    #[command(flatten)]
    start: StartOptions,
    /// Size of the window in pixels, each side from 64 to 8192
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size)]
    size: UVec2,
    /// Start without help and panel
    #[arg(long)]
    bare: bool,
}

fn size(text: &str) -> Result<UVec2, String> {
    let side = |part: &str| part.parse().ok().filter(|n| (64..=8192).contains(n));
    let sides = text.split_once('x').and_then(|(w, h)| Some(UVec2::new(side(w)?, side(h)?)));
    sides.ok_or_else(|| "expected WxH, such as 1280x720, with sides from 64 to 8192".to_owned())
}

/// What the keys change, beside the settings.
#[derive(Resource)]
struct Flight {
    start: Start,
    /// Its elevation runs on past 90°, over the zenith and down on the other side: 360° are a day.
    sun: common::SunPose,
    presets: presets::Presets,
    help: bool,
    /// Speed of the cloud clock when it is not paused.
    speed: f32,
}

fn main() -> AppExit {
    fly(&Options::parse()).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        AppExit::error()
    })
}

fn fly(options: &Options) -> Result<AppExit> {
    let start = options.start.start(Some("hills"), CloudClock::default())?;
    #[cfg(target_os = "linux")]
    check_display()?;
    let settings = start.settings.clone();
    let title = format!("bevy_cumulus: {}, {}", start.named.unwrap_or(start.scene.name), start.preset);
    let window = Window { title, resolution: options.size.into(), ..default() };
    let speed = if settings.clock.speed == 0.0 { 1.0 } else { settings.clock.speed };
    // One over the other they could not be read.
    let panel = !options.bare && options.size.x as f32 >= overlay::BOTH_FROM;
    let watched = start.preset_file.as_deref().map(watch::PresetWatch::new);
    let flight = Flight { sun: start.sun, presets: presets::Presets::new(), help: !options.bare, speed, start };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_plugins((FreeCameraPlugin, FrameTimeDiagnosticsPlugin::default(), RenderDiagnosticsPlugin))
        .add_plugins((CloudsPlugin, CloudInspectorPlugin))
        .insert_resource(settings.model)
        .insert_resource(settings.layers)
        .insert_resource(settings.lighting)
        .insert_resource(settings.quality)
        .insert_resource(settings.textures)
        .insert_resource(settings.clock)
        .insert_resource(bevy_cumulus::inspector::CloudInspector { open: panel })
        .insert_resource(flight)
        .add_systems(Startup, setup)
        .add_systems(PreUpdate, share_input.after(InputSystems))
        .add_systems(Update, (keys::sky, keys::clock, keys::screen).run_if(keys::free))
        .add_systems(Update, ((watch::follow, take_preset_sun, move_sun).chain().after(keys::sky), match_air))
        .add_systems(EguiPrimaryContextPass, overlay::show);
    if let Some(watched) = watched {
        app.insert_resource(watched);
    }
    Ok(app.run())
}

/// Bevy's window library panics where there is no X server to talk to.
#[cfg(target_os = "linux")]
fn check_display() -> Result<()> {
    use anyhow::{bail, ensure};

    let display = std::env::var("DISPLAY").unwrap_or_default();
    ensure!(!display.is_empty(), "there is no display: set DISPLAY, or use the headless example");
    match x11rb::rust_connection::RustConnection::connect(None) {
        Ok(_) => Ok(()),
        Err(error) => bail!("no X server answers at DISPLAY={display} ({error}); the headless example needs none"),
    }
}

fn setup(world: &mut World) {
    let Some(flight) = world.get_resource::<Flight>() else { return };
    let (start, ev100) = (flight.start.clone(), ev100(flight));
    common::spawn_land(world, start.scene.hills);
    common::spawn_sky(world, start.sun, start.sky, start.scene.hills);
    let flying = FreeCamera {
        // A slow aeroplane and a fast one (m/s); the wheel changes both.
        walk_speed: 100.0,
        run_speed: 1000.0,
        scroll_factor: 0.15,
        friction: 8.0,
        ..default()
    };
    let pose = (start.camera.transform(), start.camera.projection(16.0 / 9.0));
    let view = CloudView { debug: start.scene.debug, ..default() };
    let camera = world.spawn((common::camera(ev100), view, Msaa::Off, flying, pose)).id();
    if start.sky {
        world.entity_mut(camera).insert(common::sky_camera(start.camera.position.y));
    }
}

/// Bevy's atmosphere has to be told from where it is seen.
fn match_air(mut cameras: Query<(&Transform, &mut AtmosphereSettings)>) {
    for (place, mut air) in &mut cameras {
        *air = common::air(place.translation.y);
    }
}

/// Exposure for the sun's elevation (EV100).
fn ev100(flight: &Flight) -> f32 {
    let above = flight.sun.elevation.to_radians().sin().asin().to_degrees();
    common::SunPose { elevation: above, ..flight.sun }.ev100() + flight.start.scene.ev_offset
}

/// A preset that is chosen in the panel brings its sun, as one chosen by key does.
fn take_preset_sun(mut chosen: MessageReader<CloudPresetChosen>, mut flight: ResMut<Flight>) {
    if let Some(elevation) = chosen.read().filter_map(|CloudPresetChosen(preset)| preset.sun_elevation).last() {
        flight.sun.elevation = elevation;
    }
}

fn move_sun(
    flight: Res<Flight>,
    mut sun: Single<&mut Transform, With<DirectionalLight>>,
    mut exposure: Single<&mut bevy::camera::Exposure>,
) {
    sun.set_if_neq(flight.sun.transform());
    let ev100 = ev100(&flight);
    if exposure.ev100 != ev100 {
        exposure.ev100 = ev100;
    }
}

/// The camera rests while the panel has the mouse or the keyboard, unless a turn under way has only crossed it.
fn share_input(
    wants: Res<InspectorWantsInput>,
    buttons: Res<ButtonInput<MouseButton>>,
    mut camera: Single<(&mut FreeCameraState, &FreeCamera)>,
) {
    let (state, config) = &mut *camera;
    let turning = state.enabled && buttons.pressed(config.mouse_key_cursor_grab);
    let enabled = !wants.keyboard && (!wants.pointer || turning);
    if state.enabled != enabled {
        state.enabled = enabled;
        state.velocity = Vec3::ZERO;
    }
}
