//! Through cloud and through the layer's shells at 2000 m/s and 60 frames a second: no frame jumps.

use bevy::prelude::*;

use super::{quality, sky};
use crate::{
    gpu::run_updates,
    modes::all,
    view::{View, cloud_pixels},
};

/// Frames that one is compared with on either side: entering thick cloud takes no more of them.
const NEAR: usize = 2;
/// Share of the brightness below which changes do not show.
const FLOOR: f32 = 1e-3;

struct Flight {
    name: &'static str,
    from: Vec3,
    pitch: f32,
    metres: Vec3,
    frames: u32,
}

const FLIGHTS: [Flight; 5] = [
    Flight {
        name: "climb",
        from: Vec3::new(0.0, 700.0, 0.0),
        pitch: -0.1,
        metres: Vec3::new(3.0, 33.2, -4.0),
        frames: 110,
    },
    Flight {
        name: "climbup",
        from: Vec3::new(0.0, 700.0, 0.0),
        pitch: 0.9,
        metres: Vec3::new(3.0, 33.2, -4.0),
        frames: 110,
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
        from: Vec3::new(0.0, 2500.0, 0.0),
        pitch: 0.7,
        metres: Vec3::new(0.0, 0.0, -33.3),
        frames: 200,
    },
    Flight {
        name: "dash2",
        from: Vec3::new(0.0, 2000.0, 0.0),
        pitch: 0.7,
        metres: Vec3::new(33.3, 0.0, 0.0),
        frames: 200,
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

#[test]
fn at_2000_m_per_s_no_frame_jumps() {
    let (mut app, view, _) = sky();
    for flight in FLIGHTS {
        for mode in all() {
            app.insert_resource(quality(mode));
            let film: Vec<[f32; 2]> = (0..flight.frames)
                .map(|k| {
                    let at = flight.from + flight.metres * k as f32;
                    let turned = Transform::from_translation(at).with_rotation(Quat::from_rotation_x(flight.pitch));
                    app.world_mut().entity_mut(view.camera).insert(turned);
                    run_updates(&mut app, 1);
                    seen(&app, &view)
                })
                .collect();
            let changes: Vec<f32> = film.windows(2).map(|w| (w[1][0] - w[0][0]).abs()).collect();
            let brightness = film.iter().map(|[light, _]| light).sum::<f32>() / film.len() as f32;
            let mut worst = (0.0_f32, 0);
            for k in NEAR..changes.len() - NEAR {
                let mut near = [&changes[k - NEAR..k], &changes[k + 1..=k + NEAR]].concat();
                near.sort_by(f32::total_cmp);
                let jump = changes[k] / near[NEAR].max(FLOOR * brightness);
                if jump > worst.0 {
                    worst = (jump, k);
                }
                if jump > 2.5 {
                    println!(
                        "   {} {mode:?} {k}: {jump:.2} {:.4?} T {:.3?}",
                        flight.name,
                        &changes[k - 2..=k + 2],
                        film[k][1]
                    );
                }
            }
            let least = film.iter().map(|f| f[1]).fold(9.0, f32::min);
            let greatest = film.iter().map(|f| f[1]).fold(0.0, f32::max);
            println!(
                "{} {mode:?}: largest change {worst:.2?} times those around; T {least:.3} to {greatest:.3}; bright {brightness:.3}",
                flight.name
            );
            if mode == crate::modes::HELD[0] {
                println!("{:.2?}", film.iter().map(|f| f[1]).collect::<Vec<_>>());
            }
        }
    }
}
