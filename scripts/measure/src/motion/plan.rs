//! What is measured: motions, ways of combining frames, and views whose flicker is looked at.

use anyhow::{Context as _, Result};
use serde_json::Value;

/// Per frame at 60 frames a second.
pub struct Motion {
    pub name: &'static str,
    pub what: &'static str,
    pub scene: &'static str,
    /// Position, yaw and pitch at first; `None` for the scene's own.
    pub from: Option<[f64; 5]>,
    pub metres: [f64; 3],
    pub yaw: f64,
    /// Of the sun's elevation.
    pub sun: f64,
    /// Of the cloud clock, in a wind of 20 m/s.
    pub seconds: f64,
    /// Frames that are judged, counted from the first. Each is come to in motion.
    pub judged: &'static [u32],
}

const REST: Motion = Motion {
    name: "",
    what: "",
    scene: "ground_noon",
    from: None,
    metres: [0.0; 3],
    yaw: 0.0,
    sun: 0.0,
    seconds: 0.0,
    judged: &[60, 120],
};
const FRAME: f64 = 1.0 / 60.0;

pub const MOTIONS: [Motion; 6] = [
    Motion {
        name: "pan",
        what: "turning by 30°/s on the ground, wind",
        yaw: 0.5,
        seconds: FRAME,
        judged: &[40, 80, 120],
        ..REST
    },
    Motion {
        name: "past",
        what: "200 m/s below and past clouds",
        from: Some([0.0, 1100.0, 0.0, 0.0, 12.0]),
        metres: [0.0, 0.0, -200.0 * FRAME],
        judged: &[80, 160, 240],
        ..REST
    },
    // The edge of a cloud, 100 m deep, lies midway.
    Motion {
        name: "into",
        what: "200 m/s into a cloud",
        scene: "inside",
        from: Some([0.0, 2100.0, -2060.0, 180.0, 4.0]),
        metres: [0.0, 0.0, 200.0 * FRAME],
        judged: &[40, 60, 80, 100, 120],
        ..REST
    },
    Motion {
        name: "out",
        what: "200 m/s out of a cloud",
        scene: "inside",
        from: Some([0.0, 2100.0, -1590.0, 0.0, 4.0]),
        metres: [0.0, 0.0, -200.0 * FRAME],
        judged: &[40, 60, 80, 100, 120],
        ..REST
    },
    Motion { name: "sun", what: "a sun that climbs 15° a minute", sun: 0.25 * FRAME, ..REST },
    Motion { name: "wind", what: "a wind of 20 m/s", seconds: FRAME, ..REST },
];

/// Views that hardly change from frame to frame: what does is flicker. The frames after the one judged are looked at too.
pub const FLICKERS: [Motion; 3] = [
    Motion { name: "still", what: "nothing moves", judged: &[40], ..REST },
    Motion { name: "windy", what: "a wind of 20 m/s", seconds: FRAME, judged: &[40], ..REST },
    Motion {
        name: "far",
        what: "far clouds above the horizon, the camera creeping by 1 m/s",
        from: Some([0.0, 300.0, 0.0, 0.0, 3.0]),
        metres: [0.0, 0.0, -FRAME],
        judged: &[40],
        ..REST
    },
];
/// Frames in a row that flicker is measured by.
pub const FLICKER_FRAMES: u32 = 5;

/// A way of combining frames.
pub struct Mode {
    /// With settings in braces, as `label::fill` takes them.
    pub name: &'static str,
    pub options: &'static str,
    /// Frames after which little is left of what was before.
    pub memory: u32,
}

pub const MODES: [Mode; 5] = [
    // As many as its time is measured by: it has no memory.
    Mode { name: "Off", options: "--set quality.temporal=off", memory: 4 },
    Mode { name: "SlidingWindow({quality.window})", options: "--set quality.temporal=sliding_window", memory: 20 },
    Mode { name: "Exponential({quality.alpha})", options: "--set quality.temporal=exponential", memory: 48 },
    // The mean of eight samples, of which each texel has one in four frames, or in sixteen.
    Mode { name: "Upscale 2×2", options: "--set quality.temporal=upscale --set quality.block=two", memory: 40 },
    Mode { name: "Upscale 4×4", options: "--set quality.temporal=upscale --set quality.block=four", memory: 144 },
];

/// A motion in its scene.
pub struct Take<'a> {
    pub motion: &'a Motion,
    /// What `headless --effective` says of the scene.
    pub effective: &'a Value,
    pub zoom: f64,
}

impl Take<'_> {
    /// Options that put camera, sun and clock where they are `k` frames after the first (before it, where negative), and
    /// move nothing.
    pub fn at(&self, k: i64) -> Result<String> {
        let Self { motion, effective, zoom } = self;
        let number = |value: &Value| value.as_f64().with_context(|| format!("headless --effective: {effective}"));
        let camera = &effective["camera"];
        let own =
            [&camera["position"][0], &camera["position"][1], &camera["position"][2], &camera["yaw"], &camera["pitch"]];
        let [x, y, z, yaw, pitch] = match motion.from {
            Some(from) => from,
            None => {
                let mut from = [0.0; 5];
                for (to, value) in from.iter_mut().zip(own) {
                    *to = number(value)?;
                }
                from
            }
        };
        let fov = 2.0 * ((number(&camera["fov"])?.to_radians() / 2.0).tan() / zoom).atan().to_degrees();
        let k = k as f64;
        let [dx, dy, dz] = motion.metres;
        let (elevation, azimuth) = (number(&effective["sun"]["elevation"])?, number(&effective["sun"]["azimuth"])?);
        Ok(format!(
            "--camera {},{},{},{},{pitch},{fov} --sun {},{azimuth} --time {} --ev {} --set model.wind=20,0,0",
            x + k * dx,
            y + k * dy,
            z + k * dz,
            yaw + k * motion.yaw,
            elevation + k * motion.sun,
            k * motion.seconds,
            number(&effective["ev100"])?,
        ))
    }

    /// Options that come to frame `k` in motion, by so many frames that end there.
    pub fn coming_to(&self, k: u32, frames: u32) -> Result<String> {
        let Motion { metres: [dx, dy, dz], yaw, sun, seconds, .. } = self.motion;
        let from = self.at(i64::from(k) + 1 - i64::from(frames))?;
        Ok(format!("{from} --move {dx},{dy},{dz},{yaw},0 --sun-move {sun},0 --dt {seconds}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_still_stands_where_the_motion_ends() {
        let effective = &serde_json::json!({
            "camera": { "position": [1.0, 2.0, 3.0], "yaw": 10.0, "pitch": 5.0, "fov": 60.0 },
            "sun": { "elevation": 40.0, "azimuth": 90.0 }, "ev100": 14.0
        });
        let motion = &Motion { metres: [0.0, 1.0, 0.0], yaw: 0.5, sun: 0.25, seconds: 2.0, ..REST };
        let take = Take { motion, effective, zoom: 1.0 };
        let still = take.at(4).unwrap();
        assert!(still.starts_with("--camera 1,6,3,12,5,"), "{still}");
        assert!(still.contains("--sun 41,90 --time 8 --ev 14"), "{still}");
        // Ten frames that end there began nine before.
        let moving = take.coming_to(4, 10).unwrap();
        assert!(moving.starts_with("--camera 1,-3,3,7.5,5,"), "{moving}");
        assert!(moving.contains("--time -10 ") && moving.ends_with("--move 0,1,0,0.5,0 --sun-move 0.25,0 --dt 2"));
    }

    #[test]
    fn names_are_told_apart() {
        let mut names: Vec<&str> = MOTIONS.iter().chain(&FLICKERS).map(|motion| motion.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), MOTIONS.len() + FLICKERS.len());
    }
}
