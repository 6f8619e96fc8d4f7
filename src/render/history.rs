//! What a view remembers: the frames of its window, their sum, and when to start over.

use bevy::{
    math::Vec4Swizzles,
    prelude::*,
    render::{render_resource::*, renderer::RenderDevice},
};

use super::frame::Sun;

/// Where the coming frame stands in the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameInWindow {
    /// Frames since the history began.
    pub index: u32,
    /// Length of the window, 1 to 16.
    pub window: u32,
    /// Frames held before this one, at most `window`.
    pub held_before: u32,
    /// Exposure that the stored radiance is multiplied with.
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
    pub settings: u64,
    pub textures: u64,
    pub quality: crate::settings::CloudQuality,
    pub debug: crate::settings::CloudDebugView,
    pub atmosphere: bool,
    pub msaa: u32,
}

/// What may move a little within a window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub clip_from_view: Mat4,
    pub position: Vec3,
    pub rotation: Quat,
    pub sun: Sun,
    pub exposure: f32,
    /// Cloud time (s).
    pub seconds: f64,
    /// Metres of wind a window may hold before it smears: two marched texels at the shell.
    pub drift_limit: f32,
    /// Wind speed (m/s).
    pub wind: f32,
}

/// A view's textures and place in its window. Lives on the view's render entity.
#[derive(Component)]
pub(crate) struct CloudHistory {
    key: HistoryKey,
    pose: Pose,
    pub frame: FrameInWindow,
    frames: Texture,
    /// All layers, to be read.
    pub frames_view: TextureView,
    layer_views: Vec<TextureView>,
    sums: [TextureView; 2],
    /// Of the path tracer's samples.
    moments: Option<[TextureView; 2]>,
    /// Mean cloud distance and marched limit (m).
    pub distances: TextureView,
}

impl CloudHistory {
    /// A new, empty history.
    pub fn new(device: &RenderDevice, key: HistoryKey, pose: Pose) -> Self {
        let frame = FrameInWindow { index: 0, window: key.window, held_before: 0, exposure: pose.exposure };
        let texture = |label, format, layers| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: key.size.x, height: key.size.y, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let frames = texture("cloud_frames", TextureFormat::Rgba16Float, frame.layers());
        let whole = |t: Texture| t.create_view(&TextureViewDescriptor::default());
        let layer = |i| {
            frames.create_view(&TextureViewDescriptor {
                label: Some("cloud_frame"),
                dimension: Some(TextureViewDimension::D2),
                base_array_layer: i,
                array_layer_count: Some(1),
                ..default()
            })
        };
        Self {
            frames_view: frames
                .create_view(&TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() }),
            layer_views: (0..frame.layers()).map(layer).collect(),
            sums: [0, 1].map(|_| whole(texture("cloud_sum", TextureFormat::Rgba32Float, 1))),
            moments: key
                .quality
                .is_path_traced()
                .then(|| [0, 1].map(|_| whole(texture("cloud_path_moments", TextureFormat::Rgba32Float, 1)))),
            distances: whole(texture("cloud_distances", TextureFormat::Rg32Float, 1)),
            frames,
            key,
            pose,
            frame,
        }
    }

    /// Goes on to the next frame, or starts over where something changed or the last frame was not drawn.
    pub fn advance(&mut self, device: &RenderDevice, key: HistoryKey, pose: Pose, drawn: bool) {
        let path_traced = key.quality.is_path_traced();
        if key.size != self.key.size || key.window != self.key.window || path_traced != self.moments.is_some() {
            *self = Self::new(device, key, pose);
            return;
        }
        // Path-traced frames add up without end: nothing may move at all.
        let span = if path_traced { f32::MAX } else { key.window as f32 };
        let keep = drawn && key == self.key && stands_still(&self.pose, &pose, span, self.frame.exposure);
        self.frame = if keep {
            FrameInWindow {
                index: self.frame.index.wrapping_add(1),
                held_before: self.frame.held_after(),
                ..self.frame
            }
        } else {
            FrameInWindow { index: 0, held_before: 0, exposure: pose.exposure, ..self.frame }
        };
        self.key = key;
        self.pose = pose;
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

/// Whether the window may go on: the thesis's window is right only while nothing moves. The camera must not at all;
/// clouds and sun may move less than shows within a window of so many frames.
fn stands_still(before: &Pose, now: &Pose, frames: f32, stored_exposure: f32) -> bool {
    let camera = before.clip_from_view == now.clip_from_view
        && before.position.distance(now.position) < 1e-3
        && before.rotation.abs_diff_eq(now.rotation, 1e-5);
    let drift = now.wind * (now.seconds - before.seconds).abs() as f32 * frames;
    // Sine of the angle: acos has no precision where the two are alike.
    let turned = before.sun.direction.cross(now.sun.direction).length() * frames;
    let brightness = before.sun.illuminance.length().max(1e-6);
    let dimmed = (before.sun.illuminance - now.sun.illuminance).length() / brightness * frames;
    let exposed = now.exposure / stored_exposure;
    camera && drift <= now.drift_limit && turned <= 0.01 && dimmed < 0.05 && (0.25..4.0).contains(&exposed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        Pose {
            clip_from_view: Mat4::IDENTITY,
            position: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            sun: Sun { direction: Vec3::Y, illuminance: Vec3::ONE, angular_size: 0.0 },
            exposure: 1.0,
            seconds: 0.0,
            drift_limit: 10.0,
            wind: 10.0,
        }
    }

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

    #[test]
    fn motion_starts_over_and_a_breeze_does_not() {
        let still = pose();
        assert!(stands_still(&still, &Pose { seconds: 1.0 / 60.0, ..still }, 8.0, 1.0));
        for moved in [
            Pose { position: Vec3::X, ..still },
            Pose { rotation: Quat::from_rotation_y(0.01), ..still },
            Pose { seconds: 1.0, ..still },
            Pose { sun: Sun { direction: Vec3::X, ..still.sun }, ..still },
            Pose { sun: Sun { illuminance: Vec3::splat(2.0), ..still.sun }, ..still },
            Pose { exposure: 8.0, ..still },
            Pose { clip_from_view: Mat4::from_scale(Vec3::splat(2.0)), ..still },
        ] {
            assert!(!stands_still(&still, &moved, 8.0, 1.0), "{moved:?}");
        }
    }

    #[test]
    fn without_end_nothing_may_move() {
        let still = pose();
        assert!(stands_still(&still, &still, f32::MAX, 1.0));
        assert!(!stands_still(&still, &Pose { seconds: 1e-6, ..still }, f32::MAX, 1.0));
        let sun = Sun { direction: Vec3::new(1e-5, 1.0, 0.0), ..still.sun };
        assert!(!stands_still(&still, &Pose { sun, ..still }, f32::MAX, 1.0));
    }
}
