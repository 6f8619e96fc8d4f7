//! The figures of the thesis's chapter 5 as scenes. `docs/how-it-works.md` shows and explains them.

use super::{CameraPose, CloudDebugView, EVERYDAY, Scene, Setting, SunPose};

/// One ray a pixel: figures are small.
const FULL: Setting = ("quality.resolution", "full");

/// The view most figures share: a field of cumulus from the ground, the sun to the right behind the camera.
const FIELD: Scene = Scene { settings: &[FULL], ..EVERYDAY };

/// A stage of the clouds in that view.
const fn stage(name: &'static str, debug: CloudDebugView) -> Scene {
    Scene { name, debug, ..FIELD }
}

/// The same before the phase function, which the thesis adds last.
const fn light(name: &'static str, debug: CloudDebugView) -> Scene {
    Scene { settings: &[FULL, ("lighting.phase", "isotropic")], ..stage(name, debug) }
}

/// Clouds between the camera and the sun, with and without the phase function.
const fn backlit(name: &'static str, preset: &'static str, sun: SunPose, debug: CloudDebugView) -> Scene {
    let camera = CameraPose::new(0.0, 2.0, 0.0, 0.0, 20.0);
    Scene { name, preset, sun, camera, debug, ..FIELD }
}

const DAY: SunPose = SunPose::new(32.0, -3.0);
const LOW: SunPose = SunPose::new(4.0, 8.0);

/// One cloud from near by, where single steps show.
const fn near(name: &'static str, settings: &'static [Setting]) -> Scene {
    let camera = CameraPose { fov: 20.0, ..CameraPose::new(0.0, 2.0, 0.0, 9.0, 16.0) };
    Scene { name, settings, camera, ..FIELD }
}

/// Figures 5.1 to 5.13, in order.
pub const FIGURES: [Scene; 18] = [
    stage("thesis_coverage", CloudDebugView::CoverageMap),
    stage("thesis_type", CloudDebugView::TypeMap),
    stage("thesis_profile", CloudDebugView::DimensionalProfile),
    stage("thesis_eroded", CloudDebugView::ErodedDensity),
    light("thesis_single", CloudDebugView::SingleScattering),
    light("thesis_multiple", CloudDebugView::MultipleScattering),
    light("thesis_ambient", CloudDebugView::None),
    backlit("thesis_phase_day", "FairWeather", DAY, CloudDebugView::None),
    backlit("thesis_phase_day_off", "FairWeather", DAY, CloudDebugView::NoPhase),
    backlit("thesis_phase_sunset", "Sunset", LOW, CloudDebugView::None),
    backlit("thesis_phase_sunset_off", "Sunset", LOW, CloudDebugView::NoPhase),
    Scene {
        name: "thesis_coverage_sweep",
        strip: &[
            &[("model.coverage", "-0.6")],
            &[("model.coverage", "-0.25")],
            &[("model.coverage", "0.0")],
            &[("model.coverage", "0.25")],
            &[("model.coverage", "0.6")],
        ],
        ..FIELD
    },
    near("thesis_aliasing_off", &[FULL, STEP_200, LEVEL, ALONE, CENTRED]),
    near("thesis_aliasing_blue_noise", &[FULL, STEP_200, LEVEL, ALONE]),
    near("thesis_integration_naive", &[FULL, STEP_80, LEVEL, ("quality.integration", "naive")]),
    near("thesis_integration", &[FULL, STEP_80, LEVEL]),
    near("thesis_window_8m", &[FULL, ("quality.step", "8"), LEVEL, ALONE, CENTRED, MANY]),
    near("thesis_window_80m", &[FULL, STEP_80, LEVEL, MANY, ("quality.window", "8")]),
];

const STEP_80: Setting = ("quality.step", "80");
const STEP_200: Setting = ("quality.step", "200");
/// Steps as long far away as near by.
const LEVEL: Setting = ("quality.step_growth", "0");
/// Every frame alone, without the window.
const ALONE: Setting = ("quality.temporal", "off");
/// Samples in the middle of pixels and steps.
const CENTRED: Setting = ("quality.offsets", "false");
const MANY: Setting = ("quality.max_steps", "8192");
