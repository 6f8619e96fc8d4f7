//! Where a recipe's clouds gather, before the cover decides how many of them there are.

use super::{
    lattice::{Lattice, sin_cos, wave_vector},
    noise::{Cellular, Fractal, Octaves, hash, smoothstep, wave},
    recipe::WeatherRecipe,
};

/// What one texel is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Texel {
    /// How ready the place is for cloud, without unit: the readiest places get it.
    pub potential: f32,
    /// How tall cloud would be there (0..1).
    pub height: f32,
    /// How high its base would be (0..1).
    pub base: f32,
}

/// Noises of the map; equal ones in all threads.
pub(super) struct Fields<'a> {
    recipe: &'a WeatherRecipe,
    /// Cells of clouds, and smaller ones on their edges.
    cells: [Lattice; 2],
    warp: [Octaves; 2],
    shreds: Octaves,
    clumps: Octaves,
    streets: ([i32; 2], Octaves, Octaves),
    front: ([i32; 2], f32, Octaves),
    clearings: Lattice,
    hems: [Octaves; 2],
    ripples: ([[i32; 2]; 2], Octaves, Octaves),
    streaks: (Octaves, Octaves),
    height: Octaves,
    base: Octaves,
}

/// Each noise has a stream of random numbers of its own, so that no control changes another's noise.
#[derive(Clone, Copy)]
enum Stream {
    Cells,
    SmallCells,
    WarpU,
    WarpV,
    Shreds,
    Clumps,
    StreetBend,
    StreetBreaks,
    FrontBend,
    Clearings,
    HemU,
    HemV,
    RippleBend,
    RippleBreaks,
    StreakBend,
    Streaks,
    Height,
    Base,
}

impl<'a> Fields<'a> {
    pub fn new(recipe: &'a WeatherRecipe) -> Self {
        let r = recipe;
        let texel = f64::from(r.scale) / f64::from(r.size);
        let key = |stream: Stream| hash(r.seed, stream as u32, 0x5eed);
        // Repeats of a length in the map; what is to be seen takes four texels.
        let times = |length: f32| f64::from(r.scale) / f64::from(length).max(4.0 * texel);
        let noise = |stream, length: f32, most| {
            let turn = f64::from(key(stream) % 90);
            Octaves::new(key(stream), times(length), turn, r.size, most)
        };
        let cells = times(r.cell_size);
        let streets = times(r.street_spacing);
        let street_turn = f64::from(r.street_direction);
        let waves = times(r.ripple_wavelength);
        let ripple_turn = f64::from(r.ripple_direction);
        let (fibres, length) = (times(r.streak_width), times(r.streak_length));
        let streak_turn = f64::from(r.streak_direction);
        let front = front_vector(f64::from(r.front_direction));
        let along =
            |stream, length, width, turn, most| Octaves::stretched(key(stream), length, width, turn, r.size, most);
        Self {
            recipe,
            cells: [Lattice::hexagonal(cells, 17.0), Lattice::hexagonal(cells * 2.3, 41.0)],
            warp: [noise(Stream::WarpU, r.cell_size * 1.7, 3), noise(Stream::WarpV, r.cell_size * 1.7, 3)],
            shreds: noise(Stream::Shreds, r.cell_size * 0.6, 4),
            clumps: noise(Stream::Clumps, r.clump_size, 3),
            streets: (
                wave_vector(streets, street_turn + 90.0),
                noise(Stream::StreetBend, r.street_spacing * 4.0, 2),
                along(Stream::StreetBreaks, streets / 7.0, streets / 1.5, street_turn, 2),
            ),
            front: (front, front_length(front, r.scale), noise(Stream::FrontBend, r.scale / 3.0, 4)),
            clearings: Lattice::hexagonal(times(r.clearing_size), 7.0),
            hems: [noise(Stream::HemU, r.clearing_size * 0.6, 4), noise(Stream::HemV, r.clearing_size * 0.6, 4)],
            ripples: (
                [wave_vector(waves, ripple_turn), wave_vector(waves * 0.7, ripple_turn + 76.0)],
                noise(Stream::RippleBend, r.ripple_wavelength * 10.0, 2),
                along(Stream::RippleBreaks, waves / 1.6, waves / 4.0, ripple_turn, 3),
            ),
            streaks: (
                noise(Stream::StreakBend, r.streak_length * 0.6, 3),
                along(Stream::Streaks, length, fibres, streak_turn, 4),
            ),
            height: noise(Stream::Height, r.height_size, 3),
            base: noise(Stream::Base, r.base_size, 3),
        }
    }

    pub fn row(&self) -> Row<'_> {
        let key = |stream: Stream| hash(self.recipe.seed, stream as u32, 0x5eed);
        let spread = 1.0 - self.recipe.regularity;
        let jitter = 0.25 + 0.7 * spread;
        Row {
            recipe: self.recipe,
            cells: Cellular::new(&self.cells[0], key(Stream::Cells), jitter, spread),
            small: Cellular::new(&self.cells[1], key(Stream::SmallCells), jitter, 0.8 * spread),
            warp: [self.warp[0].reader(), self.warp[1].reader()],
            shreds: self.shreds.reader(),
            clumps: self.clumps.reader(),
            streets: (self.streets.0, self.streets.1.reader(), self.streets.2.reader()),
            front: (self.front.0, self.front.1, self.front.2.reader()),
            clearings: Cellular::new(&self.clearings, key(Stream::Clearings), 0.95, 0.0),
            hems: [self.hems[0].reader(), self.hems[1].reader()],
            ripples: (self.ripples.0, self.ripples.1.reader(), self.ripples.2.reader()),
            streaks: (self.streaks.0.reader(), self.streaks.1.reader()),
            height: self.height.reader(),
            base: self.base.reader(),
        }
    }
}

/// Of the directions whose line closes on itself after few repeats, the nearest.
fn front_vector(degrees: f64) -> [i32; 2] {
    let (sin, cos) = sin_cos(degrees);
    let cosine = |[a, b]: [i32; 2]| {
        let (a, b) = (f64::from(a), f64::from(b));
        (a * cos + b * sin) / (a * a + b * b).sqrt()
    };
    let half = [[1, 0], [2, 1], [1, 1], [1, 2], [0, 1], [-1, 2], [-1, 1], [-2, 1]];
    let all = half.iter().flat_map(|&[a, b]| [[a, b], [-a, -b]]);
    all.fold([1, 0], |best, next| if cosine(next) > cosine(best) + 1e-6 { next } else { best })
}

/// Distance from one passage of the front to the next (m).
fn front_length([x, y]: [i32; 2], scale: f32) -> f32 {
    scale / ((x * x + y * y) as f32).sqrt()
}

fn phase([x, y]: [i32; 2], [u, v]: [f32; 2]) -> f32 {
    x as f32 * u + y as f32 * v
}

/// Reads all fields, texel by texel; each thread has its own.
pub(super) struct Row<'a> {
    recipe: &'a WeatherRecipe,
    cells: Cellular<'a>,
    small: Cellular<'a>,
    warp: [Fractal<'a>; 2],
    shreds: Fractal<'a>,
    clumps: Fractal<'a>,
    streets: ([i32; 2], Fractal<'a>, Fractal<'a>),
    front: ([i32; 2], f32, Fractal<'a>),
    clearings: Cellular<'a>,
    hems: [Fractal<'a>; 2],
    ripples: ([[i32; 2]; 2], Fractal<'a>, Fractal<'a>),
    streaks: (Fractal<'a>, Fractal<'a>),
    height: Fractal<'a>,
    base: Fractal<'a>,
}

impl Row<'_> {
    pub fn at(&mut self, place: [f32; 2]) -> Texel {
        let r = self.recipe;
        let bent = self.bend(place);
        let (cells, growth) = self.cells(bent);
        let mut potential = cells;
        let mut tall = growth;
        if r.streaks > 0.0 {
            potential += (self.streaks(place) - potential) * r.streaks;
        }
        if r.ripples > 0.0 {
            potential += r.ripples * self.ripples(place);
        }
        if r.streets > 0.0 {
            potential += r.streets * self.streets(place);
        }
        if r.clumping > 0.0 {
            potential += 1.5 * r.clumping * self.clumps.at(bent);
        }
        if r.clearings > 0.0 {
            potential -= 3.0 * r.clearings * self.clearings(place);
        }
        if r.front > 0.0 {
            let (band, lane) = self.front(place);
            // Mixed, not added: else all other clouds would be thin beside the band.
            potential += r.front * (band * (1.5 - 0.6 * potential) - 1.2 * lane);
            tall += r.front * 0.8 * band;
        }
        let regional = if r.height_variation > 0.0 { 0.5 + 0.7 * self.height.at(place) } else { 0.0 };
        let height = (0.85 * tall + 0.5 * (regional - 0.4)).clamp(0.0, 1.0);
        let base = if r.base_variation > 0.0 { (0.5 + 0.6 * self.base.at(place)).clamp(0.0, 1.0) } else { 0.0 };
        Texel { potential, height, base }
    }

    /// Shifts a place so that cells lose their straight sides.
    fn bend(&mut self, place: [f32; 2]) -> [f32; 2] {
        let r = self.recipe;
        let reach = (0.1 + 0.3 * r.raggedness) * r.cell_size / r.scale;
        let [a, b] = &mut self.warp;
        [place[0] + reach * a.at(place), place[1] + reach * b.at(place)]
    }

    /// Potential of cells, about −1 to 1, and how tall they grow.
    fn cells(&mut self, place: [f32; 2]) -> (f32, f32) {
        let r = self.recipe;
        let large = self.cells.at(place);
        let small = self.small.at(place);
        let closed = large.bump;
        let wall = 1.0 - ((large.second - large.nearest) * 1.6).min(1.0);
        // Walls of open cells swell where they meet and have gaps.
        let open = wall * (0.4 + 0.8 * large.growth);
        let body = closed + (open - closed) * r.open_cells;
        let edge = 0.4 * (small.bump - 0.5) + 0.45 * self.shreds.at(place);
        // A dome over each cell, the larger the higher.
        let growth = 0.15 + 0.85 * body * (0.5 + 0.5 * large.growth);
        (2.0 * body - 1.0 + 1.2 * r.raggedness * edge, growth)
    }

    /// Rows that bend a little, thin out and end.
    fn streets(&mut self, place: [f32; 2]) -> f32 {
        let (waves, bend, breaks) = &mut self.streets;
        let turns = phase(*waves, place) + 0.22 * bend.at(place);
        0.95 * wave(turns) + 1.1 * breaks.at(place)
    }

    /// Rolls, here long and there broken into grains.
    fn ripples(&mut self, place: [f32; 2]) -> f32 {
        let (waves, bend, breaks) = &mut self.ripples;
        let bent = bend.at(place);
        let broken = breaks.at(place);
        let rolls = wave(phase(waves[0], place) + 0.6 * bent + 0.25 * broken);
        // A second train crosses the first where it is strong, and cuts the rolls into grains.
        let grains = wave(phase(waves[1], place) - 1.1 * bent + 0.45 * broken);
        1.2 * rolls + (0.45 + 0.6 * bent).clamp(0.0, 0.9) * grains + 0.5 * broken
    }

    /// Long fibres, fanned and hooked by a slow bend.
    fn streaks(&mut self, place: [f32; 2]) -> f32 {
        let r = self.recipe;
        let (bend, fibres) = &mut self.streaks;
        let bent = bend.at(place);
        let reach = 0.035 * r.streak_length / r.scale * bent;
        let there = [place[0] + reach, place[1] - reach];
        1.4 * fibres.at(there) + 0.45 * bent
    }

    /// 1 in the middle of a clearing, 0 outside.
    fn clearings(&mut self, place: [f32; 2]) -> f32 {
        let reach = 0.22 * self.recipe.clearing_size / self.recipe.scale;
        let [a, b] = &mut self.hems;
        let found = self.clearings.at([place[0] + reach * a.at(place), place[1] + reach * b.at(place)]);
        let radius = 0.2 + 0.3 * found.growth;
        1.0 - smoothstep(radius - 0.12, radius + 0.12, found.nearest)
    }

    /// How much a place lies in the front's band, and in the clear lane behind it (0..1).
    fn front(&mut self, place: [f32; 2]) -> (f32, f32) {
        let r = self.recipe;
        let (waves, length, bend) = &mut self.front;
        let width = r.front_width.min(0.25 * *length);
        let turns = phase(*waves, place) - r.front_position + 0.08 * bend.at(place);
        // Metres ahead of the line, along the way that it moves; half the way to the next front at most.
        let ahead = (turns - (turns + 0.5).floor()) * *length / width;
        let band = smoothstep(0.6, 0.35, ahead) * smoothstep(-0.9, -0.3, ahead);
        let lane = smoothstep(-0.5, -0.9, ahead) * smoothstep(-2.4, -1.2, ahead);
        (band, lane)
    }
}
