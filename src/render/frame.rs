//! `CloudFrame` of `frame.wesl`: everything one view's passes share.

use bevy::{prelude::*, render::render_resource::ShaderType};

use super::{
    history::FrameInWindow,
    phase_slots::{PHASE_SLOTS, PhaseSlots, diffuses, past_the_first},
};
use crate::{
    model::TangentFrame,
    settings::{CloudDebugView, CloudLighting, CloudQuality, Integration},
    textures::n_rooks::{MAX_WINDOW, n_rooks},
};

/// The brightest directional light.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct Sun {
    /// Towards the sun, world axes.
    pub direction: Vec3,
    /// Illuminance (lux, linear RGB).
    pub illuminance: Vec3,
    /// Angular diameter (rad).
    pub angular_size: f32,
}

/// What the uniform is made from, for one view.
pub(crate) struct FrameInput<'a> {
    pub clip_from_view: Mat4,
    pub world_from_view: Quat,
    pub viewport: UVec4,
    pub space: &'a TangentFrame,
    pub sun: Sun,
    pub exposure: f32,
    pub quality: &'a CloudQuality,
    pub lighting: &'a CloudLighting,
    /// Octaves of the light, not always a whole number of them.
    pub octaves: f32,
    /// Distance at which high layers pass below the horizon (m): none is shown farther.
    pub highest_horizon: f32,
    pub phases: &'a PhaseSlots,
    pub window: FrameInWindow,
    pub debug: CloudDebugView,
}

/// `CloudFrame` of `frame.wesl`, field for field.
#[derive(ShaderType, Clone, Copy, Debug, Default)]
pub(crate) struct FrameUniform {
    view_from_clip: Mat4,
    local_from_view: Mat4,
    sun_direction: Vec4,
    sun_illuminance: Vec4,
    phase_params: [Vec4; PHASE_SLOTS],
    phase_kinds: UVec4,
    phase_fall: Vec4,
    phase_shift: Vec4,
    peak_share: Vec4,
    peak_asymmetry: Vec4,
    octave_factors: Vec4,
    diffusion: Vec4,
    ambient: Vec4,
    ground_albedo: Vec4,
    sky_fallback: Vec4,
    steps: Vec4,
    limits: Vec4,
    offsets: Vec4,
    camera: Vec4,
    history: Vec4,
    size: UVec4,
    viewport: UVec4,
    counts: UVec4,
    flags: UVec4,
    layers: UVec4,
    debug: UVec4,
}

/// Marched size of a viewport.
pub(crate) fn marched_size(viewport: UVec4, quality: &CloudQuality) -> UVec2 {
    let divisor = quality.divisor();
    UVec2::new(viewport.z.div_ceil(divisor), viewport.w.div_ceil(divisor))
}

/// Angle a marched texel spans (rad): 2 tan(fov/2) over the marched height.
pub(crate) fn texel_angle(clip_from_view: Mat4, viewport: UVec4, quality: &CloudQuality) -> f32 {
    2.0 * quality.divisor() as f32 / (clip_from_view.y_axis.y.abs() * viewport.w as f32)
}

impl FrameUniform {
    /// How far is marched (m).
    pub fn reach(&self) -> f32 {
        self.limits.z
    }

    /// All that accumulating frames asks for, and nothing else.
    pub fn of_window(size: UVec2, index: u32, layers: UVec4) -> Self {
        Self { size: UVec4::new(size.x, size.y, 1, index & 255), layers, ..default() }
    }

    pub fn new(input: &FrameInput) -> Self {
        let FrameInput { space, sun, quality, lighting, phases, window, viewport, .. } = input;
        let local_from_world = space.local_from_world.as_quat();
        let local_sun = local_from_world * sun.direction;
        let size = marched_size(*viewport, quality);
        let reach = reach(quality, lighting, space);
        let [peak_share, peak_asymmetry] = phases.peaks(lighting, input.octaves);
        let held = if quality.is_path_traced() { window.index + 1 } else { window.held_after() };
        Self {
            view_from_clip: input.clip_from_view.inverse(),
            local_from_view: Mat4::from_quat(local_from_world * input.world_from_view),
            sun_direction: local_sun.extend(sun.angular_size),
            sun_illuminance: (sun.illuminance * lighting.sun_strength).extend(0.0),
            phase_params: phases.params(),
            phase_kinds: phases.kinds(),
            phase_fall: phases.fall(),
            phase_shift: phases.shift(),
            peak_share,
            peak_asymmetry,
            octave_factors: Vec4::new(
                lighting.attenuation,
                lighting.contribution,
                lighting.eccentricity,
                lighting.phase_limit,
            ),
            diffusion: diffusion(lighting, input.octaves),
            ambient: (lighting.ambient_tint * lighting.ambient_strength).extend(lighting.powder),
            ground_albedo: lighting.ground_albedo.extend(lighting.ambient_desaturation),
            // smoothstep is undefined where both edges meet.
            sky_fallback: sky_radiance(lighting, sun, local_sun.y).extend(lighting.fade_start.min(0.999)),
            steps: Vec4::new(quality.step, quality.step_growth, quality.light_step, quality.light_growth),
            limits: Vec4::new(
                quality.transmittance_stop,
                quality.density_skip,
                reach.max(input.highest_horizon),
                reach,
            ),
            offsets: offsets(quality, *window).extend(0.0),
            camera: Vec4::new(
                space.altitude as f32,
                space.radius as f32,
                quality.lod_bias,
                texel_angle(input.clip_from_view, *viewport, quality),
            ),
            history: Vec4::new(
                window.exposure,
                input.exposure / window.exposure,
                held as f32,
                lighting.aerial_perspective,
            ),
            size: UVec4::new(size.x, size.y, quality.divisor(), window.index & 255),
            viewport: *viewport,
            counts: UVec4::new(quality.max_steps, quality.light_steps, input.octaves.ceil() as u32, phases.count()),
            flags: UVec4::new(
                quality.long_step,
                quality.empty_steps,
                match quality.integration {
                    Integration::EnergyConserving => 0,
                    Integration::Naive => 1,
                },
                quality.offsets.into(),
            ),
            layers: UVec4::new(window.layer(), window.leaving_layer(), window.layers(), window.held_before),
            debug: UVec4::new(input.debug.shader_mode(), window.index, quality.seed, phases.is_coloured().into()),
        }
    }
}

/// Radiance of the sky where the scene has no `Atmosphere` (cd/m²), `sine` being that of the sun's elevation.
///
/// A clear sky loses all but a 200th of its light from sunset to the end of civil twilight [AMS, civil twilight]; here it
/// loses all. A smoothstep, cubed so that most of the light goes while the sun sets.
fn sky_radiance(lighting: &CloudLighting, sun: &Sun, sine: f32) -> Vec3 {
    /// Elevations of the sun (degrees): none of the light up to the first, all of it from the second.
    const TWILIGHT: [f32; 2] = [-6.0, 3.0];
    let elevation = sine.clamp(-1.0, 1.0).asin().to_degrees();
    let t = ((elevation - TWILIGHT[0]) / (TWILIGHT[1] - TWILIGHT[0])).clamp(0.0, 1.0);
    lighting.sky_fallback * sun.illuminance * (t * t * (3.0 - 2.0 * t)).powi(3)
}

/// How far low clouds are shown (m). From the ground `max_distance`; higher up it grows, so that from an airliner the lowest
/// clouds curve over the horizon with no bare ring before it, and from space all clouds up to the planet's rim are nearer
/// than where the fade begins.
fn reach(quality: &CloudQuality, lighting: &CloudLighting, space: &TangentFrame) -> f32 {
    /// Where it begins to grow and where low clouds are seen to the horizon (m): between, clouds within `max_distance`
    /// still hide it, or nearly so.
    const LOW: [f32; 2] = [2000.0, 12_000.0];
    /// Where it begins to grow further and where all is seen (m).
    const ALL: [f32; 2] = [10_000.0, 60_000.0];
    /// From the horizon to the far side of clouds 2 km up and of the highest there are (m).
    const PAST_HORIZON: [f64; 2] = [160_000.0, 400_000.0];
    let altitude = space.altitude.max(0.0);
    let share = |[from, to]: [f32; 2]| ((altitude as f32 - from) / (to - from)).clamp(0.0, 1.0);
    let horizon = (altitude * (2.0 * space.radius + altitude)).sqrt();
    let fade_start = lighting.fade_start.clamp(0.1, 0.999);
    let least = quality.max_distance;
    let low = (horizon as f32 / fade_start).max((horizon + PAST_HORIZON[0]) as f32).max(least);
    let all = ((horizon + PAST_HORIZON[1]) as f32 / fade_start).max(least);
    // By factors: what it is seen to do is how it compares with what is there.
    let to_horizon = least * (low / least).powf(share(LOW));
    to_horizon.max(least.lerp(all, share(ALL).powi(2)))
}

/// Where this frame samples texel and step.
pub(super) fn offsets(quality: &CloudQuality, window: FrameInWindow) -> Vec3 {
    if quality.carries_picture() {
        // There is no window whose frames could share a step out: van der Corput's sequence fills it (Högfeldt 6.1).
        let sample = window.index / quality.block_side().pow(2);
        let [x, y] = n_rooks(MAX_WINDOW)[sample as usize % MAX_WINDOW];
        return Vec3::new(x, y, van_der_corput(sample));
    }
    let rooks = n_rooks(window.window as usize);
    let slot = window.index % window.window;
    let [x, y] = rooks[slot as usize % rooks.len()];
    Vec3::new(x, y, slot as f32 / window.window as f32)
}

/// The binary digits of `i` mirrored at the point: 0, ½, ¼, ¾, ... No more than 16 of them, so that f32 holds it.
fn van_der_corput(i: u32) -> f32 {
    (i.reverse_bits() >> 16) as f32 / 65_536.0
}

/// The diffuse light and the last octave, as `frame.wesl` has them.
fn diffusion(lighting: &CloudLighting, octaves: f32) -> Vec4 {
    Vec4::new(
        lighting.diffusion * past_the_first(octaves),
        1.0 - (octaves.ceil() - octaves),
        lighting.diffusion_asymmetry,
        diffuses(lighting, octaves),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn van_der_corput_fills_the_step_evenly() {
        assert_eq!([0, 1, 2, 3, 4].map(van_der_corput), [0.0, 0.5, 0.25, 0.75, 0.125]);
        // Any run of eight hits each eighth once.
        for start in 0..40 {
            let mut eighths: Vec<u32> = (start..start + 8).map(|i| (van_der_corput(i) * 8.0) as u32).collect();
            eighths.sort_unstable();
            assert_eq!(eighths, [0, 1, 2, 3, 4, 5, 6, 7], "from {start}");
        }
    }

    #[test]
    fn from_space_no_cloud_before_the_rim_fades() {
        let lighting = CloudLighting::default();
        let quality = CloudQuality::default();
        let at = |altitude: f64| {
            let r = 6_360_000.0;
            let space = TangentFrame::below(glam::DVec3::Y * (r + altitude), glam::DVec3::ZERO, r).unwrap();
            reach(&quality, &lighting, &space)
        };
        for low in [-5.0, 2.0, 1_900.0] {
            assert_eq!(at(low), quality.max_distance);
        }
        // From up here there is no bare ring: clouds of 1500 m are marched to where they pass below the horizon.
        for high in [12e3, 20e3, 40e3_f64] {
            let r = 6_360_000.0;
            let [ground, past] = [high, 1500.0].map(|h: f64| (h * (2.0 * r + h)).sqrt());
            assert!(f64::from(at(high)) > ground + past, "from {high} m: {} m", at(high));
        }
        for high in [60e3, 400e3, 36e6_f64] {
            // Tops of 12 km on the far side of the horizon.
            let r = 6_360_000.0;
            let rim = (high * (2.0 * r + high)).sqrt() + (12e3 * (2.0 * r + 12e3)).sqrt();
            assert!(f64::from(at(high) * lighting.fade_start) > rim, "from {high} m");
        }
        // Without a jump on the way.
        let steps: Vec<f32> = (0..1000).map(|k| at(f64::from(k) * 100.0)).collect();
        assert!(steps.windows(2).all(|w| w[1] >= w[0] && w[1] < 1.025 * w[0] + 1.0));
    }
}
