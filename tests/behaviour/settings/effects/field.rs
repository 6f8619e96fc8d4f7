//! The field of cloud as the shader has it, asked at points without a camera.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::testing::model_bindings;
use rand::{Rng, SeedableRng, rngs::StdRng};

use super::scene::{Images, Scene};
use crate::support::{
    app::{clouds_app_in, is_baked},
    gpu::{run_compute_with, run_until, run_updates},
    program::Folder,
};

const COUNT: usize = 6000;
/// Radius of the planet (m).
const R: f64 = 6.36e6;
/// Metres over which the medium is filtered, as a power of two.
const LOD: f32 = 2.0;

const ASK: &str = "
import bevy_cumulus::model::model::sample_medium;

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x * 4u;
    let o = id.x * 7u;
    if i >= arrayLength(&values) {
        return;
    }
    let medium = sample_medium(vec3(values[i], values[i + 1u], values[i + 2u]), values[i + 3u]);
    results[o] = medium.density;
    results[o + 1u] = medium.extinction;
    results[o + 2u] = medium.albedo.x;
    results[o + 3u] = medium.albedo.y;
    results[o + 4u] = medium.albedo.z;
    results[o + 5u] = medium.profile;
    results[o + 6u] = medium.phase.x;
}
";

/// What the shader says of a point.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Altitude, and place over the ground (m).
    pub height: f32,
    pub ground: Vec2,
    pub density: f32,
    pub extinction: f32,
    pub albedo: Vec3,
    pub profile: f32,
    /// Share of the first phase function.
    pub phase: f32,
}

/// Points of a scene.
pub struct Field(pub Vec<Point>);

/// An app without a camera, whose model a shader asks.
pub struct FieldLab {
    app: App,
    images: Images,
    _files: Folder,
}

impl FieldLab {
    pub fn new() -> Self {
        let files = Folder::new();
        let white = image::RgbaImage::from_pixel(8, 8, image::Rgba([255, 255, 255, 255]));
        white.save(files.join("white.png")).expect("the folder can be written");
        let mut app = clouds_app_in(&files);
        run_until(&mut app, "the textures are baked", 600, |app| is_baked(app));
        Self { app, images: Images::default(), _files: files }
    }

    /// Shows a scene, once its textures and maps are there.
    pub fn show(&mut self, scene: &Scene) {
        scene.apply(&mut self.app, &mut self.images);
        run_updates(&mut self.app, 3);
        run_until(&mut self.app, "textures and maps", 900, |app| is_baked(app));
        // What went by meanwhile does not count.
        scene.apply(&mut self.app, &mut self.images);
    }

    /// The scene's field, each point moved by what `shift` says for its altitude.
    pub fn moved(&mut self, scene: &Scene, shift: impl Fn(f32) -> Vec3) -> Field {
        self.show(scene);
        self.field(scene, shift)
    }

    pub fn of(&mut self, scene: &Scene) -> Field {
        self.moved(scene, |_| Vec3::ZERO)
    }

    /// The field as things stand, at the points of a scene.
    pub fn now(&mut self, scene: &Scene) -> Field {
        self.field(scene, |_| Vec3::ZERO)
    }

    fn field(&mut self, scene: &Scene, shift: impl Fn(f32) -> Vec3) -> Field {
        let group = model_bindings(&self.app, DVec3::ZERO).expect("the model can be bound");
        let mut rng = StdRng::seed_from_u64(77);
        let mut within = |end: f32| rng.random_range(-end..end);
        let [low, high] = scene.heights;
        let places: Vec<Vec3> = (0..COUNT)
            .map(|_| {
                let height = 0.5 * (low + high) + within(0.5 * (high - low));
                Vec3::new(within(scene.wide), height, within(scene.wide)) + shift(height)
            })
            .collect();
        let question = |at: &Vec3| {
            let [x, z] = [at.x, at.z].map(f64::from);
            let up = R + f64::from(at.y);
            [at.x, ((up * up - x * x - z * z).sqrt() - R) as f32, at.z, LOD]
        };
        let questions: Vec<f32> = places.iter().flat_map(question).collect();
        let answers = run_compute_with(&mut self.app, ASK, Some(&group), &questions, 7 * COUNT, COUNT as u32);
        let point = |(at, a): (&Vec3, &[f32; 7])| Point {
            height: at.y,
            ground: Vec2::new(at.x, at.z),
            density: a[0],
            extinction: a[1],
            albedo: Vec3::new(a[2], a[3], a[4]),
            profile: a[5],
            phase: a[6],
        };
        let field = Field(places.iter().zip(answers.as_chunks::<7>().0).map(point).collect());
        let is_good = |p: &Point| p.density >= 0.0 && p.extinction.is_finite() && p.albedo.is_finite();
        assert!(field.0.iter().all(is_good), "some of the field is no number");
        field
    }

    /// How much the density differs over this way, in shares of its mean.
    pub fn roughness(&mut self, scene: &Scene, way: Vec3) -> f32 {
        let here = self.of(scene);
        let there = self.field(scene, |_| way);
        here.difference(&there) / here.density().max(1e-9)
    }

    /// How the field of `b` differs from that of `a`: as it is, and looked at where `a` should have gone.
    pub fn moves(&mut self, a: &Scene, b: &Scene, shift: impl Fn(f32) -> Vec3) -> [f32; 2] {
        let [first, left] = [self.of(a), self.of(b)];
        let followed = self.field(b, shift);
        [first.difference(&left), first.difference(&followed)]
    }

    /// The app, to do to it what scenes do not say.
    pub fn app(&mut self) -> &mut App {
        &mut self.app
    }
}

impl Field {
    fn mean(&self, of: impl Fn(&Point) -> f32) -> f32 {
        self.0.iter().map(of).sum::<f32>() / self.0.len().max(1) as f32
    }

    /// Those points of which this holds.
    pub fn only(&self, is_meant: impl Fn(&Point) -> bool) -> Self {
        let points: Vec<Point> = self.0.iter().filter(|p| is_meant(p)).copied().collect();
        assert!(points.len() > 50, "only {} points are meant", points.len());
        Self(points)
    }

    /// Mean density, over all points.
    pub fn density(&self) -> f32 {
        self.mean(|p| p.density)
    }

    /// Mean extinction (1/m), over all points.
    pub fn extinction(&self) -> f32 {
        self.mean(|p| p.extinction)
    }

    /// Mean profile, over all points.
    pub fn profile(&self) -> f32 {
        self.mean(|p| p.profile)
    }

    /// Share of points with cloud.
    pub fn cover(&self) -> f32 {
        self.mean(|p| f32::from(p.density > 0.0))
    }

    fn cloudy(&self) -> impl Iterator<Item = &Point> {
        self.0.iter().filter(|p| p.density > 0.0)
    }

    /// Altitude of the lowest point with cloud (m).
    pub fn lowest(&self) -> f32 {
        self.cloudy().map(|p| p.height).fold(f32::INFINITY, f32::min)
    }

    pub fn highest(&self) -> f32 {
        self.cloudy().map(|p| p.height).fold(f32::NEG_INFINITY, f32::max)
    }

    /// Greatest density.
    pub fn densest(&self) -> f32 {
        self.cloudy().map(|p| p.density).fold(0.0, f32::max)
    }

    /// Mean altitude of the cloud (m).
    pub fn altitude(&self) -> f32 {
        self.mean(|p| p.density * p.height) / self.density().max(1e-9)
    }

    /// Mean albedo of points with cloud.
    pub fn albedo(&self) -> Vec3 {
        self.cloudy().map(|p| p.albedo).sum::<Vec3>() / self.cloudy().count().max(1) as f32
    }

    /// Mean share of the first phase function, of points with cloud.
    pub fn phase(&self) -> f32 {
        self.cloudy().map(|p| p.phase).sum::<f32>() / self.cloudy().count().max(1) as f32
    }

    /// Mean difference of the densities.
    pub fn difference(&self, other: &Self) -> f32 {
        let all = self.0.iter().zip(&other.0).map(|(a, b)| (a.density - b.density).abs());
        all.sum::<f32>() / self.0.len() as f32
    }
}
