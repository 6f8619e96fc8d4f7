//! Every setting by its effect: change it, and the map, the field of cloud or the picture moves the way its docs say.
//!
//! The CPU twin reads the numbers that the shader does, so a setting that is packed wrongly looks right to every test
//! that compares the two. Here the shader is asked, and what it answers is held against what the field's docs promise.
//! A row names its setting in one column and nowhere else.

mod field;
mod layer_rows;
mod lighting_rows;
mod map_rows;
mod model_rows;
mod picture;
mod quality_rows;
mod scene;
mod texture_rows;

use std::collections::BTreeSet;

use bevy::reflect::Typed;
use bevy_cumulus::prelude::*;

use self::{
    field::FieldLab,
    picture::{PictureLab, SharedLab},
    scene::Scene,
};
use crate::support::{declared::declared_in, gpu::needs_atmosphere};

/// What is looked at, in a laboratory `L`.
pub enum Measure<L> {
    /// A number of each scene: with the first value, and with the second.
    Each(fn(&mut L, &Scene) -> f32),
    /// Two numbers of both scenes together.
    Both(fn(&mut L, &Scene, &Scene) -> [f32; 2]),
}

/// How the second number lies to the first.
#[derive(Clone, Copy, Debug)]
pub enum Expect {
    /// So many times as much, to this share.
    Times(f32, f32),
    /// More than so many times as much.
    Over(f32),
    /// Less than so many times as much.
    Under(f32),
    /// More by something from here to there.
    By(f32, f32),
}

impl Expect {
    fn is_met(self, [before, after]: [f32; 2]) -> bool {
        // A factor on nothing would say nothing.
        let is_there = before > 1e-6;
        match self {
            Self::Times(factor, off) => is_there && (after / before / factor - 1.0).abs() <= off,
            Self::Over(factor) => is_there && after > factor * before,
            Self::Under(factor) => is_there && after < factor * before,
            Self::By(least, most) => (least..=most).contains(&(after - before)),
        }
    }
}

/// A setting, the scene it is changed in, its two values, what is measured, and what is expected of that.
pub struct Row<L> {
    path: &'static str,
    scene: fn() -> Scene,
    values: [&'static str; 2],
    measure: Measure<L>,
    expect: Expect,
}

fn each<L>(
    path: &'static str,
    scene: fn() -> Scene,
    values: [&'static str; 2],
    measure: fn(&mut L, &Scene) -> f32,
    expect: Expect,
) -> Row<L> {
    Row { path, scene, values, measure: Measure::Each(measure), expect }
}

fn both<L>(
    path: &'static str,
    scene: fn() -> Scene,
    values: [&'static str; 2],
    measure: fn(&mut L, &Scene, &Scene) -> [f32; 2],
    expect: Expect,
) -> Row<L> {
    Row { path, scene, values, measure: Measure::Both(measure), expect }
}

/// Makes every row's change and fails with all that had another effect than expected.
fn check<L>(lab: &mut L, rows: &[Row<L>]) {
    let mut wrong = Vec::new();
    for row in rows {
        let scenes = row.values.map(|value| {
            let mut scene = (row.scene)();
            scene.set(row.path, value);
            scene
        });
        let found = match row.measure {
            Measure::Each(measure) => [measure(lab, &scenes[0]), measure(lab, &scenes[1])],
            Measure::Both(measure) => measure(lab, &scenes[0], &scenes[1]),
        };
        let what = format!("{} from {} to {}: {found:?}", row.path, row.values[0], row.values[1]);
        println!("{what}, {:?}", row.expect);
        if !row.expect.is_met(found) {
            wrong.push(format!("{what} is not {:?}", row.expect));
        }
    }
    assert!(wrong.is_empty(), "{} settings have no such effect:\n{}", wrong.len(), wrong.join("\n"));
}

/// Rows that the field of cloud is asked for.
fn field_rows() -> Vec<Row<FieldLab>> {
    [model_rows::rows(), layer_rows::rows(), texture_rows::rows()].into_iter().flatten().collect()
}

/// Rows that need pictures; those of paths and of air have apps of their own.
fn picture_rows() -> Vec<Row<PictureLab>> {
    [lighting_rows::rows(), lighting_rows::of_layers(), quality_rows::rows(), quality_rows::of_views()]
        .into_iter()
        .flatten()
        .collect()
}

#[test]
fn every_setting_has_a_row_and_every_row_a_setting() {
    let declared: BTreeSet<String> = [
        declared_in("model", CloudModel::type_info()),
        declared_in("layers.0", CloudLayer::type_info()),
        declared_in("lighting", CloudLighting::type_info()),
        declared_in("quality", CloudQuality::type_info()),
        declared_in("textures", CloudTextures::type_info()),
        declared_in("slots", CloudTextureSlots::type_info()),
        declared_in("clock", CloudClock::type_info()),
        declared_in("zone", CloudZone::type_info()),
        declared_in("view", CloudView::type_info()),
    ]
    .into_iter()
    .flatten()
    .map(|(path, _)| path)
    .collect();
    let mut rows: BTreeSet<String> = map_rows::rows().iter().map(|row| row.path.to_owned()).collect();
    rows.extend(field_rows().iter().map(|row| row.path.to_owned()));
    rows.extend(quality_rows::traced().iter().map(|row| row.path.to_owned()));
    rows.extend(lighting_rows::air().iter().map(|row| row.path.to_owned()));
    rows.extend(picture_rows().iter().map(|row| row.path.to_owned()));
    let without: Vec<_> = declared.difference(&rows).collect();
    let unknown: Vec<_> = rows.difference(&declared).collect();
    assert!(without.is_empty() && unknown.is_empty(), "without a row: {without:?}; no such setting: {unknown:?}");
    assert!(declared.len() > 150, "only {} settings were found", declared.len());
}

#[test]
fn maps_change_as_their_recipe_says() {
    check(&mut (), &map_rows::rows());
}

#[test]
fn the_field_changes_as_its_settings_say() {
    check(&mut FieldLab::new(), &field_rows());
}

#[test]
fn pictures_change_as_their_settings_say() {
    check(&mut PictureLab::new(), &picture_rows());
}

#[test]
fn traced_pictures_change_as_their_settings_say() {
    check(&mut SharedLab::traced(), &quality_rows::traced());
}

#[test]
fn pictures_through_air_change_as_their_settings_say() {
    needs_atmosphere();
    check(&mut SharedLab::air(), &lighting_rows::air());
}
