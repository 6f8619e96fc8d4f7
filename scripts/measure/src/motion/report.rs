//! The report on motion.

use super::{
    Results,
    judge::{CONVERGED, Judged, Moved, Row},
    plan::{FLICKER_FRAMES, FLICKERS},
};
use crate::{
    engine::title,
    markdown::{maybe, number, table, zoomed},
};

/// How far a moving frame's FLIP may be above that of the same mode at rest.
const TARGET: f64 = 0.05;

const HEAD: &str = "# In motion

How well each way of combining frames (`quality.temporal`) holds up while the camera, the sun and the clouds move, how much
a picture that hardly changes flickers, and what it costs. Written by `scripts/report motion`; edit that, not this file.
";

const COLUMNS: &str = "
| Column | Meaning |
|---|---|
| at rest | FLIP to a converged still (`CONVERGED`), over the cloud: the same mode, nothing moving. Mean over the instants judged |
| moving | the same of a frame in motion, against a converged still of its instant |
| above rest | the difference: what the motion costs |
| worst | the same at the instant where it is greatest. Bold where it is over the target |
| march, all | GPU time of the march, and of all our passes, in motion (ms a frame) |
";

pub fn write(results: &Results) -> String {
    let machine = &results.machine;
    let mut text = format!(
        "{HEAD}\nMeasured {} at commit {} on {}, {}: pictures of {}{}, preset {}, {}60 frames a second, {} min {} s in \
         all. {}\n\nTarget: moving at most {TARGET} above rest, at every instant.\n{}",
        machine.date,
        machine.commit,
        machine.adapter,
        machine.processor,
        results.size,
        zoomed(results.zoom),
        results.preset.map_or_else(|| "of its own".to_owned(), title),
        if results.sky { "" } else { "over a plain sky in place of Bevy's, " },
        results.seconds / 60,
        results.seconds % 60,
        machine.about_times(),
        COLUMNS.replace("CONVERGED", CONVERGED),
    );
    for moved in &results.motions {
        text += &of_motion(moved, &results.modes);
    }
    if let Some(flicker) = &results.flicker {
        text += &of_flicker(flicker, &results.modes);
    }
    text
}

fn of_motion(Moved { motion, rows, through }: &Moved, modes: &[String]) -> String {
    let instants = motion.judged.iter().zip(through).map(|(k, through)| format!("{k} ({})", number(*through)));
    let lines: Vec<Vec<String>> = modes.iter().zip(rows).map(|(mode, row)| line(mode, row)).collect();
    format!(
        "\n## {}: {}\n\nJudged after so many frames (in brackets: mean transmittance of the view): {}.\n\n{}",
        motion.name,
        motion.what,
        instants.collect::<Vec<_>>().join(", "),
        table(&["", "at rest", "moving", "above rest", "worst", "march", "all"], &lines)
    )
}

fn line(name: &str, row: &Row) -> Vec<String> {
    let worst = row.worst().map(|(_, judged)| judged.above_rest());
    let shown = maybe(worst);
    vec![
        name.to_owned(),
        number(row.mean(|judged| judged.still)),
        number(row.mean(|judged| judged.moving)),
        number(row.mean(Judged::above_rest)),
        if worst.is_some_and(|worst| worst > TARGET) { format!("**{shown}**") } else { shown },
        maybe(row.march),
        maybe(row.total),
    ]
}

fn of_flicker(flicker: &[Vec<f64>], modes: &[String]) -> String {
    let mut text = format!(
        "\n## Flicker\n\nStandard deviation over {FLICKER_FRAMES} frames in a row of a pixel's brightness as shown, over the \
         mean brightness. What really moves in that time is far less than a pixel.\n\n| View | |\n|---|---|\n"
    );
    for motion in &FLICKERS {
        text += &format!("| {} | {} |\n", motion.name, motion.what);
    }
    let lines: Vec<Vec<String>> = modes
        .iter()
        .enumerate()
        .map(|(mode, name)| {
            let values = flicker.iter().map(|view| maybe(view.get(mode).copied()));
            [name.clone()].into_iter().chain(values).collect()
        })
        .collect();
    let head: Vec<&str> = [""].into_iter().chain(FLICKERS.iter().map(|motion| motion.name)).collect();
    text + "\n" + &table(&head, &lines)
}
