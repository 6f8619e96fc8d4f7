//! Phase functions and octaves of the light while they change: what [`CloudLighting`]'s own fields cannot say.

use super::mix::between;
use crate::settings::{CloudLighting, CloudPhase, PhaseFunction};

/// Most phase functions that are mixed: as many as a medium may have.
const MOST: usize = 4;

/// What the light's phase function is at a time of a transition: a mixture, with a number of octaves that is not whole.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct LightMix {
    /// Phase functions and their shares, whose sum is 1. [`CloudLighting`]'s own is one of them.
    pub phases: Vec<(CloudPhase, f32)>,
    /// Octaves: the last one counts by what is over a whole number.
    pub octaves: f32,
}

impl Default for LightMix {
    fn default() -> Self {
        Self::from(&CloudLighting::default())
    }
}

impl From<&CloudLighting> for LightMix {
    fn from(lighting: &CloudLighting) -> Self {
        Self { phases: vec![(lighting.into(), 1.0)], octaves: lighting.octaves as f32 }
    }
}

impl LightMix {
    /// Whether one becomes the other by its numbers alone. One function's numbers mean nothing to another, and a table is
    /// not made anew for each frame.
    pub fn becomes(&self, other: &Self) -> bool {
        let ([(a, _)], [(b, _)]) = (&*self.phases, &*other.phases) else { return false };
        let tabulated = matches!(a.function, PhaseFunction::Mie | PhaseFunction::Ice | PhaseFunction::Table);
        a.function == b.function && !tabulated
    }

    pub fn octaves_to(&self, other: &Self, s: f64) -> f32 {
        between(self.octaves.into(), other.octaves.into(), s) as f32
    }

    /// From this mixture (s = 0) to the other (s = 1), by shares. Of more than four the smallest are left out, but never
    /// that of `shown`, which the lighting's fields name.
    pub fn crossed(&self, other: &Self, s: f64, shown: &CloudLighting) -> Self {
        let octaves = self.octaves_to(other, s);
        let mut phases: Vec<(CloudPhase, f32)> = Vec::new();
        let both = [(self, 1.0 - s), (other, s)];
        for (phase, share) in both.iter().flat_map(|(of, part)| of.phases.iter().map(|(p, x)| (*p, *x * *part as f32)))
        {
            match phases.iter_mut().find(|(known, _)| *known == phase) {
                Some((_, sum)) => *sum += share,
                None => phases.push((phase, share)),
            }
        }
        let shown = CloudPhase::from(shown);
        phases.retain(|(phase, share)| *share > 0.0 || *phase == shown);
        while phases.len() > MOST {
            let least = phases.iter().enumerate().filter(|(_, (phase, _))| *phase != shown);
            match least.min_by(|(_, a), (_, b)| a.1.total_cmp(&b.1)).map(|(i, _)| i) {
                Some(i) => phases.remove(i),
                None => break,
            };
        }
        let sum: f32 = phases.iter().map(|(_, share)| share).sum();
        if sum > 0.0 {
            phases.iter_mut().for_each(|(_, share)| *share /= sum);
        }
        Self { phases, octaves }
    }

    /// The phase functions beside the one that the lighting's fields name.
    pub fn others(&self, lighting: &CloudLighting) -> impl Iterator<Item = (CloudPhase, f32)> {
        let own = CloudPhase::from(lighting);
        self.phases.iter().copied().filter(move |(phase, _)| *phase != own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(phase: PhaseFunction, octaves: u32) -> CloudLighting {
        CloudLighting { phase, octaves, ..CloudLighting::default() }
    }

    #[test]
    fn shares_pass_from_one_to_the_other_and_a_restart_keeps_what_is_there() {
        let [a, b, c] = [PhaseFunction::Isotropic, PhaseFunction::Rayleigh, PhaseFunction::Ice].map(|f| of(f, 3));
        let [mix_a, mix_b, mix_c] = [&a, &b, &c].map(LightMix::from);
        assert!(!mix_a.becomes(&mix_b) && mix_b.becomes(&mix_b) && !mix_c.becomes(&mix_c));
        let midway = mix_a.crossed(&mix_b, 0.25, &a);
        assert_eq!(midway.phases, [((&a).into(), 0.75), ((&b).into(), 0.25)]);
        assert_eq!(midway.others(&a).collect::<Vec<_>>(), [((&b).into(), 0.25)]);
        let on = midway.crossed(&mix_c, 0.0, &a);
        assert_eq!(on.phases, midway.phases, "a restart jumps");
        let three = midway.crossed(&mix_c, 0.5, &c);
        assert_eq!(three.phases, [((&a).into(), 0.375), ((&b).into(), 0.125), ((&c).into(), 0.5)]);
        assert_eq!(midway.crossed(&mix_c, 1.0, &c), mix_c);
        // Of five the one with the least share goes, but not the one that is shown.
        let mut many = three;
        for (k, g) in [0.1, 0.2].into_iter().enumerate() {
            let next = CloudLighting { g, ..of(PhaseFunction::Schlick, 3) };
            many = many.crossed(&LightMix::from(&next), 0.05 + 0.01 * k as f64, &a);
        }
        assert_eq!(many.phases.len(), MOST);
        assert!((many.phases.iter().map(|(_, share)| share).sum::<f32>() - 1.0).abs() < 1e-6);
        assert_eq!(many.phases[0].0, (&a).into());
    }

    #[test]
    fn octaves_need_not_be_whole() {
        let [a, b] = [1, 4].map(|octaves| LightMix::from(&of(PhaseFunction::Isotropic, octaves)));
        assert_eq!([0.0, 0.5, 1.0].map(|s| a.octaves_to(&b, s)), [1.0, 2.5, 4.0]);
    }
}
