//! What a thing uncovers is right within four frames.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{Picture, REST, SIZE, picture, pose, quality, sky, start_over, truth};
use crate::support::{
    app::View,
    gpu::run_updates,
    scene::spawn_box,
    temporal_modes::{ALONE, Mode, all},
};

/// Columns that the box lays bare a frame.
const SPEED: u32 = 3;
/// Its right edge at first (columns).
const EDGE: u32 = 70;
/// Frames that the window holds.
const WINDOW_FRAMES: usize = 8;
/// Frames before it moves, and those it moves for.
const WARM: u32 = 24;
const FRAMES: u32 = 20;
/// Most that transmittance may have too much or too little of behind the box: more would be a ghost. One texel of sixteen
/// knows the mean of what it stands for no better than twice that.
const GHOST: f32 = 0.02;
const COARSE_GHOST: f32 = 0.04;

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

/// A mode whose picture is coarser than the truth cannot be right: it has to be no worse than this many times what it shows
/// where there never was a box.
const AS_IF_OPEN: f32 = 1.2;

/// Frames after which what was uncovered has to be right, and the most that errors may then be, in those of single frames.
fn due(mode: Mode) -> (usize, f32) {
    match mode {
        (TemporalMode::Off, _) => (1, 1.0),
        // As the mean of four frames.
        (TemporalMode::SlidingWindow | TemporalMode::Exponential, _) => (4, 0.5),
        // Marched at once, and then no oftener than all else: as right as a single frame.
        (TemporalMode::Upscale, UpscaleBlock::Two) => (4, 1.0),
        (TemporalMode::Upscale, UpscaleBlock::Four) => (1, 1.2),
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
            let (due, most) = due(mode);
            let settled: Vec<(usize, &Bare)> =
                ages.iter().enumerate().skip(due).filter(|(_, bare)| bare.pixels > 0).collect();
            let mut whole = Bare::default();
            settled.iter().for_each(|(_, bare)| whole.add(bare));
            if mode == ALONE {
                alone = whole.means()[0];
            }
            for (age, bare) in settled {
                let [error, without, through] = bare.means();
                let what = format!("{mode:?} {resolution:?}, bare for {age} frames");
                println!("{what}: {error:.4} behind the box, {without:.4} without it, {through:.4} too much");
                let right = error < most * alone || error < AS_IF_OPEN * without;
                assert!(mode == ALONE || right, "{what}: {error}, {without} without it, single frames {alone}");
                // Nothing is left of it once frames alone, or a window of them, have passed.
                let gone = match mode.0 {
                    TemporalMode::Off => 1,
                    TemporalMode::SlidingWindow => WINDOW_FRAMES,
                    _ => usize::MAX,
                };
                assert!(age <= gone || error < 1.05 * without, "{what}: {error}, {without} without it");
            }
            let [.., through] = whole.means();
            assert!(whole.pixels > 200, "{mode:?} {resolution:?}: {} pixels", whole.pixels);
            let ghost = if mode.1 == UpscaleBlock::Four { COARSE_GHOST } else { GHOST };
            assert!(through.abs() < ghost, "{mode:?} {resolution:?}: {through} of a ghost");
        }
    }
}
