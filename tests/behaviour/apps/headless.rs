//! The headless example, run as a user runs it.

use std::{collections::BTreeSet, fs, path::Path, process::Output, sync::LazyLock};

use crate::support::program::{Folder, command, read, read_cloud};
use bevy_cumulus::settings::{CloudPreset, CloudSettings};
use image::Rgba32FImage;
use serde_json::Value;

/// An example has no tests of its own.
#[path = "../../../examples/headless/finite.rs"]
mod finite;

/// Textures small enough to be baked in no time.
const SMALL: [&str; 4] = ["--set", "textures.volume_size=32", "--set", "textures.map_size=256"];

fn run_in(folder: &Path, arguments: &[&str]) -> Output {
    command().args(arguments).current_dir(folder).output().expect("the example starts")
}

/// Runs the example in a folder of its own and returns that.
fn render(arguments: &[&str]) -> Folder {
    let folder = Folder::new();
    let output = run_in(&folder, &[arguments, &SMALL].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?} failed with {:?}: {said}", output.status.code());
    folder
}

/// The clouds of one picture a line, made in one run.
fn render_batch<const N: usize>(shared: &[&str], lines: [&str; N]) -> [Rgba32FImage; N] {
    let folder = Folder::new();
    let numbered = (1..).zip(lines).map(|(n, line)| format!("{line} --cloud {n}.exr # {n}\n\n")).collect::<String>();
    fs::write(folder.join("batch.txt"), numbered).expect("the folder can be written");
    let output = run_in(&folder, &[shared, &SMALL, &["--batch", "batch.txt"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told: String = (1..=N).map(|n| format!("[{n}/{N}] {n}.exr\n")).collect();
    assert_eq!(String::from_utf8_lossy(&output.stdout), told);
    std::array::from_fn(|k| read_cloud(&folder.join(format!("{}.exr", k + 1))))
}

const SHOT: &[&str] = &["--size", "64x36", "--frames", "3", "--cloud", "cloud.exr", "--set", "model.density=0.9"];

/// One run that writes everything, shared by the tests that look at it.
static WRITTEN: LazyLock<Folder> = LazyLock::new(|| {
    render(&[SHOT, &["--scene", "ground_noon", "--out", "shot.png", "--timings", "timings.json"]].concat())
});

/// Scenes of the thesis's figures.
pub const FIGURES: [&str; 18] = [
    "thesis_coverage",
    "thesis_type",
    "thesis_profile",
    "thesis_eroded",
    "thesis_single",
    "thesis_multiple",
    "thesis_ambient",
    "thesis_phase_day",
    "thesis_phase_day_off",
    "thesis_phase_sunset",
    "thesis_phase_sunset_off",
    "thesis_coverage_sweep",
    "thesis_aliasing_off",
    "thesis_aliasing_blue_noise",
    "thesis_integration_naive",
    "thesis_integration",
    "thesis_window_8m",
    "thesis_window_80m",
];

#[test]
fn every_figure_can_be_made_and_is_like_no_other() {
    // The strip is made by another test.
    let figures: Vec<&str> = FIGURES.into_iter().filter(|figure| *figure != "thesis_coverage_sweep").collect();
    let folder = Folder::new();
    let lines: String = figures.iter().map(|figure| format!("--scene {figure} --cloud {figure}.exr\n")).collect();
    // The first figure once more, by an option.
    let again = "--scene thesis_profile --debug coverage_map --cloud again.exr";
    fs::write(folder.join("batch"), lines + again).expect("the folder can be written");
    let alike = ["--batch", "batch", "--size", "32x18", "--frames", "1", "--no-sky"];
    let output = run_in(&folder, &[&alike[..], &SMALL].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let pictures: Vec<Rgba32FImage> =
        figures.iter().map(|figure| read_cloud(&folder.join(format!("{figure}.exr")))).collect();
    for (k, (figure, picture)) in figures.iter().zip(&pictures).enumerate() {
        let cloudy = picture.pixels().filter(|p| p.0[3] < 0.9).count();
        assert!(cloudy > 60, "{figure} has cloud in {cloudy} of 576 pixels");
        for (other, before) in figures.iter().zip(&pictures[..k]) {
            assert!(picture != before, "{figure} is the same picture as {other}");
        }
    }
    let map = &pictures[0];
    assert!(*map == read_cloud(&folder.join("again.exr")), "--debug shows something else than the scene of that view");
    let is_grey = |p: &image::Rgba<f32>| p.0[..3].iter().all(|c| (c - p.0[0]).abs() <= 1e-3 * p.0[0]);
    assert!(map.pixels().all(is_grey), "the coverage map is grey all over");
}

#[test]
fn a_strip_has_its_pictures_side_by_side() {
    let files = ["--scene", "thesis_coverage_sweep", "--size", "32x18", "--frames", "1", "--out", "strip.png"];
    let strip = read(&render(&files).join("strip.png")).to_rgb8();
    assert_eq!(strip.dimensions(), (5 * 32, 18));
    let panel = |k: u32| image::imageops::crop_imm(&strip, 32 * k, 0, 32, 18).to_image();
    for k in 0..4 {
        assert!(panel(k) != panel(k + 1), "pictures {k} and {} are the same", k + 1);
    }
    // More cloud hides more of the blue.
    let blue = |k| panel(k).pixels().map(|p| i64::from(p[2]) - i64::from(p[0])).sum::<i64>();
    assert!(blue(0) > 2 * blue(4).max(1), "{} and {}", blue(0), blue(4));
}

#[test]
fn list_prints_scenes_presets_and_paths_one_a_line() {
    let output = run_in(&Folder::new(), &["--list"]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).expect("the list is text");
    let lines: BTreeSet<&str> = text.lines().collect();
    let everyday = ["ground_noon", "ground_backlit", "overcast", "sunset", "hills", "broken", "storm"];
    let viewpoints = ["inside", "above", "between", "orbit", "limb", "hills_in_cloud", "split_screen"];
    let scenes = everyday.into_iter().chain(viewpoints).chain(FIGURES).map(str::to_owned);
    let paths = CloudSettings::default().paths();
    assert!(paths.contains(&"model.coverage".to_owned()));
    let wanted = scenes.chain(CloudPreset::names().map(str::to_owned)).chain(paths);
    assert_eq!(lines, wanted.collect::<Vec<_>>().iter().map(String::as_str).collect());
}

#[test]
fn mistakes_are_named_and_nothing_is_written() {
    let folder = Folder::new();
    let cases: &[(&[&str], &[&str])] = &[
        (&["--scene", "moonbase"], &["moonbase", "ground_noon"]),
        (&["--preset", "Nimbus"], &["Nimbus", "FairWeather"]),
        (&["--preset", "missing.ron"], &["missing.ron"]),
        (&["--set", "model.colour=1"], &["model.colour"]),
        (&["--set", "model.coverage=1.5"], &["model.coverage", "1.5", "-1", "1"]),
        (&["--set", "model.coverage=NaN"], &["model.coverage"]),
        (&["--set", "model.top=100"], &["model.top", "model.bottom"]),
        (&["--set", "model.coverage"], &["PATH=VALUE"]),
        (&["--debug", "xray"], &["--debug", "xray", "coverage_map"]),
        (&["--scene", "thesis_coverage_sweep"], &["thesis_coverage_sweep", "strip", "--cloud"]),
        (&["--quality", "best"], &["--quality", "best", "ultra"]),
        (&["--noise", "noise.exr"], &["--noise", "reference"]),
        (&["--size", "0x36"], &["--size", "0x36", "8192"]),
        (&["--size", "64x8193"], &["--size", "64x8193"]),
        (&["--frames", "0"], &["--frames", "100000"]),
        (&["--camera", "0,0,0"], &["--camera", "x,y,z,yaw,pitch"]),
        (&["--camera", "0,nan,0,0,0"], &["--camera", "nan"]),
        (&["--camera", "0,1,0,0,91"], &["--camera", "pitch", "90"]),
        (&["--sun", "inf,0"], &["--sun", "inf"]),
        (&["--move", "1,2,3"], &["--move", "dx,dy,dz,dyaw,dpitch"]),
        (&["--time", "inf"], &["--time", "inf"]),
        (&["--out", "nowhere/shot.png"], &["--out", "nowhere"]),
        (&["--out", "shot.jpg"], &["shot.jpg", "png"]),
        (&["--timings", "."], &["--timings", "directory"]),
    ];
    for (mistake, named) in cases {
        // Another valid output, so that having none is never what is wrong.
        let output = run_in(&folder, &[*mistake, &["--cloud", "never.exr"]].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{mistake:?} passed");
        assert!(!said.contains("panicked"), "{mistake:?}: {said}");
        for name in *named {
            assert!(said.contains(name), "{mistake:?} does not name {name:?}: {said}");
        }
    }
    let output = run_in(&folder, &["--scene", "sunset"]);
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("--out"));
    assert_eq!(fs::read_dir(&*folder).expect("the folder is there").count(), 0);
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error() {
    // Opens, but takes no byte: what is written last must be checked too.
    let folder = Folder::new();
    let output = run_in(
        &folder,
        &[&["--size", "8x8", "--frames", "1", "--no-sky", "--no-land", "--timings", "/dev/full"], &SMALL[..]].concat(),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("/dev/full") && !said.contains("panicked"), "{said}");
}

#[test]
fn the_picture_has_the_size_asked_for_and_is_not_blank() {
    let picture = read(&WRITTEN.join("shot.png")).to_rgb8();
    assert_eq!(picture.dimensions(), (64, 36));
    let colours: BTreeSet<_> = picture.pixels().map(|p| p.0).collect();
    assert!(colours.len() > 100, "only {} colours", colours.len());
}

#[test]
fn the_cloud_buffer_holds_cloud_and_clear_sky() {
    let cloud = read_cloud(&WRITTEN.join("cloud.exr"));
    assert_eq!(cloud.dimensions(), (64, 36));
    assert!(cloud.pixels().all(|p| p.0.iter().all(|v| v.is_finite()) && (0.0..=1.0).contains(&p.0[3])));
    let clear = cloud.pixels().filter(|p| p.0[3] > 0.99).count();
    let cloudy: Vec<_> = cloud.pixels().filter(|p| p.0[3] < 0.5).collect();
    assert!(clear > 20 && cloudy.len() > 20, "{clear} clear, {} cloudy", cloudy.len());
    // Sunlit cloud is some thousands of cd/m²: exposure is divided out.
    let brightest = cloudy.iter().map(|p| p.0[1]).fold(0.0, f32::max);
    assert!((2.0e3..2.0e5).contains(&brightest), "{brightest} cd/m²");
}

#[test]
fn what_is_no_number_is_named() {
    let whole = Rgba32FImage::from_fn(3, 2, |x, y| image::Rgba([x as f32, y as f32, 6e4, 1.0]));
    assert_eq!(finite::flaw("the cloud buffer", &whole), None);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for channel in 0..4 {
            let mut image = whole.clone();
            image.get_pixel_mut(1, 1).0[channel] = bad;
            image.get_pixel_mut(2, 1).0[channel] = bad;
            let said = finite::flaw("the noise", &image).expect("two pixels are bad");
            for part in ["the noise", "2 pixels", "1,1"] {
                assert!(said.contains(part), "channel {channel}, {bad}: {said}");
            }
        }
    }
}

#[test]
fn the_reference_makes_a_picture_and_knows_its_noise() {
    let view = ["--scene", "ground_noon", "--size", "32x18", "--quality", "reference"];
    let files = ["--frames", "5", "--out", "shot.png", "--cloud", "cloud.exr", "--noise", "noise.exr"];
    let folder = render(&[&view[..], &files].concat());
    let (cloud, noise) = (read_cloud(&folder.join("cloud.exr")), read_cloud(&folder.join("noise.exr")));
    assert_eq!(read(&folder.join("shot.png")).to_rgb8().dimensions(), (32, 18));
    assert!(noise.pixels().all(|p| p.0[2] == 5.0 && p.0[3] == 0.0), "not 5 samples, or weight was lost");
    for (cloud, noise) in cloud.pixels().zip(noise.pixels()) {
        let clear = cloud.0 == [0.0, 0.0, 0.0, 1.0];
        assert!(noise.0[0] >= 0.0 && (!clear || noise.0[..2] == [0.0, 0.0]), "{cloud:?} ± {noise:?}");
    }
    assert!(noise.pixels().filter(|p| p.0[0] > 0.0).count() > 50, "where there is cloud there is noise");
}

#[test]
fn the_timings_file_has_every_key() {
    let text = fs::read_to_string(WRITTEN.join("timings.json")).expect("the file is there");
    let timings: Value = serde_json::from_str(&text).expect("the file is JSON");
    assert!(timings["adapter"].as_str().is_some_and(|name| !name.is_empty()));
    assert_eq!(timings["size"], serde_json::json!([64, 36]));
    let spread = |value: &Value| ["min", "median", "max"].map(|key| value[key].as_f64().expect("a number"));
    let [min, median, max] = spread(&timings["frame"]);
    assert!(0.0 < min && min <= median && median <= max);
    for pass in ["cloud_sky", "cloud_march", "cloud_accumulate", "cloud_composite"] {
        let times = timings["passes"].get(pass).unwrap_or_else(|| panic!("{pass} is missing"));
        if !times.is_null() {
            let [min, median, max] = spread(times);
            assert!(0.0 <= min && min <= median && median <= max, "{pass}: {times}");
        }
    }
    let settings = &timings["settings"];
    for part in ["model", "layers", "lighting", "quality", "textures", "clock", "camera", "sun", "scene", "preset"] {
        assert!(!settings[part].is_null(), "settings.{part} is missing");
    }
    assert_eq!(settings["model"]["density"], 0.9);
    assert_eq!(settings["textures"]["volume_size"], 32);
    assert_eq!(settings["scene"], "ground_noon");
    assert_eq!(settings["preset"], "FairWeather");
}

#[test]
fn the_same_command_gives_the_same_clouds_from_any_folder() {
    let again = render(&[SHOT, &["--scene", "ground_noon", "--out", "shot.png"]].concat());
    assert_ne!(*again, **WRITTEN);
    let (first, second) = (read_cloud(&WRITTEN.join("cloud.exr")), read_cloud(&again.join("cloud.exr")));
    assert!(first == second, "two runs differ");
}

#[test]
fn moves_are_made_before_every_frame_but_the_first() {
    // Nothing is carried from frame to frame, so the last one is as if it stood alone.
    let alone =
        ["--size", "32x18", "--set", "quality.temporal=off", "--set", "quality.offsets=false", "--no-sky", "--no-land"];
    let moving =
        "--frames 3 --camera -50,100,0,-10,20 --move 0,100,0,5,0 --sun 40,-20 --sun-move 1,-2 --time 100 --dt 10";
    let standing = "--frames 1 --camera -50,300,0,0,20 --sun 42,-24 --time 120";
    let started = "--frames 1 --camera -50,100,0,-10,20 --sun 40,-20 --time 100";
    let [moving, standing, started] = render_batch(&alone, [moving, standing, started]);
    assert!(moving == standing, "two moves from the start is where the third frame stands");
    assert!(moving != started, "moves change what is seen");
}

#[test]
fn without_sky_and_cloud_the_picture_is_black_above() {
    let clear = ["--set", "model.coverage=-1", "--camera", "0,2,0,0,60"];
    let files =
        ["--size", "16x16", "--frames", "1", "--no-sky", "--no-land", "--out", "shot.png", "--cloud", "cloud.exr"];
    let folder = render(&[&files[..], &clear].concat());
    assert!(read(&folder.join("shot.png")).to_rgb8().pixels().all(|p| p.0 == [0; 3]));
    assert!(read_cloud(&folder.join("cloud.exr")).pixels().all(|p| p.0 == [0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn a_batch_makes_the_pictures_that_its_lines_make_alone() {
    let still = ["--size", "32x18", "--frames", "1", "--no-sky", "--no-land"];
    let still = [&still[..], &["--set", "quality.temporal=off", "--set", "quality.offsets=false"]].concat();
    let lines = ["--set model.coverage=0.3", "--set model.coverage=-0.2 --set quality.resolution=quarter --time 50"];
    let together = render_batch(&still, lines);
    for (line, together) in lines.into_iter().zip(together) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let alone = render(&[&still[..], &words, &["--cloud", "cloud.exr"]].concat());
        assert!(read_cloud(&alone.join("cloud.exr")) == together, "{line}: the batch's picture differs");
    }
}

#[test]
fn a_mistake_in_a_batch_is_named_with_its_line() {
    let cases = [
        ("--out a.png\n--set model.colour=1 --out b.png", "line 2", "model.colour"),
        ("--out a.png\n\n--size 16x16 --out b.png", "line 3", "--size"),
        ("--out a.png\n--set textures.seed=9 --out b.png", "line 2", "textures"),
        ("--frames 4", "line 1", "--out"),
        ("# nothing", "batch.txt", "no picture"),
        ("--batch again.txt --out a.png", "line 1", "no picture"),
    ];
    let folder = Folder::new();
    for (text, at, what) in cases {
        fs::write(folder.join("batch.txt"), text).expect("the folder can be written");
        let output = run_in(&folder, &["--batch", "batch.txt"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(at) && said.contains(what), "{text}: {said}");
        assert!(!said.contains("panicked") && !folder.join("a.png").exists(), "{text}: {said}");
    }
}

#[test]
fn effective_prints_the_settings_and_renders_nothing() {
    let options = ["--effective", "--scene", "sunset", "--quality", "low", "--set", "model.density=0.7"];
    let options = [&options[..], &["--set", "layers.0.map.cover=6.5", "--set", "layers.0.kind=sheet"]].concat();
    let output = run_in(&Folder::new(), &options);
    let all: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&all["quality"]["resolution"], &all["scene"]), (&"Quarter".into(), &"sunset".into()));
    assert_eq!(all["model"]["density"], 0.7);
    assert_eq!((&all["layers"][0]["map"]["cover"], &all["layers"][0]["kind"]), (&6.5.into(), &"Sheet".into()));
}
