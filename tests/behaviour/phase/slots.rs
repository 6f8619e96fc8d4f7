//! Several phase functions in one cloud: the march and the path tracer mix them by the medium's shares.

use bevy::{light::light_consts::lux, prelude::*};
use bevy_cumulus::{
    ModelPhases,
    prelude::*,
    reference::phase::{HgDraine, Phase},
};

use crate::support::{
    adding_doubling::{Slab, moments},
    app::{View, cloud_pixels, spawn_sun, until_drawn},
    gpu::{run_updates, times_logged},
    path_trace::{assert_near, frames, light_from, mean, mixed_slab, noise, spawn_pinhole, sun_light, traced_app},
};

pub fn of(function: PhaseFunction, g: f32) -> CloudPhase {
    CloudPhase { function, g, ..default() }
}

/// Single scattering, unshadowed and unsmoothed.
pub fn single(app: &mut App, lighting: CloudLighting) {
    app.insert_resource(CloudLighting { octaves: 1, diffusion: 0.0, ambient_strength: 0.0, ..lighting });
    app.insert_resource(CloudQuality {
        resolution: MarchResolution::Full,
        step: 50.0,
        step_growth: 0.0,
        light_steps: 0,
        transmittance_stop: 0.0,
        density_skip: 0.0,
        max_distance: 2_000_000.0,
        offsets: false,
        temporal: TemporalMode::Off,
        ..default()
    });
}

/// The picture's middle with the sun at this angle from the camera's direction, straight up.
pub fn middle(app: &mut App, view: &View, sun: Entity, degrees: f32) -> Vec4 {
    let towards = Quat::from_rotation_z(degrees.to_radians()) * Vec3::Y;
    app.world_mut().entity_mut(sun).insert(Transform::default().looking_to(-towards, Vec3::Z));
    run_updates(app, 1);
    cloud_pixels(app, view)[0]
}

const SHARES: [f64; 4] = [0.1, 0.4, 0.3, 0.2];

#[test]
fn the_march_mixes_phase_functions_by_share() {
    let lighting = CloudLighting { fade_start: 1.0, aerial_perspective: 0.0, ..sun_light(PhaseFunction::Isotropic) };
    let layers =
        [of(PhaseFunction::HenyeyGreenstein, 0.6), of(PhaseFunction::Rayleigh, 0.0), of(PhaseFunction::Schlick, -0.5)];
    let mut app = traced_app(Some(mixed_slab(0.7, [0.9, 0.5, 0.2], SHARES)), lighting.clone());
    app.insert_resource(ModelPhases(layers.to_vec()));
    let sun = spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_pinhole(&mut app, UVec2::ONE, 1.0);
    single(&mut app, lighting);
    until_drawn(&mut app);
    let phases: Vec<Phase> =
        std::iter::once(Phase::Isotropic).chain(layers.iter().map(|phase| Phase::of(phase).unwrap())).collect();
    for degrees in [0.0_f32, 35.0, 90.0, 140.0, 180.0] {
        let seen = middle(&mut app, &view, sun, degrees);
        let cosine = f64::from(degrees).to_radians().cos();
        let phase: f64 = phases.iter().zip(SHARES).map(|(phase, share)| share * phase.value(cosine, 1.0)).sum();
        for (found, albedo) in seen.to_array().into_iter().zip([0.9, 0.5, 0.2]) {
            let exact = f64::from(lux::RAW_SUNLIGHT) * albedo * phase * (1.0 - (-0.7_f64).exp());
            assert_near(found.into(), exact, 3e-3, &format!("{degrees}°"));
        }
    }
    // A bad one is refused, and those that were there stay.
    let before = middle(&mut app, &view, sun, 35.0);
    app.insert_resource(ModelPhases(vec![of(PhaseFunction::Rayleigh, 0.0), of(PhaseFunction::Schlick, 1.5)]));
    run_updates(&mut app, 1);
    assert_eq!(middle(&mut app, &view, sun, 35.0), before);
    assert_eq!(times_logged("phases[1].g = 1.5 is outside its range"), 1);
}

#[test]
fn a_fourth_phase_function_of_layers_is_told_with_its_layer() {
    let mut app = crate::support::app::clouds_app();
    let layer = |k: u8| CloudLayer {
        name: format!("slot {k}"),
        own_phase: true,
        phase: of(PhaseFunction::HenyeyGreenstein, 0.1 * f32::from(k)),
        ..default()
    };
    let says = "layers.4.phase (\"slot 4\") takes the light's phase function";
    app.insert_resource(CloudLayers(vec![layer(1), layer(2), layer(1), layer(3)]));
    run_updates(&mut app, 2);
    assert_eq!(times_logged(says), 0);
    app.insert_resource(CloudLayers([1, 2, 1, 3, 4].map(layer).to_vec()));
    run_updates(&mut app, 4);
    assert_eq!(times_logged(says), 1);
}

/// The chain of narrow events between the sun and a broad one is drawn before it is known where they are: as much light
/// must arrive whatever the shares there.
#[test]
fn the_path_tracer_mixes_phase_functions_as_adding_says() {
    let (depth, albedo, mu, n) = (2.0, 0.95, 0.75, 200);
    let droplets = HgDraine::from_diameter(5.0).unwrap();
    let broad = Phase::HenyeyGreenstein { g: 0.3_f32.into() };
    let moments = moments(2 * n, |x| 0.6 * broad.value(x, 1.0) + 0.4 * droplets.value(x));
    let slab = Slab::new(depth, albedo, &moments, n, mu);
    let [above, below] = slab.sun_seen_vertically();
    for up in [1.0, -1.0] {
        let lighting = CloudLighting { g: 0.3, ..sun_light(PhaseFunction::HenyeyGreenstein) };
        let mut app = traced_app(Some(mixed_slab(depth, [albedo; 3], [0.6, 0.0, 0.4, 0.0])), lighting);
        let small = CloudPhase { droplet_diameter: 5.0, ..of(PhaseFunction::HgDraine, 0.0) };
        app.insert_resource(ModelPhases(vec![of(PhaseFunction::Rayleigh, 0.0), small]));
        spawn_sun(&mut app, light_from(mu));
        let view = spawn_pinhole(&mut app, UVec2::new(128, 96), up);
        let [found, ..] = mean(&mut app, &view, frames(120));
        let expected = f64::from(lux::RAW_SUNLIGHT) * if up > 0.0 { below } else { above };
        assert_near(found, expected, noise(), &format!("looking {up}"));
    }
}
