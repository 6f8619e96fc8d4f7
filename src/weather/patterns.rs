//! Recipes for skies that have a name.

use super::recipe::WeatherRecipe;

impl WeatherRecipe {
    /// Names that [`pattern`](Self::pattern) knows.
    pub const PATTERNS: [&'static str; 14] = [
        "cumulus",
        "humilis",
        "congestus",
        "streets",
        "stratocumulus",
        "open_cells",
        "stratus",
        "overcast",
        "altocumulus",
        "mackerel",
        "altostratus",
        "cirrus",
        "clearings",
        "front",
    ];

    /// The recipe of a sky as satellites see it: `cumulus` (the default recipe), `humilis`, `congestus`, `streets`,
    /// `stratocumulus` (closed cells), `open_cells`, `stratus`, `overcast`, `altocumulus`, `mackerel`, `altostratus`,
    /// `cirrus`, `clearings` or `front`.
    pub fn pattern(name: &str) -> Option<Self> {
        Self::convective_pattern(name).or_else(|| Self::layered_pattern(name))
    }

    fn convective_pattern(name: &str) -> Option<Self> {
        let cumulus = Self::default();
        Some(match name {
            "cumulus" => cumulus,
            "humilis" => Self {
                scale: 30_000.0,
                cover: 1.5,
                cell_size: 1000.0,
                clump_size: 6000.0,
                height_variation: 0.4,
                ..cumulus
            },
            "congestus" => Self {
                cover: 4.0,
                cell_size: 4000.0,
                raggedness: 0.6,
                softness: 0.8,
                clumping: 0.5,
                height_variation: 0.8,
                ..cumulus
            },
            "streets" => Self { cell_size: 1500.0, streets: 0.9, clumping: 0.25, ..cumulus },
            "open_cells" => Self {
                scale: 90_000.0,
                cover: 3.5,
                cell_size: 8000.0,
                regularity: 0.6,
                open_cells: 1.0,
                raggedness: 0.6,
                clumping: 0.45,
                clump_size: 25_000.0,
                height_size: 15_000.0,
                ..cumulus
            },
            "clearings" => Self { cover: 6.0, regularity: 0.6, clearings: 0.8, ..cumulus },
            "front" => Self { scale: 80_000.0, cover: 4.0, front: 0.9, front_width: 9000.0, ..cumulus },
            _ => return None,
        })
    }

    fn layered_pattern(name: &str) -> Option<Self> {
        let flat = Self { height_variation: 0.3, base_variation: 0.1, ..Self::default() };
        Some(match name {
            "stratocumulus" => Self {
                scale: 50_000.0,
                cover: 6.5,
                cell_size: 3000.0,
                regularity: 0.85,
                raggedness: 0.4,
                clumping: 0.25,
                ..flat
            },
            "stratus" => Self { cover: 7.6, cell_size: 6000.0, softness: 1.0, raggedness: 0.7, ..flat },
            "overcast" => Self { cover: 8.0, cell_size: 5000.0, softness: 0.8, ..flat },
            "altocumulus" => Self {
                scale: 30_000.0,
                cover: 4.5,
                cell_size: 900.0,
                regularity: 0.8,
                raggedness: 0.35,
                clumping: 0.7,
                ripples: 0.25,
                ..flat
            },
            "mackerel" => Self {
                scale: 30_000.0,
                cover: 4.5,
                cell_size: 900.0,
                regularity: 0.8,
                clumping: 0.7,
                ripples: 0.85,
                ripple_direction: 30.0,
                ..flat
            },
            "altostratus" => Self {
                scale: 80_000.0,
                cover: 8.0,
                cell_size: 14_000.0,
                softness: 1.0,
                clumping: 0.6,
                clump_size: 30_000.0,
                streaks: 0.5,
                streak_width: 4000.0,
                streak_length: 30_000.0,
                ..flat
            },
            "cirrus" => Self {
                scale: 80_000.0,
                cover: 3.0,
                softness: 1.0,
                clumping: 0.5,
                clump_size: 25_000.0,
                streaks: 1.0,
                streak_width: 1500.0,
                streak_length: 30_000.0,
                ..flat
            },
            _ => return None,
        })
    }
}
