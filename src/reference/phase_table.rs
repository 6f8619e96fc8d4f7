//! Phase functions from a table, in colour. Twin of `render/march/table.wesl`.

use std::f64::consts::PI;

use glam::DVec3;

/// Cells of each half of a table, forwards and backwards.
pub const HALF: usize = 512;
/// `vec4`s of a table on the GPU: see [`PhaseTable::on_gpu`].
pub const GPU_LENGTH: usize = 2 + 6 * (HALF + 1);

/// Light turned by less than this (rad) may belong to a narrow peak, which the path tracer follows in another way.
const NARROW: f64 = 0.105;
/// A peak of less than this share is left in the broad part.
const LEAST_NARROW: f64 = 0.02;

/// 1 − |cosθ| at a node: `(i/512)⁴`, so that nodes are 0.04° apart at 1°, 0.2° at 30° and 0.45° at 90°.
pub fn node(i: usize) -> f64 {
    (i as f64 / HALF as f64).powi(4)
}

/// A phase function in each colour (1/sr), linear in cosθ between its nodes. Each integrates to 1 over the sphere.
#[derive(Clone, PartialEq, Debug)]
pub struct PhaseTable {
    /// Forwards: from θ = 0 to 90°.
    front: Vec<DVec3>,
    /// Backwards: from θ = 180° to 90°.
    back: Vec<DVec3>,
}

impl PhaseTable {
    /// From values at the [`node`]s, [`HALF`] + 1 from straight on and as many from straight back, to be normalised.
    pub(crate) fn from_nodes(mut front: Vec<DVec3>, mut back: Vec<DVec3>) -> Self {
        let total = 2.0 * PI * (integral(&front, HALF) + integral(&back, HALF));
        front.iter_mut().chain(&mut back).for_each(|value| *value /= total);
        Self { front, back }
    }

    /// From a function of the angle (rad), to be normalised.
    pub fn from_fn(value: impl Fn(f64) -> DVec3) -> Self {
        // 1 − cosθ = 2 sin²(θ/2)
        let angle = |i| 2.0 * (0.5 * node(i)).sqrt().asin();
        let front = (0..=HALF).map(|i| value(angle(i))).collect();
        let back = (0..=HALF).map(|i| value(PI - angle(i))).collect();
        Self::from_nodes(front, back)
    }

    /// The phase value (1/sr) of red, green and blue.
    pub fn value(&self, cos_theta: f64) -> DVec3 {
        let half = if cos_theta >= 0.0 { &self.front } else { &self.back };
        let versine = (1.0 - cos_theta.abs()).clamp(0.0, 1.0);
        let i = ((versine.sqrt().sqrt() * HALF as f64) as usize).min(HALF - 1);
        half[i].lerp(half[i + 1], ((versine - node(i)) / (node(i + 1) - node(i))).clamp(0.0, 1.0))
    }

    /// Mean cosine ⟨cosθ⟩ of the scattering angle, by colour.
    pub fn mean_cosine(&self) -> DVec3 {
        2.0 * PI * (cosine_integral(&self.front) - cosine_integral(&self.back))
    }

    /// Mean cosine of the light in the narrow forward peak, all colours together: 0 where there is none.
    pub fn narrow_mean_cosine(&self) -> f64 {
        let share = self.narrow_share().element_sum();
        if share > 0.0 { 2.0 * PI * cosine_integral(&self.narrow()).element_sum() / share } else { 0.0 }
    }

    /// Share of the light in the narrow forward peak, by colour: what lies above the value at 6°.
    pub fn narrow_share(&self) -> DVec3 {
        let share = 2.0 * PI * integral(&self.narrow(), HALF);
        if share.element_sum() < 3.0 * LEAST_NARROW { DVec3::ZERO } else { share }
    }

    fn narrow(&self) -> Vec<DVec3> {
        let last = (0..=HALF).find(|i| node(*i) >= 1.0 - NARROW.cos()).unwrap_or(HALF);
        let level = self.front[last];
        self.front
            .iter()
            .enumerate()
            .map(|(i, value)| if i < last { (*value - level).max(DVec3::ZERO) } else { DVec3::ZERO })
            .collect()
    }

    /// As `table.wesl` reads it: the peak's share; what share of the rest goes forwards; for each node forwards the
    /// density of the peak and of the rest (each with an integral of 1), and how much of each lies before the node; for
    /// each node backwards the same of the rest.
    #[doc(hidden)]
    pub fn on_gpu(&self) -> Vec<[f32; 4]> {
        let share = self.narrow_share();
        let has_peak = share != DVec3::ZERO;
        let narrow = if has_peak { self.narrow() } else { vec![DVec3::ZERO; HALF + 1] };
        let scaled = |values: &mut dyn Iterator<Item = DVec3>, by: DVec3| -> Vec<DVec3> {
            values.map(|value| value / by).collect()
        };
        let rest = DVec3::ONE - share;
        let front = scaled(&mut self.front.iter().zip(&narrow).map(|(all, peak)| *all - *peak), rest);
        let back = scaled(&mut self.back.iter().copied(), rest);
        let narrow = scaled(&mut narrow.into_iter(), if has_peak { share } else { DVec3::ONE });
        let forwards = 2.0 * PI * integral(&front, HALF);
        let texel = |v: DVec3| v.as_vec3().extend(0.0).to_array();
        let mut out = vec![texel(share), texel(forwards)];
        let before = |values: &[DVec3]| -> Vec<DVec3> {
            let all = integral(values, HALF).max(DVec3::splat(1e-300));
            let mut sum = DVec3::ZERO;
            std::iter::once(DVec3::ZERO)
                .chain((0..HALF).map(|i| {
                    sum += cell(values, i);
                    sum / all
                }))
                .collect()
        };
        let columns = [&narrow, &front, &before(&narrow), &before(&front)];
        out.extend((0..=HALF).flat_map(|i| columns.map(|column| texel(column[i]))));
        let columns = [&back, &before(&back)];
        out.extend((0..=HALF).flat_map(|i| columns.map(|column| texel(column[i]))));
        out
    }
}

fn cell(values: &[DVec3], i: usize) -> DVec3 {
    0.5 * (values[i] + values[i + 1]) * (node(i + 1) - node(i))
}

/// Integral over 1 − |cosθ| up to a node.
fn integral(values: &[DVec3], to: usize) -> DVec3 {
    (0..to).map(|i| cell(values, i)).sum()
}

/// Integral of a half's values times |cosθ|.
fn cosine_integral(values: &[DVec3]) -> DVec3 {
    let cells = (0..HALF).map(|i| {
        let (a, b) = (1.0 - node(i), 1.0 - node(i + 1));
        // Simpson's rule, exact for the product of two lines.
        let middle = (values[i] + values[i + 1]) * (a + b);
        (a - b) / 6.0 * (values[i] * a + middle + values[i + 1] * b)
    });
    cells.sum()
}
