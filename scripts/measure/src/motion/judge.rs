//! Every mode at several instants of a motion, against converged stills of those instants.

use anyhow::{Context as _, Result};

use super::{
    Bench,
    plan::{MODES, Motion, Take},
};
use crate::{engine::Job, metrics::Truth, sheet};

/// The converged still: as many frames as a window holds, of half the steps of the default, which holds as many.
pub const CONVERGED: &str = "--set quality.temporal=sliding_window --set quality.window=16 --set quality.step=50 \
                         --set quality.step_growth=0.0045";
const CONVERGED_AFTER: u32 = 16;

/// One mode at one instant: FLIP to the converged still, over the cloud.
#[derive(Clone, Copy)]
pub struct Judged {
    pub still: f64,
    pub moving: f64,
}

impl Judged {
    pub fn above_rest(self) -> f64 {
        self.moving - self.still
    }
}

/// One mode in one motion.
pub struct Row {
    /// At each instant.
    pub judged: Vec<Judged>,
    /// GPU time of the march and of all our passes in motion (ms), mean over the instants.
    pub march: Option<f64>,
    pub total: Option<f64>,
}

impl Row {
    /// Mean over the instants.
    pub fn mean(&self, of: impl Fn(Judged) -> f64) -> f64 {
        self.judged.iter().map(|judged| of(*judged)).sum::<f64>() / self.judged.len() as f64
    }

    /// The instant at which motion costs most.
    pub fn worst(&self) -> Option<(usize, Judged)> {
        let by_cost = |a: &(usize, Judged), b: &(usize, Judged)| a.1.above_rest().total_cmp(&b.1.above_rest());
        self.judged.iter().copied().enumerate().max_by(by_cost)
    }
}

/// One motion.
pub struct Moved {
    pub motion: &'static Motion,
    /// One for each mode.
    pub rows: Vec<Row>,
    /// How much of the sky is seen through the clouds, at each instant.
    pub through: Vec<f64>,
}

pub fn job(motion: &Motion, mode: usize, instant: u32, what: &str) -> String {
    format!("{}_{mode}_{instant}_{what}", motion.name)
}

const TRUTH: usize = MODES.len();

fn jobs(bench: &Bench, take: &Take) -> Result<Vec<Job>> {
    let motion = take.motion;
    let mut jobs = Vec::new();
    for k in motion.judged {
        let still = format!("{} {}", take.at(i64::from(*k))?, bench.sky());
        let new = |name, options, frames| Job { name, options, frames, picture: true };
        jobs.push(new(job(motion, TRUTH, *k, "truth"), format!("{still} {CONVERGED}"), CONVERGED_AFTER));
        for (mode, way) in MODES.iter().enumerate() {
            let moving = format!("{} {} {}", take.coming_to(*k, way.memory)?, bench.sky(), way.options);
            jobs.push(new(job(motion, mode, *k, "moving"), moving, way.memory));
            jobs.push(new(job(motion, mode, *k, "still"), format!("{still} {}", way.options), way.memory));
        }
    }
    Ok(jobs)
}

pub fn measure(bench: &Bench, motion: &'static Motion) -> Result<Moved> {
    let scene = motion.scene;
    let effective = &bench.engine.effective(&format!("--scene {scene}"))?;
    let take = Take { motion, effective, zoom: bench.zoom };
    bench.engine.render(scene, &bench.size, &jobs(bench, &take)?, &bench.progress)?;
    let picture = |mode, k: u32, what: &str| bench.picture(scene, &job(motion, mode, k, what), effective);
    let truths = motion.judged.iter().map(|k| Truth::exact(picture(TRUTH, *k, "truth")?));
    let truths: Vec<Truth> = truths.collect::<Result<_>>()?;
    let (mut rows, mut pictures) = (Vec::new(), Vec::new());
    for mode in 0..MODES.len() {
        let (mut judged, mut march, mut total) = (Vec::new(), Vec::new(), Vec::new());
        for (k, truth) in motion.judged.iter().zip(&truths) {
            let of = |what| Ok::<_, anyhow::Error>(truth.judge(&picture(mode, *k, what)?)?.0.flip);
            judged.push(Judged { still: of("still")?, moving: of("moving")? });
            let cost = bench.engine.cost(scene, &job(motion, mode, *k, "moving"))?;
            march.push(cost.march());
            total.push(cost.total());
        }
        let row = Row { judged, march: mean(march), total: mean(total) };
        // Of the worst instant.
        let (i, _) = row.worst().with_context(|| format!("{}: no instant is judged", motion.name))?;
        let [still, moving] = ["still", "moving"].map(|what| picture(mode, motion.judged[i], what));
        let (still, moving) = (still?, moving?);
        let map = truths[i].judge(&moving)?.1.magma;
        pictures.push(vec![truths[i].picture().shown.clone(), still.shown, moving.shown, map]);
        rows.push(row);
    }
    sheet::write(&bench.engine.out.join(format!("{}.png", motion.name)), &pictures)?;
    let through = truths.iter().map(seen_through).collect();
    Ok(Moved { motion, rows, through })
}

/// Mean transmittance.
fn seen_through(truth: &Truth) -> f64 {
    let cloud = &truth.picture().cloud;
    let sum: f64 = cloud.pixels().map(|p| f64::from(p.0[3])).sum();
    sum / f64::from(cloud.width() * cloud.height()).max(1.0)
}

/// The mean, where all are known.
fn mean(values: Vec<Option<f64>>) -> Option<f64> {
    let count = values.len();
    let known: Vec<f64> = values.into_iter().collect::<Option<_>>()?;
    (count > 0).then(|| known.iter().sum::<f64>() / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_instant_is_where_motion_costs_most() {
        let judged = [(0.1, 0.12), (0.02, 0.08), (0.3, 0.31)].map(|(still, moving)| Judged { still, moving }).to_vec();
        let row = Row { judged, march: None, total: None };
        assert_eq!(row.worst().map(|(i, _)| i), Some(1));
        assert!((row.mean(Judged::above_rest) - 0.03).abs() < 1e-9);
        assert_eq!(mean(vec![Some(1.0), Some(3.0)]), Some(2.0));
        assert_eq!(mean(vec![Some(1.0), None]), None);
        assert_eq!(mean(Vec::new()), None);
    }
}
