//! docs/settings.md is what the settings themselves say.

#[path = "../../../examples/settings_reference/reference.rs"]
mod reference;

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{NamedField, TypeInfo, Typed},
};
use bevy_cumulus::prelude::*;

use super::root;

fn written() -> String {
    std::fs::read_to_string(root().join("docs/settings.md")).expect("the page is there")
}

#[test]
fn the_settings_page_is_as_generated() {
    let (written, generated) = (written(), reference::page());
    for (n, (old, new)) in written.lines().zip(generated.lines()).enumerate() {
        assert_eq!(old, new, "docs/settings.md, line {}: run `cargo run --example settings_reference`", n + 1);
    }
    assert!(written == generated, "docs/settings.md: run `cargo run --example settings_reference`");
}

/// The field, or those of the struct that it is. A layer's map has a section of its own.
fn within(field: &'static NamedField) -> Vec<&'static NamedField> {
    match field.type_info() {
        _ if field.is::<WeatherRecipe>() => Vec::new(),
        Some(TypeInfo::Struct(info)) if !field.is::<Vec3>() && !field.is::<DVec3>() => info.iter().collect(),
        _ => vec![field],
    }
}

#[test]
fn the_settings_page_has_every_field() {
    let page = written();
    let all = [
        CloudModel::type_info(),
        CloudLayer::type_info(),
        WeatherRecipe::type_info(),
        CloudLighting::type_info(),
        CloudQuality::type_info(),
        CloudTextures::type_info(),
        CloudTextureSlots::type_info(),
        CloudClock::type_info(),
        CloudZone::type_info(),
        CloudView::type_info(),
    ];
    for info in all {
        let TypeInfo::Struct(info) = info else { panic!("{} is not a struct", info.type_path()) };
        let name = info.type_path_table().ident().expect("a name");
        let section = page.split(&format!("\n## {name}\n")).nth(1).unwrap_or_else(|| panic!("{name} has no section"));
        let section = section.split("\n## ").next().unwrap_or_default();
        for field in info.iter().flat_map(within) {
            let is_its = |row: &&str| {
                let path = row.split('`').nth(1).unwrap_or_default();
                row.starts_with("| `") && path.rsplit('.').next() == Some(field.name())
            };
            let row = section.lines().find(is_its).unwrap_or_else(|| panic!("{name} has no row for {}", field.name()));
            let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
            assert!(cells.len() >= 5 && !cells[1].is_empty() && !cells[3].is_empty(), "{name}: {row}");
            assert!(cells[4..].join(" ").len() > 20, "{name} does not explain {}: {row}", field.name());
        }
    }
}
