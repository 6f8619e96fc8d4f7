//! Weather-map layers, by the field.

use bevy::prelude::*;
use bevy_cumulus::prelude::*;

use super::{
    Expect::{By, Over, Times, Under},
    Row, both, each,
    field::FieldLab,
    model_rows::{FOLLOWED, after, broken},
    scene::Scene,
};
use crate::support::gpu::run_updates;

const BASE: f32 = 1200.0;

pub fn of(layer: CloudLayer, heights: [f32; 2]) -> Scene {
    let mut scene = broken();
    scene.settings.model.enabled = false;
    scene.settings.layers = CloudLayers(vec![layer]);
    scene.heights = heights;
    scene
}

/// Cumulus that does not lean or evolve, in a wind along x.
pub fn cumulus() -> CloudLayer {
    CloudLayer {
        map: WeatherRecipe { size: 64, scale: 20_000.0, cell_size: 2500.0, cover: 4.0, ..default() },
        base: BASE,
        base_rise: 0.0,
        wind: Vec3::new(10.0, 0.0, 0.0),
        wind_skew: 0.0,
        evolution: 0.0,
        renewal: 0.0,
        ..default()
    }
}

fn volume() -> Scene {
    of(cumulus(), [1200.0, 2600.0])
}

/// The profile alone, of clouds that are all equally tall.
fn bare_layer() -> CloudLayer {
    let layer = cumulus();
    let map = WeatherRecipe { height_variation: 0.0, base_variation: 1.0, ..layer.map.clone() };
    CloudLayer { map, shape_strength: 0.0, detail_strength: 0.0, turbulence: 0.0, shape_gain: 1.0, ..layer }
}

fn bare() -> Scene {
    of(bare_layer(), [300.0, 4300.0])
}

/// The profile and detail.
fn fine() -> Scene {
    of(CloudLayer { detail_strength: 0.8, ..bare_layer() }, [1200.0, 2600.0])
}

/// The same near the base, detail taking all that wisps take.
fn all_billow() -> Scene {
    let mut scene = fine();
    scene.slots = vec![("detail", [255; 4])];
    scene.heights = [1250.0, 1600.0];
    scene
}

/// The profile moved about by turbulence.
fn turbulent() -> Scene {
    of(CloudLayer { turbulence: 1500.0, turbulence_height: 1.0, shape_strength: 0.9, ..bare_layer() }, [1250.0, 2500.0])
}

/// Closed and so tall that shapes alone make a difference between these altitudes.
fn shapes_layer() -> CloudLayer {
    CloudLayer {
        coverage: 1.0,
        base: 0.0,
        thickness: 20_000.0,
        peak_height: 0.5,
        profile_strength: 0.6,
        shape_gain: 1.0,
        turbulence: 0.0,
        detail_strength: 0.0,
        shape_strength: 0.9,
        map: bare_layer().map,
        ..cumulus()
    }
}

pub fn shapes() -> Scene {
    of(shapes_layer(), [9000.0, 11_000.0])
}

/// Detail, and no other noise of it.
pub fn details() -> Scene {
    of(CloudLayer { shape_strength: 0.0, detail_strength: 0.8, ..shapes_layer() }, [9000.0, 11_000.0])
}

/// Shapes eight times as long along the wind as across it.
fn long() -> Scene {
    of(CloudLayer { stretch: 8.0, ..shapes_layer() }, [9000.0, 11_000.0])
}

fn storm() -> Scene {
    of(CloudLayer { thickness: 8000.0, ..bare_layer() }, [1200.0, 9200.0])
}

/// Rain from cumulus.
fn rain() -> Scene {
    let layer = bare_layer();
    let map = WeatherRecipe { cover: 6.0, base_variation: 0.0, ..layer.map.clone() };
    of(CloudLayer { rain: 1.0, base: 2000.0, rain_slant: 0.0, map, ..layer }, [100.0, 1950.0])
}

/// More and more cloud missing from 3 km on.
fn far() -> Scene {
    of(CloudLayer { far_coverage: -1.0, far_start: 3000.0, far_end: 9000.0, ..bare_layer() }, [1300.0, 2200.0])
}

/// In place of its map one colour, which is green: no coverage, and full height.
fn green() -> Scene {
    let mut scene = bare();
    scene.map_image = Some([0, 255, 0, 255]);
    scene
}

fn own_phase() -> Scene {
    let mut scene = volume();
    scene.set("layers.0.phase.function", "isotropic");
    scene
}

/// How rough the density is along x, in shares of how rough it is along z.
fn along_over_across(lab: &mut FieldLab, scene: &Scene) -> f32 {
    lab.roughness(scene, Vec3::X * 200.0) / lab.roughness(scene, Vec3::Z * 200.0)
}

/// How the density differs from that of the same scene without turbulence, in shares of that.
fn turned(lab: &mut FieldLab, scene: &Scene, heights: [f32; 2]) -> f32 {
    let scene = Scene { heights, ..scene.clone() };
    let mut calm = scene.clone();
    calm.settings.layers.0[0].turbulence = 0.0;
    let calm = lab.of(&calm);
    calm.difference(&lab.of(&scene)) / calm.density()
}

/// Altitude of the lowest cloud half way to the same sky 2 km higher, whose layer is called "same".
fn lowest_half_way(lab: &mut FieldLab, scene: &Scene) -> f32 {
    lab.of(scene);
    let mut target = scene.clone();
    target.set("layers.0.name", "same");
    target.set("layers.0.base", "3200");
    let CloudSettings { model, layers, lighting, textures, .. } = target.settings;
    let preset = CloudPreset { model, layers, lighting, textures, sun_elevation: None };
    let world = lab.app().world_mut();
    world.resource_mut::<CloudWeather>().transition_at(&preset, 0.0, 100.0).expect("a good preset");
    world.resource_mut::<CloudClock>().seconds = 50.0;
    run_updates(lab.app(), 2);
    let lowest = lab.now(scene).lowest();
    lab.app().insert_resource(CloudWeather::default());
    lowest
}

pub fn rows() -> Vec<Row<FieldLab>> {
    [maps(), profile(), noise(), medium(), below(), motion()].into_iter().flatten().collect()
}

#[rustfmt::skip]
fn maps() -> Vec<Row<FieldLab>> {
    vec![
        each("layers.0.name", bare, ["other", "same"], lowest_half_way, By(800.0, 1200.0)),
        each("layers.0.enabled", volume, ["false", "true"], |lab, s| lab.of(s).cover(), By(0.1, 1.0)),
        // A sheet's noise is the same at every height.
        each("layers.0.kind", shapes, ["volume", "sheet"], |lab, s| lab.roughness(s, Vec3::Y * 300.0), Under(0.3)),
        // A repeat twice as long holds twice as many cells, which are as large as before.
        each("layers.0.map.scale", bare, ["20000", "40000"],
            |lab, s| lab.roughness(s, Vec3::X * 200.0), Times(1.0, 0.35)),
        each("layers.0.map_file", bare, ["", "white.png"], |lab, s| lab.of(s).cover(), Over(1.5)),
        each("layers.0.map_image", bare, ["none", "white"], |lab, s| lab.of(s).cover(), Over(1.5)),
        each("layers.0.map_image", bare, ["none", "black"], |lab, s| lab.of(s).cover(), Under(1e-6)),
        each("layers.0.map_channels", green, ["rgb", "green"], |lab, s| lab.of(s).cover(), By(0.2, 1.0)),
        each("layers.0.coverage", bare, ["0", "0.3"], |lab, s| lab.of(s).cover(), Over(1.3)),
        each("layers.0.coverage", bare, ["0", "-1"], |lab, s| lab.of(s).cover(), Under(1e-6)),
        // Clouds are whole sooner and no larger.
        each("layers.0.sharpness", bare, ["1", "4"], |lab, s| lab.of(s).density(), Over(1.3)),
        each("layers.0.sharpness", bare, ["1", "4"], |lab, s| lab.of(s).cover(), Times(1.0, 0.01)),
        each("layers.0.far_coverage", far, ["0", "-1"],
            |lab, s| lab.of(s).only(|p| p.ground.length() > 9000.0).cover(), Under(1e-6)),
        each("layers.0.far_coverage", far, ["0", "-1"],
            |lab, s| lab.of(s).only(|p| p.ground.length() < 3000.0).cover(), Times(1.0, 1e-6)),
        each("layers.0.far_start", far, ["0", "8000"], |lab, s| lab.of(s).cover(), Over(1.3)),
        each("layers.0.far_end", far, ["4000", "20000"], |lab, s| lab.of(s).cover(), Over(1.3)),
    ]
}

#[rustfmt::skip]
fn profile() -> Vec<Row<FieldLab>> {
    vec![
        each("layers.0.base", bare, ["1200", "1900"], |lab, s| lab.of(s).lowest(), By(650.0, 750.0)),
        each("layers.0.base_rise", bare, ["0", "1000"], |lab, s| lab.of(s).altitude(), By(150.0, 900.0)),
        each("layers.0.thickness", bare, ["1000", "2000"], |lab, s| lab.of(s).highest(), By(900.0, 1100.0)),
        each("layers.0.peak_height", bare, ["0.2", "0.8"], |lab, s| lab.of(s).altitude(), By(100.0, 800.0)),
        each("layers.0.profile_strength", bare, ["1", "0.5"], |lab, s| lab.of(s).profile(), Times(0.5, 1e-3)),
        each("layers.0.base_to_top", bare, ["0", "1"], |lab, s| lab.of(s).altitude(), By(50.0, 600.0)),
        // From the anvil's height to what stands below it.
        each("layers.0.anvil", storm, ["0", "1"], |lab, s| {
            let field = lab.of(s);
            let share = |from: f32, to: f32| {
                field.only(|p| (from..to).contains(&((p.height - BASE) / 8000.0))).cover()
            };
            share(0.78, 0.88) / share(0.2, 0.5)
        }, Over(1.5)),
        each("layers.0.shape_gain", bare, ["1", "3"], |lab, s| lab.of(s).density(), Over(1.3)),
    ]
}

#[rustfmt::skip]
fn noise() -> Vec<Row<FieldLab>> {
    vec![
        each("layers.0.shape_strength", volume, ["0", "1"], |lab, s| lab.of(s).density(), Under(0.8)),
        each("layers.0.shape_scale", shapes, ["3000", "12000"], |lab, s| lab.roughness(s, Vec3::X * 150.0), Under(0.6)),
        each("layers.0.stretch", shapes, ["1", "8"], along_over_across, Under(0.5)),
        each("layers.0.stretch_angle", long, ["0", "90"], along_over_across, Over(4.0)),
        each("layers.0.detail_strength", volume, ["0", "1"], |lab, s| lab.of(s).density(), Under(0.9)),
        each("layers.0.edge_threshold", fine, ["0.1", "1"], |lab, s| lab.of(s).density(), Under(0.9)),
        each("layers.0.detail_scale", details, ["800", "4000"], |lab, s| lab.roughness(s, Vec3::X * 20.0), Under(0.6)),
        // Billows that take nothing, as wisps take all.
        each("layers.0.wispiness", all_billow, ["0", "1"], |lab, s| lab.of(s).density(), Under(0.9)),
        each("layers.0.turbulence", || { let mut s = turbulent(); s.set("layers.0.turbulence_height", "0.4"); s },
            ["0", "1500"], |lab, s| turned(lab, s, [1250.0, 1500.0]), By(0.1, 2.0)),
        each("layers.0.turbulence_height", turbulent, ["0.2", "2"],
            |lab, s| turned(lab, s, [1700.0, 2300.0]), By(0.1, 2.0)),
        each("layers.0.turbulence_scale", turbulent, ["1500", "12000"],
            |lab, s| lab.roughness(s, Vec3::X * 100.0), Under(0.8)),
    ]
}

#[rustfmt::skip]
fn medium() -> Vec<Row<FieldLab>> {
    vec![
        each("layers.0.density", volume, ["1", "2"], |lab, s| lab.of(s).density(), Times(2.0, 1e-4)),
        each("layers.0.extinction", volume, ["0.05", "0.1"], |lab, s| lab.of(s).extinction(), Times(2.0, 1e-4)),
        each("layers.0.albedo", volume, ["0.8,0.8,0.8", "0.4,0.8,0.8"],
            |lab, s| lab.of(s).albedo().x, Times(0.5, 1e-4)),
        each("layers.0.albedo", volume, ["0.8,0.8,0.8", "0.8,0.4,0.8"],
            |lab, s| lab.of(s).albedo().y, Times(0.5, 1e-4)),
        each("layers.0.albedo", volume, ["0.8,0.8,0.8", "0.8,0.8,0.4"],
            |lab, s| lab.of(s).albedo().z, Times(0.5, 1e-4)),
        each("layers.0.own_phase", own_phase, ["false", "true"], |lab, s| lab.of(s).phase(), Under(1e-6)),
    ]
}

#[rustfmt::skip]
fn below() -> Vec<Row<FieldLab>> {
    vec![
        // Shafts below the base, and a thicker cloud above it.
        each("layers.0.rain", rain, ["0", "1"], |lab, s| lab.of(s).density(), By(0.01, 1.0)),
        each("layers.0.rain", || Scene { heights: [2010.0, 2300.0], ..rain() }, ["0", "1"],
            |lab, s| lab.of(s).extinction(), Over(1.3)),
        each("layers.0.rain_extinction", rain, ["0.001", "0.002"], |lab, s| lab.of(s).extinction(), Times(2.0, 1e-4)),
        each("layers.0.rain_depth", rain, ["600", "1600"], |lab, s| lab.of(s).lowest(), By(-1100.0, -800.0)),
        // Two metres behind for each that drops fall, against a wind along x.
        both("layers.0.rain_slant", rain, ["0", "2"],
            |lab, a, b| lab.moves(a, b, |h| Vec3::NEG_X * (2.0 * (2000.0 - h))), FOLLOWED),
    ]
}

#[rustfmt::skip]
fn motion() -> Vec<Row<FieldLab>> {
    vec![
        both("layers.0.wind", volume, ["0,0,0", "10,0,-5"],
            |lab, a, b| after(lab, 100.0, a, b, |_| Vec3::new(1000.0, 0.0, -500.0)), FOLLOWED),
        both("layers.0.wind", shapes, ["0,0,0", "0,5,0"],
            |lab, a, b| after(lab, 100.0, a, b, |_| Vec3::Y * 500.0), Under(0.1)),
        both("layers.0.evolution", shapes, ["0", "5"],
            |lab, a, b| after(lab, 100.0, a, b, |_| Vec3::Y * 500.0), Under(0.1)),
        both("layers.0.drift", volume, ["0,0,0", "1000,0,-500"],
            |lab, a, b| lab.moves(a, b, |_| Vec3::new(1000.0, 0.0, -500.0)), FOLLOWED),
        both("layers.0.drift", shapes, ["0,0,0", "0,500,0"],
            |lab, a, b| lab.moves(a, b, |_| Vec3::Y * 500.0), Under(0.1)),
        // Tops go 500 m downwind over a thickness of 1400 m.
        both("layers.0.wind_skew", volume, ["0", "500"],
            |lab, a, b| lab.moves(a, b, |h| Vec3::X * ((h - BASE) / 1400.0 * 500.0)), FOLLOWED),
        // Clouds stand still, and dissolve and form.
        each("layers.0.renewal", || { let mut s = bare(); s.set("layers.0.wind", "0,0,0"); s }, ["0", "10"], |lab, s| {
            let [now, later] = [0.0, 1000.0].map(|seconds| {
                let mut s = s.clone();
                s.settings.clock.seconds = seconds;
                lab.of(&s)
            });
            now.difference(&later) / now.density()
        }, By(0.1, 2.0)),
        // As far as a wave of 10 m/s is after 1000 s.
        both("layers.0.renewal_drift", bare, ["0", "10000"], |lab, a, b| {
            let mut waited = a.clone();
            waited.set("layers.0.renewal", "10");
            waited.set("layers.0.wind", "0,0,0");
            waited.set("clock.seconds", "1000");
            let (a, b, waited) = (lab.of(a), lab.of(b), lab.of(&waited));
            [a.difference(&b), waited.difference(&b)]
        }, Under(0.01)),
    ]
}
