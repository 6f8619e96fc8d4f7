//! Weather maps: made, converted, edited; and skies from reports and soundings.

pub mod convert;
mod edits;
mod maps;
#[cfg(feature = "metar")]
mod metar;
#[cfg(feature = "metar")]
mod program;
#[cfg(feature = "metar")]
mod sky;
mod steering;

use bevy_cumulus::prelude::*;

/// A small recipe: 128 texels of 200 m.
fn small() -> WeatherRecipe {
    WeatherRecipe { size: 128, scale: 25_600.0, ..Default::default() }
}

fn made(recipe: &WeatherRecipe) -> WeatherMap {
    recipe.generate().expect("a good recipe")
}

/// One channel of a map, 0 to 1, row by row.
fn channel(map: &WeatherMap, n: usize) -> Vec<f32> {
    map.texels().iter().map(|texel| f32::from(texel[n]) / 255.0).collect()
}
