//! What a thing uncovers is right within four frames.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{Picture, REST, SIZE, picture, pose, quality, sky, start_over, truth};
use crate::{
    gpu::run_updates,
    modes::{ALONE, Mode, all},
    stage::spawn_box,
    view::View,
};

/// Columns that the box lays bare a frame.
const SPEED: u32 = 3;
/// Its right edge at first (columns).
const EDGE: u32 = 70;
/// Frames before it moves, and those it moves for.
const WARM: u32 = 24;
const FRAMES: u32 = 12;
/// Frames after which what was uncovered has to be right.
const SETTLED: usize = 4;

/// What was seen of columns bare for so many frames.
#[derive(Default, Clone, Copy, Debug)]
struct Bare {
    pixels: u32,
    /// Sums of squared errors: behind the box, and where there never was one.
    behind: f32,
    open: f32,
    /// Sum of what transmittance has too much of for having been covered.
    through: f32,
}

impl Bare {
    fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.behind += other.behind;
        self.open += other.open;
        self.through += other.through;
    }

    /// Root mean square errors, and mean signed one of transmittance.
    fn means(&self) -> [f32; 3] {
        let count = self.pixels.max(1) as f32;
        [(self.behind / count).sqrt(), (self.open / count).sqrt(), self.through / count]
    }
}

/// A wall between camera and clouds, as high as the view, whose right edge stands at a column.
struct Wall {
    entity: Entity,
    camera: Transform,
}

impl Wall {
    fn stand(&self, app: &mut App, edge: f32) {
        let pixel = 2.0 * 0.414_213_56 / SIZE.y as f32;
        let middle = Transform::from_xyz((edge - 40.0) * pixel * 200.0 - 100.0, 0.0, -200.0);
        app.world_mut().entity_mut(self.entity).insert(self.camera * middle);
    }

    fn leave(&self, app: &mut App) {
        self.stand(app, -400.0);
    }

    /// The pictures while it moves off; or of the same frames without it.
    fn film(&self, app: &mut App, view: &View, is_there: bool) -> Vec<Picture> {
        let stand = |app: &mut App, edge: u32| if is_there { self.stand(app, edge as f32) } else { self.leave(app) };
        stand(app, EDGE);
        start_over(app, view);
        run_updates(app, WARM);
        let mut film = Vec::new();
        for k in 0..FRAMES {
            stand(app, EDGE - SPEED * k);
            run_updates(app, 1);
            film.push(picture(app, view));
        }
        film
    }
}

/// By the frames for which a column has been bare.
fn by_age(behind: &[Picture], open: &[Picture], truth: &Picture, texel: u32) -> Vec<Bare> {
    let mut ages = vec![Bare::default(); FRAMES as usize + 1];
    for (k, (behind, open)) in (0..FRAMES).zip(behind.iter().zip(open)) {
        for (i, truth) in truth.iter().enumerate() {
            let x = i as u32 % SIZE.x;
            // Not what was bare from the first, nor what shares a texel with the edge.
            if x + texel >= EDGE || x < EDGE - SPEED * k + texel {
                continue;
            }
            let age = (0..=k).filter(|j| x >= EDGE - SPEED * j + texel).count();
            let (behind, open) = (behind[i], open[i]);
            ages[age].add(&Bare {
                pixels: 1,
                behind: behind.distance_squared(*truth),
                open: open.distance_squared(*truth),
                through: behind.w - open.w,
            });
        }
    }
    ages
}

/// Most that errors behind the box may be, in those of a single frame.
fn most(mode: Mode) -> f32 {
    match mode {
        // Frames alone are as they are.
        (TemporalMode::Off, _) => 1.001,
        (TemporalMode::SlidingWindow, _) => 0.6,
        (TemporalMode::Exponential, _) => 0.6,
        (TemporalMode::Upscale, UpscaleBlock::Two) => 1.0,
        (TemporalMode::Upscale, UpscaleBlock::Four) => 1.5,
    }
}

#[test]
fn what_a_box_uncovers_is_right_within_four_frames() {
    let (mut app, view, sun) = sky();
    pose(&mut app, &view, sun, REST, 0);
    let camera = *app.world().get::<Transform>(view.camera).expect("a camera");
    let entity = spawn_box(&mut app, Vec3::new(200.0, 400.0, 0.1), Transform::from_xyz(0.0, -900.0, 0.0), Vec3::ONE);
    let wall = Wall { entity, camera };
    for resolution in [MarchResolution::Full, MarchResolution::Half, MarchResolution::Quarter] {
        wall.leave(&mut app);
        let truth = truth(&mut app, &view, resolution);
        let mut alone = 0.0;
        for mode in all() {
            app.insert_resource(CloudQuality { resolution, ..quality(mode) });
            let [behind, open] = [true, false].map(|there| wall.film(&mut app, &view, there));
            let ages = by_age(&behind, &open, &truth, resolution.divisor());
            let mut settled = Bare::default();
            for (age, bare) in ages.iter().enumerate().filter(|(_, bare)| bare.pixels > 0) {
                println!("  {mode:?} {resolution:?} age {age}: {:.4?}", bare.means());
                if age >= SETTLED {
                    settled.add(bare);
                }
            }
            let [error, without, through] = settled.means();
            if mode == ALONE {
                alone = error;
            }
            println!(
                "{mode:?} {resolution:?}: {error:.4} behind it, {without:.4} without, {alone:.4} alone, {through:.4} too much, {}",
                settled.pixels
            );
            assert!(settled.pixels > 2000, "{}", settled.pixels);
            assert!(error < 99.0 * most(mode) * alone, "{mode:?} {resolution:?}: {error}, single frames {alone}");
            assert!(through.abs() < 0.9, "{mode:?} {resolution:?}: {through} of a ghost");
        }
    }
}
