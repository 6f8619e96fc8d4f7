//! Every setting can be found, described, checked, set by its path, and written and read back.

use std::{
    ops::RangeInclusive,
    time::{Duration, Instant},
};

use bevy::{
    asset::AssetPlugin,
    math::DVec3,
    prelude::*,
    reflect::{GetPath, NamedField, ReflectRef, TypeInfo, Typed},
};
use bevy_cumulus::{
    prelude::*,
    settings::{CloudSettings, LayerKind, MAX_LAYERS, MapChannels, SettingsError, Validate, snake_case},
};
use serde::{Serialize, de::DeserializeOwned};

use crate::support::declared::{declared_in};

/// Settings none of whose parts is the default.
fn unusual() -> CloudSettings {
    CloudSettings {
        model: CloudModel {
            coverage: -0.125,
            wind: Vec3::new(-1.5, 0.25, 7.0),
            erosion: Erosion::Subtract,
            ..default()
        },
        layers: CloudLayers(vec![
            CloudLayer::default(),
            CloudLayer {
                name: "high, thin".to_owned(),
                coverage: 0.25,
                kind: LayerKind::Sheet,
                map: WeatherRecipe { cover: 6.5, seed: 77, ..default() },
                map_file: "maps/sky.png".to_owned(),
                map_channels: MapChannels::Blue,
                drift: DVec3::new(-1.0e9, 0.5, 3.0),
                ..default()
            },
        ]),
        lighting: CloudLighting { octaves: 3, phase: PhaseFunction::TwoLobe, ground_albedo: Vec3::X, ..default() },
        quality: CloudQuality { integration: Integration::Naive, window: 3, ..CloudQuality::low() },
        textures: CloudTextures { seed: u32::MAX, volume_size: 64, ..default() },
        clock: CloudClock { seconds: 1.0e9 + 0.1, speed: -2.5 },
    }
}

/// The field at a path, where there is one: that of a layer which is not there yet is not.
fn field<'a>(settings: &'a CloudSettings, path: &str) -> Option<&'a dyn PartialReflect> {
    let (root, rest) = path.split_once('.').expect("a path has two parts");
    let part: &dyn Reflect = match root {
        "model" => &settings.model,
        "lighting" => &settings.lighting,
        "quality" => &settings.quality,
        "textures" => &settings.textures,
        "clock" => &settings.clock,
        "layers" => {
            let (number, rest) = rest.split_once('.').expect("a layer has fields");
            let layer = settings.layers.0.get(number.parse::<usize>().expect("layers are numbered"))?;
            return Some(layer.reflect_path(rest).unwrap_or_else(|error| panic!("{path}: {error}")));
        }
        _ => panic!("{root} is no root"),
    };
    Some(part.reflect_path(rest).unwrap_or_else(|error| panic!("{path}: {error}")))
}

/// The field as [`CloudSettings::set`] takes it.
fn text_of(field: &dyn PartialReflect) -> String {
    if let Some(v) = field.try_downcast_ref::<Vec3>() {
        format!("{},{},{}", v.x, v.y, v.z)
    } else if let Some(v) = field.try_downcast_ref::<DVec3>() {
        format!("{},{},{}", v.x, v.y, v.z)
    } else if let Some(v) = field.try_downcast_ref::<f32>() {
        v.to_string()
    } else if let Some(v) = field.try_downcast_ref::<f64>() {
        v.to_string()
    } else if let Some(v) = field.try_downcast_ref::<u32>() {
        v.to_string()
    } else if let Some(v) = field.try_downcast_ref::<bool>() {
        v.to_string()
    } else if let Some(v) = field.try_downcast_ref::<String>() {
        v.clone()
    } else if let ReflectRef::Enum(v) = field.reflect_ref() {
        snake_case(v.variant_name())
    } else {
        panic!("{:?} has no text", field.reflect_type_path())
    }
}

/// Those of the settings that paths lead to, in the order of [`CloudSettings::paths`] where there are no layers; then others.
fn all_declarations() -> Vec<(String, &'static NamedField)> {
    [
        declared_in("model", CloudModel::type_info()),
        declared_in("layers.0", CloudLayer::type_info()),
        declared_in("lighting", CloudLighting::type_info()),
        declared_in("quality", CloudQuality::type_info()),
        declared_in("textures", CloudTextures::type_info()),
        declared_in("clock", CloudClock::type_info()),
        declared_in("slots", CloudTextureSlots::type_info()),
        declared_in("view", CloudView::type_info()),
    ]
    .concat()
}

/// Ends of the range on a field, as text for one number.
fn range_of(info: &NamedField) -> Option<[String; 2]> {
    if let Some(r) = info.get_attribute::<RangeInclusive<u32>>() {
        Some([r.start().to_string(), r.end().to_string()])
    } else {
        let r = info.get_attribute::<RangeInclusive<f32>>()?;
        Some([r.start().to_string(), r.end().to_string()])
    }
}

#[test]
fn every_field_is_described_and_every_number_has_a_range() {
    for (path, info) in all_declarations() {
        let docs = info.docs().unwrap_or_default().trim().to_owned();
        assert!(docs.len() > 20, "{path} has no description: {docs:?}");
        let slot = path.starts_with("slots.");
        assert!(slot || docs.to_lowercase().contains("default"), "{path} does not say its default: {docs}");
        let number =
            info.is::<f32>() || info.is::<f64>() || info.is::<u32>() || info.is::<Vec3>() || info.is::<DVec3>();
        // Any number is a good `reset`: it is only compared.
        if number && path != "view.reset" {
            let range = range_of(info);
            let [start, end] = range.unwrap_or_else(|| panic!("{path} has no range"));
            assert!(start.parse::<f64>().unwrap() < end.parse::<f64>().unwrap(), "{path}: {start} to {end}");
            let whole = info.get_attribute::<RangeInclusive<u32>>().is_some();
            assert_eq!(whole, info.is::<u32>(), "{path}: the range is of another type");
        }
    }
}

#[test]
fn the_contracts_paths_are_there() {
    let mut settings = CloudSettings::default();
    let paths = settings.paths();
    for (path, value) in [
        ("quality.temporal", "off"),
        ("quality.temporal", "sliding_window"),
        ("quality.window", "16"),
        ("quality.resolution", "full"),
        ("quality.resolution", "half"),
        ("quality.resolution", "quarter"),
        ("quality.step", "40"),
        ("lighting.octaves", "1"),
        ("lighting.phase", "henyey_greenstein"),
        ("lighting.phase", "hg_draine"),
        ("model.coverage", "0.25"),
        ("layers.0.kind", "sheet"),
        ("layers.0.map.cover", "6.5"),
    ] {
        assert!(paths.iter().any(|known| known == path), "{path} is gone");
        settings.set(path, value).unwrap_or_else(|error| panic!("{path}={value}: {error}"));
        assert_eq!(text_of(field(&settings, path).expect(path)), value, "{path}");
    }
    // Each field is reached once, and nothing else is.
    let fields: Vec<String> = all_declarations().into_iter().map(|(path, _)| path).collect();
    let in_code = |p: &String| p.starts_with("slots.") || p.starts_with("view.") || p.ends_with(".map_image");
    let settable: Vec<String> = fields.into_iter().filter(|p| !in_code(p)).collect();
    assert_eq!(paths, settable);
}

/// Texts that a field takes beside numbers: every choice, or some text.
fn choices(info: &NamedField) -> Vec<String> {
    if info.is::<bool>() {
        vec!["true".to_owned(), "false".to_owned()]
    } else if info.is::<String>() {
        vec!["one".to_owned(), "two words".to_owned()]
    } else if let Some(TypeInfo::Enum(choice)) = info.type_info() {
        choice.variant_names().iter().map(|name| snake_case(name)).collect()
    } else {
        Vec::new()
    }
}

#[test]
fn every_path_takes_its_own_value_and_its_limits_and_no_more() {
    let declarations = all_declarations();
    for start in [CloudSettings::default(), unusual()] {
        // Of a layer that is not there yet, another test asks.
        let there: Vec<String> = start.paths().into_iter().filter(|path| field(&start, path).is_some()).collect();
        for path in there {
            let mut settings = start.clone();
            let now = |settings: &CloudSettings| text_of(field(settings, &path).expect("a field"));
            let own = now(&settings);
            settings.set(&path, &own).unwrap_or_else(|error| panic!("{path}={own}: {error}"));
            assert_eq!(settings, start, "{path}={own} changes something");
            let declared = path.replace("layers.1.", "layers.0.");
            let info = declarations.iter().find(|(known, _)| *known == declared).unwrap().1;
            let vector = info.is::<Vec3>() || info.is::<DVec3>();
            let spell = |n: &str| if vector { format!("{n},{n},{n}") } else { n.to_owned() };
            let mut values: Vec<String> = range_of(info).iter().flatten().map(|end| spell(end)).collect();
            values.extend(choices(info));
            assert!(values.len() >= 2, "{path} has no choice");
            for value in &values {
                settings.set(&path, value).unwrap_or_else(|error| panic!("{path}={value}: {error}"));
                assert_eq!(now(&settings), *value, "{path}");
            }
            if info.is::<String>() {
                continue;
            }
            let kept = settings.clone();
            let beyond: Vec<String> = range_of(info).map(beyond).iter().flatten().map(|n| spell(n)).collect();
            for value in beyond.iter().chain(&["none of these".to_owned(), String::new()]) {
                let error = settings.set(&path, value).expect_err(&format!("{path}={value:?} passed"));
                assert!(error.to_string().contains(&path), "{path}={value:?}: {error}");
                assert_eq!(settings, kept, "{path}={value:?} is refused and changes something");
            }
        }
    }
    for path in ["", "model", "model.", "model.colour", "sky.coverage", "model.coverage.x", "layers.1.base"] {
        let error = CloudSettings::default().set(path, "1").unwrap_err();
        assert_eq!(error, SettingsError::UnknownPath(path.to_owned()));
    }
}

#[test]
fn a_path_into_the_layer_after_the_last_adds_it() {
    let mut settings = CloudSettings::default();
    for i in 0..MAX_LAYERS {
        let next = format!("layers.{i}.");
        assert!(settings.paths().iter().any(|path| path.starts_with(&next)), "{next} is not listed");
        // What is refused adds nothing.
        settings.set(&format!("{next}map.cover"), "9").expect_err("9 oktas");
        settings.set(&format!("{next}colour"), "9").expect_err("no such field");
        assert_eq!(settings.layers.0.len(), i);
        settings.set(&format!("{next}map.cover"), "6.5").unwrap_or_else(|error| panic!("{next}: {error}"));
        assert_eq!(settings.layers.0.len(), i + 1);
        settings.set(&format!("{next}name"), "").expect("it is there");
        assert_eq!(settings.layers.0.len(), i + 1, "set twice, added twice");
    }
    let recipe = WeatherRecipe { cover: 6.5, ..default() };
    assert_eq!(settings.layers.0, vec![CloudLayer { map: recipe, ..default() }; MAX_LAYERS]);
    settings.validate().expect("that many layers are shown");
    assert!(!settings.paths().iter().any(|path| path.starts_with(&format!("layers.{MAX_LAYERS}."))));
    let error = settings.set(&format!("layers.{MAX_LAYERS}.base"), "900").unwrap_err();
    assert_eq!(error, SettingsError::TooManyLayers { count: MAX_LAYERS + 1, most: MAX_LAYERS });
    assert_eq!(settings.layers.0.len(), MAX_LAYERS);
}

/// Numbers below and above the range, by more than its length.
fn beyond([start, end]: [String; 2]) -> [String; 2] {
    let [start, end] = [start, end].map(|n| n.parse::<f64>().expect("a range has numbers"));
    let far = end - start + 1.0;
    [start - far, end + far].map(|n| n.to_string())
}

fn round_trip<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: &T) {
    let text = ron::to_string(value).expect("it can be written");
    assert_eq!(ron::from_str::<T>(&text).expect("what is written can be read"), *value, "{text}");
    let text = serde_json::to_string(value).expect("it can be written");
    assert_eq!(serde_json::from_str::<T>(&text).expect("what is written can be read"), *value, "{text}");
}

#[test]
fn settings_are_read_back_as_written() {
    for settings in [CloudSettings::default(), unusual()] {
        round_trip(&settings.model);
        round_trip(&settings.layers);
        round_trip(&settings.lighting);
        round_trip(&settings.quality);
        round_trip(&settings.textures);
        round_trip(&settings.clock);
        round_trip(&CloudView {
            enabled: false,
            quality: Some(settings.quality),
            reset: 7,
            debug: CloudDebugView::Steps,
            order: CloudOrder::AfterTransparent,
        });
        round_trip(&CloudPreset {
            model: settings.model,
            layers: settings.layers,
            lighting: settings.lighting,
            textures: settings.textures,
            sun_elevation: Some(-3.5),
        });
    }
    round_trip(&CloudView::default());
    // What is left out is the default.
    assert_eq!(ron::from_str::<CloudModel>("(coverage: 0.5)").unwrap(), CloudModel { coverage: 0.5, ..default() });
}

#[test]
fn presets_parse_validate_and_are_read_back_as_written() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/presets");
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let preset = CloudPreset::read(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(CloudPreset::parse(&preset.to_ron(), "written").unwrap(), preset, "{}", path.display());
        let name = path.file_name().unwrap().to_string_lossy().replace(".clouds.ron", "");
        assert_eq!(CloudPreset::named(&name), Some(preset), "{name} is not built in");
        files += 1;
    }
    assert!(files >= 4 && files == CloudPreset::names().count());
    for name in CloudPreset::names() {
        assert!(CloudPreset::named(name).is_some(), "{name}");
    }
    let presets: Vec<_> = CloudPreset::names().map(|name| CloudPreset::named(name).unwrap().to_ron()).collect();
    for (k, preset) in presets.iter().enumerate() {
        assert!(!presets[..k].contains(preset), "two presets are the same: {preset}");
    }
    for name in ["low", "medium", "high", "ultra", "reference"] {
        CloudQuality::named(name).unwrap().validate().unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    assert_eq!(CloudQuality::named("best"), None);
}

#[test]
fn preset_files_load_as_assets_without_a_renderer() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), CloudsPlugin));
    app.finish();
    app.cleanup();
    assert!(app.world().resource::<CloudStatus>().unsupported().is_some_and(|why| why.contains("renderer")));
    let server = app.world().resource::<AssetServer>().clone();
    let preset: Handle<CloudPreset> = server.load("presets/overcast.clouds.ron");
    let missing: Handle<CloudPreset> = server.load("presets/nowhere.clouds.ron");
    let start = Instant::now();
    let done = || server.is_loaded(&preset) && server.load_state(&missing).is_failed();
    while !done() && start.elapsed() < Duration::from_secs(60) {
        app.update();
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(server.load_state(&missing).is_failed(), "a missing file loads");
    let presets = app.world().resource::<Assets<CloudPreset>>();
    assert_eq!(presets.get(&preset).cloned(), CloudPreset::named("Overcast"));
    let preset = CloudPreset::named("Overcast").unwrap();
    preset.apply(app.world_mut());
    app.update();
    assert_eq!(*app.world().resource::<CloudModel>(), preset.model);
}
