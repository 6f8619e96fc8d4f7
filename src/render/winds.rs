//! How fast the clouds that are shown move: by altitude, and as the camera sees it.

use bevy::{
    math::{DMat2, DVec2},
    prelude::*,
};

use crate::settings::{CloudLayer, CloudModel, MAX_LAYERS};

/// Most winds at once: the thesis's layer's and those of all weather-map layers.
pub(super) const MOST_WINDS: usize = MAX_LAYERS + 1;
/// Altitude where the highest band ends (m).
const WITHOUT_END: f32 = 1e9;
/// Cloud counts as no nearer than this (m).
const NEAREST: f32 = 300.0;

/// The winds of what is shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Winds {
    /// Wind (m/s, tangent frame) and altitude where its band ends (m), lowest first; the last one again and again.
    pub bands: [Vec4; MOST_WINDS],
    /// How fast shapes change besides (m/s), where they do so fastest.
    pub rise: f32,
    /// Fastest that clouds may move across the view (rad/s).
    pub across: f32,
}

/// One layer's altitudes (m) and motion (m/s).
struct Moving {
    bottom: f32,
    top: f32,
    wind: Vec3,
    rise: f32,
}

impl Moving {
    fn own(model: &CloudModel) -> Self {
        let CloudModel { bottom, top, wind, evolution, .. } = *model;
        Self { bottom, top, wind: wind.with_y(0.0), rise: wind.y.abs() + evolution.abs() }
    }

    fn layer(layer: &CloudLayer) -> Self {
        let rise = layer.wind.y.abs() + layer.evolution.abs() + layer.renewal.abs();
        Self { bottom: layer.bottom(), top: layer.top(), wind: layer.wind.with_y(0.0), rise }
    }
}

impl Winds {
    /// Of the model's own layer, where it is shown, and of these, seen from an altitude (m).
    pub fn new<'a>(model: &CloudModel, layers: impl Iterator<Item = &'a CloudLayer>, altitude: f32) -> Self {
        let own = model.enabled.then(|| Moving::own(model));
        let mut shown: Vec<Moving> = layers.take(MAX_LAYERS).map(Moving::layer).chain(own).collect();
        if shown.is_empty() {
            // Only a model of the user's own can show anything then, and this is all the wind that it is told of.
            shown.push(Moving::own(model));
        }
        shown.sort_by(|a, b| (a.bottom + a.top).total_cmp(&(b.bottom + b.top)));
        let mut winds = Self { bands: [Vec4::ZERO; MOST_WINDS], rise: 0.0, across: 0.0 };
        for (i, band) in winds.bands.iter_mut().enumerate() {
            let Some(own) = shown.get(i).or(shown.last()) else { break };
            // Half way to the next one, or through what both have.
            let end = shown.get(i + 1).map_or(WITHOUT_END, |next| 0.5 * (own.top + next.bottom));
            *band = own.wind.extend(end);
        }
        for own in &shown {
            let away = (own.bottom - altitude).max(altitude - own.top).max(NEAREST);
            winds.rise = winds.rise.max(own.rise);
            winds.across = winds.across.max((own.wind.length() + own.rise) / away);
        }
        winds
    }

    /// As they go over the ground where the map is stretched; `shrink` is from lengths on the map to those there.
    pub fn over_ground(mut self, shrink: DMat2) -> Self {
        for band in &mut self.bands {
            let wind = shrink * DVec2::new(band.x.into(), band.z.into());
            (band.x, band.z) = (wind.x as f32, wind.y as f32);
        }
        self
    }

    /// The different winds (m/s).
    pub fn all(&self) -> impl Iterator<Item = Vec3> {
        self.bands.iter().map(|band| band.truncate())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(base: f32, wind: Vec3) -> CloudLayer {
        CloudLayer { base, base_rise: 0.0, thickness: 1000.0, wind, evolution: 0.5, renewal: 2.0, ..default() }
    }

    /// What the shader picks.
    fn at(winds: &Winds, altitude: f32) -> Vec3 {
        winds.bands.iter().find(|band| altitude < band.w).unwrap().truncate()
    }

    #[test]
    fn each_altitude_has_the_wind_of_what_is_shown_there() {
        let model = CloudModel { enabled: false, wind: Vec3::new(99.0, 0.0, 0.0), ..default() };
        let (low, high) = (Vec3::new(7.0, 0.0, 3.0), Vec3::new(34.0, 1.0, 8.0));
        let layers = [layer(8000.0, high), layer(1000.0, low)];
        let winds = Winds::new(&model, layers.iter(), 10.0);
        for (altitude, wind) in [(1500.0, low), (4000.0, low), (6000.0, high), (8500.0, high), (1e6, high)] {
            assert_eq!(at(&winds, altitude), wind.with_y(0.0), "{altitude} m");
        }
        let across = winds.over_ground(DMat2::from_diagonal(DVec2::new(1.0, 0.5)));
        assert_eq!(at(&across, 1500.0), Vec3::new(7.0, 0.0, 1.5));
        // Noise that rises, evolution and renewal.
        assert_eq!(winds.rise, 3.5);
        // A low cloud's slow wind moves it faster across the view than the jet stream does cirrus.
        assert_eq!(winds.across, (low.length() + 2.5) / 990.0);
        // The thesis's layer among them, once it is shown.
        let own = CloudModel { enabled: true, bottom: 3000.0, top: 4000.0, ..model };
        assert_eq!(at(&Winds::new(&own, layers.iter(), 10.0), 3500.0), model.wind);
    }

    #[test]
    fn what_is_not_shown_has_no_wind() {
        let model = CloudModel { enabled: false, wind: Vec3::new(50.0, 0.0, 0.0), ..default() };
        let still = CloudLayer { evolution: 0.0, renewal: 0.0, ..layer(1000.0, Vec3::ZERO) };
        let winds = Winds::new(&model, [still].iter(), 10.0);
        assert_eq!((winds.rise, winds.across), (0.0, 0.0));
        assert!(winds.all().all(|wind| wind == Vec3::ZERO));
    }
}
