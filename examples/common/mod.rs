//! What the examples share: named scenes, poses of camera and sun, the ground and the hills.
#![allow(dead_code, reason = "each example uses a part")]

mod ground;
mod hills;
mod objects;
mod thesis;

use std::str::FromStr;

use bevy::{
    camera::{Exposure, Hdr},
    core_pipeline::tonemapping::Tonemapping,
    light::{
        Atmosphere, AtmosphereEnvironmentMapLight, CascadeShadowConfigBuilder, SunDisk, atmosphere::ScatteringMedium,
        light_consts::lux,
    },
    pbr::{AtmosphereMode, AtmosphereSettings},
    prelude::*,
};
use bevy_cumulus::{prelude::*, reference::planet::PLANET_RADIUS};
use serde::Serialize;

/// Defaults for a picture: what is in it, and from where it is seen.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// Its name on the command line.
    pub name: &'static str,
    /// A built-in `CloudPreset`.
    pub preset: &'static str,
    /// Where the camera stands.
    pub camera: CameraPose,
    /// Where the sun stands.
    pub sun: SunPose,
    /// Whether there are hills and buildings up to 2 km high.
    pub hills: bool,
    /// Added to the exposure that the sun's elevation asks for (EV, below 0 is brighter).
    pub ev_offset: f32,
    /// Settings that differ from the preset's, by path.
    pub settings: &'static [Setting],
    /// The stage that is looked at.
    pub debug: CloudDebugView,
    /// Whether the picture is shared by two cameras: the right half looks back.
    pub split: bool,
    /// Further settings of each picture of a strip; empty where there is one picture.
    pub strip: &'static [&'static [Setting]],
}

/// Path and value of a setting, as `CloudSettings::set` takes them.
pub type Setting = (&'static str, &'static str);

/// What scenes have unless they say otherwise.
const EVERYDAY: Scene = Scene {
    name: "",
    preset: "FairWeather",
    camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 16.0),
    sun: SunPose::new(58.0, 130.0),
    hills: false,
    ev_offset: 0.0,
    settings: &[],
    debug: CloudDebugView::None,
    split: false,
    strip: &[],
};

/// The everyday scenes. The ground, the sun and Bevy's atmosphere are in each.
const SCENES: [Scene; 14] = [
    Scene {
        name: "ground_noon",
        preset: "FairWeather",
        camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 16.0),
        sun: SunPose::new(58.0, 130.0),
        ..EVERYDAY
    },
    Scene {
        name: "ground_backlit",
        preset: "FairWeather",
        camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 22.0),
        sun: SunPose::new(32.0, -3.0),
        ..EVERYDAY
    },
    Scene {
        name: "overcast",
        preset: "Overcast",
        camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 15.0),
        sun: SunPose::new(42.0, 40.0),
        ev_offset: -0.5,
        ..EVERYDAY
    },
    Scene {
        name: "sunset",
        preset: "Sunset",
        camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 13.0),
        sun: SunPose::new(3.0, 12.0),
        ..EVERYDAY
    },
    Scene {
        name: "hills",
        preset: "FairWeather",
        camera: CameraPose::new(0.0, 420.0, 0.0, 0.0, 9.0),
        sun: SunPose::new(38.0, 115.0),
        hills: true,
        ..EVERYDAY
    },
    Scene {
        name: "broken",
        preset: "Broken",
        camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 16.0),
        sun: SunPose::new(50.0, 130.0),
        ..EVERYDAY
    },
    Scene {
        name: "storm",
        preset: "Storm",
        camera: CameraPose::new(0.0, 2.0, 0.0, 0.0, 14.0),
        sun: SunPose::new(35.0, 60.0),
        ..EVERYDAY
    },
    Scene { name: "inside", camera: CameraPose::new(0.0, 2100.0, 0.0, 40.0, 4.0), ..EVERYDAY },
    Scene { name: "above", camera: CameraPose::new(0.0, 7000.0, 0.0, 0.0, -22.0), ..EVERYDAY },
    Scene {
        name: "between",
        camera: CameraPose::new(0.0, 2000.0, 0.0, -60.0, 0.0),
        sun: SunPose::new(30.0, 60.0),
        ..EVERYDAY
    },
    Scene {
        name: "orbit",
        preset: "WeatherSystems",
        camera: CameraPose::new(0.0, 400_000.0, 0.0, 0.0, -50.0),
        sun: SunPose::new(45.0, 60.0),
        ..EVERYDAY
    },
    Scene {
        name: "limb",
        preset: "WeatherSystems",
        camera: CameraPose::new(0.0, 400_000.0, 0.0, 0.0, -19.0),
        sun: SunPose::new(40.0, 60.0),
        ..EVERYDAY
    },
    Scene {
        name: "hills_in_cloud",
        preset: "Overcast",
        camera: CameraPose::new(0.0, 1700.0, 0.0, 0.0, -12.0),
        sun: SunPose::new(38.0, 115.0),
        hills: true,
        settings: &[("model.bottom", "300"), ("model.top", "1100")],
        ..EVERYDAY
    },
    Scene {
        name: "split_screen",
        hills: true,
        camera: CameraPose::new(0.0, 420.0, 0.0, 0.0, 9.0),
        split: true,
        ..EVERYDAY
    },
];

/// What is drawn where no scene is named: the first scene's view.
pub const PLAIN: Scene = Scene { name: "", ..SCENES[0] };

impl Scene {
    /// All scenes: the everyday ones, then the figures of the thesis.
    pub fn all() -> impl Iterator<Item = Self> {
        SCENES.into_iter().chain(thesis::FIGURES)
    }

    /// The scene of this name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|scene| scene.name == name)
    }
}

/// Where a camera is and looks.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct CameraPose {
    /// Position (m); y is the altitude near the world's origin.
    pub position: Vec3,
    /// Heading (degrees): 0 looks along −Z, positive turns right.
    pub yaw: f32,
    /// Tilt (degrees): positive looks up.
    pub pitch: f32,
    /// Vertical field of view (degrees).
    pub fov: f32,
}

impl CameraPose {
    /// A pose with the default field of view, 60°.
    pub const fn new(x: f32, y: f32, z: f32, yaw: f32, pitch: f32) -> Self {
        Self { position: Vec3::new(x, y, z), yaw, pitch, fov: 60.0 }
    }

    /// This pose as a transform.
    pub fn transform(&self) -> Transform {
        Transform { translation: self.position, rotation: heading(self.yaw, self.pitch), scale: Vec3::ONE }
    }

    /// The projection with this pose's field of view. Only culling reads `far`: depth is infinite.
    pub fn projection(&self, aspect_ratio: f32) -> Projection {
        Projection::Perspective(PerspectiveProjection {
            fov: self.fov.to_radians(),
            aspect_ratio,
            far: 1.0e8,
            ..default()
        })
    }
}

/// `x,y,z,yaw,pitch[,fov]`.
impl FromStr for CameraPose {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        const WHAT: &str = "x,y,z,yaw,pitch[,fov]";
        let n = numbers(text, WHAT)?;
        let (x, y, z, yaw, pitch, fov) = match n[..] {
            [x, y, z, yaw, pitch] => (x, y, z, yaw, pitch, 60.0),
            [x, y, z, yaw, pitch, fov] => (x, y, z, yaw, pitch, fov),
            _ => return Err(format!("expected {WHAT}, found {} numbers", n.len())),
        };
        within("x", x, -1.0e8, 1.0e8)?;
        within("y", y, -1.0e8, 1.0e8)?;
        within("z", z, -1.0e8, 1.0e8)?;
        within("pitch", pitch, -90.0, 90.0)?;
        within("fov", fov, 0.1, 170.0)?;
        Ok(Self { fov, ..Self::new(x, y, z, yaw, pitch) })
    }
}

/// Where the sun stands.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct SunPose {
    /// Angle above the horizon (degrees).
    pub elevation: f32,
    /// Compass direction (degrees): 0 is −Z, positive to the right (+X), like a camera's yaw.
    pub azimuth: f32,
}

impl SunPose {
    /// A sun at this elevation and azimuth (degrees).
    pub const fn new(elevation: f32, azimuth: f32) -> Self {
        Self { elevation, azimuth }
    }

    /// The transform of a directional light that shines from here. Defined at the zenith as well.
    pub fn transform(&self) -> Transform {
        let back = Quat::from_rotation_y(std::f32::consts::PI);
        Transform::from_rotation(heading(self.azimuth, self.elevation) * back)
    }

    /// An exposure at which the sky looks as bright as it does to the eye (EV100): 13.5 by day, 10.5 at sunset and
    /// 5 at the end of twilight.
    pub fn ev100(&self) -> f32 {
        let t = self.elevation;
        if t >= 0.0 { 10.5 + 3.0 * (t / 25.0).min(1.0) } else { (10.5 + t * 0.45).max(5.0) }
    }
}

/// `elevation,azimuth`.
impl FromStr for SunPose {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let [elevation, azimuth] = exactly(text, "elevation,azimuth")?;
        within("elevation", elevation, -90.0, 90.0)?;
        Ok(Self { elevation, azimuth })
    }
}

/// Turns −Z to this yaw and pitch (degrees).
fn heading(yaw: f32, pitch: f32) -> Quat {
    Quat::from_rotation_y(-yaw.to_radians()) * Quat::from_rotation_x(pitch.to_radians())
}

/// The finite numbers in `a,b,c`.
fn numbers(text: &str, what: &str) -> Result<Vec<f32>, String> {
    let number = |part: &str| match part.trim().parse::<f32>() {
        Ok(n) if n.is_finite() => Ok(n),
        _ => Err(format!("expected {what}, but {part:?} is not a finite number")),
    };
    text.split(',').map(number).collect()
}

/// Exactly `N` finite numbers in `a,b,c`; `what` names them in errors.
pub fn exactly<const N: usize>(text: &str, what: &str) -> Result<[f32; N], String> {
    let found = numbers(text, what)?;
    found.try_into().map_err(|found: Vec<f32>| format!("expected {what}, found {} numbers", found.len()))
}

fn within(name: &str, value: f32, min: f32, max: f32) -> Result<(), String> {
    if (min..=max).contains(&value) {
        Ok(())
    } else {
        Err(format!("{name} = {value} is outside its range {min} to {max}"))
    }
}

/// Spawns the ground, and the hills where the scene has them.
pub fn spawn_land(world: &mut World, hills: bool) {
    ground::spawn(world);
    if hills {
        hills::spawn(world);
        objects::spawn(world);
    }
}

/// Spawns the sun, and with `sky` Bevy's atmosphere, whose light it needs unfiltered.
pub fn spawn_sky(world: &mut World, sun: SunPose, sky: bool, shadows: bool) -> Entity {
    if sky {
        let medium = ScatteringMedium::earth(256, 256);
        let medium = world.resource_mut::<Assets<ScatteringMedium>>().add(medium);
        world.spawn(Atmosphere::earth(medium));
    }
    world.insert_resource(ClearColor(Color::BLACK));
    world.insert_resource(if sky {
        GlobalAmbientLight::NONE
    } else {
        GlobalAmbientLight { brightness: 1500.0, ..default() }
    });
    let cascades = CascadeShadowConfigBuilder {
        num_cascades: 3,
        minimum_distance: 10.0,
        first_cascade_far_bound: 3_000.0,
        maximum_distance: 30_000.0,
        ..default()
    };
    let light = DirectionalLight {
        illuminance: if sky { lux::RAW_SUNLIGHT } else { lux::DIRECT_SUNLIGHT },
        shadow_maps_enabled: shadows,
        ..default()
    };
    world.spawn((light, SunDisk::EARTH, cascades.build(), sun.transform())).id()
}

/// The parts of a camera that the pictures have in common; target, pose and clouds come with the example.
pub fn camera(ev100: f32) -> impl Bundle {
    (Camera3d::default(), Hdr, Exposure { ev100 }, Tonemapping::AcesFitted)
}

/// Altitude from which Bevy's atmosphere is marched (m): most of the air lies below.
const MARCHED_FROM: f32 = 25_000.0;

/// Bevy's atmosphere for a camera at this altitude (m).
///
/// Its table of the air before things has to reach to the horizon, beyond which the ground would show too dark, or where that
/// is near as far as clouds are seen. From far above the tables hold nothing, and Bevy has to march.
pub fn air(altitude: f32) -> AtmosphereSettings {
    let horizon = (2.0 * PLANET_RADIUS as f32 * altitude.max(0.0)).sqrt();
    let rendering_method =
        if altitude < MARCHED_FROM { AtmosphereMode::LookupTexture } else { AtmosphereMode::Raymarched };
    AtmosphereSettings {
        aerial_view_lut_max_distance: (1.1 * horizon).clamp(100_000.0, 400_000.0),
        rendering_method,
        sky_max_samples: 32,
        ..default()
    }
}

/// The parts of a camera that need Bevy's atmosphere, at this altitude (m).
pub fn sky_camera(altitude: f32) -> impl Bundle {
    let settings = air(altitude);
    (settings, AtmosphereEnvironmentMapLight::default())
}
