//! Help and timings over the picture. They take no input.

use bevy::{
    diagnostic::{DiagnosticsStore, FrameTimeDiagnosticsPlugin},
    prelude::*,
};
use bevy_cumulus::{
    inspector::{CloudInspector, gpu_times},
    prelude::*,
    textures::CloudTextureStatus,
};
use bevy_egui::{EguiContexts, egui};

use crate::{
    Flight,
    keys::{HELP, QUALITIES},
};

#[derive(bevy::ecs::system::SystemParam)]
pub struct Shown<'w, 's> {
    flight: Res<'w, Flight>,
    store: Res<'w, DiagnosticsStore>,
    model: Res<'w, CloudModel>,
    layers: Res<'w, CloudLayers>,
    lighting: Res<'w, CloudLighting>,
    quality: Res<'w, CloudQuality>,
    clock: Res<'w, CloudClock>,
    status: Res<'w, CloudStatus>,
    baking: Res<'w, CloudTextureStatus>,
    panel: Res<'w, CloudInspector>,
    camera: Query<'w, 's, &'static Transform, With<CloudView>>,
}

/// Size of the whole overlay in a window that has room for it (points), without its lines.
const MARGINS: egui::Vec2 = egui::vec2(350.0, 40.0);
/// Height of a line.
const LINE: f32 = 19.0;
/// Text smaller than this share of the normal size is hard to read.
const SMALLEST: f32 = 0.75;
/// Windows narrower than this have no room for help and panel side by side.
pub const BOTH_FROM: f32 = 750.0;

/// How far the text must shrink for so many lines, help included, to fit.
fn scale(room: egui::Vec2, lines: usize) -> f32 {
    let height = MARGINS.y + LINE * (lines + HELP.len()) as f32;
    (room.x / MARGINS.x).min(room.y / height).min(1.0)
}

/// Draws both.
pub fn show(mut contexts: EguiContexts, shown: Shown) {
    let Ok(ctx) = contexts.ctx_mut() else { return };
    let room = ctx.content_rect().size();
    // The panel would lie over it.
    let covered = shown.panel.open && room.x < BOTH_FROM;
    if !shown.flight.help || covered {
        return;
    }
    let mut lines = lines(&shown);
    if scale(room, lines.len()) < SMALLEST {
        // The panel has the passes' times as well.
        lines.retain(|line| !line.starts_with(INDENT));
    }
    let scale = scale(room, lines.len());
    let area = egui::Area::new("overlay".into())
        .order(egui::Order::Background)
        .anchor(egui::Align2::LEFT_TOP, [6.0, 6.0])
        .interactable(false);
    area.show(ctx, |ui| {
        egui::Frame::new().fill(egui::Color32::from_black_alpha(190)).inner_margin(6).show(ui, |ui| {
            // The theme's grey is hard to read over a sky.
            ui.visuals_mut().override_text_color = Some(egui::Color32::WHITE);
            for font in ui.style_mut().text_styles.values_mut() {
                font.size *= scale;
            }
            let spacing = ui.spacing_mut();
            spacing.item_spacing.y = 3.0 * scale;
            spacing.interact_size.y *= scale;
            for line in lines {
                ui.monospace(line);
            }
            ui.separator();
            egui::Grid::new("keys").num_columns(2).spacing([12.0 * scale, 1.0]).show(ui, |ui| {
                for (key, what) in HELP {
                    ui.strong(key);
                    ui.label(what);
                    ui.end_row();
                }
            });
        });
    });
}

/// What the lines of the single passes begin with.
const INDENT: &str = "  ";

fn lines(shown: &Shown) -> Vec<String> {
    let smoothed = |path| shown.store.get(path).and_then(|d| d.smoothed()).unwrap_or_default();
    let (fps, ms) = (smoothed(&FrameTimeDiagnosticsPlugin::FPS), smoothed(&FrameTimeDiagnosticsPlugin::FRAME_TIME));
    let mut lines = vec![format!("{fps:.1} frames/s, {ms:.1} ms")];
    for (name, ms) in gpu_times(&shown.store) {
        lines.push(format!("{INDENT}{name:<18}{ms:8.2} ms"));
    }
    if let Some(reason) = shown.status.unsupported() {
        lines.push(format!("clouds are off: {reason}"));
    } else if shown.baking.baking {
        lines.push(format!("baking {:.0} %", shown.baking.progress * 100.0));
    }
    let quality = QUALITIES.into_iter().find(|name| CloudQuality::named(name).as_ref() == Some(&*shown.quality));
    let preset = shown.flight.presets.name(&shown.model, &shown.layers, &shown.lighting);
    lines.push(format!("preset {}, quality {}", preset.unwrap_or("your own"), quality.unwrap_or("your own")));
    lines.push(format!("coverage {:+.2}, sun at {:.0}°", shown.model.coverage, shown.flight.sun.elevation));
    let paused = if shown.clock.speed == 0.0 { ", paused" } else { "" };
    lines.push(format!("cloud clock {:.1} s{paused}", shown.clock.seconds));
    if let Some(place) = shown.camera.iter().next() {
        let [x, y, z] = place.translation.to_array();
        lines.push(format!("at {x:.0}, {y:.0}, {z:.0} m"));
    }
    lines
}
