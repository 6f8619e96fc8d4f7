//! Wind above the ground, from the wind at 10 m.

use bevy::math::{Vec2, Vec3};

/// Height at which surface wind is measured (m).
const MEASURED: f32 = 10.0;
/// Eddy viscosity in the boundary layer (m²/s), as Stull 1988, section 6.4.
const EDDY_VISCOSITY: f32 = 5.0;
/// The earth's rate of rotation (rad/s).
const ROTATION: f32 = 7.2921e-5;
/// Angle between the wind at 10 m and that above the boundary layer where the theory would have 45° (rad). Over land some
/// 25° are observed (Stull 1988, section 6.4).
const OBSERVED_TURN: f32 = 25.0 * std::f32::consts::PI / 180.0;
/// Speed rises no more above this, wherever Ekman's layer would end (m).
const DEEPEST: f32 = 1500.0;

/// How wind changes with height: faster by a power law, and turned as friction gives way to the earth's rotation. Of jets and
/// thermal wind it knows nothing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WindProfile {
    /// Wind at 10 m (m/s, world axes: +x east, −z north).
    pub surface: Vec3,
    /// Roughness length of the ground (m): 0.0002 sea, 0.03 grass, 0.1 fields and hedges, 1 forest or town.
    pub roughness: f32,
    /// Degrees north. Wind turns right with height on the northern half of the earth, left on the southern.
    pub latitude: f32,
}

impl WindProfile {
    /// Wind at a height above ground (m/s). Never slower than at 10 m.
    ///
    /// Speed: (z/10)^α up to the depth of Ekman's layer, with α = 0.24 + 0.096 log z₀ + 0.016 log² z₀ (Counihan 1975,
    /// Atmospheric Environment 9, 871–905). Direction: the angle of Ekman's spiral, u = 1 − e^(−γz) cos γz and
    /// v = e^(−γz) sin γz with γ = √(f/2K) (Ekman 1905; Stull 1988, section 6.4), scaled to the turn that is observed.
    pub fn at(&self, height: f32) -> Vec3 {
        let z = height.max(MEASURED);
        let coriolis = 2.0 * ROTATION * self.latitude.to_radians().sin();
        let decay = (0.5 * coriolis.abs() / EDDY_VISCOSITY).sqrt();
        let deep = (std::f32::consts::PI / decay.max(1e-6)).min(DEEPEST);
        let logarithm = self.roughness.clamp(1e-5, 5.0).log10();
        let power = (0.24 + 0.096 * logarithm + 0.016 * logarithm * logarithm).max(0.05);
        let faster = (z.min(deep) / MEASURED).powf(power);
        let angle = |z: f32| {
            let (fade, turned) = ((-decay * z).exp(), decay * z);
            (fade * turned.sin()).atan2(1.0 - fade * turned.cos())
        };
        // Both are 45° where the earth's rotation has no part, at the equator.
        let turn = if decay < 1e-5 { 0.0 } else { angle(MEASURED) - angle(z) };
        let turn = turn * OBSERVED_TURN / std::f32::consts::FRAC_PI_4 * coriolis.signum();
        // From x towards z is clockwise, seen from above.
        let wind = Vec2::from_angle(turn).rotate(Vec2::new(self.surface.x, self.surface.z)) * faster;
        Vec3::new(wind.x, self.surface.y, wind.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wind_rises_and_veers_with_height() {
        let profile = WindProfile { surface: Vec3::new(6.0, 0.0, 0.0), roughness: 0.1, latitude: 50.0 };
        assert_eq!(profile.at(0.0), profile.surface);
        let at = |height: f32| {
            let wind = profile.at(height);
            (wind.length(), wind.z.atan2(wind.x).to_degrees())
        };
        // Counihan's power for this roughness is 0.16.
        assert!((at(100.0).0 / 6.0 - 10_f32.powf(0.16)).abs() < 0.01, "{:?}", at(100.0));
        let heights = [10.0, 100.0, 300.0, 600.0, 900.0];
        assert!(
            heights.map(|h| at(h).0).is_sorted_by(|a, b| a < b) && heights.map(|h| at(h).1).is_sorted_by(|a, b| a < b)
        );
        let (speed, turn) = at(8000.0);
        assert!((20.0..30.0).contains(&turn) && (12.0..15.0).contains(&speed), "{speed} m/s, {turn}°");
        // South of the equator it backs, at the equator it does neither.
        let south = WindProfile { latitude: -50.0, ..profile }.at(8000.0);
        assert!((south.z + profile.at(8000.0).z).abs() < 1e-4);
        let equator = WindProfile { latitude: 0.0, ..profile }.at(8000.0);
        assert!(equator.z.abs() < 1e-3 && equator.x > 10.0, "{equator}");
        assert_eq!(WindProfile { surface: Vec3::ZERO, ..profile }.at(3000.0), Vec3::ZERO);
    }
}
