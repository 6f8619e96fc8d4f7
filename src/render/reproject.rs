//! Where the frames held saw what is seen now: [`HeldUniform`], and what makes a frame useless.

use bevy::{math::DVec3, prelude::*, render::render_resource::ShaderType};

use super::{
    frame::Sun,
    winds::{MOST_WINDS, Winds},
};

/// Most frames a view holds besides the newest.
const MOST_HELD: usize = 16;

/// From where, when and in what light a frame was marched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub clip_from_view: Mat4,
    /// Position on the planet's map (m): a floating origin's shift does not change it.
    pub position: DVec3,
    /// World from view.
    pub rotation: Quat,
    /// World from the tangent frame under the camera.
    pub world_from_local: Quat,
    pub sun: Sun,
    pub exposure: f32,
    /// Cloud time (s).
    pub seconds: f64,
    pub winds: Winds,
    /// How fast a transition moves outlines (m/s): slow enough to be at rest, but a leap in time is a cut.
    pub outlines: f32,
    /// Metres between the camera and the nearest cloud there may be, at least 300.
    pub to_shell: f32,
    /// Angle that a marched texel spans (rad).
    pub texel: f32,
}

impl Pose {
    /// Cloud time since `before` (s).
    fn since(&self, before: &Self) -> f32 {
        (self.seconds - before.seconds) as f32
    }

    /// The camera's way since `before` (m, world axes).
    fn moved(&self, before: &Self) -> Vec3 {
        (self.position - before.position).as_vec3()
    }

    /// Farthest from where `before` saw a cloud to where this one sees it (m), whichever wind carries it.
    fn shift(&self, before: &Self) -> f32 {
        let (moved, seconds) = (self.world_from_local.inverse() * self.moved(before), self.since(before));
        self.winds.all().map(|wind| (moved - wind * seconds).length()).fold(0.0, f32::max)
    }

    /// Whether so many frames may be added up as they are, each differing from the next as these two neighbours do: the camera must not move at all, clouds and sun by less than shows within a window.
    pub fn stands_still(&self, before: &Self, frames: f32) -> bool {
        let camera = self.clip_from_view == before.clip_from_view
            && self.position.distance(before.position) < 1e-3
            && self.rotation.abs_diff_eq(before.rotation, 1e-5);
        camera
            && (self.winds.across * self.since(before)).abs() * frames <= 0.5 * self.texel
            && turned(self, before) * frames <= 0.01
            && dimmed(self, before) * frames < 0.05
    }

    /// Whether a frame held is of any use now. It is not after a cut, a leap in time or another sun.
    pub fn fits(&self, before: &Self) -> bool {
        let zoom = self.clip_from_view.y_axis.y / before.clip_from_view.y_axis.y;
        self.shift(before) < 250_f32.max(0.2 * self.to_shell)
            && self.rotation.angle_between(before.rotation) < 1.5
            && (0.8..1.25).contains(&zoom)
            && turned(self, before) <= 0.03
            && dimmed(self, before) < 0.2
            && ((self.winds.rise + self.outlines) * self.since(before)).abs() < 30.0
    }

    /// Whether the view was cut from the frame `before` this one.
    pub fn is_cut(&self, before: &Self) -> bool {
        !self.fits(before) || self.rotation.angle_between(before.rotation) > 0.5
    }

    /// From this pose's tangent frame around the camera to the clip space of `before`, for what no wind carries.
    fn clip_of(&self, before: &Self) -> Mat4 {
        before.clip_from_view
            * Mat4::from_quat(before.rotation.inverse())
            * Mat4::from_translation(self.moved(before))
            * Mat4::from_quat(self.world_from_local)
    }
}

/// Angle between two suns (rad). Its sine: acos has no precision where they are alike.
fn turned(a: &Pose, b: &Pose) -> f32 {
    let sine = a.sun.direction.cross(b.sun.direction).length();
    if a.sun.direction.dot(b.sun.direction) > 0.0 { sine } else { std::f32::consts::PI }
}

fn dimmed(a: &Pose, b: &Pose) -> f32 {
    let brightness = b.sun.illuminance.length().max(1e-6);
    (b.sun.illuminance - a.sun.illuminance).length() / brightness
}

/// The one texel that is marched of each block.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sparse {
    /// Texels along a block's side.
    pub side: u32,
    /// The one of them.
    pub place: UVec2,
}

impl Sparse {
    /// For the frame of this index, a side that is a power of two, and a picture of this size. In a row of frames each
    /// place comes once, and neighbours in time are far apart; a picture smaller than a block has fewer places.
    pub fn new(side: u32, index: u32, size: UVec2) -> Self {
        const PLACES: [UVec2; 4] = [UVec2::ZERO, UVec2::ONE, UVec2::X, UVec2::Y];
        let mut place = UVec2::ZERO;
        let (mut rest, mut unit) = (index, side / 2);
        while unit > 0 {
            place += unit * PLACES[rest as usize % 4];
            (rest, unit) = (rest / 4, unit / 2);
        }
        Self { side, place: place % size.clamp(UVec2::ONE, UVec2::splat(side)) }
    }
}

/// `Held` of `held.wesl`, field for field.
#[derive(ShaderType, Clone, Copy, Debug, Default)]
pub(crate) struct HeldUniform {
    clip_from_local: [Mat4; MOST_HELD],
    terms: [Vec4; MOST_HELD],
    moves: [Vec4; MOST_HELD],
    places: [Vec4; MOST_HELD],
    winds: [Vec4; MOST_WINDS],
    counts: UVec4,
}

/// A frame held: where it was marched from, and the offsets of its samples.
pub(crate) type HeldFrame<'a> = (&'a Pose, Vec3);

impl HeldUniform {
    /// Of a camera that stands still: every held frame has today's exposure.
    pub fn still() -> Self {
        Self { terms: [Vec4::W; MOST_HELD], ..default() }
    }

    /// For a frame with this pose after `held` ones, the latest first. `march` says which texels are marched.
    pub fn new<'a>(
        now: &Pose,
        held: impl ExactSizeIterator<Item = HeldFrame<'a>>,
        still: bool,
        march: Sparse,
        samples_kept: f32,
    ) -> Self {
        let counts = UVec4::new(held.len() as u32, still.into(), march.side, march.place.x | march.place.y << 8);
        let mut uniform = Self { counts, winds: now.winds.bands, ..default() };
        uniform.terms[0].z = samples_kept;
        let to_local = now.world_from_local.inverse();
        for (k, (before, place)) in held.enumerate().take(MOST_HELD) {
            uniform.clip_from_local[k] = now.clip_of(before);
            uniform.moves[k] = (to_local * now.moved(before)).extend(0.0);
            uniform.places[k] = place.extend(0.0);
            let terms = &mut uniform.terms[k];
            let weight = if now.fits(before) { 1.0 } else { 0.0 };
            (terms.x, terms.y) = (weight, now.since(before));
            terms.w = now.exposure / before.exposure;
        }
        uniform
    }
}

#[cfg(test)]
mod tests {
    use bevy::camera::CameraProjection;

    use super::*;
    use crate::settings::CloudModel;

    fn lens(fov: f32) -> Mat4 {
        PerspectiveProjection { fov, aspect_ratio: 1.5, ..default() }.get_clip_from_view()
    }

    /// Of one layer a kilometre up.
    fn winds(wind: Vec3) -> Winds {
        Winds::new(&CloudModel { bottom: 1000.0, top: 2000.0, wind, evolution: 0.0, ..default() }, [].iter(), 0.0)
    }

    fn pose() -> Pose {
        Pose {
            clip_from_view: lens(1.0),
            position: DVec3::ZERO,
            rotation: Quat::IDENTITY,
            world_from_local: Quat::IDENTITY,
            sun: Sun { direction: Vec3::Y, illuminance: Vec3::ONE, angular_size: 0.0 },
            exposure: 1.0,
            seconds: 0.0,
            winds: winds(Vec3::X * 10.0),
            outlines: 0.0,
            to_shell: 1000.0,
            texel: 0.02,
        }
    }

    #[test]
    fn a_breeze_is_still_and_motion_is_not() {
        let before = pose();
        assert!(Pose { seconds: 1.0 / 60.0, ..before }.stands_still(&before, 8.0));
        for moved in [
            Pose { position: DVec3::X, ..before },
            Pose { rotation: Quat::from_rotation_y(0.01), ..before },
            Pose { seconds: 1.0, ..before },
            Pose { sun: Sun { direction: Vec3::new(0.01, 1.0, 0.0), ..before.sun }, ..before },
            Pose { clip_from_view: lens(1.1), ..before },
        ] {
            assert!(!moved.stands_still(&before, 8.0), "{moved:?}");
            assert!(!moved.is_cut(&before), "{moved:?}");
        }
    }

    #[test]
    fn without_end_nothing_may_move() {
        let still = pose();
        assert!(still.stands_still(&still, f32::MAX));
        assert!(!Pose { seconds: 1e-6, ..still }.stands_still(&still, f32::MAX));
        let calm = Pose { winds: winds(Vec3::ZERO), ..still };
        assert!(Pose { seconds: 100.0, ..calm }.stands_still(&calm, f32::MAX));
        let sun = Sun { direction: Vec3::new(1e-5, 1.0, 0.0), ..still.sun };
        assert!(!Pose { sun, ..still }.stands_still(&still, f32::MAX));
    }

    #[test]
    fn every_texel_of_a_block_is_marched_in_turn() {
        for side in [1, 2, 4] {
            for start in [0, 5, 48] {
                let mut seen: Vec<UVec2> =
                    (start..start + side * side).map(|i| Sparse::new(side, i, UVec2::splat(9)).place).collect();
                assert!(seen.iter().all(|place| place.max_element() < side));
                seen.sort_by_key(|place| place.to_array());
                seen.dedup();
                assert_eq!(seen.len() as u32, side * side, "side {side} from frame {start}");
            }
        }
    }

    #[test]
    fn a_picture_smaller_than_a_block_is_marched_whole() {
        for size in [UVec2::ONE, UVec2::new(3, 2), UVec2::new(2, 90)] {
            let places: Vec<UVec2> = (0..16).map(|i| Sparse::new(4, i, size).place).collect();
            for x in 0..size.x.min(4) {
                for y in 0..size.y.min(4) {
                    assert!(places.contains(&UVec2::new(x, y)), "{x}, {y} of {size}");
                }
            }
            assert!(places.iter().all(|place| place.cmplt(size).all()), "{size}");
        }
    }

    #[test]
    fn cuts_are_seen() {
        let before = pose();
        for cut in [
            Pose { position: DVec3::X * 1000.0, ..before },
            Pose { rotation: Quat::from_rotation_y(0.6), ..before },
            Pose { rotation: Quat::from_rotation_y(3.0), ..before },
            Pose { seconds: 100.0, ..before },
            Pose { sun: Sun { direction: Vec3::X, ..before.sun }, ..before },
            Pose { sun: Sun { direction: Vec3::NEG_Y, ..before.sun }, ..before },
            Pose { sun: Sun { illuminance: Vec3::splat(2.0), ..before.sun }, ..before },
            Pose { clip_from_view: lens(0.5), ..before },
        ] {
            assert!(cut.is_cut(&before), "{cut:?}");
        }
    }

    #[test]
    fn a_point_is_found_where_the_held_frame_saw_it() {
        let before = Pose { rotation: Quat::from_rotation_y(0.2), ..pose() };
        let tilted = Quat::from_rotation_z(0.3);
        let now = Pose { position: DVec3::new(30.0, 5.0, -70.0), seconds: 2.0, world_from_local: tilted, ..pose() };
        // Cloud that stands here today stood 20 m upwind.
        let cloud = DVec3::new(-100.0, 300.0, -1000.0);
        let was = cloud.as_vec3() - tilted * Vec3::new(20.0, 0.0, 0.0);
        let exact = before.clip_from_view * (before.rotation.inverse() * was).extend(1.0);
        let local = tilted.inverse() * (cloud - now.position).as_vec3();
        let all = Sparse::new(1, 0, UVec2::ONE);
        // As around.wesl takes the wind back.
        let seen = |now: &Pose, before: Pose| {
            let held = HeldUniform::new(now, [(&before, Vec3::ZERO)].into_iter(), false, all, 8.0);
            let carried = held.winds[0].truncate() * held.terms[0].y;
            let shift = held.moves[0].truncate() - carried;
            assert!((shift.length() - now.shift(&before)).abs() < 1e-3);
            held.clip_from_local[0] * (local - carried).extend(1.0)
        };
        let found = seen(&now, before);
        assert!((found / found.w).abs_diff_eq(exact / exact.w, 1e-5), "{found} for {exact}");
        // Far from the origin it is the same, to the bit.
        let far = DVec3::new(1e7, 0.0, -3e6);
        let shifted = Pose { position: before.position + far, ..before };
        assert_eq!(seen(&Pose { position: now.position + far, ..now }, shifted), found);
    }
}
