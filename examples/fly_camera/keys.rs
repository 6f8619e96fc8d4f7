//! What each key does.

use bevy::{
    prelude::*,
    window::{MonitorSelection, PrimaryWindow, WindowMode},
};
use bevy_cumulus::{
    inspector::{CloudInspector, InspectorWantsInput},
    prelude::*,
};

use crate::Flight;

/// The keys as the help shows them. The camera's own are Bevy's.
pub const HELP: [(&str, &str); 12] = [
    ("W A S D  Q E", "fly (Shift: faster; wheel: speed)"),
    ("right mouse, M", "look around"),
    ("T", "time of day (Shift: back)"),
    ("C", "more cloud (Shift: less)"),
    ("1 2 3 4", "quality: low, medium, high, ultra"),
    ("P", "next preset"),
    ("Space", "pause the cloud clock"),
    ("N", "one second of it"),
    ("I", "panel"),
    ("F", "fullscreen"),
    ("H", "this help"),
    ("Alt F4", "quit"),
];

/// Degrees of the sun's arc a second, and coverage a second.
const SUN_SPEED: f32 = 12.0;
const COVERAGE_SPEED: f32 = 0.2;

type Keys<'w> = Res<'w, ButtonInput<KeyCode>>;

/// Run condition: no text box has the keyboard.
pub fn free(wants: Res<InspectorWantsInput>) -> bool {
    !wants.keyboard
}

/// −1 with Shift, else 1.
fn direction(keys: &ButtonInput<KeyCode>) -> f32 {
    if keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]) { -1.0 } else { 1.0 }
}

/// Sun, coverage, quality and preset.
pub fn sky(
    keys: Keys,
    time: Res<Time>,
    mut flight: ResMut<Flight>,
    (mut model, mut layers): (ResMut<CloudModel>, ResMut<CloudLayers>),
    mut lighting: ResMut<CloudLighting>,
    mut textures: ResMut<CloudTextures>,
    mut quality: ResMut<CloudQuality>,
) {
    // A slow frame must not make the sun jump.
    let step = direction(&keys) * time.delta_secs().min(0.1);
    if keys.pressed(KeyCode::KeyT) {
        flight.sun.elevation = (flight.sun.elevation + SUN_SPEED * step).rem_euclid(360.0);
    }
    if keys.pressed(KeyCode::KeyC) {
        model.coverage = (model.coverage + COVERAGE_SPEED * step).clamp(-1.0, 1.0);
    }
    let digits = [KeyCode::Digit1, KeyCode::Digit2, KeyCode::Digit3, KeyCode::Digit4];
    let chosen = digits.into_iter().zip(QUALITIES).find(|(key, _)| keys.just_pressed(*key));
    if let Some(chosen) = chosen.and_then(|(_, name)| CloudQuality::named(name)) {
        quality.set_if_neq(chosen);
    }
    if keys.just_pressed(KeyCode::KeyP)
        && let Some(next) = flight.presets.next(&model, &layers, &lighting)
    {
        if let Some(elevation) = next.sun_elevation {
            flight.sun.elevation = elevation;
        }
        next.apply_to(&mut model, &mut layers, &mut lighting, &mut textures);
    }
}

/// Names of the quality presets, in the order of their keys.
pub const QUALITIES: [&str; 4] = ["low", "medium", "high", "ultra"];

/// Pause and single step of the cloud clock.
pub fn clock(keys: Keys, mut flight: ResMut<Flight>, mut clock: ResMut<CloudClock>) {
    if keys.just_pressed(KeyCode::Space) {
        if clock.speed == 0.0 {
            clock.speed = flight.speed;
        } else {
            flight.speed = clock.speed;
            clock.speed = 0.0;
        }
    }
    if keys.just_pressed(KeyCode::KeyN) {
        if clock.speed != 0.0 {
            flight.speed = clock.speed;
            clock.speed = 0.0;
        }
        clock.seconds += 1.0;
    }
}

/// Help, panel and fullscreen.
pub fn screen(
    keys: Keys,
    mut flight: ResMut<Flight>,
    mut inspector: ResMut<CloudInspector>,
    window: Option<Single<&mut Window, With<PrimaryWindow>>>,
) {
    if keys.just_pressed(KeyCode::KeyH) {
        flight.help = !flight.help;
    }
    if keys.just_pressed(KeyCode::KeyI) {
        inspector.open = !inspector.open;
    }
    if let Some(mut window) = window
        && keys.just_pressed(KeyCode::KeyF)
    {
        window.mode = match window.mode {
            WindowMode::Windowed => WindowMode::BorderlessFullscreen(MonitorSelection::Current),
            _ => WindowMode::Windowed,
        };
    }
}
