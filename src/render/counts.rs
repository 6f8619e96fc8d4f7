//! What the count views counted, read from a frame as it was marched.

/// What the rays of one frame did, added up: how many steps they took with
/// [`CloudDebugView::StepCount`](crate::CloudDebugView::StepCount), and so with the other count views.
///
/// Counts are whole numbers and repeat from run to run, where times do not: of the same view, settings and frame of the
/// history they are the same to the digit on one device and driver. Another may round the odd ray into one step more.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct CloudCounts {
    /// Rays marched in this frame.
    pub rays: u64,
    /// The count of all of them together.
    pub total: u64,
    /// The most that a single one counted. A ray's count ends at 4 194 303.
    pub most: u64,
}

impl CloudCounts {
    /// Adds up the RGBA texels of a [`CloudFrame`](crate::CloudFrame), of which R is the count modulo 2048, G the count
    /// over 2048, and B says which frame of the history marched it: 1 in the first, 2 in the next, up to 2047 and over again.
    /// A is 0.
    ///
    /// The newest frame is taken to be the one of the largest B: read frames that are among the first 2047 since the
    /// history began. Texels that this frame did not march (`TemporalMode::Upscale` leaves some out) are not counted.
    pub fn of(texels: &[[f32; 4]]) -> Self {
        let newest = texels.iter().map(|texel| texel[2]).fold(0.0, f32::max);
        let marched = texels.iter().filter(|texel| texel[2] == newest && newest > 0.0);
        marched.fold(Self::default(), |sum, [low, high, ..]| {
            let count = *low as u64 + 2048 * *high as u64;
            Self { rays: sum.rays + 1, total: sum.total + count, most: sum.most.max(count) }
        })
    }

    /// Mean of a ray; 0 where there was none.
    pub fn mean(&self) -> f64 {
        if self.rays == 0 { 0.0 } else { self.total as f64 / self.rays as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_make_a_count_and_only_the_newest_frame_counts() {
        let texels = [[7.0, 0.0, 3.0, 0.0], [1.0, 2.0, 3.0, 0.0], [2047.0, 2047.0, 2.0, 0.0], [0.0; 4]];
        let found = CloudCounts::of(&texels);
        assert_eq!(found, CloudCounts { rays: 2, total: 7 + 1 + 2 * 2048, most: 4097 });
        assert_eq!(found.mean(), 2052.0);
        assert_eq!(CloudCounts::of(&[[0.0; 4]; 3]), CloudCounts::default());
        assert_eq!(CloudCounts::default().mean(), 0.0);
    }
}
