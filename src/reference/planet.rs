//! A round planet: altitude, rays against shells, map coordinates. Twin of `model/planet.wesl`.
//!
//! Positions are in the camera's tangent frame: origin on the surface straight below the camera, y up, the camera at
//! (0, `h0`, 0). Lengths in metres.

use std::f64::consts::PI;

use bevy::math::{DVec2, DVec3, Vec3};

/// Radius of the planet where the scene's `Atmosphere` gives none (m).
pub const PLANET_RADIUS: f64 = 6_360_000.0;

/// A planet of the scene.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Planet {
    /// Its centre (m): world space plus [`CloudModel::world_offset`](crate::CloudModel::world_offset), so that a shift of
    /// the origin does not move it.
    pub centre: DVec3,
    /// Its radius (m).
    pub radius: f64,
}

impl Default for Planet {
    /// Where the scene has no `Atmosphere`: [`PLANET_RADIUS`], with the world's origin on its surface where there is no offset.
    fn default() -> Self {
        Self { centre: DVec3::new(0.0, -PLANET_RADIUS, 0.0), radius: PLANET_RADIUS }
    }
}

impl Planet {
    /// That of an `Atmosphere` with its centre there in world space (m). Its entity is moved as all others are when the
    /// origin shifts; but Bevy gives it no `Transform`, and where it is put by default nobody has moved it: then it stands
    /// where it does without an offset.
    pub(crate) fn of_atmosphere(at: Vec3, radius: f32, offset: DVec3) -> Self {
        let unmoved = at == Vec3::NEG_Y * radius;
        let offset = if unmoved { DVec3::ZERO } else { offset };
        Self { centre: at.as_dvec3() + offset, radius: radius.into() }
    }
}

/// A stretch of a ray: distances from the camera (m) where it begins and ends.
pub type Interval = [f64; 2];

/// Altitude of `p` above a planet of this radius (m).
pub fn altitude(p: DVec3, radius: f64) -> f64 {
    (p + DVec3::Y * radius).length() - radius
}

/// Where the whole line through the camera crosses the shell of altitude `shell`, in order; `None` where it misses.
///
/// `h0` is the camera's altitude and `mu` the cosine between the ray and up (−1..=1). The roots of
/// `t² + 2bt + c`, with `b = (R + h0)·mu` and `c = (h0 − H)(2R + h0 + H)` (Högfeldt 5.2; his algorithm 5.2 is
/// misprinted), the one that does not cancel first.
pub fn shell_roots(h0: f64, mu: f64, shell: f64, radius: f64) -> Option<Interval> {
    let b = (radius + h0) * mu;
    let c = (h0 - shell) * (2.0 * radius + h0 + shell);
    let discriminant = b * b - c;
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    // Not signum(b), whose zero would lose both roots of a level ray.
    let sign = if b >= 0.0 { 1.0 } else { -1.0 };
    let q = -(b + sign * discriminant.sqrt());
    let other = if q == 0.0 { 0.0 } else { c / q };
    Some([q.min(other), q.max(other)])
}

/// The parts of a ray between the shells `bottom` and `top` within 0..=`t_max`, in order: none, one or two.
///
/// The planet's surface (altitude 0) ends the ray. A camera below it (in a valley under sea level) sees out through
/// it, but sees nothing below the horizontal. `bottom` and `top` are altitudes; the rest is as in [`shell_roots`].
pub fn shell_intervals(h0: f64, mu: f64, bottom: f64, top: f64, radius: f64, t_max: f64) -> Vec<Interval> {
    if h0 < 0.0 && mu < 0.0 {
        return Vec::new();
    }
    let ground = if h0 >= 0.0 { ground_distance(h0, mu, radius) } else { None };
    layer_intervals(h0, mu, [bottom, top], radius, t_max.min(ground.unwrap_or(f64::INFINITY)))
}

/// Distance to the planet's surface (m), seen from above it (`h0` ≥ 0); `None` where the ray misses it.
pub fn ground_distance(h0: f64, mu: f64, radius: f64) -> Option<f64> {
    shell_roots(h0, mu, 0.0, radius).filter(|[_, last]| *last > 0.0).map(|[first, _]| first.max(0.0))
}

/// The smallest radius of a sun's disc that is told from a point (rad), as in the shader.
const SMALLEST_DISC: f64 = 1e-5;

/// Share of the sun's disc that can be seen past the planet from altitude `h` (m), 0..=1.
///
/// `mu` is the cosine between up and the disc's middle, `size` its angular diameter (rad; 0 is a point). The horizon dips
/// by acos(R / (R + h)) and crosses the disc as a straight line; from below the surface it is level.
pub fn visible_sun(h: f64, mu: f64, size: f64, radius: f64) -> f64 {
    let height = h.max(0.0);
    let from_centre = radius + height;
    let dip_sine = (height * (2.0 * radius + height)).sqrt() / from_centre;
    let elevation = mu * (radius / from_centre) + (1.0 - mu * mu).max(0.0).sqrt() * dip_sine;
    let half = (0.5 * size).max(SMALLEST_DISC);
    let d = elevation / (half * (1.0 - half * half / 6.0));
    if d >= 1.0 {
        1.0
    } else if d > -1.0 {
        // A circular segment's share of its circle.
        0.5 + (d * (1.0 - d * d).sqrt() + d.asin()) / PI
    } else {
        0.0
    }
}

/// The angular diameter of a sun (rad) that a scene gives; what cannot be one is that of a point.
pub(crate) fn disc_size(angular_size: f32) -> f32 {
    if (0.0..=std::f32::consts::PI).contains(&angular_size) { angular_size } else { 0.0 }
}

/// The parts of a ray between the shells `bottom` and `top` within 0..=`t_max`, as if there were no surface.
pub fn layer_intervals(h0: f64, mu: f64, [bottom, top]: [f64; 2], radius: f64, t_max: f64) -> Vec<Interval> {
    let Some(outer) = shell_roots(h0, mu, top, radius) else {
        return Vec::new();
    };
    let parts = match shell_roots(h0, mu, bottom, radius) {
        None => vec![outer],
        Some(inner) => vec![[outer[0], inner[0]], [inner[1], outer[1]]],
    };
    parts.into_iter().map(|[a, b]| [a.max(0.0), b.min(t_max)]).filter(|[a, b]| b > a).collect()
}

/// Horizontal map coordinates of `p` relative to the point below the camera (m): arc length along the surface, in the
/// direction of (x, z). The planet's centre maps to the origin.
pub fn map_position(p: DVec3, radius: f64) -> DVec2 {
    let across = DVec2::new(p.x, p.z);
    across.normalize_or_zero() * radius * across.length().atan2(radius + p.y)
}

#[cfg(test)]
mod tests {
    use bevy::math::Mat4;
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;

    /// Walks along rays and asks of each point what its altitude says.
    #[test]
    fn intervals_hold_exactly_the_points_between_the_shells() {
        let mut rng = StdRng::seed_from_u64(7);
        let mut inside = 0;
        for _ in 0..4000 {
            let bottom = rng.random_range(100.0..3000.0);
            let top = bottom + rng.random_range(100.0..9000.0);
            let h0 = match rng.random_range(0..4) {
                0 => rng.random_range(-100.0..bottom),
                1 => rng.random_range(bottom..top),
                2 => rng.random_range(top..30_000.0),
                _ => rng.random_range(30_000.0..5e6),
            };
            let mu: f64 = if rng.random_bool(0.5) { rng.random_range(-0.2..0.1) } else { rng.random_range(-1.0..1.0) };
            let intervals = shell_intervals(h0, mu, bottom, top, PLANET_RADIUS, 3e6);
            assert!(intervals.len() <= 2);
            let closest = (PLANET_RADIUS + h0) * (1.0 - mu * mu).sqrt() - PLANET_RADIUS;
            if mu < 0.0 && (-2.0..0.1).contains(&closest) {
                // Whether it grazes the ground is too fine a question for points 2 km apart.
                continue;
            }
            let direction = DVec3::new((1.0 - mu * mu).sqrt(), mu, 0.0);
            let mut blocked = h0 < 0.0 && mu < 0.0;
            for step in 1..1500 {
                let t = f64::from(step) * 2000.0;
                let h = altitude(DVec3::Y * h0 + direction * t, PLANET_RADIUS);
                blocked |= h0 >= 0.0 && h < -1.0;
                let expected = !blocked && (bottom..top).contains(&h);
                let near_an_edge = (h - bottom).abs() < 0.01 || (h - top).abs() < 0.01 || h.abs() < 1.0;
                let found = intervals.iter().any(|&[a, b]| (a..b).contains(&t));
                assert!(found == expected || near_an_edge, "h0 {h0} mu {mu} shells {bottom}..{top} t {t} h {h}");
                inside += u32::from(found);
            }
        }
        assert!(inside > 10_000, "only {inside} points lay inside");
    }

    /// Asks of points all over the disc whether a ray to them meets the ground.
    #[test]
    fn the_visible_sun_is_the_part_of_its_disc_over_the_ground() {
        for size in [0.005, 0.0093, 0.06] {
            for h in [0.0, 2.0, 1500.0, 12_000.0, 4e5] {
                let dip = (PLANET_RADIUS / (PLANET_RADIUS + h)).acos();
                for k in -12..=12 {
                    // The middle's zenith angle: from wholly hidden to wholly in sight.
                    let zenith = 0.5 * PI + dip - 0.05 * f64::from(k) * size;
                    let (sine, cosine) = zenith.sin_cos();
                    let (middle, over) = (DVec3::new(sine, cosine, 0.0), DVec3::new(-cosine, sine, 0.0));
                    let points = 40_000;
                    let seen = (0..points).filter(|k| {
                        // Evenly over the disc, a golden angle apart.
                        let r = 0.5 * size * ((f64::from(*k) + 0.5) / f64::from(points)).sqrt();
                        let (across, up) = (2.399_963_23 * f64::from(*k)).sin_cos();
                        let ray = (middle + r * (up * over + across * DVec3::Z)).normalize();
                        ground_distance(h, ray.y, PLANET_RADIUS).is_none()
                    });
                    let (share, found) =
                        (seen.count() as f64 / f64::from(points), visible_sun(h, cosine, size, PLANET_RADIUS));
                    assert!((found - share).abs() < 5e-3, "size {size}, from {h} m, {k}: {found}, not {share}");
                }
            }
        }
        // Shares of 0 and 1 are exact, below the sea too.
        let seen = [0.02_f64, -0.02].map(|mu| visible_sun(-50.0, mu, 0.0093, PLANET_RADIUS));
        assert_eq!(seen, [1.0, 0.0]);
        assert_eq!([f32::NAN, -1.0, f32::INFINITY, 0.0093].map(disc_size), [0.0, 0.0, 0.0, 0.0093]);
    }

    #[test]
    fn a_shift_of_the_origin_leaves_the_planet_where_it_is() {
        let (radius, offset) = (6_360_000.0, DVec3::new(65_536.0, -4096.0, 1024.0));
        let at = |at: Vec3, offset| {
            // As the renderer has it from Bevy.
            let found = Mat4::from_translation(at).inverse().inverse().w_axis.truncate();
            Planet::of_atmosphere(found, radius, offset)
        };
        let default = at(Vec3::NEG_Y * radius, DVec3::ZERO);
        assert_eq!(default, Planet::default());
        // Whether its entity is left where Bevy puts it, or moved along.
        assert_eq!(at(Vec3::NEG_Y * radius, offset), default);
        assert_eq!(at(Vec3::NEG_Y * radius - offset.as_vec3(), offset), default);
        assert_eq!(at(Vec3::X * 9e6 - offset.as_vec3(), offset), at(Vec3::X * 9e6, DVec3::ZERO));
    }

    #[test]
    fn map_coordinates_are_arc_lengths() {
        let quarter = map_position(DVec3::new(0.0, -PLANET_RADIUS, PLANET_RADIUS), PLANET_RADIUS);
        assert!(quarter.abs_diff_eq(DVec2::new(0.0, PLANET_RADIUS * std::f64::consts::FRAC_PI_2), 1e-6));
        assert_eq!(map_position(DVec3::Y * 800.0, PLANET_RADIUS), DVec2::ZERO);
    }
}
