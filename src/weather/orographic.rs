//! Cloud that hills make: wind lifts the air on one side and dries it on the other.

use bevy::prelude::*;
use thiserror::Error;

use super::{
    convert::picture_channel,
    map::WeatherMap,
    noise::{Octaves, smoothstep},
    steering::{LclFormula, Steering, lifting_condensation_level},
};
use crate::{
    settings::{SettingsError, Validate},
    weather::WeatherMapError,
};

/// How long cloud water takes to form and to fall or dry up (s), with which it drifts downwind: 200 to 2000 in Smith and
/// Barstad 2004; 1000 is their usual value.
const DELAY: f32 = 1000.0;

/// Heights of the ground under one repeat of a map.
#[derive(Clone, PartialEq, Debug)]
pub struct Terrain {
    size: UVec2,
    /// Row by row (m).
    heights: Vec<f32>,
}

/// Heights that are no terrain.
#[derive(Error, Clone, PartialEq, Debug)]
pub enum TerrainError {
    /// The picture cannot be read.
    #[error("terrain: {0}")]
    Picture(#[from] WeatherMapError),
    /// Not as many heights as the size asks for, or none.
    #[error("the terrain has {found} heights; {width} × {height} needs {needed}, and at least one")]
    Count {
        /// Heights across.
        width: u32,
        /// Heights down.
        height: u32,
        /// Their product.
        needed: usize,
        /// Heights given.
        found: usize,
    },
    /// A height is not a number, or infinite.
    #[error("the terrain's height at ({x}, {y}) is {value}")]
    NotFinite {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// The height.
        value: f32,
    },
    /// A setting of the air is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
}

impl Terrain {
    /// Heights (m) row by row, over one repeat of the map.
    ///
    /// # Errors
    /// [`TerrainError::Count`] or [`TerrainError::NotFinite`].
    pub fn new(size: UVec2, heights: Vec<f32>) -> Result<Self, TerrainError> {
        let needed = size.x as usize * size.y as usize;
        if needed == 0 || heights.len() != needed {
            let (width, height) = (size.x, size.y);
            return Err(TerrainError::Count { width, height, needed, found: heights.len() });
        }
        if let Some(n) = heights.iter().position(|h| !h.is_finite()) {
            let (x, y) = (n as u32 % size.x, n as u32 / size.x);
            return Err(TerrainError::NotFinite { x, y, value: heights[n] });
        }
        Ok(Self { size, heights })
    }

    /// Takes heights from the red channel of a picture in any format that a map may have: black is `low`, white `high` (m).
    ///
    /// # Errors
    /// What is wrong with the picture, or with a height.
    pub fn from_image(image: &Image, low: f32, high: f32) -> Result<Self, TerrainError> {
        let (size, red) = picture_channel(image)?;
        Self::new(size, red.into_iter().map(|share| low + (high - low) * share).collect())
    }

    /// Height (m) at a place in repeats of the map, filtered.
    pub fn height(&self, place: Vec2) -> f32 {
        let at = (place - place.floor()) * self.size.as_vec2() - 0.5;
        let (low, t) = (at.floor().as_ivec2(), at.fract_gl());
        let texel = |dx, dy| {
            let texel = (low + IVec2::new(dx, dy)).rem_euclid(self.size.as_ivec2());
            self.heights[texel.y as usize * self.size.x as usize + texel.x as usize]
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        mix(mix(texel(0, 0), texel(1, 0), t.x), mix(texel(0, 1), texel(1, 1), t.x), t.y)
    }

    /// How far the air at a place has been lifted (m): its height less the mean of the heights it came over, those of longer
    /// ago counting less. It is the source U·∇h of Smith and Barstad (2004, equation 4), followed along the wind for
    /// [`DELAY`]. `reach` is how far the air comes in that time, as a vector in repeats of the map.
    fn lift(&self, place: Vec2, reach: Vec2) -> f32 {
        const STEPS: u32 = 24;
        let (mut sum, mut weights) = (0.0, 0.0);
        for step in 0..STEPS {
            let back = 3.0 * (step as f32 + 0.5) / STEPS as f32;
            let weight = (-back).exp();
            weights += weight;
            sum += weight * self.height(place - reach * back);
        }
        self.height(place) - sum / weights
    }
}

/// Adds the cloud that `terrain` makes in this air to a map whose repeat is `scale` metres, and clears the lee.
///
/// Air that must rise by what is missing from the top of the mixed layer to its condensation level makes cloud, with its base
/// as low as it gets; air that has come down by as much has lost its cloud (foehn). Without wind nothing changes.
///
/// # Errors
/// The first setting of the air found out of range.
pub fn orographic(map: &mut WeatherMap, terrain: &Terrain, air: &Steering, scale: f32) -> Result<(), TerrainError> {
    air.validate()?;
    let wind = Vec2::from_angle(air.wind_direction.to_radians()) * air.wind_speed;
    let reach = wind * DELAY / scale;
    if !reach.is_finite() || reach == Vec2::ZERO {
        return Ok(());
    }
    let base = lifting_condensation_level(air.temperature, air.dew_point, LclFormula::default());
    let missing = (base - air.mixed_layer()).max(50.0);
    let size = map.size();
    let width = size.x as usize;
    let noise = Octaves::new(1, f64::from(scale) / 4000.0, 31.0, size.max_element(), 4);
    let mut unevenness = noise.reader();
    for (n, texel) in map.texels_mut().iter_mut().enumerate() {
        let place = (UVec2::new((n % width) as u32, (n / width) as u32).as_vec2() + 0.5) / size.as_vec2();
        // Air is not equally moist everywhere.
        let lift = terrain.lift(place, reach) + 80.0 * unevenness.at(place.to_array());
        let formed = smoothstep(0.6 * missing, 0.6 * missing + 400.0, lift);
        let dried = smoothstep(0.4 * missing + 80.0, 0.8 * missing + 300.0, -lift);
        let [coverage, height, base, free] = texel.map(f32::from);
        let coverage = coverage.max(255.0 * formed) * (1.0 - dried);
        *texel = [coverage, height, base * (1.0 - formed), free].map(|x| (x + 0.5) as u8);
    }
    Ok(())
}
