//! Pictures as they were when last approved.
//!
//! Each is made by the headless example and compared with `tests/goldens/NAME.png`. After a change of the look that is
//! meant, `CUMULUS_BLESS=1 cargo test --test behaviour goldens` writes them anew: look at each before it is committed.

use std::fs;

use image::RgbImage;

use crate::support::{
    golden::{compare, compare_with_golden, failures, folder, is_alike, read},
    gpu::webgpu_limits,
    program::command,
};

/// What every picture has in common: small, and made from small textures.
#[rustfmt::skip]
const SMALL: [&str; 10] = [
    "--size", "128x72", "--frames", "4", "--quality", "medium",
    "--set", "textures.volume_size=32", "--set", "textures.map_size=128",
];

fn render(name: &str, arguments: &[&str]) -> RgbImage {
    let out = failures().join(format!("{name}.png"));
    let path = out.to_string_lossy().into_owned();
    let output = command().args(arguments).args(SMALL).args(["--out", &path]).output().expect("the example starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name} failed with {:?}: {said}", output.status.code());
    read(&out).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn check(name: &str, arguments: &[&str]) {
    // Under WebGPU's limits Bevy's environment light from the atmosphere is missing and the ground is dark, so there
    // only the pictures without a sky can be compared.
    if webgpu_limits() && !arguments.contains(&"--no-sky") {
        eprintln!("{name} is not compared under WebGPU's limits");
        return;
    }
    let actual = render(name, arguments);
    let made = failures().join(format!("{name}.png"));
    compare_with_golden(name, &actual, &made).unwrap_or_else(|differs| panic!("{differs}"));
}

macro_rules! goldens {
    ($($name:ident: $arguments:expr;)*) => {
        $(#[test]
        fn $name() {
            check(stringify!($name), &$arguments);
        })*

        #[test]
        fn no_golden_is_left_over() {
            let known = [$(stringify!($name)),*];
            for entry in fs::read_dir(folder()).expect("the goldens are there") {
                let path = entry.expect("the folder can be read").path();
                if path.is_dir() {
                    // Those of the presets, which have a test of their own.
                    continue;
                }
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                assert!(known.contains(&name.as_str()), "{} belongs to no test", path.display());
            }
        }
    };
}

goldens! {
    ground_noon: ["--scene", "ground_noon"];
    ground_backlit: ["--scene", "ground_backlit"];
    overcast: ["--scene", "overcast"];
    sunset: ["--scene", "sunset"];
    hills: ["--scene", "hills"];
    inside: ["--scene", "ground_noon", "--camera", "0,2100,0,40,4"];
    above: ["--scene", "ground_noon", "--camera", "0,7000,0,0,-22"];
    ground_without_sky: ["--scene", "ground_noon", "--no-sky"];
    between: ["--scene", "between"];
    orbit: ["--scene", "orbit"];
    limb: ["--scene", "limb"];
    hills_in_cloud: ["--scene", "hills_in_cloud"];
    split_screen: ["--scene", "split_screen"];
    above_without_sky: ["--scene", "sunset", "--camera", "0,6000,0,90,-18", "--no-sky"];
}

#[test]
fn a_small_change_of_the_look_is_seen() {
    let golden = render("as_it_is", &["--scene", "ground_noon", "--no-sky"]);
    assert_eq!(compare(&golden, &golden), Some((1.0, 0.0)));
    for (name, change) in [("denser", "model.density=1.3"), ("more", "model.coverage=0.05")] {
        let other = render(name, &["--scene", "ground_noon", "--no-sky", "--set", change]);
        let alike = compare(&golden, &other).expect("both have the same size");
        assert!(!is_alike(alike), "{change} passes for the same: {alike:?}");
    }
}
