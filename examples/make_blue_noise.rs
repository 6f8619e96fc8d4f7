//! Writes a blue-noise tile, such as the shipped one: `cargo run --release --example make_blue_noise`.

use std::{path::PathBuf, time::Duration};

use anyhow::Context;
use bevy_cumulus::textures::blue_noise::{BlueNoiseParams, generate};
use clap::Parser;
use image::{ExtendedColorType, ImageFormat};
use indicatif::{HumanDuration, ProgressBar};

/// Makes a seamless RGBA tile of three independent channels of blue noise (void and cluster).
#[derive(Parser)]
struct Args {
    /// Width and height in pixels: a power of two, 8 to 256.
    #[arg(long, default_value_t = BlueNoiseParams::default().size)]
    size: u32,
    /// Another seed gives another tile.
    #[arg(long, default_value_t = BlueNoiseParams::default().seed)]
    seed: u64,
    /// Width of the Gaussian that measures crowding, in pixels, 1 to 3.
    #[arg(long, default_value_t = BlueNoiseParams::default().sigma)]
    sigma: f32,
    /// The PNG to write.
    #[arg(long, default_value = "assets/textures/blue_noise.png")]
    out: PathBuf,
}

fn main() -> anyhow::Result<()> {
    let Args { size, seed, sigma, out } = Args::parse();
    let progress = ProgressBar::new_spinner().with_message(format!("generating {size} × {size}"));
    progress.enable_steady_tick(Duration::from_millis(100));
    let rgba = generate(BlueNoiseParams { size, seed, sigma })?;
    if let Some(folder) = out.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    }
    image::save_buffer_with_format(&out, &rgba, size, size, ExtendedColorType::Rgba8, ImageFormat::Png)
        .with_context(|| format!("cannot write {}", out.display()))?;
    progress.finish_with_message(format!("wrote {} in {}", out.display(), HumanDuration(progress.elapsed())));
    Ok(())
}
