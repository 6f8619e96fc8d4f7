//! Weather maps made on the CPU: where cloud is, how tall it grows and how high its base is.
//!
//! This module knows no renderer. A [`WeatherRecipe`] makes a [`WeatherMap`] from a few numbers; a picture that was painted or
//! loaded becomes one with [`WeatherMap::from_image`]. [`Steering`] makes the numbers from the state of the air,
//! [`orographic`] adds the cloud that hills make, and [`metar`] reads a sky from an airport's report.

mod aloft;
mod convert;
mod edit;
mod fields;
mod generate;
mod lattice;
mod map;
#[cfg(feature = "metar")]
pub mod metar;
mod noise;
mod orographic;
mod patterns;
mod pyramid;
mod recipe;
mod sky;
mod steering;
mod swirl;

pub use aloft::WindProfile;
pub use convert::WeatherMapError;
pub use edit::StormCell;
pub use map::WeatherMap;
pub use orographic::{Terrain, TerrainError, orographic};
pub(crate) use pyramid::WeatherPyramid;
pub use recipe::WeatherRecipe;
pub use steering::{LayerHints, LclFormula, Steering, lifting_condensation_level, relative_humidity, stratiform_cover};
pub(crate) use swirl::{SWIRL_SIZE, Swirl};
