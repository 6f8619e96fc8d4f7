//! How far a picture is from the truth.
//!
//! The truth may be noisy. It then consists of two halves made from independent samples, A and B: for a test value T
//! the product (T − A)(T − B) has the mean (T − truth)², without the variance that (T − A)² would add.

use anyhow::{Result, ensure};
use image::{RgbImage, Rgba32FImage};
use serde_json::{Value, json};

use crate::{backdrop::Backdrop, picture::Picture, smooth::smoothed};

/// A pixel counts as cloud where the truth's transmittance is below this.
pub const CLOUD_BELOW: f32 = 0.98;
/// Added to the brightness that a pixel's error is divided by, as a share of the clouds' mean: dim pixels do not rule.
pub const FLOOR: f64 = 0.05;

/// What pictures are held against.
pub struct Truth {
    halves: [Picture; 2],
    mean: Picture,
    mask: Vec<bool>,
    /// Luminance around each pixel (3×3, in cloud), squared, with the floor: what a squared error is divided by.
    scale: Vec<f64>,
    luminance: f64,
    /// What test pictures are shown before; without one they are taken as the renderer shows them.
    backdrop: Option<Backdrop>,
}

/// Errors of one picture. Means over the cloud's pixels unless said otherwise.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Errors {
    /// FLIP (0 equal, 1 worst).
    pub flip: f64,
    /// FLIP over the whole picture.
    pub flip_all: f64,
    /// Squared error of radiance, per channel, over the squared luminance around the pixel.
    pub rel_mse: f64,
    /// Total luminance of the clouds over the truth's.
    pub luminance: f64,
    /// Root of the mean squared error of transmittance.
    pub transmittance: f64,
}

impl Errors {
    /// The mean of several; of nothing there is none.
    pub fn mean(all: &[Self]) -> Option<Self> {
        let mean = |get: fn(&Self) -> f64| all.iter().map(get).sum::<f64>() / all.len() as f64;
        (!all.is_empty()).then(|| Self {
            flip: mean(|e| e.flip),
            flip_all: mean(|e| e.flip_all),
            rel_mse: mean(|e| e.rel_mse),
            luminance: mean(|e| e.luminance),
            transmittance: mean(|e| e.transmittance),
        })
    }

    pub fn to_json(self) -> Value {
        json!({ "flip": self.flip, "flip_all": self.flip_all, "rel_mse": self.rel_mse, "luminance": self.luminance,
            "transmittance": self.transmittance })
    }
}

/// FLIP of each pixel, row by row, and the map as a picture.
pub struct FlipMap {
    pub values: Vec<f32>,
    pub magma: RgbImage,
}

/// LDR-FLIP of sRGB pictures at the usual viewing distance (67 pixels a degree).
pub fn flip(truth: &RgbImage, test: &RgbImage) -> Result<FlipMap> {
    ensure!(
        truth.dimensions() == test.dimensions(),
        "pictures of {:?} and {:?}",
        truth.dimensions(),
        test.dimensions()
    );
    let (width, height) = truth.dimensions();
    let load = |picture: &RgbImage| nv_flip::FlipImageRgb8::with_data(width, height, picture);
    let map = nv_flip::flip(load(truth), load(test), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
    let colours = map.apply_color_lut(&nv_flip::magma_lut()).to_vec();
    let magma = RgbImage::from_raw(width, height, colours).unwrap_or_else(|| RgbImage::new(width, height));
    Ok(FlipMap { values: map.to_vec(), magma })
}

impl Truth {
    /// A truth without noise.
    pub fn exact(picture: Picture) -> Result<Self> {
        Self::of_halves(picture.clone(), picture)
    }

    /// A truth from two pictures of independent samples.
    pub fn of_halves(a: Picture, b: Picture) -> Result<Self> {
        ensure!(a.cloud.dimensions() == b.cloud.dimensions(), "the halves of the truth differ in size");
        let mean = if a.cloud == b.cloud { a.clone() } else { Picture::mean(&a, &b) };
        let mask: Vec<bool> = mean.cloud.pixels().map(|p| p.0[3] < CLOUD_BELOW).collect();
        let brightness: Vec<f64> = mean.cloud.pixels().map(|p| luminance(&p.0)).collect();
        let luminance = masked(&mask, &brightness).sum::<f64>();
        let count = mask.iter().filter(|m| **m).count().max(1);
        let floor = FLOOR * luminance / count as f64;
        let scale = around(&mean.cloud, &mask, &brightness).into_iter().map(|y| y * y + floor * floor).collect();
        Ok(Self { halves: [a, b], mean, mask, scale, luminance, backdrop: None })
    }

    /// Has the truth shown before a sky with little of its noise left: smoothed, but for the detail of `guide`, a picture
    /// without noise. Everything but FLIP still goes by the halves as they are.
    pub fn refined(mut self, backdrop: Backdrop, guide: &Rgba32FImage) -> Result<Self> {
        ensure!(guide.dimensions() == self.mean.cloud.dimensions(), "guide and truth differ in size");
        let [a, b] = &mut self.halves;
        for picture in [a, b, &mut self.mean] {
            picture.shown = backdrop.show(&smoothed(&picture.cloud, guide));
        }
        self.backdrop = Some(backdrop);
        Ok(self)
    }

    /// How far a picture as shown here is from how the renderer shows it: mean over the pixels, in codes of 255.
    pub fn apart_from_renderer(&self, picture: &Picture) -> Result<f64> {
        self.backdrop.as_ref().map_or(Ok(0.0), |backdrop| backdrop.check(picture))
    }

    /// A test picture as it is shown to be held against this truth.
    pub fn shown(&self, test: &Picture) -> RgbImage {
        self.backdrop.as_ref().map_or_else(|| test.shown.clone(), |backdrop| backdrop.show(&test.cloud))
    }

    /// The best single picture of it.
    pub fn picture(&self) -> &Picture {
        &self.mean
    }

    /// Share of the picture that is cloud.
    pub fn cover(&self) -> f64 {
        self.mask.iter().filter(|m| **m).count() as f64 / self.mask.len().max(1) as f64
    }

    /// Mean FLIP between the two halves, over the cloud: a perfect picture would score a little less than this against
    /// either. 0 where there is no noise.
    pub fn noise(&self) -> Result<f64> {
        let map = flip(&self.halves[0].shown, &self.halves[1].shown)?;
        Ok(mean(masked(&self.mask, &map.values).map(f64::from)))
    }

    /// Errors of a picture, and where they are.
    pub fn judge(&self, test: &Picture) -> Result<(Errors, FlipMap)> {
        ensure!(test.cloud.dimensions() == self.mean.cloud.dimensions(), "picture and truth differ in size");
        ensure!(self.cover() > 0.0, "the truth shows no cloud");
        let map = flip(&self.mean.shown, &self.shown(test))?;
        let [a, b] = &self.halves;
        let triples = || test.cloud.pixels().zip(a.cloud.pixels().zip(b.cloud.pixels()));
        let product = |t: f32, a: f32, b: f32| (f64::from(t) - f64::from(a)) * (f64::from(t) - f64::from(b));
        let radiance: Vec<f64> = triples()
            .zip(&self.scale)
            .map(|((t, (a, b)), scale)| (0..3).map(|i| product(t.0[i], a.0[i], b.0[i])).sum::<f64>() / 3.0 / scale)
            .collect();
        let transmittance: Vec<f64> = triples().map(|(t, (a, b))| product(t.0[3], a.0[3], b.0[3])).collect();
        let brightness: Vec<f64> = test.cloud.pixels().map(|p| luminance(&p.0)).collect();
        let errors = Errors {
            flip: mean(masked(&self.mask, &map.values).map(f64::from)),
            flip_all: mean(map.values.iter().copied().map(f64::from)),
            rel_mse: mean(masked(&self.mask, &radiance)),
            luminance: masked(&self.mask, &brightness).sum::<f64>() / self.luminance,
            transmittance: mean(masked(&self.mask, &transmittance)).max(0.0).sqrt(),
        };
        Ok((errors, map))
    }
}

/// Rec. 709 luminance of linear light.
fn luminance(p: &[f32; 4]) -> f64 {
    0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2])
}

fn masked<'a, T: Copy>(mask: &'a [bool], values: &'a [T]) -> impl Iterator<Item = T> {
    mask.iter().zip(values).filter(|(inside, _)| **inside).map(|(_, value)| *value)
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Mean brightness of the cloud's pixels in the 3×3 around each: less noisy than the pixel's own.
fn around(picture: &Rgba32FImage, mask: &[bool], brightness: &[f64]) -> Vec<f64> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let near = |n: usize, end: usize| n.saturating_sub(1)..(n + 2).min(end);
    let at = |x: usize, y: usize| {
        mean(
            near(y, height)
                .flat_map(|v| near(x, width).map(move |u| v * width + u))
                .filter(|i| mask[*i])
                .map(|i| brightness[i]),
        )
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect()
}

/// A picture of one colour.
#[cfg(test)]
pub fn plain(shown: [u8; 3], cloud: [f32; 4]) -> Picture {
    Picture {
        shown: RgbImage::from_pixel(16, 8, image::Rgb(shown)),
        cloud: Rgba32FImage::from_pixel(16, 8, image::Rgba(cloud)),
    }
}

#[cfg(test)]
#[path = "metrics_tests.rs"]
mod tests;
