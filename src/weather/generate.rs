//! Recipe to map: fields, then as much cloud as the cover asks for.

use bevy::{
    prelude::*,
    tasks::{ComputeTaskPool, TaskPool},
};

use super::{
    fields::{Fields, Texel},
    map::WeatherMap,
    recipe::WeatherRecipe,
};
use crate::settings::{SettingsError, Validate};

impl WeatherRecipe {
    /// Makes the map. Equal recipes make equal maps, on every machine and with any number of threads.
    ///
    /// Uses the app's compute task pool where there is one; a large map (2048² takes seconds) belongs in a task.
    ///
    /// # Errors
    /// The first field found out of range.
    pub fn generate(&self) -> Result<WeatherMap, SettingsError> {
        self.validate()?;
        let fields = Fields::new(self);
        let texels = self.read(&fields);
        let ramp = Ramp::new(&texels, self);
        let data = texels.iter().map(|texel| self.finish(texel, &ramp)).collect();
        Ok(WeatherMap::from_texels(UVec2::splat(self.size), data))
    }

    fn read(&self, fields: &Fields) -> Vec<Texel> {
        let size = self.size as usize;
        let mut texels = vec![Texel { potential: 0.0, height: 0.0, base: 0.0 }; size * size];
        let own;
        let pool = match ComputeTaskPool::try_get() {
            Some(pool) => pool,
            None => {
                own = TaskPool::new();
                &own
            }
        };
        let rows = size.div_ceil(pool.thread_num().max(1) * 4);
        pool.scope(|scope| {
            for (band, texels) in texels.chunks_mut(rows * size).enumerate() {
                scope.spawn(async move {
                    let mut row = fields.row();
                    for (n, texel) in texels.iter_mut().enumerate() {
                        let (x, y) = (n % size, band * rows + n / size);
                        *texel = row.at([(x as f32 + 0.5) / size as f32, (y as f32 + 0.5) / size as f32]);
                    }
                });
            }
        });
        texels
    }

    fn finish(&self, texel: &Texel, ramp: &Ramp) -> [u8; 4] {
        let height = 1.0 - self.height_variation * (1.0 - texel.height);
        [ramp.coverage(texel.potential), byte(height), byte(self.base_variation * texel.base), 255]
    }
}

fn byte(x: f32) -> u8 {
    (x * 255.0 + 0.5) as u8
}

/// From potential to coverage.
struct Ramp {
    /// Only above it is cloud.
    from: f32,
    /// Where coverage is full.
    to: f32,
    /// Coverage that cloud starts at.
    floor: f32,
}

impl Ramp {
    /// Solved on the potentials as they are, so that the cover is met whatever their distribution.
    fn new(texels: &[Texel], recipe: &WeatherRecipe) -> Self {
        let mut sorted: Vec<f32> = texels.iter().map(|texel| texel.potential).collect();
        let share = f64::from(recipe.cover) / 8.0;
        let cloudy = (share * sorted.len() as f64).round() as usize;
        let mut of_highest = |n: usize| {
            let index = sorted.len().saturating_sub(n);
            match sorted.get(index) {
                None => f32::INFINITY,
                Some(_) => *sorted.select_nth_unstable_by(index, f32::total_cmp).1,
            }
        };
        let from = of_highest(cloudy);
        // The tenth of the cloud that stands out most is full even at the greatest softness.
        let top = of_highest((cloudy / 10).max(1)).max(from + 1e-3);
        let to = from + (top - from) * (0.08 + 0.92 * recipe.softness);
        Self { from, to, floor: 0.75 * (recipe.cover - 7.0).max(0.0) }
    }

    fn coverage(&self, potential: f32) -> u8 {
        if potential < self.from {
            return 0;
        }
        let rise = ((potential - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        byte(self.floor + (1.0 - self.floor) * rise).max(1)
    }
}
