//! What the renderer wrote: the picture as shown, and the cloud buffer behind it.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use image::{Rgb, RgbImage, Rgba, Rgba32FImage};

/// One picture of a sky.
#[derive(Clone)]
pub struct Picture {
    /// As shown: exposed, tone-mapped, sRGB.
    pub shown: RgbImage,
    /// The clouds alone: linear radiance (cd/m²), and transmittance in the fourth channel.
    pub cloud: Rgba32FImage,
}

impl Picture {
    /// Reads `STEM.png` and `STEM.exr`.
    pub fn read(stem: &Path) -> Result<Self> {
        let open = |extension| {
            let path = stem.with_extension(extension);
            image::open(&path).with_context(|| format!("cannot read {}", path.display()))
        };
        let (shown, cloud) = (open("png")?.into_rgb8(), open("exr")?.into_rgba32f());
        ensure!(
            shown.dimensions() == cloud.dimensions(),
            "{}: picture and cloud buffer differ in size",
            stem.display()
        );
        Ok(Self { shown, cloud })
    }

    /// The mean of two pictures: of the light, not of the sRGB codes.
    pub fn mean(a: &Self, b: &Self) -> Self {
        let mut out = a.clone();
        for (x, y) in out.shown.pixels_mut().zip(b.shown.pixels()) {
            *x = Rgb(std::array::from_fn(|i| encode((decode(x.0[i]) + decode(y.0[i])) / 2.0)));
        }
        for (x, y) in out.cloud.pixels_mut().zip(b.cloud.pixels()) {
            *x = Rgba(std::array::from_fn(|i| (x.0[i] + y.0[i]) / 2.0));
        }
        out
    }
}

/// Light of an sRGB code.
pub fn decode(code: u8) -> f64 {
    let v = f64::from(code) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB code of linear light.
pub fn encode(v: f64) -> u8 {
    let s = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (s * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_codes_survive() {
        for code in 0..=255 {
            assert_eq!(encode(decode(code)), code);
        }
    }

    #[test]
    fn mean_is_of_light() {
        let of = |code, value| Picture {
            shown: RgbImage::from_pixel(2, 2, Rgb([code; 3])),
            cloud: Rgba32FImage::from_pixel(2, 2, Rgba([value; 4])),
        };
        let mean = Picture::mean(&of(0, 1.0), &of(255, 3.0));
        assert_eq!(mean.shown.get_pixel(1, 1).0, [188; 3], "half of white's light is code 188, not 128");
        assert_eq!(mean.cloud.get_pixel(1, 1).0, [2.0; 4]);
    }
}
