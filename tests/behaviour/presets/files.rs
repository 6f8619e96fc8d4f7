//! Preset files: what is wrong with one is told with file, line and field; a good one is followed as it changes.

use std::{
    fs,
    path::Path,
    process::Command,
    time::{Duration, Instant},
};

use bevy::{
    asset::{AssetLoadFailedEvent, AssetPlugin},
    math::DVec3,
    prelude::*,
};
use bevy_cumulus::{prelude::*, settings::PresetError};

use crate::support::program::{Folder, binary};

/// Texts, and how the error begins that each is answered with.
const BAD: &[(&str, &str)] = &[
    // Unknown fields.
    ("(\n  model: (\n    colour: 1.0,\n  ),\n)", "sky.ron:3:5: model.colour: Unexpected field named `colour`"),
    ("(\n  layers: [\n    (bass: 900.0),\n  ],\n)", "sky.ron:3:6: layers.0.bass: Unexpected field named `bass`"),
    (
        "(\n  layers: [\n    (map: (\n      covr: 3.0)),\n  ],\n)",
        "sky.ron:4:7: layers.0.map.covr: Unexpected field named `covr`",
    ),
    // Wrong types.
    (
        "(\n  model: (\n    coverage: \"much\",\n  ),\n)",
        "sky.ron:3:15: model.coverage: Expected float (a number from -1 to 1)",
    ),
    (
        "(\n  layers: [(),\n    (thickness: \"tall\"),\n  ],\n)",
        "sky.ron:3:17: layers.1.thickness: Expected float (a number from 10 to 20000)",
    ),
    (
        "(\n  lighting: (octaves: -1),\n)",
        "sky.ron:2:24: lighting.octaves: Integer is out of bounds (a whole number from 0 to 16)",
    ),
    (
        "(\n  lighting: (octaves: 1.5),\n)",
        "sky.ron:2:24: lighting.octaves: Expected comma (a whole number from 0 to 16)",
    ),
    ("(\n  lighting: (phase: Sideways),\n)", "sky.ron:2:21: lighting.phase: Unexpected variant named `Sideways`"),
    ("(\n  model: /* none */ 5,\n)", "sky.ron:2:21: model: Expected opening `(`"),
    // Not RON.
    ("(\n  model: (coverage: 0.5", "sky.ron:2:21: model.coverage: Expected comma"),
    ("(\n  model: (coverage: 0.5)\n  lighting: ())", "sky.ron:3:3: lighting: Expected comma"),
    ("()\n)", "sky.ron:2:1: Non-whitespace trailing characters"),
    // Out of range.
    (
        "(\n  model: ( // coverage: 0.5\n    coverage: 1.5))",
        "sky.ron:3:5: model.coverage = 1.5 is outside its range -1 to 1",
    ),
    ("(layers: [\n  (),\n  (map: (cover: 9))])", "sky.ron:3:10: layers.1.map.cover = 9 is outside its range 0 to 8"),
    ("(layers: [(albedo: (0.5,\n  1.5, 0.5))])", "sky.ron:2:3: layers.0.albedo.y = 1.5 is outside its range 0 to 1"),
    ("(\n  sun_elevation: 100)", "sky.ron:2:3: sun_elevation = 100 is outside its range -90 to 90"),
    (
        "(\n  textures: (volume_size: 48))",
        "sky.ron:2:14: textures.volume_size = 48 must be a power of two from 32 to 256",
    ),
    // Inverted.
    (
        "(model: (\n  bottom: 3000.0,\n  top: 2000.0))",
        "sky.ron:3:3: model.top = 2000 must be above model.bottom = 3000",
    ),
    // The other one is the default.
    ("(model: (\n  bottom: 9000.0))", "sky.ron:2:3: model.top = "),
    (
        "(layers: [(), (\n  far_start: 9000,\n  far_end: 900)])",
        "sky.ron:3:3: layers.1.far_end = 900 must be above layers.1.far_start = 9000",
    ),
    // Too many.
    (
        "(\n  layers: [(), (), (), (),\n    (), (), (), (),\n    (name: \"ninth\")])",
        "sky.ron:4:5: layers holds 9 layers, and 8 is the most",
    ),
];

#[test]
fn bad_presets_name_file_line_and_field() {
    let error = CloudPreset::read("nowhere/sky.clouds.ron".as_ref()).unwrap_err();
    assert!(matches!(error, PresetError::Io { .. }) && error.to_string().contains("nowhere/sky.clouds.ron"), "{error}");
    for &(text, begins) in BAD {
        let error = CloudPreset::parse(text, "sky.ron").expect_err(text).to_string();
        assert!(error.starts_with(begins), "{text}\n{error}\n{begins}");
    }
}

/// A layer whose map is not there, on the third line; and one that is hidden, whose map nobody misses.
const NO_MAP: &str = "(\n  layers: [(enabled: false, map_file: \"hidden.png\"),\n    (map_file: \"maps/sky.png\")],\n)";

#[test]
fn a_missing_map_is_named_with_file_line_and_field() {
    let folder = Folder::new();
    let path = folder.join("sky.ron");
    fs::write(&path, NO_MAP).expect("written");
    let mut asked = Vec::new();
    let error = CloudPreset::read_with(&path, |map| {
        asked.push(map.to_string());
        Err("nobody has it".to_owned())
    });
    let error = error.expect_err("the map is not there").to_string();
    let place = format!("{}:3:6: layers.1.map_file = \"maps/sky.png\": nobody has it", path.display());
    assert_eq!((error, asked), (place, vec!["maps/sky.png".to_owned()]));
    assert!(CloudPreset::read_with(&path, |_| Ok(())).is_ok() && CloudPreset::read(&path).is_ok());

    let output = Command::new(binary())
        .args(["--preset", "sky.ron", "--out", "shot.png"])
        .current_dir(&*folder)
        .output()
        .expect("the example starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("sky.ron:3:6: layers.1.map_file = \"maps/sky.png\""), "{said}");
}

/// Assets and settings, without a renderer.
fn app_in(folder: &Path) -> App {
    let mut app = App::new();
    let assets = AssetPlugin { file_path: folder.display().to_string(), ..default() };
    app.add_plugins((MinimalPlugins, assets, CloudsPlugin));
    app.finish();
    app.cleanup();
    app
}

/// The settings that a preset has.
fn sky(app: &App) -> CloudPreset {
    let world = app.world();
    CloudPreset {
        model: world.resource::<CloudModel>().clone(),
        layers: world.resource::<CloudLayers>().clone(),
        lighting: world.resource::<CloudLighting>().clone(),
        textures: world.resource::<CloudTextures>().clone(),
        sun_elevation: None,
    }
}

fn preset(name: &str) -> CloudPreset {
    let textures = CloudTextures { seed: name.len() as u32, ..default() };
    CloudPreset { sun_elevation: None, textures, ..CloudPreset::named(name).expect("it is built in") }
}

fn replace(app: &mut App, handle: &Handle<CloudPreset>, preset: CloudPreset) {
    app.world_mut().resource_mut::<Assets<CloudPreset>>().insert(handle, preset).expect("the handle is good");
    app.update();
}

#[test]
fn settings_follow_a_preset_that_is_replaced() {
    let mut app = app_in(&std::env::temp_dir());
    let [overcast, storm] = ["Overcast", "Storm"].map(preset);
    let handle = app.world_mut().resource_mut::<Assets<CloudPreset>>().add(overcast.clone());
    app.update();
    assert_eq!(sky(&app), CloudPreset::default(), "nothing is followed yet");
    app.insert_resource(CloudPresetFile(handle.clone()));
    app.update();
    assert_eq!(sky(&app), overcast);

    // In between the settings are the user's.
    let offset = DVec3::new(5000.0, 0.0, -300.0);
    let mut model = app.world_mut().resource_mut::<CloudModel>();
    (model.coverage, model.world_offset) = (0.31, offset);
    app.update();
    let mine = sky(&app);
    assert_eq!(mine.model.coverage, 0.31);
    replace(&mut app, &handle, overcast.clone());
    assert_eq!(sky(&app), mine, "it says what it said before");

    replace(&mut app, &handle, storm.clone());
    let shifted = |preset: &CloudPreset| CloudPreset {
        model: CloudModel { world_offset: offset, ..preset.model.clone() },
        ..preset.clone()
    };
    assert_eq!(sky(&app), shifted(&storm), "the floating origin stays");

    for spoil in [
        |preset: &mut CloudPreset| preset.model.coverage = 7.0,
        |preset: &mut CloudPreset| preset.layers.0[0].thickness = f32::NAN,
        |preset: &mut CloudPreset| preset.sun_elevation = Some(-91.0),
    ] {
        let mut bad = overcast.clone();
        bad.layers.0.push(CloudLayer::default());
        spoil(&mut bad);
        replace(&mut app, &handle, bad);
        assert_eq!(sky(&app), shifted(&storm), "a bad one is applied");
    }

    let other = app.world_mut().resource_mut::<Assets<CloudPreset>>().add(overcast.clone());
    app.insert_resource(CloudPresetFile(other));
    app.update();
    assert_eq!(sky(&app), shifted(&overcast), "another handle");
    app.world_mut().remove_resource::<CloudPresetFile>();
    replace(&mut app, &handle, storm);
    assert_eq!(sky(&app), shifted(&overcast), "none is followed");
}

/// Runs until it is so.
fn until(app: &mut App, what: &str, mut is_so: impl FnMut(&mut App) -> bool) {
    let start = Instant::now();
    loop {
        app.update();
        if is_so(app) {
            return;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "after a minute still waiting for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Reads the file again, which has become bad, and returns what is said.
fn told(app: &mut App) -> String {
    app.world().resource::<AssetServer>().reload("sky.clouds.ron");
    let mut error = None;
    until(app, "an error", |app| {
        let mut failures = app.world_mut().resource_mut::<Messages<AssetLoadFailedEvent<CloudPreset>>>();
        error = failures.drain().next().map(|failure| failure.error.to_string());
        error.is_some()
    });
    error.unwrap_or_default()
}

#[test]
fn settings_follow_a_file_and_keep_the_last_good_one() {
    let folder = Folder::new();
    let write = |text: &str| folder.write("sky.clouds.ron", text);
    let [overcast, storm] = ["Overcast", "Storm"].map(preset);
    write(&overcast.to_ron());
    let mut app = app_in(&folder);
    let handle = app.world().resource::<AssetServer>().load("sky.clouds.ron");
    app.insert_resource(CloudPresetFile(handle));
    until(&mut app, "the first sky", |app| sky(app) == overcast);
    let reload = |app: &App| app.world().resource::<AssetServer>().reload("sky.clouds.ron");

    write(BAD[0].0);
    let error = told(&mut app);
    assert!(error.contains("sky.clouds.ron:3:5: model.colour: "), "{error}");
    write(NO_MAP);
    // What was still on its way of the one before is none of its errors.
    let error = std::iter::repeat_with(|| told(&mut app)).take(3).find(|error| !error.contains("colour"));
    let error = error.expect("the missing map is reported");
    assert!(error.contains("sky.clouds.ron:3:6: layers.1.map_file = \"maps/sky.png\": "), "{error}");
    (0..5).for_each(|_| app.update());
    assert_eq!(sky(&app), overcast, "the last good sky stays");

    write(&storm.to_ron());
    reload(&app);
    until(&mut app, "the next sky", |app| sky(app) == storm);
    // The map may come later.
    fs::create_dir(folder.join("maps")).expect("the folder can be written");
    image::GrayImage::new(8, 8).save(folder.join("maps/sky.png")).expect("the map can be written");
    write(NO_MAP);
    reload(&app);
    until(&mut app, "the sky with its own map", |app| sky(app).layers.0.len() == 2);
    assert_eq!(sky(&app).layers.0[1].map_file, "maps/sky.png");
}
