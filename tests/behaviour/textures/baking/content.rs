//! What is in the baked textures.

use bevy::prelude::*;
use bevy_cumulus::testing::textures::{self as captured, Captured};
use bevy_cumulus::{
    settings::CloudTextures,
    textures::{CloudTextureSlot, vertical_profile},
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use super::{SMALL, baked, channel, read};

/// Largest and mean difference between the planes `at` and `at + 1` across an axis, wrapping.
fn step_between(captured: &Captured, axis: usize, at: i32, channel: usize) -> (f32, f32) {
    let size = captured.size.as_ivec3();
    let (mut most, mut sum, mut count) = (0.0_f32, 0.0, 0.0);
    let others = [(axis + 1) % 3, (axis + 2) % 3];
    for i in 0..size[others[0]] {
        for j in 0..size[others[1]] {
            let mut p = IVec3::ZERO;
            (p[axis], p[others[0]], p[others[1]]) = (at, i, j);
            let mut q = p;
            q[axis] += 1;
            let step = (captured.at(p)[channel] - captured.at(q)[channel]).abs();
            most = most.max(step);
            sum += step;
            count += 1.0;
        }
    }
    (most, sum / count)
}

/// The seam must be as smooth as the inside, judged by mean and by largest step, the latter times `room`.
fn assert_tiles(captured: &Captured, axes: usize, channel: usize, room: f32, what: &str) {
    for axis in 0..axes {
        let last = captured.size[axis] as i32 - 1;
        let inside: Vec<_> = (0..last).map(|at| step_between(captured, axis, at, channel)).collect();
        let most = inside.iter().map(|step| step.0).fold(0.0, f32::max);
        let mean = inside.iter().map(|step| step.1).fold(0.0, f32::max);
        let seam = step_between(captured, axis, last, channel);
        assert!(
            seam.0 <= most * room && seam.1 <= mean * 1.1,
            "{what}, axis {axis}, channel {channel}: steps of {seam:?} at the seam, {most} and {mean} inside"
        );
    }
}

/// A volume whose finest channel has cells of four texels: with smaller ones, in coarser mips too, noise
/// changes by half its range from texel to texel, where no seam would show.
const SEAMS: CloudTextures = CloudTextures { volume_size: 64, billow_cells: 2, wisp_cells: 2, ..SMALL };

/// Each level of each channel whose cells are at least four texels wide there: what it is, its number, and the room that
/// its largest step has: of the few texels of a mip the largest is a matter of chance.
fn resolved_channels(app: &App) -> Vec<(String, Captured, usize, f32)> {
    let mut all = Vec::new();
    for slot in [CloudTextureSlot::Billow, CloudTextureSlot::Wisp] {
        for level in 0..4_u32 {
            let captured = read(app, slot, level);
            for channel in 0..4 - level as usize {
                let room = if level == 0 { 1.02 } else { 1.3 };
                all.push((format!("{slot}, level {level}"), captured.clone(), channel, room));
            }
        }
    }
    all
}

#[test]
fn noise_volumes_and_maps_tile() {
    let app = baked(SEAMS);
    let volumes = resolved_channels(&app);
    assert_eq!(volumes.len(), 20);
    for (what, captured, channel, room) in volumes {
        assert_tiles(&captured, 3, channel, room, &what);
    }
    for slot in [CloudTextureSlot::Coverage, CloudTextureSlot::TypeMap] {
        assert_tiles(&read(&app, slot, 0), 2, 0, 1.02, &slot.to_string());
    }
}

/// Planes of a volume before `depth`, so that it ends where its noise does not.
fn cut(captured: &Captured, depth: u32) -> Captured {
    let size = captured.size.with_z(depth);
    Captured { size, texels: captured.texels[..size.element_product() as usize].to_vec() }
}

#[test]
fn the_seam_check_sees_a_seam() {
    let sees = |captured: &Captured, axes, channel, room| {
        std::panic::catch_unwind(|| assert_tiles(captured, axes, channel, room, "a seam")).is_err()
    };
    let texels = (0..32 * 32).map(|i| [((i % 32) as f32 * 0.02).sin(), 0.0, 0.0, 1.0]).collect();
    assert!(sees(&Captured { size: UVec3::new(32, 32, 1), texels }, 1, 0, 1.02), "a ramp");
    for (what, captured, channel, room) in resolved_channels(&baked(SEAMS)) {
        // Half a cell short of the whole.
        let cell = captured.size.z >> (channel + 1);
        assert!(sees(&cut(&captured, captured.size.z - cell / 2), 3, channel, room), "{what}, channel {channel}");
    }
}

fn quantile(sorted: &[f32], share: f32) -> f32 {
    sorted[((sorted.len() - 1) as f32 * share) as usize]
}

#[test]
fn every_channel_spans_its_range() {
    let app = baked(CloudTextures { volume_size: 64, ..SMALL });
    for slot in [CloudTextureSlot::Billow, CloudTextureSlot::Wisp] {
        let volume = read(&app, slot, 0);
        for k in 0..4 {
            let mut values = channel(&volume, k);
            values.sort_by(f32::total_cmp);
            let (low, mid, high) = (quantile(&values, 0.005), quantile(&values, 0.5), quantile(&values, 0.995));
            assert!(low < 0.15 && (0.4..0.6).contains(&mid) && high > 0.85, "{slot} {k}: {low} {mid} {high}");
        }
    }
    let mut types = channel(&read(&app, CloudTextureSlot::TypeMap, 0), 0);
    types.sort_by(f32::total_cmp);
    assert!(quantile(&types, 0.01) < 0.1 && quantile(&types, 0.995) > 0.7, "type map");
}

#[test]
fn the_coverage_map_is_a_sky_of_separate_clouds() {
    for seed in [1, 2] {
        let app = baked(CloudTextures { seed, map_size: 256, ..SMALL });
        let values = channel(&read(&app, CloudTextureSlot::Coverage, 0), 0);
        let share = |test: fn(f32) -> bool| values.iter().filter(|v| test(**v)).count() as f32 / values.len() as f32;
        let (clear, cloud, core) = (share(|v| v < 0.02), share(|v| v > 0.5), share(|v| v > 0.95));
        assert!((0.35..0.6).contains(&clear), "seed {seed}: {clear} of the map is clear");
        assert!((0.1..0.35).contains(&cloud), "seed {seed}: {cloud} of the map is cloud");
        assert!((0.001..0.1).contains(&core), "seed {seed}: {core} of the map is at its peak");
    }
}

/// A channel read with bilinear filtering at `uv`, wrapping.
fn bilinear(level: &Captured, uv: Vec2, channel: usize) -> f32 {
    let p = uv * level.size.xy().as_vec2() - 0.5;
    let (cell, f) = (p.floor().as_ivec2(), p - p.floor());
    let at = |x, y| level.at((cell + IVec2::new(x, y)).extend(0))[channel];
    let (top, bottom) = (at(0, 0).lerp(at(1, 0), f.x), at(0, 1).lerp(at(1, 1), f.x));
    top.lerp(bottom, f.y)
}

/// Random places: no finer or equal level may exceed the bound of a level, in `channel`, within half of its texel.
pub fn assert_bounds(app: &App, slot: CloudTextureSlot, channel: usize) {
    let levels: Vec<Captured> = (0..captured::levels(app, slot)).map(|level| read(app, slot, level)).collect();
    assert_eq!(levels.last().unwrap().size, UVec3::ONE, "{slot}: the pyramid ends at one texel");
    let mut random = StdRng::seed_from_u64(7);
    let mut tight = 0;
    for round in 0..60_000 {
        let bounding = round % levels.len();
        let finer = random.random_range(0..=bounding);
        let p = Vec2::new(random.random(), random.random());
        let size = levels[bounding].size.xy().as_vec2();
        let texel = (p * size).as_ivec2().min(size.as_ivec2() - 1);
        // The bound may be read with or without filtering.
        let filtered = bilinear(&levels[bounding], p, channel);
        let bound = filtered.min(levels[bounding].at(texel.extend(0))[channel]);
        let reach = Vec2::new(random.random_range(-0.5..=0.5), random.random_range(-0.5..=0.5));
        let value = bilinear(&levels[finer], p + reach / size, 0);
        assert!(
            value <= bound * (1.0 + 1e-6),
            "{slot}: {value} at level {finer} near {p}, above the bound {bound} of level {bounding}"
        );
        tight += u32::from(value > 0.9 * bound && bound > 0.0);
    }
    assert!(tight > 100, "{slot}: the bound is never near the value, so it licenses nothing");
}

#[test]
fn pyramids_bound_what_is_read_of_them() {
    let app = baked(SMALL);
    assert_bounds(&app, CloudTextureSlot::Coverage, 1);
    assert_bounds(&app, CloudTextureSlot::TypeMap, 1);
}

#[test]
fn the_bound_check_sees_a_bound_too_low() {
    let app = baked(SMALL);
    // Blue is the largest value under the texel alone, without those around it.
    let undilated = || assert_bounds(&app, CloudTextureSlot::Coverage, 2);
    assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(undilated)).is_err());
}

#[test]
fn volumes_have_mips_that_average() {
    let app = baked(SMALL);
    let slot = CloudTextureSlot::Billow;
    assert_eq!(captured::levels(&app, slot), 6);
    let (fine, coarse) = (read(&app, slot, 0), read(&app, slot, 1));
    assert_eq!(coarse.size, UVec3::splat(16));
    for p in [IVec3::new(0, 0, 0), IVec3::new(3, 15, 9), IVec3::new(15, 15, 15)] {
        let children = (0..8).map(|i| fine.at(2 * p + IVec3::new(i & 1, (i >> 1) & 1, i >> 2))[0]);
        let mean = children.sum::<f32>() / 8.0;
        assert!((coarse.at(p)[0] - mean).abs() < 0.51 / 255.0, "{p}: {} instead of {mean}", coarse.at(p)[0]);
    }
}

#[test]
fn the_gradient_is_the_formula() {
    let app = baked(SMALL);
    let gradient = read(&app, CloudTextureSlot::Gradient, 0);
    assert_eq!(gradient.size, UVec3::new(256, 256, 1));
    for y in 0..256 {
        for x in 0..256 {
            let expected = vertical_profile((x as f32 + 0.5) / 256.0, (y as f32 + 0.5) / 256.0);
            let found = gradient.at(IVec3::new(x, y, 0))[0];
            assert!((found - expected).abs() < 1e-3, "type {x}, height {y}: {found} instead of {expected}");
        }
    }
}
