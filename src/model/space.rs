//! The tangent frame that densities are asked in.

use glam::{DQuat, DVec2, DVec3};

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
        let map = across.normalize_or_zero() * across.length().atan2(up.y) * radius;
        let frame =
            Self { radius, altitude: distance - radius, map, local_from_world: DQuat::from_rotation_arc(up, DVec3::Y) };
        (distance.is_finite() && map.is_finite()).then_some(frame)
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
    fn no_frame_at_the_centre_or_for_nan() {
        assert_eq!(TangentFrame::below(DVec3::ZERO, DVec3::ZERO, 1.0), None);
        assert_eq!(TangentFrame::below(DVec3::NAN, DVec3::ZERO, 1.0), None);
    }
}
