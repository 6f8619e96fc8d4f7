//! Checks and writes the files.

use std::{
    fs::{self, OpenOptions},
    io::Cursor,
    path::Path,
};

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use image::{DynamicImage, ImageFormat};
use serde::Serialize;
use serde_json::Value;

use crate::{
    options::{Effective, Plan},
    shoot::{Counts, Shot},
};

/// The timings file. A struct, since JSON values would widen every f32.
#[derive(Serialize)]
struct Report<'a> {
    adapter: &'a str,
    size: (u32, u32),
    settings: Effective<'a>,
    passes: Value,
    frame: Value,
}

/// The counts file.
#[derive(Serialize)]
struct Counted<'a> {
    adapter: &'a str,
    size: (u32, u32),
    settings: Effective<'a>,
    #[serde(flatten)]
    counts: &'a Counts,
}

/// Says before the work whether the file can be written after it.
pub fn check(path: &Path, extension: &str) -> Result<()> {
    let shown = path.display();
    ensure!(!path.as_os_str().is_empty(), "the name of the file is empty");
    ensure!(!path.is_dir(), "{shown} is a directory");
    if let Some(found) = path.extension() {
        ensure!(found.eq_ignore_ascii_case(extension), "{shown}: the file is a .{extension}, so its name must end so");
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder {
        ensure!(folder.is_dir(), "{shown}: there is no directory {}", folder.display());
    }
    let existed = path.exists();
    OpenOptions::new().append(true).create(true).open(path).with_context(|| format!("cannot write {shown}"))?;
    if !existed {
        fs::remove_file(path).with_context(|| format!("cannot write {shown}"))?;
    }
    Ok(())
}

/// Writes all that was asked for; then says whether it holds what it should.
pub fn write(plan: &Plan, shot: &Shot) -> Result<()> {
    if let Some(path) = &plan.out {
        let picture = shot.picture.as_ref().ok_or_else(|| anyhow!("--out: no picture came back"))?;
        put(path, &encode(&DynamicImage::ImageRgb8(picture.clone()), ImageFormat::Png)?)?;
    }
    if let Some(path) = &plan.cloud {
        let cloud = shot.cloud.as_ref().ok_or_else(|| anyhow!("--cloud: no cloud buffer came back"))?;
        put(path, &encode(&DynamicImage::ImageRgba32F(cloud.clone()), ImageFormat::OpenExr)?)?;
    }
    if let Some(path) = &plan.noise {
        let noise = shot.noise.as_ref().ok_or_else(|| anyhow!("--noise: no noise came back"))?;
        put(path, &encode(&DynamicImage::ImageRgba32F(noise.clone()), ImageFormat::OpenExr)?)?;
    }
    if let Some(path) = &plan.timings {
        let (passes, frame) = shot.timings.to_json();
        let settings = plan.effective();
        let all = Report { adapter: &shot.adapter, size: plan.size, settings, passes, frame };
        put(path, serde_json::to_string_pretty(&all)?.as_bytes())?;
    }
    if let Some(path) = &plan.counts {
        let counts = shot.counts.as_ref().ok_or_else(|| anyhow!("--counts: no counts came back"))?;
        let all = Counted { adapter: &shot.adapter, size: plan.size, settings: plan.effective(), counts };
        put(path, serde_json::to_string_pretty(&all)?.as_bytes())?;
    }
    match &shot.flaw {
        Some(flaw) => bail!("{flaw}"),
        None => Ok(()),
    }
}

fn encode(image: &DynamicImage, format: ImageFormat) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).with_context(|| format!("cannot encode {format:?}"))?;
    Ok(bytes.into_inner())
}

fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
