//! Through cloud and through the layer's shells at 2000 m/s and 60 frames a second: no frame jumps.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{quality, sky, start_over};
use crate::support::{
    app::{View, cloud_pixels},
    gpu::run_updates,
    temporal_modes::{ALONE, all},
};

/// Frames that one is compared with on either side: entering thick cloud takes no more of them.
const NEAR: usize = 2;
/// Share of the brightness below which changes do not show.
const FLOOR: f32 = 1e-3;
/// Frames at rest before a flight.
const WARM: u32 = 16;

struct Flight {
    name: &'static str,
    from: Vec3,
    pitch: f32,
    metres: Vec3,
    frames: u32,
}

const FLIGHTS: [Flight; 3] = [
    // From below the lower shell through cloud and the upper shell to above it, and back; in cloud and out of it.
    Flight {
        name: "climb",
        from: Vec3::new(0.0, 700.0, 0.0),
        pitch: 0.9,
        metres: Vec3::new(3.0, 33.2, -4.0),
        frames: 90,
    },
    Flight {
        name: "descent",
        from: Vec3::new(0.0, 4200.0, 0.0),
        pitch: -0.9,
        metres: Vec3::new(4.0, -33.0, -4.0),
        frames: 110,
    },
    Flight {
        name: "dash",
        from: Vec3::new(0.0, 1400.0, 300.0),
        pitch: 0.7,
        metres: Vec3::new(0.0, 0.0, -33.3),
        frames: 120,
    },
];

/// Mean luminance of what is seen before a grey sky, in units of that sky's, and mean transmittance.
fn seen(app: &App, view: &View) -> [f32; 2] {
    const GREY: f32 = 4000.0;
    let pixels = cloud_pixels(app, view);
    let sum = pixels.iter().fold([0.0; 2], |[light, through], p| {
        let own = p.truncate().dot(Vec3::new(0.2126, 0.7152, 0.0722));
        [light + own / GREY + p.w, through + p.w]
    });
    sum.map(|sum| sum / pixels.len() as f32)
}

/// What is seen in each frame.
fn film(app: &mut App, view: &View, flight: &Flight) -> Vec<[f32; 2]> {
    let place = |app: &mut App, k: u32| {
        let at = flight.from + flight.metres * k as f32;
        let turned = Transform::from_translation(at).with_rotation(Quat::from_rotation_x(flight.pitch));
        app.world_mut().entity_mut(view.camera).insert(turned);
    };
    place(app, 0);
    start_over(app, view);
    run_updates(app, WARM);
    let frame = |k| {
        place(app, k);
        run_updates(app, 1);
        seen(app, view)
    };
    (0..flight.frames).map(frame).collect()
}

/// By how much each frame is brighter or darker than the one before.
fn changes(film: &[[f32; 2]]) -> Vec<f32> {
    film.windows(2).map(|pair| (pair[1][0] - pair[0][0]).abs()).collect()
}

/// Each frame's change over what is usual around it: the median of its neighbours' changes, or what does not show.
/// A sky that itself changes more (`alone`: frames without a past) may be shown to do so, and late.
fn jumps(changes: &[f32], alone: &[f32], brightness: f32) -> Vec<f32> {
    let jump = |k: usize| {
        let mut near = [&changes[k - NEAR..k], &changes[k + 1..=k + NEAR]].concat();
        near.sort_by(f32::total_cmp);
        let sky = alone[k.saturating_sub(LATE)..=k + 1].iter().copied().fold(0.0, f32::max);
        changes[k] / near[NEAR].max(FLOOR * brightness).max(0.5 * sky)
    };
    (NEAR..changes.len() - NEAR).map(jump).collect()
}

/// Frames by which what is held may show a change late: a texel of four by four is marched every sixteenth.
const LATE: usize = 16;

/// Most that a frame may change by, in the usual.
const MOST: f32 = 3.0;
/// The same where only some texels are marched a frame: at a cloud's edge they come in frames apart.
const MOST_UPSCALED: f32 = 6.0;

/// Whether a frame's change is the sky's own, which at a cloud's edge is quick but smooth: in eighths of the way it comes
/// in as many parts. A jump would stay whole.
fn is_smooth(app: &mut App, view: &View, flight: &Flight, k: usize, change: f32) -> bool {
    let slow =
        Flight { from: flight.from + flight.metres * k as f32, metres: flight.metres / 8.0, frames: 9, ..*flight };
    changes(&film(app, view, &slow)).iter().all(|part| *part < 0.4 * change)
}

#[test]
fn at_2000_m_per_s_no_frame_jumps() {
    let (mut app, view, _) = sky();
    let mut bad = Vec::new();
    for flight in FLIGHTS {
        let mut alone = vec![0.0; flight.frames as usize];
        for mode in all() {
            app.insert_resource(quality(mode));
            let film = film(&mut app, &view, &flight);
            let (least, most_through) =
                film.iter().fold((1.0_f32, 0.0_f32), |(least, most), [_, t]| (least.min(*t), most.max(*t)));
            let both = least < 0.3 && most_through > 0.9;
            assert!(both, "{} {mode:?}: not in cloud and out of it: {least} to {most_through}", flight.name);
            let changes = changes(&film);
            let brightness = film.iter().map(|[light, _]| light).sum::<f32>() / film.len() as f32;
            let (mut worst, mut at) = (0.0, 0);
            for (k, jump) in (NEAR..).zip(jumps(&changes, &alone, brightness)) {
                if jump > worst {
                    (worst, at) = (jump, k);
                }
                let most = if mode.0 == TemporalMode::Upscale { MOST_UPSCALED } else { MOST };
                let own = mode == ALONE && jump > most && is_smooth(&mut app, &view, &flight, k, changes[k]);
                if jump > most && !own {
                    let around = &changes[k - NEAR..=k + NEAR];
                    bad.push(format!(
                        "{} {mode:?}: frame {k} changes by {jump:.2} times those around: {around:?}",
                        flight.name
                    ));
                }
            }
            println!("{} {mode:?}: frame {at} changes by {worst:.2} times what those around do", flight.name);
            if mode == ALONE {
                alone = changes;
            }
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}
