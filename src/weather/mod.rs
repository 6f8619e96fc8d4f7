//! Weather maps made on the CPU: where cloud is, how tall it grows and how high its base is.
//!
//! This module knows no renderer. A [`WeatherRecipe`] makes a [`WeatherMap`] from a few numbers, and a picture that was
//! painted or loaded becomes one as well.

mod convert;
mod fields;
mod generate;
mod lattice;
mod map;
mod noise;
mod recipe;

pub use convert::WeatherMapError;
pub use map::WeatherMap;
pub use recipe::WeatherRecipe;
