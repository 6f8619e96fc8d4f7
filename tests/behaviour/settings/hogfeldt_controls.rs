//! The table of Högfeldt's controls names settings that are there.

use bevy::reflect::{TypeInfo, Typed};
use bevy_cumulus::prelude::*;

const TABLE: &str = include_str!("../../../docs/hogfeldt_controls.md");

/// Högfeldt's names and what is said of them.
fn rows() -> Vec<(&'static str, &'static str)> {
    let rows = TABLE.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | "));
    rows.filter(|(name, _)| *name != "Högfeldt").collect()
}

/// What stands between backticks.
fn codes(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

fn has_field<T: Typed>(field: &str) -> bool {
    matches!(T::type_info(), TypeInfo::Struct(info) if info.field(field).is_some())
}

/// Whether a name of Rust, such as `CloudView::enabled`, is there.
fn is_there(name: &str) -> bool {
    match name.split_once("::") {
        Some(("CloudView", field)) => has_field::<CloudView>(field),
        Some(("CloudTextureSlots", field)) => has_field::<CloudTextureSlots>(field),
        Some(("CloudLayer", field)) => has_field::<CloudLayer>(field),
        Some(("CloudQuality", call)) => call.strip_suffix("()").is_some_and(|name| CloudQuality::named(name).is_some()),
        _ => false,
    }
}

#[test]
fn every_setting_in_the_table_is_there() {
    let mut settings = CloudSettings::default();
    let paths = settings.paths();
    let (mut checked, mut wrong) = (0, Vec::new());
    for (name, here) in rows() {
        assert!(codes(here).next().is_some(), "{name} has no setting");
        for code in codes(here) {
            checked += 1;
            let good = if let Some((path, value)) = code.split_once(" = ") {
                settings.set(path, value).is_ok()
            } else if code.contains("::") {
                is_there(code)
            } else if let Some(group) = code.strip_suffix('*') {
                paths.iter().any(|path| path.starts_with(&group.replace(".N.", ".0.")))
            } else if code.contains('.') {
                paths.contains(&code.replace(".N.", ".0."))
            } else {
                // The short form, for what stands beside a path of a layer, or a component's name or a call.
                paths.contains(&format!("layers.0.{code}")) || ["Atmosphere", "ultra()"].contains(&code)
            };
            if !good {
                wrong.push(format!("{name}: {code}"));
            }
        }
    }
    assert!(wrong.is_empty(), "not there: {}", wrong.join("; "));
    assert!(checked > 35, "only {checked} were found to be checked");
}

#[test]
fn all_controls_of_the_appendix_are_in_the_table() {
    let rows = rows();
    let named: Vec<&str> = rows.iter().flat_map(|(name, _)| name.split(", ")).collect();
    assert_eq!(named.len(), 25, "{named:?}");
    // In the order of the appendix.
    for name in [
        "BaseAndTopMultiplier",
        "BaseToTopMultiplier",
        "EdgeDetailThreshold",
        "ThicknessMultiplier",
        "Enable",
        "ShapeTexture",
        "DetailTexture",
        "WeatherTexture",
        "CloudQuality",
        "HeightMultiplier",
        "StartMultiplier",
        "PlanetRadius",
        "AtmosphereStart",
        "CutOffDistance",
        "Absorption",
        "Scattering",
        "Phase",
        "AmbientMultiplier",
        "AmbientDesaturate",
        "ShapeScale",
        "DetailScale",
        "WeatherScale",
        "TemporalAlpha",
        "Precipitation",
        "Offset",
    ] {
        assert_eq!(named.iter().filter(|known| **known == name).count(), 1, "{name}");
    }
}
