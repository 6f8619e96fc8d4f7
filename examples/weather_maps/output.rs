//! Writes the pictures.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use bevy::math::{Vec2, Vec3};
use bevy_cumulus::prelude::*;
use image::{ExtendedColorType, ImageFormat};

use crate::options::Options;

/// The file of each map: `clouds.png`, or `clouds_1.png` and so on. Says before the work what cannot be.
pub fn names(path: &Path, count: usize) -> Result<Vec<PathBuf>> {
    let shown = path.display();
    let is_png = path.extension().is_some_and(|found| found.eq_ignore_ascii_case("png"));
    ensure!(is_png, "--out {shown}: the file is a .png, so its name must end so");
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder {
        ensure!(folder.is_dir(), "--out {shown}: there is no directory {}", folder.display());
    }
    if count == 1 {
        return Ok(vec![path.to_owned()]);
    }
    Ok((1..=count).map(|n| beside(path, &n.to_string())).collect())
}

/// `clouds.png` and `height` to `clouds_height.png`.
fn beside(path: &Path, what: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{what}.png"))
}

/// Writes the map and the pictures of it that were asked for.
pub fn write(map: &WeatherMap, path: &Path, options: &Options) -> Result<()> {
    let (width, height) = map.size().into();
    save(path, map.texels().as_flattened(), width, height, ExtendedColorType::Rgba8)?;
    if options.channels {
        for (n, name) in ["coverage", "height", "base"].into_iter().enumerate() {
            let grey: Vec<u8> = map.texels().iter().map(|texel| texel[n]).collect();
            save(&beside(path, name), &grey, width, height, ExtendedColorType::L8)?;
        }
    }
    if options.preview {
        let rgb = preview(map);
        save(&beside(path, "preview"), &rgb, 2 * width, 2 * height, ExtendedColorType::Rgb8)?;
    }
    Ok(())
}

/// White cloud over a blue sea, its tops lit from the left: two repeats a side, so that seams would show.
fn preview(map: &WeatherMap) -> Vec<u8> {
    let size = map.size();
    let sea = Vec3::new(0.06, 0.14, 0.28);
    let top = |place: Vec2| {
        let Vec3 { x: coverage, y: height, z: base } = map.sample(place);
        (coverage, 0.6 * base + coverage.sqrt() * height)
    };
    let step = 1.0 / size.x as f32;
    let mut rgb = Vec::with_capacity(12 * map.texels().len());
    for n in 0..4 * size.x * size.y {
        let (x, y) = (n % (2 * size.x), n / (2 * size.x));
        let place = (Vec2::new(x as f32, y as f32) + 0.5) / size.as_vec2();
        let (coverage, here) = top(place);
        let light = (0.86 + 0.9 * (here - top(place - Vec2::splat(step)).1)).clamp(0.5, 1.0);
        let opacity = 1.0 - (-4.0 * coverage).exp();
        let colour = sea.lerp(Vec3::splat(light), opacity) * 255.0 + 0.5;
        rgb.extend(colour.to_array().map(|x| x as u8));
    }
    rgb
}

fn save(path: &Path, bytes: &[u8], width: u32, height: u32, colour: ExtendedColorType) -> Result<()> {
    image::save_buffer_with_format(path, bytes, width, height, colour, ImageFormat::Png)
        .with_context(|| format!("cannot write {}", path.display()))
}
