//! Pictures of scenes.

use bevy::{camera::visibility::NoFrustumCulling, prelude::*};
use bevy_cumulus::{CloudPhaseTable, prelude::*};

use super::scene::{Images, Scene};
use crate::support::{
    app::{Sky, View, cloud_pixels, clouds_app, clouds_app_in, spawn_sun, spawn_view, until_drawn},
    gpu::{run_until, run_updates},
    program::Folder,
    scene::{linear_pixels, spawn_box, spawn_linear, steps},
    shared::SharedApp,
    uniform_slab::UniformSlab,
};

pub const SIZE: UVec2 = UVec2::new(32, 18);
/// Where sunlight goes.
pub const LIGHT: Vec3 = Vec3::new(-0.4, -1.0, -0.3);
const GLASS: Vec3 = Vec3::new(1.0, 0.0, 0.0);
/// Field of view, over the height (rad).
const FOV: f32 = std::f32::consts::FRAC_PI_4;

/// Luminance and transmittance of clouds, row by row.
pub struct Picture(pub Vec<Vec4>);

/// An app with a sun, a camera, and a pane of red glass close before that, which is hidden.
pub struct PictureLab {
    app: App,
    view: View,
    glass: Entity,
    images: Images,
    resets: u32,
    _files: Folder,
}

/// A table of the phase function that sends all light back.
const BACK: &str = "0,0.001\n90,0.001\n150,1\n180,1\n";

impl PictureLab {
    pub fn new() -> Self {
        let files = Folder::new();
        files.write("back.phase.csv", BACK);
        let mut app = clouds_app_in(&files);
        spawn_sun(&mut app, LIGHT);
        let view = spawn_linear(&mut app, SIZE, Transform::default());
        let glass = spawn_box(&mut app, Vec3::new(400.0, 400.0, 0.01), Transform::default(), GLASS);
        let handle = app.world().get::<MeshMaterial3d<StandardMaterial>>(glass).expect("a material").0.clone();
        let mut materials = app.world_mut().resource_mut::<Assets<StandardMaterial>>();
        let mut material = materials.get_mut(&handle).expect("it is there");
        material.alpha_mode = AlphaMode::Blend;
        material.base_color.set_alpha(0.6);
        drop(material);
        app.world_mut().entity_mut(glass).insert((NoFrustumCulling, Visibility::Hidden));
        Self { app, view, glass, images: Images::default(), resets: 0, _files: files }
    }

    fn show(&mut self, scene: &Scene) {
        scene.apply(&mut self.app, &mut self.images);
        self.resets += 1;
        let view = CloudView { reset: self.resets, ..scene.view.clone() };
        self.app.world_mut().entity_mut(self.view.camera).insert((scene.pose, view));
        let pane = scene.pose * Transform::from_xyz(0.0, 0.0, -100.0);
        self.app.world_mut().entity_mut(self.glass).insert(pane);
        run_updates(&mut self.app, 2);
        if scene.view.enabled {
            until_drawn(&mut self.app);
        }
        if scene.settings.layers.0.iter().any(|layer| !layer.phase_file.is_empty()) {
            run_until(&mut self.app, "a table", 300, |app| {
                app.world().resource::<Assets<CloudPhaseTable>>().iter().next().is_some()
            });
            run_updates(&mut self.app, 2);
        }
        // What went by meanwhile does not count.
        scene.apply(&mut self.app, &mut self.images);
        self.start_over();
    }

    /// Drops what the view holds, in the next frame.
    fn start_over(&mut self) {
        self.resets += 1;
        self.app.world_mut().get_mut::<CloudView>(self.view.camera).expect("a view").reset = self.resets;
    }

    fn picture(&self) -> Picture {
        let picture = Picture(cloud_pixels(&self.app, &self.view));
        assert!(picture.0.iter().all(|p| p.is_finite()), "some of the picture is no number");
        picture
    }

    /// The picture after so many frames.
    pub fn after(&mut self, scene: &Scene, frames: u32) -> Picture {
        self.show(scene);
        run_updates(&mut self.app, frames);
        self.picture()
    }

    pub fn of(&mut self, scene: &Scene) -> Picture {
        self.after(scene, 2)
    }

    /// The same scene looked at another way.
    pub fn towards(&mut self, scene: &Scene, pose: Transform) -> Picture {
        self.of(&Scene { pose, ..scene.clone() })
    }

    /// Steps of each pixel's ray.
    pub fn steps(&mut self, scene: &Scene) -> Vec<f32> {
        self.show(scene);
        steps(&mut self.app, &self.view)
    }

    /// The pictures of a frame, after so many, and of the next, which `change` comes before.
    pub fn two(&mut self, scene: &Scene, frames: u32, change: impl FnOnce(&mut CloudView)) -> [Picture; 2] {
        let first = self.after(scene, frames);
        change(&mut self.app.world_mut().get_mut::<CloudView>(self.view.camera).expect("a view"));
        run_updates(&mut self.app, 1);
        [first, self.picture()]
    }

    /// The mean colour that is shown, in linear light, background and all.
    pub fn shown(&mut self, scene: &Scene) -> Vec3 {
        self.show(scene);
        run_updates(&mut self.app, 3);
        let pixels = linear_pixels(&self.app, &self.view);
        pixels.iter().sum::<Vec3>() / pixels.len() as f32
    }

    /// The same with the pane of glass.
    pub fn shown_with_glass(&mut self, scene: &Scene) -> Vec3 {
        self.app.world_mut().entity_mut(self.glass).insert(Visibility::Visible);
        let shown = self.shown(scene);
        self.app.world_mut().entity_mut(self.glass).insert(Visibility::Hidden);
        shown
    }
}

/// A sun and a camera in an app that other tests use too.
pub struct SharedLab {
    app: SharedApp,
    view: View,
    /// In place of the scenes' models.
    model: Option<CloudModel>,
    images: Images,
}

impl SharedLab {
    fn new(mut app: SharedApp, sky: Sky, model: Option<CloudModel>) -> Self {
        spawn_sun(&mut app, LIGHT);
        let view = spawn_view(&mut app, SIZE, Transform::default(), sky);
        Self { app, view, model, images: Images::default() }
    }

    /// A uniform slab before the path tracer, which takes a minute to compile for the built-in model.
    pub fn traced() -> Self {
        let slab = UniformSlab::new(1500.0, 2500.0, 0.001);
        Self::new(slab.traced_app(), Sky::Black, Some(slab.settings()))
    }

    /// Bevy's atmosphere.
    pub fn air() -> Self {
        Self::new(clouds_app(), Sky::Atmosphere, None)
    }

    pub fn of(&mut self, scene: &Scene) -> Picture {
        let mut scene = scene.clone();
        scene.settings.model = self.model.clone().unwrap_or(scene.settings.model);
        scene.apply(&mut self.app, &mut self.images);
        self.app.world_mut().entity_mut(self.view.camera).insert(scene.pose);
        run_updates(&mut self.app, 2);
        until_drawn(&mut self.app);
        self.app.world_mut().get_mut::<CloudView>(self.view.camera).expect("a view").reset += 1;
        run_updates(&mut self.app, 2);
        Picture(cloud_pixels(&self.app, &self.view))
    }
}

impl Picture {
    fn mean(&self, of: impl Fn(&Vec4) -> f32) -> f32 {
        self.0.iter().map(of).sum::<f32>() / self.0.len().max(1) as f32
    }

    /// Mean green light (cd/m²).
    pub fn light(&self) -> f32 {
        self.mean(|p| p.y)
    }

    /// Mean light in colour.
    pub fn colour(&self) -> Vec3 {
        Vec3::new(self.mean(|p| p.x), self.mean(|p| p.y), self.mean(|p| p.z))
    }

    /// Mean transmittance.
    pub fn transmittance(&self) -> f32 {
        self.mean(|p| p.w)
    }

    pub fn brightest(&self) -> f32 {
        self.0.iter().map(|p| p.y).fold(0.0, f32::max)
    }

    /// Mean difference of light from that of another picture, in shares of the mean.
    pub fn difference(&self, other: &Self) -> f32 {
        let sum: f32 = self.0.iter().zip(&other.0).map(|(a, b)| (a.y - b.y).abs()).sum();
        sum / self.0.len() as f32 / other.light().max(1e-9)
    }

    /// Share of the pixels that differ, by more than rounding.
    pub fn changed(&self, other: &Self) -> f32 {
        let count = self.0.iter().zip(&other.0).filter(|(a, b)| (a.y - b.y).abs() > 1e-3 * a.y).count();
        count as f32 / self.0.len() as f32
    }

    /// Mean difference of light from each pixel to the next of its row, in shares of the mean.
    pub fn roughness(&self) -> f32 {
        let width = SIZE.x as usize;
        let rows = self.0.chunks(width);
        let sum: f32 = rows.flat_map(|row| row.windows(2)).map(|p| (p[0].y - p[1].y).abs()).sum();
        sum / (self.0.len() - SIZE.y as usize) as f32 / self.light().max(1e-9)
    }

    /// Mean light of pixels so far from the picture's middle (degrees).
    pub fn ring(&self, from: f32, to: f32) -> f32 {
        let half = (0.5 * FOV).tan();
        let angle = |k: usize| {
            let [x, y] = [k as u32 % SIZE.x, k as u32 / SIZE.x].map(|n| n as f32 + 0.5);
            let size = SIZE.as_vec2();
            let at = Vec2::new(2.0 * x - size.x, 2.0 * y - size.y) / size.y * half;
            at.length().atan().to_degrees()
        };
        let there: Vec<f32> =
            self.0.iter().enumerate().filter(|(k, _)| (from..to).contains(&angle(*k))).map(|(_, p)| p.y).collect();
        assert!(there.len() > 5, "{} pixels from {from}° to {to}°", there.len());
        there.iter().sum::<f32>() / there.len() as f32
    }
}

/// From the ground, looking up into the sun.
pub fn into_the_sun() -> Transform {
    Transform::from_xyz(0.0, 10.0, 0.0).looking_to(-LIGHT, Vec3::Z)
}

/// From above, looking along the sun's light.
pub fn with_the_sun() -> Transform {
    Transform::from_xyz(0.0, 6000.0, 0.0).looking_to(LIGHT, Vec3::Z)
}

/// From the ground, looking this many degrees up, and away from the sun.
pub fn up(degrees: f32) -> Transform {
    Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(degrees.to_radians()))
}
