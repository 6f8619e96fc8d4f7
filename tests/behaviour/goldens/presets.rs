//! Every built-in preset as it was when last approved, from the ground and some from above; and what holds of each whatever
//! it looks like.
//!
//! One run of the headless example makes all of them. They are blessed as those of `goldens` are.

use std::{
    collections::BTreeSet,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use bevy_cumulus::{prelude::*, settings::snake_case};
use image::Rgba32FImage;

use crate::support::{
    golden::{compare_with_golden, failures, folder, read},
    gpu::needs_atmosphere,
    program::{command, read_cloud},
};

/// The mean transmittance of each preset's clouds as seen from the ground, as this test prints it. A quarter of the view is
/// ground: an empty sky has 1, and one that is closed 0.25. A preset that is retuned moves its number.
const FROM_THE_GROUND: [(&str, f32); 23] = [
    ("ClearDay", 0.961),
    ("FairWeather", 0.703),
    ("Overcast", 0.268),
    ("Sunset", 0.735),
    ("Cirrus", 0.969),
    ("Cirrocumulus", 0.771),
    ("Cirrostratus", 0.496),
    ("Altocumulus", 0.578),
    ("Altostratus", 0.262),
    ("Nimbostratus", 0.259),
    ("Stratocumulus", 0.297),
    ("Stratus", 0.259),
    ("Cumulus", 0.627),
    ("Cumulonimbus", 0.440),
    ("FairWeatherCumulus", 0.546),
    ("ToweringCumulus", 0.372),
    ("Broken", 0.279),
    ("Storm", 0.315),
    ("WinterStratus", 0.259),
    ("MackerelSky", 0.478),
    ("RedSunset", 0.403),
    ("AfterRain", 0.355),
    ("WeatherSystems", 0.300),
];
/// The same from above (no ground is near: one that is closed has 0), of skies that are tall or high.
const FROM_ABOVE: [(&str, f32); 4] =
    [("Cumulonimbus", 0.422), ("Cirrus", 0.968), ("Storm", 0.346), ("WeatherSystems", 0.455)];
/// How far it may be off that.
const OFF: f32 = 0.025;
/// Over all of them.
const ABOVE: &str = "0,14000,0,0,-20";

/// Brighter than any cloud (cd/m²): sunlight, all of it scattered into one direction by ice's forward peak, would be.
const BRIGHTEST: f32 = 1e7;

/// Small, of one frame, and made from small textures; maps of layers follow. Most of the time goes to Bevy's atmosphere.
#[rustfmt::skip]
const SMALL: [&str; 10] = [
    "--size", "96x54", "--frames", "1", "--quality", "medium",
    "--set", "textures.volume_size=32", "--set", "textures.map_size=128",
];

/// A picture to be made.
struct Shot {
    preset: &'static str,
    /// Of its files.
    name: String,
    above: bool,
    transmittance: f32,
}

fn shots() -> Vec<Shot> {
    let shot = |above: bool| {
        move |(preset, transmittance): (&'static str, f32)| {
            let name = format!("{}{}", snake_case(preset), if above { "_above" } else { "" });
            Shot { preset, name, above, transmittance }
        }
    };
    FROM_THE_GROUND.into_iter().map(shot(false)).chain(FROM_ABOVE.into_iter().map(shot(true))).collect()
}

/// The line of a batch file that asks for it.
fn line(shot: &Shot) -> String {
    let mut line = format!("--preset {0} --out {1}.png --cloud {1}.exr", shot.preset, shot.name);
    if shot.above {
        let _ = write!(line, " --camera {ABOVE}");
    }
    let layers = CloudPreset::named(shot.preset).map_or(0, |preset| preset.layers.0.len());
    for layer in 0..layers {
        let _ = write!(line, " --set layers.{layer}.map.size=128");
    }
    line
}

/// Renders all, and returns where they lie.
fn render(shots: &[Shot]) -> PathBuf {
    let made = failures().join("presets");
    fs::create_dir_all(&made).unwrap_or_else(|error| panic!("{}: {error}", made.display()));
    let lines: Vec<String> = shots.iter().map(line).collect();
    fs::write(made.join("batch"), lines.join("\n")).unwrap_or_else(|error| panic!("{}: {error}", made.display()));
    let mut command = command();
    let output =
        command.args(["--batch", "batch"]).args(SMALL).current_dir(&made).output().expect("the example starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "it failed with {:?}: {said}", output.status.code());
    made
}

/// What is wrong with the clouds alone, whatever they look like.
fn fault(clouds: &Rgba32FImage, expected: f32) -> Option<String> {
    let is_possible = |p: &image::Rgba<f32>| {
        let [light @ .., transmittance] = p.0;
        light.iter().all(|v| (0.0..=BRIGHTEST).contains(v)) && (0.0..=1.0).contains(&transmittance)
    };
    if let Some((x, y, pixel)) = clouds.enumerate_pixels().find(|(_, _, p)| !is_possible(p)) {
        return Some(format!("{:?} at {x},{y} is no light and transmittance", pixel.0));
    }
    let mean = mean_transmittance(clouds);
    let is_near = (mean - expected).abs() <= OFF;
    (!is_near).then(|| format!("transmittance {mean} in the mean, not {expected} to within {OFF}"))
}

fn mean_transmittance(clouds: &Rgba32FImage) -> f32 {
    clouds.pixels().map(|p| p.0[3]).sum::<f32>() / clouds.pixels().len() as f32
}

fn check(shot: &Shot, made: &Path) -> Result<(), String> {
    let named = |what: String| format!("{}: {what}", shot.name);
    let clouds = read_cloud(&made.join(&shot.name).with_extension("exr"));
    println!("{}: transmittance {:.3} in the mean", shot.name, mean_transmittance(&clouds));
    if let Some(fault) = fault(&clouds, shot.transmittance) {
        return Err(named(fault));
    }
    let path = made.join(&shot.name).with_extension("png");
    compare_with_golden(&format!("presets/{}", shot.name), &read(&path).map_err(named)?, &path)
}

#[test]
fn presets_look_as_they_did() {
    needs_atmosphere();
    let shots = shots();
    let made = render(&shots);
    let wrong: Vec<String> = shots.iter().filter_map(|shot| check(shot, &made).err()).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), shots.len(), wrong.join("\n"));
}

#[test]
fn every_preset_has_its_golden_and_no_other_is_there() {
    let tested: BTreeSet<&str> = FROM_THE_GROUND.into_iter().map(|(preset, _)| preset).collect();
    assert_eq!(tested, CloudPreset::names().collect());
    let there: BTreeSet<String> = fs::read_dir(folder().join("presets"))
        .expect("the goldens are there")
        .map(|entry| entry.expect("the folder can be read").path())
        .map(|path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
        .collect();
    assert_eq!(there, shots().into_iter().map(|shot| shot.name).collect());
}

#[test]
fn clouds_that_cannot_be_are_told() {
    let of = |pixel| Rgba32FImage::from_pixel(3, 2, image::Rgba(pixel));
    assert_eq!(fault(&of([1.0, 2.0, 3.0, 0.5]), 0.51), None);
    for pixel in [
        [f32::NAN, 0.0, 0.0, 0.5],
        [0.0, -1.0, 0.0, 0.5],
        [0.0, 0.0, f32::INFINITY, 0.5],
        [0.0, 0.0, 0.0, 1.1],
        [0.0, 0.0, 0.0, 0.45],
        [0.0, 0.0, 0.0, 1.0],
    ] {
        assert!(fault(&of(pixel), 0.51).is_some(), "{pixel:?}");
    }
}
