//! The example `weather_maps`, run as a program.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// Beside the tests' own program; cargo builds examples with them.
fn binary() -> PathBuf {
    let tests = std::env::current_exe().expect("a test knows its own path");
    let folder = tests.parent().and_then(Path::parent).expect("target/debug/deps");
    let path = folder.join("examples").join(format!("weather_maps{}", std::env::consts::EXE_SUFFIX));
    assert!(path.is_file(), "{} is missing: cargo build --example weather_maps makes it", path.display());
    path
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("cumulus_weather_{name}_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(binary()).args(arguments).current_dir(folder).output().expect("the example starts")
}

fn good(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {told}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn maps_and_pictures_are_written_and_the_cover_told() {
    let at = folder("maps");
    let told = good(&at, &["--set", "size=128", "--set", "cover=5", "--out", "a.png", "--channels", "--preview"]);
    assert!(told.starts_with("a.png: 128 × 128 texels of 312.5 m, cover 5.00 oktas (5 asked)"), "{told}");
    let side = |name: &str| image::open(at.join(name)).unwrap().width();
    let sides = ["a.png", "a_coverage.png", "a_height.png", "a_base.png", "a_preview.png"].map(side);
    assert_eq!(sides, [128, 128, 128, 128, 256]);
    let red: Vec<u8> = image::open(at.join("a.png")).unwrap().into_rgba8().pixels().map(|p| p[0]).collect();
    assert_eq!(red, image::open(at.join("a_coverage.png")).unwrap().into_luma8().into_raw());
    assert_eq!(red.iter().filter(|&&c| c > 0).count(), 128 * 128 * 5 / 8);
    std::fs::remove_dir_all(at).unwrap();
}

#[test]
fn a_printed_recipe_makes_the_same_map() {
    let at = folder("recipe");
    let recipe = good(&at, &["--pattern", "streets", "--set", "size=64", "--print", "--out", "a.png"]);
    let recipe = recipe.split("a.png:").next().unwrap();
    std::fs::write(at.join("r.ron"), recipe).unwrap();
    good(&at, &["--recipe", "r.ron", "--out", "b.png", "--count", "2"]);
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert!(bytes("a.png") == bytes("b_1.png"));
    assert!(bytes("a.png") != bytes("b_2.png"), "the next seed");
    std::fs::remove_dir_all(at).unwrap();
}

#[test]
fn a_report_makes_a_map_for_each_group() {
    let at = folder("metar");
    let line = "EGLL 231150Z 24012KT 9999 FEW022 BKN048 12/07 Q1013";
    let told = good(&at, &["--metar", line, "--elevation", "25", "--set", "size=64", "--out", "m.png"]);
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 2, "{told}");
    assert!(lines[0].contains("m_1.png") && lines[0].contains("cover 1.50 oktas") && lines[0].ends_with("at 696 m"));
    assert!(lines[1].contains("m_2.png") && lines[1].contains("cover 6.00 oktas") && lines[1].ends_with("at 1488 m"));
    std::fs::remove_dir_all(at).unwrap();
}

#[test]
fn steering_terrain_storms_and_clear_zones_change_the_map() {
    let at = folder("steering");
    std::fs::write(at.join("air.ron"), "(hour: 13.0, wind_speed: 9.0, humidity_aloft: 0.9)").unwrap();
    image::GrayImage::from_fn(64, 64, |x, _| image::Luma([(x * 4) as u8])).save(at.join("hills.png")).unwrap();
    let mut maps = Vec::new();
    for more in [
        &[][..],
        &["--terrain", "hills.png", "--peak", "3000"],
        &["--storm", "0.5,0.5,0.1"],
        &["--clear", "0.5,0.5,0.3", "--clear-softness", "0.2"],
    ] {
        good(&at, &[&["--steering", "air.ron", "--set", "size=64", "--out", "s.png"], more].concat());
        maps.push(std::fs::read(at.join("s.png")).unwrap());
    }
    for (n, map) in maps.iter().enumerate() {
        assert!(!maps[..n].contains(map), "map {n} is like one before");
    }
    std::fs::remove_dir_all(at).unwrap();
}

#[test]
fn mistakes_end_with_a_message_and_a_status() {
    let at = folder("mistakes");
    std::fs::write(at.join("bad.ron"), "(cover: 3.0,\n streats: 0.5)").unwrap();
    for (arguments, status, said) in [
        (&["--set", "size=64"][..], 1, "nothing to do"),
        (&["--out", "a.jpg"], 1, "must end so"),
        (&["--out", "no/such/a.png"], 1, "there is no directory"),
        (&["--pattern", "blob", "--out", "a.png"], 1, "must be one of cumulus"),
        (&["--recipe", "none.ron", "--out", "a.png"], 1, "none.ron"),
        (&["--recipe", "bad.ron", "--out", "a.png"], 1, "bad.ron:2:"),
        (&["--set", "cover", "--out", "a.png"], 1, "expected FIELD=VALUE"),
        (&["--set", "covr=3", "--out", "a.png"], 1, "covr"),
        (&["--set", "cover=many", "--out", "a.png"], 1, "--set cover=many"),
        (&["--set", "cover=9", "--out", "a.png"], 1, "weather.cover = 9 is outside its range 0 to 8"),
        (&["--metar", "EGLL 231150Z 24012KT 9999 FAW022", "--out", "a.png"], 1, "FAW022"),
        (&["--metar", "EGLL 231150Z 24012KT CAVOK 12/07 Q1013", "--out", "a.png"], 1, "the sky is clear"),
        (&["--pattern", "front", "--recipe", "bad.ron", "--out", "a.png"], 2, "cannot be used with"),
        (&["--storm", "0.5,0.5", "--out", "a.png"], 2, "three numbers"),
        (&["--terrain", "x.png", "--out", "a.png"], 2, "--steering"),
    ] {
        let output = run(&at, arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {told}");
        assert!(told.contains(said), "{arguments:?}: {told}");
    }
    assert!(!at.join("a.png").exists());
    std::fs::remove_dir_all(at).unwrap();
}
