//! MOTION.md.

use super::{FRAMES, MODES, Results, Row, STILLS, TARGET};
use crate::markdown::{maybe, number, table, zoomed};

const HEAD: &str = "# In motion

How well each way of combining frames (`quality.temporal`) holds up while the camera, the sun and the clouds move, how much
a still picture flickers, and what it costs. Written by `scripts/motion`; edit that, not this file.
";

const COLUMNS: &str = "
| Column | Meaning |
|---|---|
| at rest | FLIP to a converged still (window of 16), over the cloud: the same mode, nothing moving |
| moving | the same of the last frame of a motion, against a converged still of that instant |
| above rest | the difference: what the motion costs. Bold where it is over the target |
| flicker | how much the first motion's view changes from frame to frame at rest: standard deviation over time of a pixel's brightness as shown, over the mean |
| march, all | GPU time of the march, and of all our passes, in motion (ms a frame) |
";

pub fn write(results: &Results) -> String {
    let machine = &results.machine;
    let mut text = format!(
        "{HEAD}\nMeasured {} at commit {} on {}, {}: pictures of {}{}, preset High, {}60 frames a second, {FRAMES} frames of \
         motion, {STILLS} frames for flicker, {} min {} s in all. {}\n\nTarget: moving at most {TARGET} above rest. \n{COLUMNS}",
        machine.date,
        machine.commit,
        machine.adapter,
        machine.processor,
        results.size,
        zoomed(results.zoom),
        if results.sky { "" } else { "over a plain sky in place of Bevy's, " },
        results.seconds / 60,
        results.seconds % 60,
        machine.about_times(),
    );
    for (motion, rows) in &results.motions {
        text += &format!("\n## {}: {}\n\n", motion.name, motion.what);
        let lines: Vec<Vec<String>> = MODES.iter().zip(rows).map(|((name, _), row)| line(name, row)).collect();
        text += &table(&["", "at rest", "moving", "above rest", "flicker", "march", "all"], &lines);
    }
    text
}

fn line(name: &str, row: &Row) -> Vec<String> {
    let above = row.moving - row.still;
    let above = if above > TARGET { format!("**{}**", number(above)) } else { number(above) };
    vec![
        name.to_owned(),
        number(row.still),
        number(row.moving),
        above,
        maybe(row.flicker),
        maybe(row.march),
        maybe(row.total),
    ]
}
