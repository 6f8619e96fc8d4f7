//! Contact sheets: pictures side by side, for eyes.

use std::path::Path;

use anyhow::{Context as _, Result};
use image::{
    RgbImage,
    imageops::{FilterType, replace, resize},
};

/// Gap between pictures (pixels).
const GAP: u32 = 4;
/// Narrower pictures are enlarged to about this width (pixels).
const WIDTH: u32 = 384;

/// Writes rows of pictures, all of one size, as one.
pub fn write(path: &Path, rows: &[Vec<RgbImage>]) -> Result<()> {
    let Some(first) = rows.first().and_then(|row| row.first()) else { return Ok(()) };
    let scale = (WIDTH / first.width().max(1)).max(1);
    let (width, height) = (first.width() * scale, first.height() * scale);
    let columns = rows.iter().map(Vec::len).max().unwrap_or(1) as u32;
    let mut sheet = RgbImage::from_pixel(
        columns * (width + GAP) - GAP,
        rows.len() as u32 * (height + GAP) - GAP,
        image::Rgb([255; 3]),
    );
    for (y, row) in (0..).step_by((height + GAP) as usize).zip(rows) {
        for (x, picture) in (0..).step_by((width + GAP) as usize).zip(row) {
            replace(&mut sheet, &resize(picture, width, height, FilterType::Nearest), x, y);
        }
    }
    sheet.save(path).with_context(|| format!("cannot write {}", path.display()))
}
