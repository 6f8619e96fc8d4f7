//! Many pictures in one go: textures are baked and pipelines made once, and timings of neighbours can be compared.

use std::{io::Write as _, path::Path};

use anyhow::{Context as _, Result, ensure};
use clap::Parser as _;

use crate::{
    options::{Options, Plan},
    output, shoot,
};

/// The plan of each line of the file.
pub fn plans(file: &Path) -> Result<Vec<Plan>> {
    let shown = file.display();
    let text = std::fs::read_to_string(file).with_context(|| format!("--batch {shown}"))?;
    let given = given_besides_batch();
    let mut plans: Vec<Plan> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().take_while(|word| !word.starts_with('#')).collect();
        if words.is_empty() {
            continue;
        }
        let at = || format!("--batch {shown}, line {number}");
        let all = given.iter().map(String::as_str).chain(words);
        let line_options = Options::try_parse_from(all).with_context(at)?;
        ensure!(line_options.batch.is_none() && !line_options.list && !line_options.effective, "{}: no picture", at());
        let plan = line_options.plan().with_context(at)?;
        ensure!(!plan.files().is_empty(), "{}: give --out, --cloud, --timings or --counts", at());
        ensure!(plan.strip.is_empty(), "{}: scene {} is a strip of pictures", at(), plan.scene.name);
        if let Some(first) = plans.first() {
            let differs = plan.differs_in_setup(first);
            ensure!(differs.is_none(), "{}: {} differs from the first picture's", at(), differs.unwrap_or_default());
        }
        plans.push(plan);
    }
    ensure!(!plans.is_empty(), "--batch {shown}: there is no picture in it");
    Ok(plans)
}

/// The command line without `--batch FILE` and `--paced`, which goes with it.
fn given_besides_batch() -> Vec<String> {
    let mut given = Vec::new();
    let mut skip = false;
    for word in std::env::args() {
        if std::mem::take(&mut skip) || word.starts_with("--batch=") || word == "--paced" {
            continue;
        }
        if word == "--batch" {
            skip = true;
        } else {
            given.push(word);
        }
    }
    given
}

/// Renders and writes all of them; each one done is a line on stdout. With `paced` each waits for a line on stdin.
pub fn shoot(plans: &[Plan], paced: bool) -> Result<()> {
    let mut count = 0;
    let wait = || -> Result<()> {
        let mut line = String::new();
        ensure!(
            !paced || std::io::stdin().read_line(&mut line)? > 0,
            "--paced: standard input ended before the last picture"
        );
        Ok(())
    };
    shoot::shoot_many(plans, wait, |plan, shot| {
        output::write(plan, shot)?;
        count += 1;
        let name = plan.files().first().map(|(_, path, _)| path.display().to_string()).unwrap_or_default();
        let mut out = std::io::stdout().lock();
        writeln!(out, "[{count}/{}] {name}", plans.len())?;
        Ok(out.flush()?)
    })
}
