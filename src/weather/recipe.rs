//! A few numbers that a weather map is made from.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::settings::{SettingsError, Validate};

/// What a weather map is made from: `generate` makes it.
///
/// Lengths in metres. A direction is in degrees, 0 along the map's u (world +x) and 90 along its v (world +z). Sizes and
/// directions are rounded to the nearest ones that make the map repeat without a seam, so the coarser a thing is against
/// `scale`, the coarser its steps.
///
/// Costs are of `size` alone: 512² texels take about a quarter of a second of one processor core, and four times as many four
/// times as long. What a control adds is not computed where it is 0.
#[derive(Reflect, Serialize, Deserialize, Clone, PartialEq, Debug)]
#[reflect(Default, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct WeatherRecipe {
    /// Another seed gives another map of the same kind. Default 1.
    #[reflect(@0..=4_294_967_295_u32)]
    pub seed: u32,
    /// Texels a side: a power of two. Default 512.
    #[reflect(@64..=2048_u32)]
    pub size: u32,
    /// Side of one repeat of the map (m). Default 40 000.
    #[reflect(@500.0..=1_000_000.0_f32)]
    pub scale: f32,
    /// Share of the sky that has cloud, in eighths (oktas): exactly that share of the texels has coverage above 0. Default 3.
    /// Above 7 the thinnest places thicken too, and at 8 none is thin.
    #[reflect(@0.0..=8.0_f32)]
    pub cover: f32,
    /// Width of a cloud cell, from its centre to the next (m). Default 1800. At least four texels.
    #[reflect(@50.0..=200_000.0_f32)]
    pub cell_size: f32,
    /// 0: cells of all sizes, scattered, as cumulus. 1: equal cells, closely packed, as stratocumulus. Default 0.25.
    #[reflect(@0.0..=1.0_f32)]
    pub regularity: f32,
    /// 0: cloud in the middle of cells (closed cells, cumulus). 1: cloud along the walls between them, and their middles
    /// clear (open cells, as in cold air over a warm sea). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub open_cells: f32,
    /// How broken outlines are: 0 smooth, 1 ragged with shreds. Default 0.5.
    #[reflect(@0.0..=1.0_f32)]
    pub raggedness: f32,
    /// How gently coverage rises from a cloud's edge: at 0 it is full close by, at 1 only in the middle of the largest.
    /// Default 0.6.
    #[reflect(@0.0..=1.0_f32)]
    pub softness: f32,
    /// Strength of cloud streets, rows along the wind (0..1). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub streets: f32,
    /// Direction that streets run along (degrees). Default 0.
    #[reflect(@-360.0..=360.0_f32)]
    pub street_direction: f32,
    /// Distance from one street to the next (m); in nature two to four times the height of the cloud base. Default 4000.
    #[reflect(@100.0..=200_000.0_f32)]
    pub street_spacing: f32,
    /// How much clouds gather into groups (0..1). Default 0.35.
    #[reflect(@0.0..=1.0_f32)]
    pub clumping: f32,
    /// Size of a group (m). Default 10 000.
    #[reflect(@200.0..=1_000_000.0_f32)]
    pub clump_size: f32,
    /// Strength of a front: a wide band of solid, tall cloud, a clear lane behind it, then the other clouds (0..1).
    /// Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub front: f32,
    /// Where the front crosses the map, in repeats (0..1). Default 0.5.
    #[reflect(@0.0..=1.0_f32)]
    pub front_position: f32,
    /// Direction that the front moves in, at a right angle to its line (degrees); rounded to the nearest of sixteen whose lines
    /// close on themselves. Default 0.
    #[reflect(@-360.0..=360.0_f32)]
    pub front_direction: f32,
    /// Width of the front's band (m); at most a quarter of a repeat. Default 6000.
    #[reflect(@200.0..=250_000.0_f32)]
    pub front_width: f32,
    /// Strength of clearings, wide holes where cloud is missing (0..1). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub clearings: f32,
    /// Distance from one clearing to the next (m). Default 15 000.
    #[reflect(@200.0..=1_000_000.0_f32)]
    pub clearing_size: f32,
    /// How much lower than the layer's greatest height clouds may stay (0..1): 0 all equally tall. Default 0.6.
    #[reflect(@0.0..=1.0_f32)]
    pub height_variation: f32,
    /// Size of regions where clouds grow tall or stay low (m). Default 8000.
    #[reflect(@200.0..=1_000_000.0_f32)]
    pub height_size: f32,
    /// How much of the layer's greatest rise of the base is used (0..1): 0 all bases at one altitude. Default 0.2.
    #[reflect(@0.0..=1.0_f32)]
    pub base_variation: f32,
    /// Size of regions with high or low bases (m). Default 12 000.
    #[reflect(@200.0..=1_000_000.0_f32)]
    pub base_size: f32,
    /// Strength of ripples: the short parallel rolls of a mackerel sky (0..1). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub ripples: f32,
    /// Distance from one ripple to the next (m). Default 900. At least four texels.
    #[reflect(@50.0..=50_000.0_f32)]
    pub ripple_wavelength: f32,
    /// Direction from one ripple to the next (degrees), across their crests. Default 0.
    #[reflect(@-360.0..=360.0_f32)]
    pub ripple_direction: f32,
    /// Strength of streaks: cells give way to long fibres, as of cirrus (0..1). Default 0.
    #[reflect(@0.0..=1.0_f32)]
    pub streaks: f32,
    /// Width of a streak (m). Default 1200. At least four texels.
    #[reflect(@50.0..=200_000.0_f32)]
    pub streak_width: f32,
    /// Length of a streak (m). Default 15 000.
    #[reflect(@100.0..=1_000_000.0_f32)]
    pub streak_length: f32,
    /// Direction that streaks run along (degrees). Default 0.
    #[reflect(@-360.0..=360.0_f32)]
    pub streak_direction: f32,
}

impl Default for WeatherRecipe {
    fn default() -> Self {
        Self {
            seed: 1,
            size: 512,
            scale: 40_000.0,
            cover: 3.0,
            cell_size: 1800.0,
            regularity: 0.25,
            open_cells: 0.0,
            raggedness: 0.5,
            softness: 0.6,
            streets: 0.0,
            street_direction: 0.0,
            street_spacing: 4000.0,
            clumping: 0.35,
            clump_size: 10_000.0,
            front: 0.0,
            front_position: 0.5,
            front_direction: 0.0,
            front_width: 6000.0,
            clearings: 0.0,
            clearing_size: 15_000.0,
            height_variation: 0.6,
            height_size: 8000.0,
            base_variation: 0.2,
            base_size: 12_000.0,
            ripples: 0.0,
            ripple_wavelength: 900.0,
            ripple_direction: 0.0,
            streaks: 0.0,
            streak_width: 1200.0,
            streak_length: 15_000.0,
            streak_direction: 0.0,
        }
    }
}

impl Validate for WeatherRecipe {
    const ROOT: &'static str = "weather";

    fn validate_relations(&self) -> Result<(), SettingsError> {
        if !self.size.is_power_of_two() {
            let field = "weather.size".to_owned();
            return Err(SettingsError::NotPowerOfTwo { field, value: self.size, min: 64, max: 2048 });
        }
        Ok(())
    }
}
