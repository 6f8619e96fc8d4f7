//! [`CloudWeather`]: the sky changes into another over time.

mod light;
mod mix;
mod sky;
#[cfg(test)]
mod tests;

use bevy::prelude::*;

pub(crate) use self::light::LightMix;
use self::{
    mix::Span,
    sky::{Leg, Sky},
};
use super::{CloudClock, CloudLayer, CloudLayers, CloudLighting, CloudModel, CloudPreset, SettingsError, Validate};

/// Most transitions that are remembered: scrubbed back to before the oldest of them, time shows the sky it began with.
const REMEMBERED: usize = 16;
/// How far outlines move while clouds form or dissolve (m): the size of a cell, more or less.
const OUTLINES_MOVE: f64 = 1000.0;

/// Changes the sky into another one over time, without a jump.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_cumulus::prelude::*;
///
/// fn storm_comes(mut weather: ResMut<CloudWeather>) -> Result {
///     let storm = CloudPreset::named("Storm").ok_or("there is no such preset")?;
///     weather.transition_to(&storm, 120.0)?;
///     Ok(())
/// }
/// ```
///
/// While it knows a transition it writes [`CloudModel`], [`CloudLayers`] and [`CloudLighting`] at the end of each frame. What
/// it writes follows from the cloud time ([`CloudClock::seconds`]) alone: when time is scrubbed back and forth, or runs on
/// another machine, the same time shows the same sky. A paused clock pauses it. Change one of the three yourself, and it lets
/// go: the sky stays as it is, with your change (`world_offset` may change at any time).
///
/// Numbers move evenly and gently; wind changes what moves, never where it is. Layers of one name become one another if they
/// read the same map and the same noise (scales, stretch) by the same phase function; other old ones dissolve while new ones
/// form. Where that would be more than eight layers or three phase functions at once, the new ones wait until the old are
/// gone. [`CloudModel`]'s own layer dissolves and forms again where its scales differ. One phase function of the lighting
/// turns into another as a mixture of both, and octaves come and go by degrees; the fields name the one there is more of,
/// and a whole number. (Where layers have three phase functions of their own there is no room for a mixture, and it switches
/// half way.) [`CloudTextures`](super::CloudTextures) are not part of it.
///
/// Costs: for as long as it lasts, the layers of both skies. Maps of the new sky are made in the background as soon as it is
/// asked for; a layer stays away until its map is there, so give it a few seconds.
#[derive(Resource, Reflect, Clone, Debug, Default)]
#[reflect(Resource, Default)]
pub struct CloudWeather {
    #[reflect(ignore)]
    asked: Vec<Asked>,
    #[reflect(ignore)]
    legs: Vec<Leg>,
    /// What was written last.
    #[reflect(ignore)]
    written: Option<Sky>,
    /// What of the lighting is shown beside its fields; none where they say all.
    #[reflect(ignore)]
    light: Option<LightMix>,
    /// Whether this frame shows another sky than the last, by a transition.
    #[reflect(ignore)]
    moved: bool,
    /// Whether what was written last is the last transition's end: from there on nothing changes.
    #[reflect(ignore)]
    ended: bool,
}

#[derive(Clone, Debug)]
struct Asked {
    target: Sky,
    begin: Option<f64>,
    seconds: f64,
}

impl CloudWeather {
    /// From the sky as it is now to that of `preset`, in so many seconds of cloud time. A transition that is under way ends
    /// where it stands, and this one goes on from there. With 0 seconds it is a cut.
    ///
    /// # Errors
    /// A setting of the preset that is out of its range, or a duration that is none; nothing changes then.
    pub fn transition_to(&mut self, preset: &CloudPreset, seconds: f64) -> Result<(), SettingsError> {
        self.ask(preset, None, seconds)
    }

    /// As [`transition_to`](Self::transition_to), but from the cloud time `begin` on, which may be over or still to come: on
    /// every machine that asks for it, even late, the sky is the same. Transitions that begin later are forgotten.
    ///
    /// # Errors
    /// As [`transition_to`](Self::transition_to); and where `begin` is not a number or beyond the clock's range.
    pub fn transition_at(&mut self, preset: &CloudPreset, begin: f64, seconds: f64) -> Result<(), SettingsError> {
        CloudClock { seconds: begin, ..default() }.validate()?;
        self.ask(preset, Some(begin), seconds)
    }

    fn ask(&mut self, preset: &CloudPreset, begin: Option<f64>, seconds: f64) -> Result<(), SettingsError> {
        preset.model.validate()?;
        preset.layers.validate()?;
        preset.lighting.validate()?;
        if !(0.0..=LONGEST).contains(&seconds) {
            return Err(SettingsError::OutOfRange {
                field: "weather.seconds".to_owned(),
                value: seconds.to_string(),
                min: "0".to_owned(),
                max: LONGEST.to_string(),
            });
        }
        self.asked.push(Asked { target: preset.into(), begin, seconds });
        Ok(())
    }

    /// Lets go of the sky: it stays as it is.
    pub fn stop(&mut self) {
        self.asked.clear();
        self.legs.clear();
    }

    /// How much of the transition that is shown at cloud time `seconds` is over, 0 to 1; `None` where there is none.
    pub fn progress(&self, seconds: f64) -> Option<f64> {
        self.leg(seconds).map(|leg| leg.span.progress(seconds))
    }

    /// Whether nothing is left to do at cloud time `t` unless somebody changes the sky: its end has been written already.
    fn rests(&self, t: f64) -> bool {
        let over = |leg: &Leg| leg.span.progress(t) >= 1.0;
        self.asked.is_empty() && self.ended && !self.moved && self.legs.last().is_some_and(over)
    }

    /// The latest that has begun, or the first.
    fn leg(&self, t: f64) -> Option<&Leg> {
        self.legs.iter().rev().find(|leg| leg.span.begin <= t).or(self.legs.first())
    }

    /// Whether this frame's sky differs from the last frame's by a transition.
    pub(crate) fn has_moved(&self) -> bool {
        self.moved
    }

    /// Whether the lighting is as it was written last, so that what its fields do not say still goes with it.
    fn keeps_light(&self, lighting: &CloudLighting) -> bool {
        self.written.as_ref().is_some_and(|sky| sky.lighting == *lighting)
    }

    /// What of the lighting its fields do not say, while it changes.
    pub(crate) fn light(&self) -> Option<&LightMix> {
        self.light.as_ref()
    }

    /// How fast outlines of clouds move by a transition (m/s).
    pub(crate) fn outline_speed(&self, t: f64) -> f64 {
        match self.leg(t) {
            Some(leg) if self.moved => OUTLINES_MOVE / leg.span.seconds.max(1e-3),
            _ => 0.0,
        }
    }

    /// Layers whose maps will be wanted, or may be wanted again.
    pub(crate) fn layers_ahead(&self, t: f64) -> impl Iterator<Item = &CloudLayer> {
        let last = self.legs.last().filter(|leg| leg.span.progress(t) < 1.0);
        let both = last.into_iter().flat_map(|leg| [&leg.start.layers, &leg.target.layers]);
        both.flat_map(|layers| layers.shown().map(|(_, layer)| layer))
    }

    /// Takes in what was asked for, at cloud time `now` and with this sky shown.
    fn take_in(&mut self, shown: &Sky, now: f64) {
        for Asked { target, begin, seconds } in std::mem::take(&mut self.asked) {
            let begin = begin.unwrap_or(now);
            self.legs.retain(|leg| leg.span.begin < begin);
            let start = self.leg(begin).map_or_else(|| shown.clone(), |leg| leg.at(begin));
            if self.legs.len() >= REMEMBERED {
                self.legs.remove(0);
            }
            self.legs.push(Leg { start, target, span: Span { begin, seconds } });
        }
    }
}

/// Longest transition (s): a year.
const LONGEST: f64 = 3.2e7;

/// Writes the sky of this time.
pub(super) fn change_weather(
    mut weather: ResMut<CloudWeather>,
    clock: Option<Res<CloudClock>>,
    model: Option<ResMut<CloudModel>>,
    layers: Option<ResMut<CloudLayers>>,
    lighting: Option<ResMut<CloudLighting>>,
) {
    if weather.asked.is_empty() && weather.legs.is_empty() {
        let stays = lighting.is_some_and(|lighting| weather.keeps_light(&lighting));
        if weather.moved || (weather.light.is_some() && !stays) {
            weather.moved = !stays && weather.light.take().is_some();
        }
        return;
    }
    let (Some(clock), Some(mut model), Some(mut layers), Some(mut lighting)) = (clock, model, layers, lighting) else {
        return;
    };
    if clock.validate().is_err() {
        return;
    }
    let touched = model.is_changed() || layers.is_changed() || lighting.is_changed();
    if !touched && weather.rests(clock.seconds) {
        return;
    }
    let weather = &mut *weather;
    if !weather.written.as_ref().is_some_and(|sky| sky.is(&model, &layers, &lighting)) {
        // Somebody else has taken over.
        weather.legs.clear();
        weather.light = weather.light.take().filter(|_| weather.keeps_light(&lighting));
    }
    weather.moved = false;
    if !weather.asked.is_empty() {
        let mut shown = Sky::new(&model, &layers, &lighting);
        if let Some(light) = &weather.light {
            shown.light.clone_from(light);
        }
        weather.take_in(&shown, clock.seconds);
    }
    weather.ended = weather.legs.last().is_some_and(|leg| leg.span.progress(clock.seconds) >= 1.0);
    let Some(leg) = weather.leg(clock.seconds) else { return };
    let mut sky = leg.at(clock.seconds);
    sky.model.world_offset = model.world_offset;
    let is_cut = leg.span.seconds <= 0.0;
    let model_moved = model.set_if_neq(sky.model.clone());
    let layers_moved = layers.set_if_neq(sky.layers.clone());
    let lighting_moved = lighting.set_if_neq(sky.lighting.clone());
    let light = Some(&sky.light).filter(|light| **light != LightMix::from(&sky.lighting));
    let light_moved = weather.light.as_ref() != light;
    weather.light = light.cloned();
    weather.moved = (model_moved || layers_moved || lighting_moved || light_moved) && !is_cut;
    weather.written = Some(sky);
}
