//! Costa's studies (chapter 4.1): cost against eye steps, light steps, noise size and screen size.

use anyhow::{Result, anyhow};

use crate::{
    engine::{Engine, Job},
    metrics::Truth,
    progress::Progress,
};

/// One measured point.
pub struct Point {
    pub x: f64,
    /// What x is, where a number does not say it.
    pub label: String,
    /// GPU time of the march (ms).
    pub march: Option<f64>,
    /// FLIP to the last point of its line, over the cloud.
    pub flip: Option<f64>,
}

/// The points of one setting.
pub struct Line {
    pub name: String,
    pub points: Vec<Point>,
}

/// One of the studies.
pub struct Study {
    pub name: &'static str,
    pub title: &'static str,
    pub x: &'static str,
    pub lines: Vec<Line>,
}

/// What one point is rendered with.
struct Ask {
    x: f64,
    label: String,
    size: String,
    /// Options of the whole run that it is rendered in.
    shared: String,
    options: String,
}

/// As Costa's program marches: every step alike, none left out, towards the sun as well.
const PLAIN: &str = "--quality high --set quality.resolution=full --set quality.long_step=1 --set quality.step_growth=0 \
    --set quality.transmittance_stop=0 --set quality.density_skip=0 --set quality.max_steps=8192 \
    --set quality.max_distance=36000 --set quality.light_growth=1";
/// The layer's thickness in the scene (m), which the eye steps divide, and the reach of the light steps (m).
pub const THICKNESS: f64 = 2000.0;
pub const LIGHT_REACH: f64 = 1000.0;

/// Texels along a side of the noise volumes.
const NOISE: [u32; 4] = [32, 64, 128, 256];
const SCREENS: [&str; 5] = ["64x36", "96x54", "128x72", "192x108", "256x144"];
/// Costa's table 12.
const FULL_SCREENS: [&str; 13] = [
    "320x240",
    "640x360",
    "640x480",
    "800x480",
    "800x600",
    "960x540",
    "1024x768",
    "1280x720",
    "1366x768",
    "1600x900",
    "1920x1080",
    "2048x1080",
    "3840x2160",
];

fn steps(eye: f64, light: f64) -> String {
    format!(
        "{PLAIN} --set quality.step={} --set quality.light_steps={light} --set quality.light_step={}",
        THICKNESS / eye,
        LIGHT_REACH / light
    )
}

fn pixels(size: &str) -> f64 {
    size.split('x').filter_map(|side| side.parse::<f64>().ok()).product()
}

/// The names of the studies.
pub const NAMES: [&str; 4] = ["eye", "light", "noise", "screen"];

/// Title, axis and lines of a study; its points are yet to be measured.
fn plan(name: &str, size: &str, full: bool) -> Option<(&'static str, &'static str, Vec<(String, Vec<Ask>)>)> {
    let ask = |x: f64, options: String| Ask {
        x,
        label: x.to_string(),
        size: size.to_owned(),
        shared: String::new(),
        options,
    };
    Some(match name {
        "eye" => {
            let line = |light: f64| {
                let asks = [8.0, 16.0, 32.0, 64.0, 128.0].map(|eye| ask(eye, steps(eye, light)));
                (format!("{light} light steps"), asks.into())
            };
            ("Eye steps", "eye steps through the layer, straight up", vec![line(1.0), line(32.0)])
        }
        "light" => {
            let line = |eye: f64| {
                let asks = [8.0, 16.0, 32.0, 64.0].map(|light| ask(light, steps(eye, light)));
                (format!("{eye} eye steps"), asks.into())
            };
            ("Light steps", "light steps", vec![line(32.0), line(64.0)])
        }
        "noise" => {
            let asks = NOISE.map(|side| Ask {
                shared: format!("--set textures.volume_size={side}"),
                ..ask(side.into(), "--quality high".to_owned())
            });
            ("Noise size", "texels along a side of the noise volumes", vec![("High".into(), asks.into())])
        }
        "screen" => {
            let sizes: &[&str] = if full { &FULL_SCREENS } else { &SCREENS };
            let line = |quality: &str| {
                let at = |size: &&str| Ask {
                    x: pixels(size),
                    label: (*size).to_owned(),
                    size: (*size).to_owned(),
                    shared: String::new(),
                    options: format!("--quality {quality}"),
                };
                (quality.to_owned(), sizes.iter().map(at).collect())
            };
            ("Screen size", "pixels", vec![line("low"), line("high"), line("ultra")])
        }
        _ => return None,
    })
}

/// How many pictures a study takes.
pub fn count(name: &str, full: bool) -> usize {
    plan(name, "1x1", full).map_or(0, |(_, _, lines)| lines.iter().map(|(_, asks)| asks.len()).sum())
}

/// Renders a study.
pub fn measure(engine: &Engine, name: &'static str, size: &str, full: bool, progress: &Progress) -> Result<Study> {
    let (title, x, lines) = plan(name, size, full).ok_or_else(|| anyhow!("there is no study {name}"))?;
    // Pictures of unlike sizes cannot be compared: only the time counts.
    let same_size = name != "screen";
    let job = |line: usize, point: usize, ask: &Ask| -> Result<Job> {
        let frames = if same_size { engine.frames(&ask.options)? } else { super::TIMED_FRAMES };
        let name = format!("{name}_{line}_{point}");
        Ok(Job { name, options: ask.options.clone(), frames, picture: same_size })
    };
    // One process for those that share size and textures.
    let mut batches: Vec<(&str, &str, Vec<Job>)> = Vec::new();
    for (i, (_, asks)) in lines.iter().enumerate() {
        for (k, ask) in asks.iter().enumerate() {
            let job = job(i, k, ask)?;
            match batches.iter_mut().find(|(size, shared, _)| *size == ask.size && *shared == ask.shared) {
                Some((_, _, jobs)) => jobs.push(job),
                None => batches.push((&ask.size, &ask.shared, vec![job])),
            }
        }
    }
    for (size, shared, jobs) in &batches {
        engine.render_sharing(shared, super::SCENE, size, jobs, progress)?;
    }
    let mut measured = Vec::new();
    for (i, (line_name, asks)) in lines.into_iter().enumerate() {
        let last = format!("{name}_{i}_{}", asks.len() - 1);
        let finest = if same_size { Some(Truth::exact(engine.picture(super::SCENE, &last)?)?) } else { None };
        let mut points = Vec::new();
        for (k, ask) in asks.into_iter().enumerate() {
            let job = format!("{name}_{i}_{k}");
            let flip =
                |finest: &Truth| -> Result<f64> { Ok(finest.judge(&engine.picture(super::SCENE, &job)?)?.0.flip) };
            let flip = finest.as_ref().map(flip).transpose()?;
            points.push(Point { x: ask.x, label: ask.label, march: engine.cost(super::SCENE, &job)?.march(), flip });
        }
        measured.push(Line { name: line_name, points });
    }
    Ok(Study { name, title, x, lines: measured })
}
