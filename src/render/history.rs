//! What a view remembers: the frames of its window, their sum, and when to start over.

use std::collections::VecDeque;

use bevy::{
    math::Vec4Swizzles,
    prelude::*,
    render::{render_resource::*, renderer::RenderDevice},
};

use super::{
    frame::offsets,
    reproject::{HeldUniform, Pose, Sparse},
    versions::Versions,
};

/// Where the coming frame stands in the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameInWindow {
    /// Frames since the history began.
    pub index: u32,
    /// Length of the window, 1 to 16.
    pub window: u32,
    /// Frames held before this one, at most `window`.
    pub held_before: u32,
    /// Exposure that the picture's radiance is multiplied with; each frame's is with that of its own.
    pub exposure: f32,
}

impl FrameInWindow {
    /// One layer more than the window, so that the frame that leaves is never the one being written.
    pub fn layers(self) -> u32 {
        self.window + 1
    }
    /// Layer of this frame.
    pub fn layer(self) -> u32 {
        self.index % self.layers()
    }
    /// Layer of the frame that leaves: `window` frames ago.
    pub fn leaving_layer(self) -> u32 {
        (self.index + 1) % self.layers()
    }
    /// Frames held once this one is added.
    pub fn held_after(self) -> u32 {
        (self.held_before + 1).min(self.window)
    }
}

/// What must stay the same for a history to be kept.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct HistoryKey {
    pub size: UVec2,
    pub viewport: UVec4,
    pub window: u32,
    pub reset: u32,
    pub versions: Versions,
    pub quality: crate::settings::CloudQuality,
    pub debug: crate::settings::CloudDebugView,
    pub atmosphere: bool,
    pub msaa: u32,
}

/// What only a picture that is carried on needs.
struct Carried {
    /// How far its texels were marched, as `pack_marched` in `held.wesl` puts it: by frame, in turn.
    marched: [TextureView; 2],
    /// Distances of the frame as marched; those of the picture are resolved with it.
    scratch: TextureView,
}

/// A view's textures and place in its window. Lives on the view's render entity.
#[derive(Component)]
pub(crate) struct CloudHistory {
    key: HistoryKey,
    pose: Pose,
    /// Poses of the frames held before this one, the latest first.
    held: VecDeque<Pose>,
    pub frame: FrameInWindow,
    frames: Texture,
    /// All layers, to be read.
    pub frames_view: TextureView,
    layer_views: Vec<TextureView>,
    /// The same of what `pack_marched` in `held.wesl` makes.
    pub marched_view: TextureView,
    marched_layers: Vec<TextureView>,
    sums: [TextureView; 2],
    carried: Option<Carried>,
    /// Of the path tracer's samples.
    moments: Option<[TextureView; 2]>,
    /// Mean cloud distance, marched limit and where cloud begins (m), in the newest frame.
    pub distances: TextureView,
    /// The picture at the viewport's size, as it is blended over the scene.
    pub resolved: TextureView,
}

impl CloudHistory {
    /// A new, empty history.
    pub fn new(device: &RenderDevice, key: HistoryKey, pose: Pose) -> Self {
        let frame = FrameInWindow { index: 0, window: key.window, held_before: 0, exposure: pose.exposure };
        let sized = |label, format, layers, size: UVec2| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let texture = |label, format, layers| sized(label, format, layers, key.size);
        let frames = texture("cloud_frames", TextureFormat::Rgba16Float, frame.layers());
        let marched = texture("cloud_marched", TextureFormat::R32Uint, frame.layers());
        let whole = |t: Texture| t.create_view(&TextureViewDescriptor::default());
        let (frames_view, layer_views) = layers(&frames);
        let (marched_view, marched_layers) = layers(&marched);
        Self {
            frames_view,
            layer_views,
            marched_view,
            marched_layers,
            held: VecDeque::with_capacity(frame.layers() as usize),
            sums: [0, 1].map(|_| whole(texture("cloud_sum", TextureFormat::Rgba32Float, 1))),
            moments: key
                .quality
                .is_path_traced()
                .then(|| [0, 1].map(|_| whole(texture("cloud_path_moments", TextureFormat::Rgba32Float, 1)))),
            distances: whole(texture("cloud_distances", TextureFormat::Rgba32Float, 1)),
            resolved: whole(sized("cloud_resolved", TextureFormat::Rgba16Float, 1, key.viewport.zw())),
            carried: key.quality.carries_picture().then(|| Carried {
                marched: [0, 1].map(|_| whole(texture("cloud_picture_marched", TextureFormat::R32Uint, 1))),
                scratch: whole(texture("cloud_scratch", TextureFormat::Rgba32Float, 1)),
            }),
            frames,
            key,
            pose,
            frame,
        }
    }

    /// Goes on to the next frame, or starts over where something changed or the last frame was not drawn.
    pub fn advance(&mut self, device: &RenderDevice, key: HistoryKey, pose: Pose, drawn: bool) {
        let path_traced = key.quality.is_path_traced();
        let same_textures =
            path_traced == self.moments.is_some() && key.quality.carries_picture() == self.carried.is_some();
        let same_size = key.size == self.key.size && key.viewport.zw() == self.key.viewport.zw();
        if !same_size || key.window != self.key.window || !same_textures {
            *self = Self::new(device, key, pose);
            return;
        }
        let exposed = pose.exposure / self.pose.exposure;
        // Path-traced frames add up without end: nothing may move at all.
        let goes_on = if path_traced { pose.stands_still(&self.pose, f32::MAX) } else { !pose.is_cut(&self.pose) };
        // Frames are half floats: what was stored a thousand times too dark has no digits left.
        let keep = drawn && key == self.key && (1e-3..1e3).contains(&exposed) && goes_on;
        self.frame = if keep {
            self.held.push_front(self.pose);
            self.held.truncate(key.window as usize);
            FrameInWindow {
                index: self.frame.index.wrapping_add(1),
                held_before: self.frame.held_after(),
                // A sum without end is of floats that hold any exposure.
                exposure: if path_traced { self.frame.exposure } else { pose.exposure },
                ..self.frame
            }
        } else {
            self.held.clear();
            FrameInWindow { index: 0, held_before: 0, exposure: pose.exposure, ..self.frame }
        };
        self.key = key;
        self.pose = pose;
    }

    /// Where the frames held before this one saw what this one sees.
    pub fn held_uniform(&self) -> HeldUniform {
        let still = self.held.front().is_some_and(|before| self.pose.stands_still(before, self.key.window as f32));
        let held = self.held.iter().enumerate().map(|(k, pose)| {
            let index = self.frame.index.wrapping_sub(k as u32 + 1);
            (pose, offsets(&self.key.quality, FrameInWindow { index, ..self.frame }))
        });
        HeldUniform::new(&self.pose, held, still, self.sparse(), self.key.quality.samples_kept())
    }

    /// Which texels this frame marches.
    fn sparse(&self) -> Sparse {
        Sparse::new(self.key.quality.block_side(), self.frame.index, self.key.size)
    }

    /// Rays along each side that cover what this frame marches.
    pub fn rays(&self) -> UVec2 {
        let side = self.key.quality.block_side();
        (self.key.size + side - 1) / side
    }

    /// Marched size.
    pub fn size(&self) -> UVec2 {
        self.key.size
    }
    /// Size of the viewport.
    pub fn viewport_size(&self) -> UVec2 {
        self.key.viewport.zw()
    }
    /// Where this frame is marched to.
    pub fn newest(&self) -> &TextureView {
        &self.layer_views[self.frame.layer() as usize]
    }
    /// How far this frame's texels are marched.
    pub fn marched_now(&self) -> &TextureView {
        &self.marched_layers[self.frame.layer() as usize]
    }
    /// How far the last picture's were; another texture than this frame's even where there was none.
    pub fn marched_before(&self) -> &TextureView {
        if let Some(carried) = &self.carried {
            return &carried.marched[(self.frame.index & 1) as usize];
        }
        let layers = self.frame.layers();
        &self.marched_layers[((self.frame.layer() + layers - 1) % layers) as usize]
    }
    /// How far the texels of the picture with this frame are, where one is carried on.
    pub fn marched_after(&self) -> Option<&TextureView> {
        Some(&self.carried.as_ref()?.marched[(self.frame.index & 1 ^ 1) as usize])
    }
    /// Where the march writes distances.
    pub fn marched_distances(&self) -> &TextureView {
        self.carried.as_ref().map_or(&self.distances, |carried| &carried.scratch)
    }
    /// The sum before this frame.
    pub fn sum_before(&self) -> &TextureView {
        &self.sums[(self.frame.index & 1) as usize]
    }
    /// The sum with this frame.
    pub fn sum_after(&self) -> &TextureView {
        &self.sums[(self.frame.index & 1 ^ 1) as usize]
    }
    /// The path tracer's moments before and with this frame.
    pub fn moments(&self) -> Option<[&TextureView; 2]> {
        let [even, odd] = self.moments.as_ref()?;
        Some(if self.frame.index & 1 == 0 { [even, odd] } else { [odd, even] })
    }
    /// The newest frame, to be copied.
    pub fn newest_copy(&self) -> TexelCopyTextureInfo<'_> {
        TexelCopyTextureInfo { origin: Origin3d { x: 0, y: 0, z: self.frame.layer() }, ..self.frames.as_image_copy() }
    }
}

/// A view of all layers, and one of each.
fn layers(texture: &Texture) -> (TextureView, Vec<TextureView>) {
    let all = TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() };
    let one = |i| {
        texture.create_view(&TextureViewDescriptor {
            dimension: Some(TextureViewDimension::D2),
            base_array_layer: i,
            array_layer_count: Some(1),
            ..default()
        })
    };
    (texture.create_view(&all), (0..texture.depth_or_array_layers()).map(one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_never_meet() {
        for window in 1..=16 {
            for index in 0..100 {
                let f = FrameInWindow { index, window, held_before: window, exposure: 1.0 };
                assert_ne!(f.layer(), f.leaving_layer());
                if index >= window {
                    let left = FrameInWindow { index: index - window, ..f };
                    assert_eq!(f.leaving_layer(), left.layer());
                }
            }
        }
    }
}
