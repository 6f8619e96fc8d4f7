//! The command line, and the maps it asks for.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use anyhow::{Context as _, Result, anyhow, ensure};
use bevy::{asset::RenderAssetUsages, image::Image, math::Vec2};
use bevy_cumulus::{
    prelude::*,
    settings::Validate,
    weather::{Steering, StormCell, Terrain, metar::MetarSky},
};
use clap::{ArgGroup, Parser};
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Makes weather maps: where cloud is (red), how tall it grows (green) and how high its base is (blue).
#[derive(Parser, Debug)]
#[command(name = "weather_maps", version)]
#[command(group = ArgGroup::new("source").args(["pattern", "recipe", "metar", "steering"]))]
pub struct Options {
    /// Print the names of patterns, one a line
    #[arg(long)]
    pub list: bool,
    /// A sky that has a name (see --list)
    #[arg(long, value_name = "NAME")]
    pattern: Option<String>,
    /// A recipe, as --print prints it
    #[arg(long, value_name = "FILE.ron")]
    recipe: Option<PathBuf>,
    /// A METAR report in quotes: one map for each of its cloud groups, from low to high
    #[arg(long, value_name = "LINE")]
    metar: Option<String>,
    /// The METAR station's altitude (m)
    #[arg(long, value_name = "M", default_value_t = 0.0, requires = "metar", allow_negative_numbers = true)]
    elevation: f32,
    /// State of the air that steers the recipe
    #[arg(long, value_name = "FILE.ron")]
    steering: Option<PathBuf>,
    /// Heights under the map, black 0 m and white --peak: hills make cloud and dry it (needs --steering)
    #[arg(long, value_name = "FILE.png", requires = "steering")]
    terrain: Option<PathBuf>,
    /// Height of the terrain's white (m)
    #[arg(long, value_name = "M", default_value_t = 2000.0, requires = "terrain")]
    peak: f32,
    /// A field of the recipe, such as cover=5 or streets=0.8; any number of times
    #[arg(long, value_name = "FIELD=VALUE")]
    set: Vec<String>,
    /// Make this many maps, each with the next seed
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    count: u32,
    /// Stamp a storm: its place and radius in repeats of the map (0..1); any number of times
    #[arg(long = "storm", value_name = "U,V,RADIUS")]
    pub storms: Vec<Disc>,
    /// Clear the sky around a place, as --storm; any number of times
    #[arg(long, value_name = "U,V,RADIUS")]
    pub clear: Vec<Disc>,
    /// How softly cleared zones end (0..1)
    #[arg(long, value_name = "X", default_value_t = 0.5)]
    pub clear_softness: f32,
    /// Print the recipes
    #[arg(long)]
    pub print: bool,
    /// The map; with several, a number is put before .png
    #[arg(long, value_name = "FILE.png")]
    pub out: Option<PathBuf>,
    /// Also write a grey picture of each channel
    #[arg(long)]
    pub channels: bool,
    /// Also write a picture as from above, two repeats a side
    #[arg(long)]
    pub preview: bool,
}

/// A place and a radius, in repeats of the map.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    pub centre: Vec2,
    pub radius: f32,
}

impl FromStr for Disc {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<f32> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
        match parts[..] {
            [u, v, radius] if radius > 0.0 && parts.iter().all(|part| part.is_finite()) => {
                Ok(Self { centre: Vec2::new(u, v), radius })
            }
            _ => Err("expected three numbers U,V,RADIUS, the last above 0".to_owned()),
        }
    }
}

/// One map to make.
pub struct Job {
    pub recipe: WeatherRecipe,
    pub air: Option<Steering>,
    /// What to tell of it.
    pub note: String,
}

impl Options {
    /// The maps that are asked for, checked.
    pub fn jobs(&self) -> Result<Vec<Job>> {
        ensure!(self.out.is_some() || self.print, "nothing to do: give --out, --print or --list");
        let mut jobs = Vec::new();
        for (recipe, air, note) in self.sources()? {
            let recipe = self.with_fields(recipe)?;
            for n in 0..self.count {
                let recipe = WeatherRecipe { seed: recipe.seed.wrapping_add(n), ..recipe.clone() };
                recipe.validate()?;
                jobs.push(Job { recipe, air: air.clone(), note: note.clone() });
            }
        }
        ensure!(!jobs.is_empty(), "the METAR report has no cloud group: the sky is clear");
        Ok(jobs)
    }

    fn sources(&self) -> Result<Vec<(WeatherRecipe, Option<Steering>, String)>> {
        if let Some(line) = &self.metar {
            let sky = MetarSky::parse(line, self.elevation).context("--metar")?;
            let one = |group| {
                let recipe = sky.recipe(group);
                (recipe, None, format!(", {} at {:.0} m", sky.pattern(group), group.base))
            };
            return Ok(sky.groups.iter().map(one).collect());
        }
        if let Some(file) = &self.steering {
            let air: Steering = read_ron(file).context("--steering")?;
            let (recipe, hints) = air.steer(&WeatherRecipe::default()).context("--steering")?;
            return Ok(vec![(recipe, Some(air), format!(", {:.0} m to {:.0} m above ground", hints.base, hints.top))]);
        }
        let recipe = match (&self.recipe, &self.pattern) {
            (Some(file), _) => read_ron(file).context("--recipe")?,
            (_, Some(name)) => WeatherRecipe::pattern(name)
                .ok_or_else(|| anyhow!("--pattern {name}: it must be one of {}", WeatherRecipe::PATTERNS.join(", ")))?,
            _ => WeatherRecipe::default(),
        };
        Ok(vec![(recipe, None, String::new())])
    }

    fn with_fields(&self, recipe: WeatherRecipe) -> Result<WeatherRecipe> {
        let mut fields = serde_json::to_value(&recipe)?;
        for set in &self.set {
            let (name, text) = set.split_once('=').ok_or_else(|| anyhow!("--set {set}: expected FIELD=VALUE"))?;
            let value: Value = serde_json::from_str(text.trim()).with_context(|| format!("--set {set}"))?;
            fields[name.trim()] = value;
            // Each by itself, so that a mistake is told with its option.
            serde_json::from_value::<WeatherRecipe>(fields.clone()).with_context(|| format!("--set {set}"))?;
        }
        Ok(serde_json::from_value(fields)?)
    }

    /// The ground under the map, if there is any.
    pub fn terrain(&self) -> Result<Option<Terrain>> {
        let Some(file) = &self.terrain else { return Ok(None) };
        let shown = || format!("--terrain {}", file.display());
        let picture = image::open(file).with_context(shown)?;
        let picture = Image::from_dynamic(picture, false, RenderAssetUsages::default());
        Ok(Some(Terrain::from_image(&picture, 0.0, self.peak).with_context(shown)?))
    }

    /// A storm whose anvil goes with the wind that the recipe knows.
    pub fn storm_cell(&self, recipe: &WeatherRecipe) -> StormCell {
        StormCell { seed: recipe.seed, anvil_direction: recipe.street_direction, ..StormCell::default() }
    }
}

fn read_ron<T: DeserializeOwned>(file: &Path) -> Result<T> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    ron::from_str(&text).map_err(|error| anyhow!("{}:{}: {}", file.display(), error.span.start, error.code))
}
