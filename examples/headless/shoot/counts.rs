//! What the rays of a plan's last frame do, counted by the count views: numbers that repeat, unlike times.

use std::time::Instant;

use anyhow::{Result, anyhow, ensure};
use bevy::{
    prelude::*,
    render::{
        gpu_readback::{Readback, ReadbackComplete},
        renderer::RenderDevice,
    },
};
use bevy_cumulus::{CloudCounts, CloudFrame, prelude::*};
use half::f16;
use serde::Serialize;

use super::{BACK_WITHIN, Caught, SETTLED_FRAMES, Studio};
use crate::options::Plan;

/// Totals over the rays of one frame, means of a ray, and the most of one.
#[derive(Serialize)]
pub struct Counts {
    pub rays: u64,
    pub steps: Count,
    pub samples: Count,
    pub reads: Count,
}

#[derive(Serialize)]
pub struct Count {
    total: u64,
    mean: f64,
    most: u64,
}

impl From<CloudCounts> for Count {
    fn from(counts: CloudCounts) -> Self {
        Self { total: counts.total, mean: counts.mean(), most: counts.most }
    }
}

impl Studio {
    /// Renders the plan's frames once for each thing to be counted, and counts it in the last one.
    pub(super) fn counts(&mut self, plan: &Plan) -> Result<Counts> {
        let (width, height) = plan.size;
        let world = self.app.world_mut();
        let image = world.resource_mut::<Assets<Image>>().add(CloudFrame::image(width, height));
        world.entity_mut(self.camera).insert(CloudFrame(image.clone()));
        let views = [CloudDebugView::StepCount, CloudDebugView::SampleCount, CloudDebugView::ReadCount];
        let mut counted = Vec::new();
        for view in views {
            self.show(view);
            self.pose(plan, 0);
            self.make_ready(plan, SETTLED_FRAMES)?;
            counted.push(CloudCounts::of(&self.last_frame(plan, &image)?));
        }
        self.app.world_mut().entity_mut(self.camera).remove::<CloudFrame>();
        self.show(plan.debug);
        let [steps, samples, reads] = counted[..] else { return Err(anyhow!("--counts: a count is missing")) };
        let rays = steps.rays;
        ensure!(
            rays > 0 && samples.rays == rays && reads.rays == rays,
            "--counts: no ray was counted, or not all alike"
        );
        Ok(Counts { rays, steps: steps.into(), samples: samples.into(), reads: reads.into() })
    }

    fn show(&mut self, debug: CloudDebugView) {
        if let Some(mut view) = self.app.world_mut().get_mut::<CloudView>(self.camera) {
            view.debug = debug;
        }
    }

    /// The texels of the plan's last frame as it was marched.
    fn last_frame(&mut self, plan: &Plan, image: &Handle<Image>) -> Result<Vec<[f32; 4]>> {
        if let Some(mut view) = self.app.world_mut().get_mut::<CloudView>(self.camera) {
            view.reset += 1;
        }
        let mut asked = None;
        for k in 0..plan.frames {
            self.pose(plan, k);
            if k + 1 == plan.frames {
                let mut entity = self.app.world_mut().spawn(Readback::texture(image.clone()));
                entity.observe(|read: On<ReadbackComplete>, mut caught: ResMut<Caught>| {
                    caught.frame.get_or_insert_with(|| read.data.clone());
                });
                asked = Some(entity.id());
            }
            self.update()?;
        }
        if let Some(entity) = asked {
            self.app.world_mut().entity_mut(entity).remove::<Readback>();
        }
        let waiting_since = Instant::now();
        loop {
            if let Some(bytes) = self.app.world_mut().resource_mut::<Caught>().frame.take() {
                return Ok(texels(plan.size, &bytes));
            }
            ensure!(
                waiting_since.elapsed() < BACK_WITHIN,
                "--counts: the frame did not come back from the GPU within {} s",
                BACK_WITHIN.as_secs()
            );
            self.update()?;
        }
    }
}

/// The texels in the bytes of an `Rgba16Float` image, whose rows are padded to a multiple of 256.
fn texels((width, _): (u32, u32), bytes: &[u8]) -> Vec<[f32; 4]> {
    let row = width as usize * 8;
    let rows = bytes.chunks(RenderDevice::align_copy_bytes_per_row(row));
    let bytes = rows.flat_map(|line| &line[..row.min(line.len())]).copied().collect::<Vec<u8>>();
    let texel = |b: &[u8; 8]| [0, 2, 4, 6].map(|i| f16::from_le_bytes([b[i], b[i + 1]]).to_f32());
    bytes.as_chunks::<8>().0.iter().map(texel).collect()
}
