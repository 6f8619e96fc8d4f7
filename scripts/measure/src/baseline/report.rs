//! The report on old and new.

use super::{COMMIT, COUNTED, Found, Results};
use crate::{
    engine::{Cost, median},
    markdown::{maybe, number, table},
};

const HEAD: &str = "# Beside commit eba2f38

What today's code costs, and what its rays do, beside the code of commit eba2f38, in the same scenes under the same presets
(those of that commit, frozen). Written by `scripts/report baseline`; edit that, not this file.
";

const TIMES: &str = "
| Column | Meaning |
|---|---|
| march, all | GPU time of the march, and of all our passes (ms a frame): median over the rounds of the median frame |
| new over old | the ratio of the two, of each round by itself: median over the rounds, and from the least to the largest |

";

const COUNTS: &str = "
Of one frame: steps of the rays, media that they sampled (towards the light too), and textures that they read; a ray's mean,
and the ratio of what all rays together count. Counts repeat to the digit from run to run of one driver.

";

pub fn write(results: &Results) -> String {
    let machine = &results.machine;
    let (rounds, about) = match results.rounds {
        0 => ("counts alone".to_owned(), String::new()),
        1 => ("one round".to_owned(), format!(" {}", machine.about_medians())),
        rounds => (format!("{rounds} rounds"), format!(" {}", machine.about_medians())),
    };
    let mut text = format!(
        "{HEAD}\nMeasured {} at commit {} beside {COMMIT} on {}, {}: pictures of {}, {rounds}, {} min {} s in all.{about}\n",
        machine.date,
        machine.commit,
        machine.adapter,
        machine.processor,
        results.size,
        results.seconds / 60,
        results.seconds % 60,
    );
    if results.rounds > 0 {
        text += &format!("\n## Times\n{TIMES}{}", times(&results.scenes));
    }
    text += &format!("\n## Counts\n{COUNTS}{}", counts(&results.scenes));
    text += "\n## Every scene's options\n\n`headless --size SIZE --frames N` and, old and new:\n\n";
    for found in &results.scenes {
        text += &format!("- {}: `{}`; `{}`\n", found.scene.name, found.scene.old, found.scene.new);
    }
    text
}

fn times(scenes: &[Found]) -> String {
    let rows = scenes.iter().map(|found| {
        let mut cells = vec![found.scene.name.to_owned()];
        for get in [Cost::march, Cost::total] {
            cells.extend([0, 1].map(|side| maybe(found.time(side, get))));
            cells.push(spread(found.ratios(get)));
        }
        cells
    });
    table(&["scene", "march, old", "new", "new over old", "all, old", "new", "new over old"], &rows.collect::<Vec<_>>())
}

/// The median, and how far the rounds lie apart.
fn spread(ratios: Vec<f64>) -> String {
    let least = ratios.iter().copied().reduce(f64::min);
    let most = ratios.iter().copied().reduce(f64::max);
    match (median(ratios), least, most) {
        (Some(middle), Some(least), Some(most)) => {
            format!("{} ({} to {})", number(middle), number(least), number(most))
        }
        _ => maybe(None),
    }
}

fn counts(scenes: &[Found]) -> String {
    let mut head = vec!["scene".to_owned(), "rays, old".to_owned(), "new".to_owned()];
    for name in COUNTED {
        head.extend([format!("{name} a ray, old"), "new".to_owned(), "new over old".to_owned()]);
    }
    let row = |found: &Found| {
        let [old, new] = &found.counts;
        let mut cells = vec![found.scene.name.to_owned(), old.rays.to_string(), new.rays.to_string()];
        for i in 0..COUNTED.len() {
            cells.extend([number(old.counts[i].mean), number(new.counts[i].mean), maybe(found.count_ratio(i))]);
        }
        cells
    };
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    table(&head, &scenes.iter().map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_names_middle_and_ends() {
        assert_eq!(spread(vec![0.5, 0.4, 0.7]), "0.50 (0.40 to 0.70)");
        assert_eq!(spread(Vec::new()), "–");
    }
}
