//! What a camera shows of clouds before a sky.
//!
//! A noisy reference has to be averaged as light: tone mapping bends, so that the mean of noisy pictures as shown is too dark,
//! and too much of the colour that its most frequent samples have. References are therefore averaged as cloud buffers, and
//! shown here as Bevy would show them; so is every picture that is held against them.

use anyhow::{Context as _, Result, ensure};
use image::{Rgb, RgbImage, Rgba32FImage};

use crate::{
    engine::{Engine, Job},
    picture::{Picture, decode, encode},
    progress::Progress,
};

/// No cloud of the model anywhere, and textures that are soon baked. Layers are turned off one by one.
const CLEAR: &str = "--quality low --set model.coverage=-1 --set textures.volume_size=32 --set textures.map_size=64";
/// Stops by which the sky is shown darker each time. A pixel is read where it is not yet overexposed.
const BRACKETS: [f32; 3] = [0.0, 4.0, 8.0];
/// Codes above this say little about the light.
const OVEREXPOSED: u8 = 235;

/// The sky of a view without clouds, as light times exposure, and the exposure.
#[derive(Clone)]
pub struct Backdrop {
    width: u32,
    light: Vec<[f64; 3]>,
    exposure: f64,
}

impl Backdrop {
    /// Pictures that `of` takes.
    pub const PICTURES: usize = BRACKETS.len();

    /// Renders the sky of a scene at some exposures, and reads its light back from what was shown.
    pub fn of(engine: &Engine, scene: &str, size: &str, progress: &Progress) -> Result<Self> {
        let settings = engine.effective(&format!("--scene {scene}"))?;
        let ev = settings["ev100"].as_f64().context("headless --effective: no ev100")?;
        let layers = settings["layers"].as_array().context("headless --effective: no layers")?.len();
        let clear = (0..layers).fold(CLEAR.to_owned(), |all, i| format!("{all} --set layers.{i}.enabled=false"));
        let mut found: Option<Self> = None;
        for (i, stops) in BRACKETS.into_iter().enumerate() {
            let exposed = ev + f64::from(stops);
            let name = format!("clear_{i}");
            let job = Job { name: name.clone(), options: clear.clone(), frames: 2, picture: true };
            // One exposure to a run.
            engine.render_sharing(&format!("--ev {exposed}"), scene, size, &[job], progress)?;
            let seen = Self::read(&engine.picture(scene, &name)?.shown, exposed);
            match &mut found {
                None => found = Some(seen),
                Some(found) => found.take_overexposed(&seen, stops),
            }
        }
        found.context("no exposure")
    }

    /// The light that is shown like this.
    fn read(shown: &RgbImage, ev: f64) -> Self {
        // Bevy's `Exposure::exposure`.
        let exposure = (-ev).exp2() / 1.2;
        let light = shown.pixels().map(|p| light_of(p.0.map(decode))).collect();
        Self { width: shown.width(), light, exposure }
    }

    /// Takes the light of overexposed pixels from a picture that is so many stops darker.
    fn take_overexposed(&mut self, darker: &Self, stops: f32) {
        let gain = f64::from(stops).exp2();
        for (mine, theirs) in self.light.iter_mut().zip(&darker.light) {
            if shown(*mine).into_iter().any(|v| encode(v) > OVEREXPOSED) {
                *mine = theirs.map(|v| v * gain);
            }
        }
    }

    /// Clouds before this sky.
    pub fn show(&self, cloud: &Rgba32FImage) -> RgbImage {
        let mut out = RgbImage::new(self.width, cloud.height());
        for ((pixel, cloud), sky) in out.pixels_mut().zip(cloud.pixels()).zip(&self.light) {
            let c = cloud.0.map(f64::from);
            *pixel = Rgb(shown(std::array::from_fn(|i| sky[i] * c[3] + c[i] * self.exposure)).map(encode));
        }
        out
    }

    /// How far what is shown here is from what the renderer shows: mean over the pixels, in codes of 255.
    pub fn check(&self, picture: &Picture) -> Result<f64> {
        ensure!(picture.cloud.pixels().len() == self.light.len(), "picture and backdrop differ in size");
        let own = self.show(&picture.cloud);
        let apart = own.iter().zip(picture.shown.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
        Ok(apart / own.len() as f64)
    }
}

/// Bevy's `ACESFitted` (Stephen Hill): sRGB to the space of the curve, and back.
const INTO: [[f64; 3]; 3] = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
const BACK: [[f64; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

/// Light as shown: tone-mapped, still linear.
fn shown(light: [f64; 3]) -> [f64; 3] {
    let curve = |v: f64| (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081);
    times(&BACK, times(&INTO, light.map(|v| v.max(0.0))).map(curve)).map(|v| v.clamp(0.0, 1.0))
}

/// The light that is shown like this; of what lies outside the curve's range, the nearest that is shown.
fn light_of(shown: [f64; 3]) -> [f64; 3] {
    let curve = |y: f64| {
        // y = (v² + p·v − q) / (a·v² + b·v + c), solved for v.
        let y = y.clamp(0.0, 0.999);
        let (a, b, c) = (1.0 - 0.983_729 * y, 0.024_578_6 - 0.432_951 * y, -0.000_090_537 - 0.238_081 * y);
        (-b + (b * b - 4.0 * a * c).max(0.0).sqrt()) / (2.0 * a)
    };
    times(&inverse(&INTO), times(&inverse(&BACK), shown).map(curve)).map(|v| v.max(0.0))
}

fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let at = |i: usize, k: usize| m[(r + i) % 3][(c + k) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let det: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| minor(c, r) / det))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_survives_being_shown() {
        for light in [[0.05, 0.1, 0.3], [0.3, 0.35, 0.4], [1.2, 1.0, 0.7], [0.01; 3]] {
            let found = light_of(shown(light));
            for (a, b) in found.into_iter().zip(light) {
                assert!((a / b - 1.0).abs() < 1e-4, "{found:?} instead of {light:?}");
            }
        }
    }

    #[test]
    fn a_darker_picture_tells_what_an_overexposed_one_cannot() {
        let bright = [40.0, 35.0, 30.0];
        let picture = |light: [f64; 3]| RgbImage::from_pixel(2, 1, Rgb(shown(light).map(encode)));
        let mut sky = Backdrop::read(&picture(bright), 10.0);
        sky.take_overexposed(&Backdrop::read(&picture(bright.map(|v| v / 256.0)), 18.0), 8.0);
        for (a, b) in sky.light[0].into_iter().zip(bright) {
            assert!((a / b - 1.0).abs() < 0.05, "{a} instead of {b}");
        }
    }

    /// A cloud that hides all and shines as the sky does changes nothing, and neither does none.
    #[test]
    fn clouds_are_shown_before_the_sky() {
        let sky = [0.2, 0.3, 0.5];
        let picture = RgbImage::from_pixel(4, 2, Rgb(shown(sky).map(encode)));
        let backdrop = Backdrop::read(&picture, 12.0);
        let of = |c: [f64; 4]| Rgba32FImage::from_pixel(4, 2, image::Rgba(c.map(|v| v as f32)));
        let [r, g, b] = sky.map(|v| v / backdrop.exposure);
        for cloud in [[r, g, b, 0.0], [0.0, 0.0, 0.0, 1.0], [r / 2.0, g / 2.0, b / 2.0, 0.5]] {
            let own = backdrop.show(&of(cloud));
            assert!(own.iter().zip(picture.iter()).all(|(a, b)| a.abs_diff(*b) <= 1), "{cloud:?}");
        }
        let twice = of([2.0 * r, 2.0 * g, 2.0 * b, 0.0]);
        let apart = backdrop.check(&Picture { shown: picture, cloud: twice }).unwrap();
        assert!(apart > 10.0, "{apart}");
    }
}
