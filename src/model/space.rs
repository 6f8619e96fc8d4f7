//! The tangent frame that densities are asked in.

use glam::{DMat2, DQuat, DVec2, DVec3};

use crate::reference::planet::map_position;

/// Most that the map is stretched: 15 700 km from its pole. Beyond that clouds slide a little as the camera passes.
const MOST_STRETCH: f64 = 4.0;

/// A frame on the planet's surface straight below a point: y up, origin at altitude 0. Computed in f64, so that what
/// is sent to the GPU is small and exact however far from the origin the point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TangentFrame {
    /// Planet radius (m).
    pub radius: f64,
    /// Altitude of the point (m).
    pub altitude: f64,
    /// Position of the frame's origin on the map (m): arc lengths from the planet's pole (world +Y).
    pub map: DVec2,
    /// Lengths on the map around there over those on the ground: 1 towards the pole and more across, where the map spreads
    /// out what lies closer together on the planet. Without it clouds would slide as the camera goes across.
    pub stretch: DMat2,
    /// World axes to the frame's.
    pub local_from_world: DQuat,
}

impl TangentFrame {
    /// The frame below `point`, on a planet of this centre and radius (world space, m). `None` where up is undefined.
    pub fn below(point: DVec3, centre: DVec3, radius: f64) -> Option<Self> {
        let from_centre = point - centre;
        let distance = from_centre.length();
        let up = from_centre.try_normalize()?;
        let across = DVec2::new(up.x, up.z);
        // Azimuthal equidistant around the pole: true lengths along any line through the world's origin.
        let outward = across.normalize_or_zero();
        let sine = across.length();
        let angle = sine.atan2(up.y);
        let map = outward * angle * radius;
        // At the pole, 0 over 0, there is no sideways.
        let spread = (angle / sine).min(MOST_STRETCH);
        let sideways = outward.perp();
        let stretch = DMat2::IDENTITY + DMat2::from_cols(sideways * sideways.x, sideways * sideways.y) * (spread - 1.0);
        let local_from_world = DQuat::from_rotation_arc(up, DVec3::Y);
        let frame = Self { radius, altitude: distance - radius, map, stretch, local_from_world };
        (distance.is_finite() && map.is_finite()).then_some(frame)
    }

    /// From lengths on the map back to those on the ground.
    pub fn shrink(&self) -> DMat2 {
        self.stretch.inverse()
    }

    /// The most that [`stretch`](Self::stretch) lengthens: it leaves lengths towards the pole as they are.
    pub fn longest(&self) -> f64 {
        self.stretch.determinant().max(1.0)
    }

    /// Where a point of this frame is on the map, from below the frame's own (m).
    pub fn map_at(&self, local: DVec3) -> DVec2 {
        self.stretch * map_position(local, self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn altitude_and_map_are_exact_near_and_far() {
        let r = 6_360_000.0;
        let centre = DVec3::new(0.0, -r, 0.0);
        let here = TangentFrame::below(DVec3::new(0.0, 1234.5, 0.0), centre, r).unwrap();
        assert!((here.altitude - 1234.5).abs() < 1e-6);
        assert_eq!(here.map, DVec2::ZERO);
        let angle: f64 = 0.1;
        let far = centre + (r + 500.0) * DVec3::new(angle.sin(), angle.cos(), 0.0);
        let there = TangentFrame::below(far, centre, r).unwrap();
        assert!((there.altitude - 500.0).abs() < 1e-6);
        assert!((there.map.x - r * angle).abs() < 1e-3 && there.map.y.abs() < 1e-6);
        let up = there.local_from_world * DVec3::new(angle.sin(), angle.cos(), 0.0);
        assert!((up - DVec3::Y).length() < 1e-12);
    }

    #[test]
    fn neighbours_agree_on_the_map_all_over_the_planet() {
        let r = 6_360_000.0;
        let centre = DVec3::new(0.0, -r, 0.0);
        let up = |degrees: f64, aside: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            DVec3::new(sin, cos, aside / r).normalize()
        };
        for degrees in [0.0, 1.0, 20.0, 60.0, 90.0, 120.0] {
            // A kilometre to the side, as seen from here and from there.
            let [here, there] = [0.0, 1000.0].map(|aside| centre + (r + 500.0) * up(degrees, aside));
            let frame = |eye| TangentFrame::below(eye, centre, r).unwrap();
            let seen = frame(here);
            let local = seen.local_from_world * (there - here) + DVec3::Y * seen.altitude;
            let apart = (seen.map + seen.map_at(local) - frame(there).map).length();
            assert!(apart < 1.0, "{degrees} degrees from the pole: {apart} m");
        }
    }

    #[test]
    fn no_frame_at_the_centre_or_for_nan() {
        assert_eq!(TangentFrame::below(DVec3::ZERO, DVec3::ZERO, 1.0), None);
        assert_eq!(TangentFrame::below(DVec3::NAN, DVec3::ZERO, 1.0), None);
    }
}
