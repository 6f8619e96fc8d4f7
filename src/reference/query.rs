//! What a game may ask: [`CloudSky`].

use std::sync::Arc;

use bevy::math::DVec3;

pub use super::texture_set::{CloudTextureSet, LayerTextureSet};
use super::{
    field::{LocalModel, Medium},
    integrate,
    planet::{Interval, Planet, ground_distance, layer_intervals, visible_sun},
    quadrature::{self, Accuracy},
};
use crate::{
    model::{MAX_ZONES, ModelSettings, TangentFrame, ZoneAt, ZoneUniform},
    settings::{CloudLayers, CloudModel, SettingsError, Validate},
};

/// Extinction (1/m) from which on a point counts as in cloud: one can see less than a kilometre (Koschmieder's
/// 3.912/V), where the World Meteorological Organization draws the line between mist and fog.
pub const IN_CLOUD: f64 = 3.912e-3;

/// Optical depth past which nothing passes: e⁻¹⁶ is 1e-7.
const OPAQUE: f64 = 16.0;

/// The sky as it is drawn, for the CPU to ask: settings, zones, textures, planet, sun and cloud time.
///
/// Points are in the scene's world space (m), as `Vec3` or `DVec3`; [`CloudModel::world_offset`] and the planet of the
/// scene's `Atmosphere` are reckoned with. Only cloud counts: no terrain, no clear air. Answers are those of the shader to
/// the precision of its texture filter, at full detail (`lod` 0, filtered over a metre), in f64, and depend on nothing
/// but their inputs. A point that is not finite is in clear air.
///
/// It needs no renderer once it is there, is `Send + Sync`, and clones in no time: take it along to a task.
#[derive(Clone, Debug)]
pub struct CloudSky {
    model: Arc<CloudModel>,
    layers: Arc<CloudLayers>,
    zones: Arc<[ZoneAt]>,
    textures: CloudTextureSet,
    planets: Arc<[Planet]>,
    sun: Option<DVec3>,
    /// Angular diameter of the sun (rad).
    sun_size: f64,
    seconds: f64,
}

impl CloudSky {
    /// The sky of these settings and textures at cloud time 0, on the default planet, without a sun and weather-map layers.
    ///
    /// # Errors
    /// Where a setting is out of its range.
    pub fn new(model: CloudModel, textures: CloudTextureSet) -> Result<Self, SettingsError> {
        model.validate()?;
        let planets = Arc::from([Planet::default()]);
        Ok(Self {
            model: Arc::new(model),
            layers: Arc::default(),
            zones: Arc::from([]),
            textures,
            planets,
            sun: None,
            sun_size: 0.0,
            seconds: 0.0,
        })
    }

    /// The same sky with other settings.
    ///
    /// # Errors
    /// Where one is out of its range.
    pub fn with_model(self, model: CloudModel) -> Result<Self, SettingsError> {
        model.validate()?;
        Ok(Self { model: Arc::new(model), ..self })
    }

    /// The same sky with these weather-map layers; those whose map is not among its textures are not there.
    ///
    /// # Errors
    /// Where a setting is out of its range.
    pub fn with_layers(self, layers: CloudLayers) -> Result<Self, SettingsError> {
        layers.validate()?;
        Ok(Self { layers: Arc::new(layers), ..self })
    }

    /// The same sky with these zones.
    pub(crate) fn with_zones(mut self, zones: Vec<ZoneAt>) -> Self {
        if *zones != *self.zones {
            self.zones = zones.into();
        }
        self
    }

    /// The same sky over these planets; a point belongs to the one whose centre is nearest. None is the default planet.
    #[must_use]
    pub fn with_planets(mut self, planets: &[Planet]) -> Self {
        let default = [Planet::default()];
        let planets = if planets.is_empty() { &default } else { planets };
        if *planets != *self.planets {
            self.planets = planets.into();
        }
        self
    }

    /// The same sky with the sun in this direction (from the scene to the sun), or without one.
    #[must_use]
    pub fn with_sun(self, direction: Option<DVec3>) -> Self {
        Self { sun: direction.and_then(DVec3::try_normalize), ..self }
    }

    /// The same sky with a sun of this angular diameter (rad): its disc sinks below the horizon bit by bit. 0, as
    /// [`new`](Self::new) has it, is a point.
    #[must_use]
    pub fn with_sun_size(self, diameter: f64) -> Self {
        Self { sun_size: diameter, ..self }
    }

    /// The same sky at another cloud time (s).
    #[must_use]
    pub fn at(self, seconds: f64) -> Self {
        Self { seconds, ..self }
    }

    /// Cloud time (s).
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The settings of the thesis's layer.
    pub fn model(&self) -> &CloudModel {
        &self.model
    }

    /// The weather-map layers.
    pub fn layers(&self) -> &CloudLayers {
        &self.layers
    }

    /// The textures.
    pub fn textures(&self) -> &CloudTextureSet {
        &self.textures
    }

    /// Direction to the sun, the scene's brightest `DirectionalLight`.
    pub fn sun(&self) -> Option<DVec3> {
        self.sun
    }

    /// Angular diameter of the sun (rad): that of the light's `SunDisk`, the Earth's sun's where it has none.
    pub fn sun_size(&self) -> f64 {
        self.sun_size
    }

    /// Density at `p` at cloud time `t` (s), the sum of all layers', rain included: 0 in clear air. About 1 µs, and as much
    /// again for each weather-map layer that reaches this altitude.
    pub fn density(&self, p: impl Into<DVec3>, t: f64) -> f64 {
        self.medium(p, t).density
    }

    /// All that the model says of `p` at cloud time `t` (s): density, extinction, albedo, phase functions.
    pub fn medium(&self, p: impl Into<DVec3>, t: f64) -> Medium {
        let p = p.into();
        self.seen_from(p, t).map_or(Medium::EMPTY, |model| model.sample_medium(model.local(p), 0.0))
    }

    /// Whether `p` is in cloud now, thick enough to see less than a kilometre in ([`IN_CLOUD`]).
    pub fn is_in_cloud(&self, p: impl Into<DVec3>) -> bool {
        self.medium(p, self.seconds).extinction >= IN_CLOUD
    }

    /// Optical depth of the cloud between two points now: `∫ σt ds` along the straight line, 0 or more.
    ///
    /// As a camera at `a` sees it. Another camera's map lies a little aside: a metre, where both it and what it sees are
    /// 50 km from `a` and the map's origin.
    ///
    /// Adaptive Simpson's rule, within 0.2 % of the value or 0.001, whichever is more; measured 0.06 % at most, against
    /// steps of half a metre. Time grows with the cloud on the way: about 10 µs through 100 m, a millisecond through 10 km.
    pub fn optical_depth(&self, a: impl Into<DVec3>, b: impl Into<DVec3>) -> f64 {
        let (a, b) = (a.into(), b.into());
        self.depth(a, b - a, (b - a).length(), f64::INFINITY)
    }

    /// Share of light that passes straight from `a` to `b` now, 0..=1: `e^−τ` of the [optical
    /// depth](Self::optical_depth), given up where less than 1e-7 is left. Within 0.001;
    /// measured 0.0002 at most.
    pub fn transmittance(&self, a: impl Into<DVec3>, b: impl Into<DVec3>) -> f64 {
        let (a, b) = (a.into(), b.into());
        integrate::transmittance(self.depth(a, b - a, (b - a).length(), OPAQUE))
    }

    /// Share of direct sunlight that reaches `p` through the clouds now: 1 in clear air, 0 where the planet or thick
    /// cloud hides the sun, or there is none. The sun is the scene's brightest `DirectionalLight`. The horizon, lower the
    /// higher `p` lies, covers its disc bit by bit ([`visible_sun`]); cloud dims it as it does the disc's middle. About
    /// 0.1 ms.
    pub fn sun_visibility(&self, p: impl Into<DVec3>) -> f64 {
        let p = p.into();
        let seen = |h0: f64, mu: f64, radius: f64| visible_sun(h0, mu, self.sun_size, radius);
        self.sun.map_or(0.0, |direction| self.light_from(p, direction, seen))
    }

    /// As [`sun_visibility`](Self::sun_visibility), for a point of light infinitely far away in any direction.
    pub fn visibility_towards(&self, p: impl Into<DVec3>, direction: impl Into<DVec3>) -> f64 {
        // As in the renderer: what is below sea level sees out, but nothing below the horizontal.
        let is_hidden =
            |h0: f64, mu: f64, radius| if h0 < 0.0 { mu < 0.0 } else { ground_distance(h0, mu, radius).is_some() };
        self.light_from(p.into(), direction.into(), |h0, mu, radius| if is_hidden(h0, mu, radius) { 0.0 } else { 1.0 })
    }

    /// Share of a light infinitely far away that reaches `p`: the share `seen` past the planet, from the altitude of `p`,
    /// the cosine between up and the light and the planet's radius, times what the clouds let through.
    fn light_from(&self, p: DVec3, direction: DVec3, seen: impl Fn(f64, f64, f64) -> f64) -> f64 {
        let Some(model) = self.seen_from(p, self.seconds) else { return 1.0 };
        let Some(up) = model.local_direction(direction).try_normalize() else { return 1.0 };
        let seen = seen(model.eye_altitude(), up.y, model.radius());
        if seen <= 0.0 {
            return 0.0;
        }
        seen * integrate::transmittance(self.depth(p, direction, f64::INFINITY, OPAQUE))
    }

    /// The model in the frame below `eye`, at cloud time `t`.
    fn seen_from(&self, eye: DVec3, t: f64) -> Option<LocalModel<'_, CloudTextureSet>> {
        let place = eye + self.model.world_offset;
        let away = |planet: &&Planet| planet.centre.distance_squared(place);
        let planet = self.planets.iter().min_by(|a, b| away(a).total_cmp(&away(b))).copied().unwrap_or_default();
        if !t.is_finite() {
            return None;
        }
        let zones = self.zones_around(place, planet)?;
        let settings = ModelSettings { model: &self.model, layers: &self.layers, zones: &zones };
        LocalModel::of_settings(&settings, t, eye, planet, &self.textures)
    }

    /// The zones nearest to `eye` (offset included), as many as a view shows.
    fn zones_around(&self, eye: DVec3, planet: Planet) -> Option<Vec<ZoneUniform>> {
        if self.zones.is_empty() {
            return Some(Vec::new());
        }
        let frame = TangentFrame::below(eye, planet.centre, planet.radius)?;
        let mut near: Vec<(f64, ZoneUniform)> = self.zones.iter().map(|zone| zone.seen_from(eye, &frame)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(MAX_ZONES);
        Some(near.into_iter().map(|(_, zone)| zone).collect())
    }

    /// Optical depth from `a` towards `direction` over `length` metres, until it is `enough`.
    fn depth(&self, a: DVec3, direction: DVec3, length: f64, enough: f64) -> f64 {
        let Some(model) = self.seen_from(a, self.seconds) else { return 0.0 };
        let Some(direction) = model.local_direction(direction).try_normalize() else { return 0.0 };
        let eye = DVec3::Y * model.eye_altitude();
        let at = |s: f64| eye + direction * s;
        let extinction = |s: f64| model.sample_medium(at(s), 0.0).extinction;
        let bound = |s: f64, half: f64| model.extinction_bound(at(s), half);
        // Five samples over four texels.
        let panel = (4.0 * model.finest()).clamp(4.0, 100.0);
        let mut depth = 0.0;
        let through = |deck: Interval| layer_intervals(eye.y, direction.y, deck, model.radius(), length);
        let mut intervals: Vec<Interval> = model.decks().flat_map(through).collect();
        intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
        for interval in intervals {
            let accuracy = Accuracy { panel, relative: 2e-3, shortest: 0.25, enough: enough - depth };
            depth += quadrature::integrate(extinction, bound, interval, accuracy);
            if depth > enough {
                break;
            }
        }
        depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{planet::PLANET_RADIUS, sampler::Texture};

    /// Cloud of density 1 all through the layer.
    fn slab(gradient: Texture) -> CloudSky {
        let one = Arc::new(Texture::uniform(1.0));
        let textures = CloudTextureSet {
            billow: one.clone(),
            wisp: one.clone(),
            coverage: one.clone(),
            coverage_bound: one.clone(),
            type_map: one,
            gradient: Arc::new(gradient),
            layers: None,
        };
        let model = CloudModel {
            bottom: 1000.0,
            top: 1400.0,
            coverage: 1.0,
            noise_strength: 0.0,
            density: 0.5,
            extinction: 0.01,
            ..CloudModel::default()
        };
        CloudSky::new(model, textures).unwrap()
    }

    /// Metres of a ray from altitude `h0` that lie between the shells, by the law of cosines.
    fn path(h0: f64, mu: f64, length: f64) -> f64 {
        let steps = 200_000;
        let step = length / f64::from(steps);
        let inside = |i: i32| {
            let s = (f64::from(i) + 0.5) * step;
            let r = PLANET_RADIUS + h0;
            (1000.0..=1400.0).contains(&((r * r + 2.0 * r * s * mu + s * s).sqrt() - PLANET_RADIUS))
        };
        step * (0..steps).filter(|i| inside(*i)).count() as f64
    }

    #[test]
    fn a_slab_passes_what_its_thickness_says() {
        let sky = slab(Texture::uniform(1.0)).with_sun(Some(DVec3::new(3.0, 4.0, 0.0)));
        let (below, above) = (DVec3::new(0.0, 500.0, 0.0), DVec3::new(0.0, 2000.0, 0.0));
        let exact = (-2.0_f64).exp();
        for (a, b) in [(below, above), (above, below)] {
            assert!((sky.optical_depth(a, b) - 2.0).abs() < 2e-3);
            assert!((sky.transmittance(a, b) - exact).abs() < 1e-3);
        }
        let inside = DVec3::new(0.0, 1100.0, 0.0);
        assert!((sky.optical_depth(below, inside) - 0.5).abs() < 2e-3);
        assert!((sky.optical_depth(inside, inside + 100.0 * DVec3::X) - 0.5).abs() < 2e-3);
        assert_eq!(sky.optical_depth(inside, inside), 0.0);
        assert!((sky.density(inside, 7.0) - 0.5).abs() < 1e-12 && sky.density(below, 7.0) == 0.0);
        assert!(sky.is_in_cloud(inside) && !sky.is_in_cloud(above));
        assert_eq!(sky.transmittance(above, above + DVec3::new(9e4, 1e5, 0.0)), 1.0);
        // Long slanted ways, from below, inside and above, with the planet's roundness in them.
        for (h0, mu, length) in [(0.0, 0.8_f64, 1e4), (0.0, 0.05, 9e4), (1200.0, -0.006, 8e4), (3000.0, -0.02, 2e5)] {
            let a = DVec3::new(0.0, h0, 0.0);
            let direction = DVec3::new(0.6 * (1.0 - mu * mu).sqrt(), mu, -0.8 * (1.0 - mu * mu).sqrt());
            let (found, exact) = (sky.optical_depth(a, a + direction * length), 0.005 * path(h0, mu, length));
            assert!((found - exact).abs() < 2e-3 * exact + 1e-3, "{h0} m, cosine {mu}: {found}, not {exact}");
        }
        // The sun, 4/5 up.
        assert!((sky.sun_visibility(below) - (-2.5_f64).exp()).abs() < 1e-3);
        assert_eq!(sky.sun_visibility(above), 1.0);
        assert_eq!(sky.visibility_towards(above, DVec3::new(1.0, -0.5, 0.0)), 0.0, "the planet is in between");
        assert_eq!(sky.visibility_towards(above, DVec3::X), 1.0);
    }

    #[test]
    fn a_cumulus_passes_what_its_profile_says() {
        use crate::textures::{CUMULUS_PROFILE, vertical_profile};
        let rows = 1024;
        let texels = (0..rows).map(|y| vertical_profile(1.0, (y as f32 + 0.5) / rows as f32)).collect();
        let gradient =
            Texture::new(vec![(bevy::math::UVec3::new(1, rows, 1), texels)], crate::reference::sampler::Address::Clamp);
        let sky = slab(gradient.unwrap());
        // The area of the trapezium that rises to a and falls from b to c.
        let [a, b, c] = CUMULUS_PROFILE.map(f64::from);
        let exact = 2.0 * 0.5 * (c + b - a);
        let found = sky.optical_depth(DVec3::ZERO, DVec3::new(0.0, 5000.0, 0.0));
        assert!((found - exact).abs() < 2e-3 * exact, "{found}, not {exact}");
    }

    #[test]
    fn planets_and_offsets_move_the_layer() {
        let planet = Planet { centre: DVec3::new(1e7, 2e7, 3e7), radius: 1e5 };
        let sky = slab(Texture::uniform(1.0)).with_planets(&[planet, Planet::default()]);
        let up = DVec3::new(1.0, -2.0, 0.5).normalize();
        let at = |h: f64| planet.centre + up * (planet.radius + h);
        assert!(sky.is_in_cloud(at(1200.0)) && !sky.is_in_cloud(at(900.0)) && !sky.is_in_cloud(at(1500.0)));
        assert!((sky.transmittance(at(0.0), at(1e4)) - (-2.0_f64).exp()).abs() < 1e-3);
        assert!(sky.is_in_cloud(DVec3::new(0.0, 1200.0, 0.0)));
        let model = CloudModel { world_offset: DVec3::new(0.0, 1000.0, 0.0), ..sky.model().clone() };
        let raised = sky.with_model(model).unwrap();
        assert!(raised.is_in_cloud(DVec3::new(0.0, 200.0, 0.0)) && !raised.is_in_cloud(DVec3::new(0.0, 1200.0, 0.0)));
        // A shift of the origin towards a planet: points of the world come nearer to its own, the planets stay.
        let model = CloudModel { world_offset: planet.centre, ..raised.model().clone() };
        let shifted = raised.with_model(model).unwrap();
        assert!(shifted.is_in_cloud(at(1200.0) - planet.centre) && !shifted.is_in_cloud(at(1200.0)));
    }

    #[test]
    fn nothing_that_is_asked_breaks_it() {
        let sky = slab(Texture::uniform(1.0)).with_sun(Some(DVec3::Y));
        let odd = [f64::NAN, f64::INFINITY, -1e300, 1e15, 0.0, -PLANET_RADIUS];
        for x in odd {
            for y in odd {
                let (p, q) = (DVec3::new(x, y, 0.0), DVec3::new(y, -x, x));
                let answers = [
                    sky.density(p, 0.0),
                    sky.density(DVec3::Y * 1200.0, x),
                    sky.transmittance(p, q),
                    sky.optical_depth(p, q),
                    sky.sun_visibility(p),
                    sky.visibility_towards(p, q),
                ];
                assert!(answers.iter().all(|a| *a >= 0.0), "{p} {q}: {answers:?}");
            }
        }
        assert_eq!(sky.clone().with_sun(None).sun_visibility(DVec3::Y * 1e4), 0.0);
        assert!(CloudSky::new(CloudModel { top: 0.0, ..sky.model().clone() }, sky.textures().clone()).is_err());
        let far = sky.clone().with_planets(&[Planet { centre: DVec3::ZERO, radius: 1e30 }]);
        assert!(far.transmittance(DVec3::Y * 1e30, DVec3::Y * -1e30) >= 0.0);
    }
}
