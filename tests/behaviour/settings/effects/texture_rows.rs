//! What textures are baked from, and images in their place, by the field; blue noise is among the pictures.

use bevy::prelude::*;

use super::{
    Expect::{By, Over, Times, Under},
    Row, both, each,
    field::FieldLab,
    layer_rows::{details, shapes},
    model_rows::{bare, billows, broken, of_types, wisps},
    scene::Scene,
};

/// Where type and coverage maps are all there is, far from closed.
fn patches() -> Scene {
    let mut scene = bare();
    scene.set("model.coverage", "0");
    scene.set("model.map_variation", "0");
    scene
}

/// Differences of a field from itself, asked twice, and from that of another value.
fn differs(lab: &mut FieldLab, a: &Scene, b: &Scene) -> [f32; 2] {
    let (first, other) = (lab.of(a), lab.of(b));
    let again = lab.of(a);
    [first.difference(&again), first.difference(&other)].map(|d| d / first.density())
}

#[rustfmt::skip]
pub fn rows() -> Vec<Row<FieldLab>> {
    vec![
        both("textures.seed", broken, ["1", "2"], differs, By(0.2, 2.0)),
        each("textures.seed", billows, ["1", "2"], |lab, s| lab.of(s).density(), Times(1.0, 0.2)),
        // A finer texture has octaves more.
        each("textures.volume_size", billows, ["32", "64"], |lab, s| lab.roughness(s, Vec3::X * 40.0), Over(1.03)),
        each("textures.map_size", patches, ["64", "256"], |lab, s| lab.roughness(s, Vec3::X * 100.0), Over(1.03)),
        each("textures.billow_cells", billows, ["2", "8"], |lab, s| lab.roughness(s, Vec3::X * 150.0), Over(1.5)),
        each("textures.wisp_cells", wisps, ["2", "8"], |lab, s| lab.roughness(s, Vec3::X * 60.0), Over(1.5)),
        each("textures.coverage_cells", patches, ["3", "12"], |lab, s| lab.roughness(s, Vec3::X * 400.0), Over(1.5)),
        each("textures.type_cells", of_types, ["3", "12"], |lab, s| lab.roughness(s, Vec3::X * 300.0), Over(1.3)),
        each("textures.shape_cells", shapes, ["2", "8"], |lab, s| lab.roughness(s, Vec3::X * 150.0), Over(1.5)),
        each("textures.detail_cells", details, ["2", "8"], |lab, s| lab.roughness(s, Vec3::X * 20.0), Over(1.3)),
        // Noise of 1 takes nothing away.
        each("slots.billow", billows, ["none", "white"], |lab, s| lab.of(s).density(), Over(1.3)),
        each("slots.wisp", wisps, ["none", "white"], |lab, s| lab.of(s).density(), Over(1.3)),
        each("slots.shape", shapes, ["none", "white"], |lab, s| lab.of(s).density(), Over(1.3)),
        each("slots.detail", details, ["none", "white"], |lab, s| lab.of(s).density(), Over(1.05)),
        each("slots.coverage", patches, ["none", "black"], |lab, s| lab.of(s).cover(), Under(1e-6)),
        each("slots.coverage", patches, ["none", "white"], |lab, s| lab.of(s).cover(), Over(1.3)),
        // Stratus where the map says so, thin and low.
        each("slots.type_map", of_types, ["none", "black"], |lab, s| lab.of(s).altitude(), By(-1500.0, -100.0)),
        // A profile that is 1 up to the top.
        each("slots.gradient", bare, ["none", "white"], |lab, s| lab.of(s).altitude(), By(100.0, 1500.0)),
    ]
}
