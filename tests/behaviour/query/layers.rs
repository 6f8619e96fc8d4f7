//! Weather-map layers: the twin's answers against the GPU's, and against its own bounds.

use std::cell::Cell;

use bevy::{
    math::{DVec2, DVec3, DVec4},
    prelude::*,
};
use bevy_cumulus::testing::model_bindings;
use bevy_cumulus::{
    prelude::*,
    reference::{
        field::{LayerSides, LocalModel, Medium, ModelTextures},
        planet::Planet,
        query::CloudTextureSet,
    },
    settings::LayerKind,
};
use rand::{Rng, SeedableRng, rngs::StdRng};

use super::{BYTES, F32, WEIGHT, field_app, percentile, sky, small, summary, until_current};
use crate::support::{evaluate::U, gpu::run_compute_with};

/// Results: density, extinction, profile, their bounds, span, albedo, phase.
const ASK: &str = "
import bevy_cumulus::model::model::{density_bound, extinction_bound, sample_medium};

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x * 4u;
    if i >= arrayLength(&values) {
        return;
    }
    let p = vec3<f32>(values[i], values[i + 1u], values[i + 2u]);
    let lod = values[i + 3u];
    let medium = sample_medium(p, lod);
    let o = id.x * 12u;
    results[o] = medium.density;
    results[o + 1u] = medium.extinction;
    results[o + 2u] = medium.profile;
    results[o + 3u] = density_bound(p, lod);
    results[o + 4u] = extinction_bound(p, lod);
    results[o + 5u] = medium.span.x;
    results[o + 6u] = medium.span.y;
    results[o + 7u] = medium.albedo.x;
    results[o + 8u] = medium.phase.x;
    results[o + 9u] = medium.phase.y;
    results[o + 10u] = medium.phase.z;
    results[o + 11u] = medium.phase.w;
}
";

/// The twin's textures with one reading, or all, wrong by as much as a GPU's filter may get it.
///
/// A layer's density rises with some readings, falls with others and is moved by others still. What all errors do together
/// is what each does alone, added up, to first order; some draws of all at once show the kinks that one alone does not
/// reach.
struct Wrong<'a> {
    exact: &'a CloudTextureSet,
    which: Cell<Which>,
    asked: Cell<usize>,
}

#[derive(Clone, Copy)]
enum Which {
    None,
    /// This one, in the order of asking, with this sign.
    One(usize, f64),
    /// All, with the signs of this draw.
    All(u64),
}

/// Draws of all errors at once.
const DRAWS: u64 = 12;

impl Wrong<'_> {
    fn turn(&self) -> Option<f64> {
        let n = self.asked.get();
        self.asked.set(n + 1);
        match self.which.get() {
            Which::None => None,
            Which::One(one, sign) => (n == one).then_some(sign),
            // The first two draws are all too high and all too low.
            Which::All(draw @ 0..2) => Some(if draw == 0 { 1.0 } else { -1.0 }),
            Which::All(draw) => {
                let hash = (draw << 32 | n as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                Some(if (hash ^ hash >> 29) & 1 << 33 == 0 { 1.0 } else { -1.0 })
            }
        }
    }

    /// A reading of a texture of this many texels a side in these many axes.
    fn read(&self, read: impl Fn(DVec3, f64) -> f64, at: DVec3, level: f64, (side, axes, rounding): Shape) -> f64 {
        let exact = read(at, level);
        let Some(sign) = self.turn() else { return exact };
        let off = |at: DVec3, level: f64| (read(at, level) - exact).abs();
        let mut error = rounding + off(at, level + WEIGHT).max(off(at, level - WEIGHT));
        let texels = (f64::from(side) / level.clamp(0.0, 30.0).ceil().exp2()).max(1.0);
        for axis in &DVec3::AXES[..axes] {
            let step = *axis * (WEIGHT / texels + 4.0 * U * (at.dot(*axis).abs() + 1.0));
            error += off(at + step, level).max(off(at - step, level));
        }
        exact + sign * error
    }

    fn flat(&self, read: impl Fn(DVec2, f64) -> f64, at: DVec2, level: f64, side: u32, rounding: f64) -> f64 {
        self.read(|at, level| read(at.truncate(), level), at.extend(0.0), level, (side, 2, rounding))
    }
}

type Shape = (u32, usize, f64);

impl ModelTextures for Wrong<'_> {
    fn sides(&self) -> [u32; 4] {
        self.exact.sides()
    }
    fn billow(&self, at: DVec3, level: f64) -> f64 {
        self.read(|at, level| self.exact.billow(at, level), at, level, (self.sides()[0], 3, BYTES))
    }
    fn wisp(&self, at: DVec3, level: f64) -> f64 {
        self.read(|at, level| self.exact.wisp(at, level), at, level, (self.sides()[1], 3, BYTES))
    }
    fn coverage(&self, at: DVec2, level: f64) -> f64 {
        self.flat(|at, level| self.exact.coverage(at, level), at, level, self.sides()[2], 0.0)
    }
    fn coverage_bound(&self, at: DVec2, level: f64) -> f64 {
        self.flat(|at, level| self.exact.coverage_bound(at, level), at, level, self.sides()[2], 0.0)
    }
    fn type_map(&self, at: DVec2, level: f64) -> f64 {
        self.flat(|at, level| self.exact.type_map(at, level), at, level, self.sides()[3], 0.0)
    }
    fn gradient(&self, cloud_type: f64, height: f64) -> f64 {
        let read = |at: DVec2, _: f64| self.exact.gradient(at.x, at.y);
        self.flat(read, DVec2::new(cloud_type, height), 0.0, 256, 0.0)
    }
    fn layer_sides(&self) -> Option<LayerSides> {
        self.exact.layer_sides()
    }
    fn shape(&self, at: DVec3, level: f64) -> [f64; 2] {
        let side = self.layer_sides().unwrap().shape;
        [0, 1].map(|k| self.read(|at, level| self.exact.shape(at, level)[k], at, level, (side, 3, BYTES)))
    }
    fn detail(&self, at: DVec3, level: f64) -> f64 {
        let side = self.layer_sides().unwrap().detail;
        self.read(|at, level| self.exact.detail(at, level), at, level, (side, 3, BYTES))
    }
    fn weather(&self, layer: usize, at: DVec2, level: f64) -> DVec4 {
        let side = self.layer_sides().unwrap().weather;
        let read = |k: usize| self.flat(|at, level| self.exact.weather(layer, at, level)[k], at, level, side, BYTES);
        DVec4::from_array([0, 1, 2, 3].map(read))
    }
    fn swirl(&self, at: DVec2, level: f64) -> DVec4 {
        let read = |k: usize| self.flat(|at, level| self.exact.swirl(at, level)[k], at, level, 256, BYTES);
        DVec4::from_array([0, 1, 2, 3].map(read))
    }
}

/// What each error alone does to numbers, added up, and the most of what all at once do.
fn allowed<const N: usize>(wrong: &Wrong, numbers: impl Fn(DVec3) -> [f64; N], p: DVec3) -> [f64; N] {
    let ask = |which: Which, p: DVec3| {
        wrong.which.set(which);
        wrong.asked.set(0);
        numbers(p)
    };
    let exact = ask(Which::None, p);
    let readings = wrong.asked.get();
    let off = |a: [f64; N]| std::array::from_fn::<f64, N, _>(|k| (a[k] - exact[k]).abs());
    let most = |a: [f64; N], b: [f64; N]| std::array::from_fn::<f64, N, _>(|k| a[k].max(b[k]));
    let mut sum = (0..DRAWS).map(|draw| off(ask(Which::All(draw), p))).fold([0.0; N], most);
    let mut add = |errors: [f64; N]| (0..N).for_each(|k| sum[k] += errors[k]);
    for n in 0..readings {
        add(most(off(ask(Which::One(n, 1.0), p)), off(ask(Which::One(n, -1.0), p))));
    }
    // The altitude, which heights in clouds are differences of.
    let step = 0.02 * DVec3::Y;
    add(most(off(ask(Which::None, p + step)), off(ask(Which::None, p - step))));
    sum
}

pub fn map(seed: u32, scale: f32, cover: f32) -> WeatherRecipe {
    WeatherRecipe { seed, scale, cover, size: 128, cell_size: scale / 16.0, ..default() }
}

/// A storm with rain and an anvil, low and thick.
pub fn storm() -> CloudLayer {
    CloudLayer {
        map: map(1, 20_000.0, 6.0),
        coverage: 0.2,
        sharpness: 2.0,
        base: 900.0,
        base_rise: 400.0,
        thickness: 6000.0,
        anvil: 0.8,
        rain: 0.9,
        rain_depth: 800.0,
        turbulence: 600.0,
        stretch: 3.0,
        stretch_angle: 30.0,
        wind: Vec3::new(-20.0, 1.0, 35.0),
        wind_skew: 3000.0,
        base_to_top: 0.4,
        ..default()
    }
}

/// Fibres high up.
pub fn sheet() -> CloudLayer {
    CloudLayer {
        kind: LayerKind::Sheet,
        map: map(2, 60_000.0, 5.0),
        base: 5000.0,
        thickness: 1500.0,
        density: 0.4,
        extinction: 0.004,
        stretch: 6.0,
        turbulence: 900.0,
        turbulence_height: 4.0,
        wispiness: 0.4,
        far_coverage: 0.5,
        far_start: 2000.0,
        far_end: 50_000.0,
        own_phase: true,
        phase: CloudPhase { function: PhaseFunction::Rayleigh, ..default() },
        ..default()
    }
}

fn heap() -> CloudLayer {
    CloudLayer {
        map: map(3, 12_000.0, 4.0),
        coverage: 0.1,
        far_coverage: -0.6,
        peak_height: 0.5,
        profile_strength: 2.0,
        shape_gain: 3.0,
        detail_strength: 0.9,
        wispiness: 1.0,
        density: 2.0,
        drift: DVec3::new(5e6, -300.0, -2e6),
        evolution: -4.0,
        renewal: 20.0,
        albedo: Vec3::new(0.9, 0.95, 1.0),
        ..default()
    }
}

struct Case {
    model: CloudModel,
    layers: Vec<CloudLayer>,
    seconds: f64,
    camera: DVec3,
}

fn cases() -> Vec<Case> {
    let off = CloudModel { enabled: false, ..default() };
    let on = CloudModel { coverage: 0.5, bottom: 1500.0, top: 4000.0, density: 0.7, ..default() };
    let far = CloudModel { world_offset: DVec3::new(4e5, 0.0, -3e5), ..on.clone() };
    let hidden = CloudLayer { enabled: false, ..storm() };
    let case = |model: &CloudModel, layers: &[CloudLayer], seconds, camera: [f64; 3]| Case {
        model: model.clone(),
        layers: layers.to_vec(),
        seconds,
        camera: camera.into(),
    };
    vec![
        case(&off, &[storm()], 0.0, [0.0, 2.0, 0.0]),
        case(&off, &[sheet()], 36_000.0, [-3000.0, 9000.0, 500.0]),
        case(&off, &[hidden, heap()], 3.2e5, [12_345.0, 10.0, -6789.0]),
        case(&on, &[sheet(), storm(), heap()], 86_400.0, [100.0, 3000.0, 200.0]),
        case(&far, &[storm(), heap(), CloudLayer { base: 3000.0, ..sheet() }], -7200.0, [0.0, 1500.0, 0.0]),
    ]
}

/// Within 60 km, from under the decks to over them; half of the filter widths at full detail.
fn point(rng: &mut StdRng, [bottom, top]: [f64; 2]) -> [f32; 4] {
    let away = 10_f32.powf(rng.random_range(1.0..4.8));
    let angle: f32 = rng.random_range(0.0..std::f32::consts::TAU);
    let height = rng.random_range(bottom as f32 - 100.0..top as f32 + 100.0);
    let lod = if rng.random_bool(0.5) { 0.0 } else { rng.random_range(-2.0..12.0) };
    [away * angle.cos(), height - away * away / (2.0 * 6.36e6), away * angle.sin(), lod]
}

fn numbers(medium: Medium) -> [f64; 10] {
    let Medium { density, extinction, albedo, profile, phase, span } = medium;
    [density, extinction, profile, albedo.x, phase.x, phase.y, phase.z, phase.w, span.x, span.y]
}

fn compare(
    k: usize,
    twin: &LocalModel<CloudTextureSet>,
    wrong: &Wrong,
    rough: &LocalModel<Wrong>,
    asked: &Asked,
) -> f64 {
    let (point, gpu) = asked;
    let g = gpu.map(f64::from);
    let (p, lod) = (Vec3::from_slice(point).as_dvec3(), f64::from(point[3]));
    let medium = twin.sample_medium(p, lod);
    let cpu = numbers(medium);
    let found = [g[0], g[1], g[2], g[7], g[8], g[9], g[10], g[11], g[5], g[6]];
    // Ways are in metres, of altitudes in f32.
    let near = |i: usize| (found[i] - cpu[i]).abs() <= if i < 8 { F32 * cpu[i].max(0.01) } else { 0.05 };
    if !(0..10).all(near) {
        let allowed = allowed(wrong, |p| numbers(rough.sample_medium(p, lod)), p);
        // A mixture of next to nothing and next to nothing may be of any kind.
        let some = cpu[0] > 0.0 && g[0] > 0.0 && allowed[1] < 0.5 * cpu[1];
        for i in 0..if some { 10 } else { 3 } {
            let tolerance = allowed[i] + 4.0 * F32 * cpu[i].max(0.1);
            let error = (found[i] - cpu[i]).abs();
            assert!(error <= tolerance, "case {k}: {point:?}: number {i} is {} not {}, {tolerance}", found[i], cpu[i]);
        }
    }
    bounds_agree(k, twin, wrong, rough, asked);
    (g[0] - cpu[0]).abs()
}

fn bounds_agree(k: usize, twin: &LocalModel<CloudTextureSet>, wrong: &Wrong, rough: &LocalModel<Wrong>, asked: &Asked) {
    let (point, gpu) = asked;
    let p = Vec3::from_slice(point).as_dvec3();
    // Where rounding decides which level is read, either will do.
    let reach = f64::from(point[3]).exp2();
    for (i, found) in [(0, f64::from(gpu[3])), (1, f64::from(gpu[4]))] {
        let both = |p: DVec3, reach: f64| [twin.density_bound(p, reach), twin.extinction_bound(p, reach)];
        let close = |reach: f64| (both(p, reach)[i] - found).abs() <= 1e-4 * found.max(1e-3);
        if [reach, reach * 1.00001, reach * 0.99999].into_iter().any(close) {
            continue;
        }
        let rough = |p: DVec3| [rough.density_bound(p, reach), rough.extinction_bound(p, reach)];
        let (allowed, exact) = (allowed(wrong, rough, p)[i], both(p, reach)[i]);
        assert!(
            (found - exact).abs() <= allowed + 1e-3 * exact,
            "case {k}: {point:?}: bound {i} is {found}, not {exact}, {allowed}"
        );
    }
}

type Asked = ([f32; 4], [f32; 12]);

#[test]
fn gpu_and_cpu_agree_on_layers_at_100_000_points() {
    let mut app = field_app(small(1));
    let mut rng = StdRng::seed_from_u64(90);
    let mut errors = Vec::new();
    let mut rain = 0;
    for (k, Case { model, layers, seconds, camera }) in cases().into_iter().enumerate() {
        app.insert_resource(CloudLayers(layers.clone()))
            .insert_resource(model.clone())
            .insert_resource(CloudClock { seconds, speed: 0.0 });
        until_current(&mut app);
        let sky = sky(&app);
        assert_eq!((sky.model(), &sky.layers().0, sky.seconds()), (&model, &layers, seconds));
        let wrong = Wrong { exact: sky.textures(), which: Cell::new(Which::None), asked: Cell::new(0) };
        let planet = Planet::default();
        let twin = LocalModel::new(&model, sky.layers(), seconds, camera, planet, sky.textures()).unwrap();
        let rough = LocalModel::new(&model, sky.layers(), seconds, camera, planet, &wrong).unwrap();
        let points: Vec<[f32; 4]> = (0..20_000).map(|_| point(&mut rng, twin.bounds())).collect();
        let group = model_bindings(&app, camera).expect("the model can be bound");
        let (n, count) = (12 * points.len(), points.len() as u32);
        let found = run_compute_with(&mut app, ASK, Some(&group), points.as_flattened(), n, count);
        let mut own = Vec::new();
        for asked in points.into_iter().zip(found.as_chunks::<12>().0.iter().copied()) {
            let error = compare(k, &twin, &wrong, &rough, &asked);
            if asked.1[0] > 0.0 {
                own.push(error);
                rain += u32::from(asked.1[2] == 0.0);
            }
        }
        println!("case {k}: {} in cloud, error {}", own.len(), summary(&mut own));
        assert!(own.len() > 1000, "case {k}: {} points in cloud", own.len());
        errors.extend(own);
    }
    println!("{} in cloud, {rain} in rain, error {}", errors.len(), summary(&mut errors));
    assert!(rain > 300, "{rain} in rain");
    // The tolerance of most points is far smaller than that of the worst.
    assert!(percentile(&errors, 0.5) < 0.002 && percentile(&errors, 0.99) < 0.06, "{}", summary(&mut errors));
}

#[test]
fn nothing_of_a_layer_is_denser_than_the_bound_around_it() {
    let mut app = field_app(small(1));
    let mut rng = StdRng::seed_from_u64(91);
    for (k, Case { model, layers, seconds, camera }) in cases().into_iter().enumerate() {
        app.insert_resource(CloudLayers(layers)).insert_resource(model);
        until_current(&mut app);
        let sky = sky(&app);
        let twin =
            LocalModel::new(sky.model(), sky.layers(), seconds, camera, Planet::default(), sky.textures()).unwrap();
        let (mut empty, mut cloud, mut close) = (0, 0, 0.0_f64);
        for _ in 0..40_000 {
            let p = Vec3::from_slice(&point(&mut rng, twin.bounds())).as_dvec3();
            let lod: f64 = rng.random_range(-1.0..12.0);
            let direction = DVec3::from_array([(); 3].map(|()| rng.random_range(-1.0..1.0))).normalize_or(DVec3::Y);
            let q = p + direction * 0.9999 * lod.exp2() * rng.random_range(0.0_f64..1.0).sqrt();
            let finer = if rng.random_bool(0.3) { 0.0 } else { rng.random_range(0.0..8.0) };
            let (medium, reach) = (twin.sample_medium(q, lod - finer), lod.exp2());
            let [density, extinction] = [twin.density_bound(p, reach), twin.extinction_bound(p, reach)];
            assert!(medium.density <= density + 1e-9, "case {k}: {p} {q} {lod}: {medium:?} over {density}");
            assert!(medium.extinction <= extinction + 1e-12, "case {k}: {p} {q} {lod}: {medium:?} over {extinction}");
            empty += u32::from(density == 0.0);
            cloud += u32::from(medium.density > 0.0);
            close = close.max(medium.density / density.max(1e-9));
        }
        println!("case {k}: {empty} certainly empty, {cloud} in cloud, density up to {close:.3} of the bound");
        assert!(empty > 300 && cloud > 1000, "case {k}: {empty} certainly empty, {cloud} in cloud");
    }
}
