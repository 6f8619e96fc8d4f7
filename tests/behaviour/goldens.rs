//! Pictures as they were when last approved.
//!
//! Each is made by the headless example and compared with `tests/goldens/NAME.png`. After a change of the look that is
//! meant, `CUMULUS_BLESS=1 cargo test --test behaviour goldens` writes them anew: look at each before it is committed.

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::{ImageReader, RgbImage};

use crate::{gpu::webgpu_limits, headless::command};

/// Least mean structural similarity (hybrid of MSSIM on luma and RMS on chroma; 1 is the same). One machine repeats its
/// pictures to the bit. Software renderers differ by version and by what SIMD the CPU has: with other code for
/// filtering and mip levels (lavapipe 25, `GALLIVM_PERF=no_quad_lod,no_aos_sampling,nopt`) single pixels differ by 2
/// levels, 0.15 in the mean; the limits leave five times that. `model.density=1.3` scores 0.990.
const LEAST_SCORE: f64 = 0.994;
/// Greatest root of the mean squared difference, in levels of 255: catches a change of brightness, to which
/// structure is blind. `model.density=1.3` has 1.9, `model.coverage=0.05` 1.5.
const GREATEST_RMS: f64 = 0.7;

/// What every picture has in common: small, and made from small textures.
#[rustfmt::skip]
const SMALL: [&str; 10] = [
    "--size", "128x72", "--frames", "4", "--quality", "medium",
    "--set", "textures.volume_size=32", "--set", "textures.map_size=128",
];

pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/goldens")
}

/// A folder of `target` for what failed.
pub fn failures() -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("goldens");
    fs::create_dir_all(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    path
}

pub fn read(path: &Path) -> Result<RgbImage, String> {
    let opened = ImageReader::open(path).map_err(|error| error.to_string())?;
    Ok(opened.decode().map_err(|error| error.to_string())?.to_rgb8())
}

fn render(name: &str, arguments: &[&str]) -> RgbImage {
    let out = failures().join(format!("{name}.png"));
    let path = out.to_string_lossy().into_owned();
    let output = command().args(arguments).args(SMALL).args(["--out", &path]).output().expect("the example starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name} failed with {:?}: {said}", output.status.code());
    read(&out).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn rms(a: &RgbImage, b: &RgbImage) -> f64 {
    let squares = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    (squares.sum::<f64>() / a.as_raw().len() as f64).sqrt()
}

/// Score and root mean square of the differences; `None` where the sizes differ.
fn compare(golden: &RgbImage, actual: &RgbImage) -> Option<(f64, f64)> {
    let score = image_compare::rgb_hybrid_compare(golden, actual).ok()?.score;
    Some((score, rms(golden, actual)))
}

fn is_alike((score, rms): (f64, f64)) -> bool {
    score >= LEAST_SCORE && rms <= GREATEST_RMS
}

/// Differences eight times as strong, around grey.
fn difference(golden: &RgbImage, actual: &RgbImage) -> RgbImage {
    RgbImage::from_fn(golden.width(), golden.height(), |x, y| {
        let (a, b) = (golden.get_pixel(x, y), actual.get_pixel_checked(x, y).unwrap_or(&image::Rgb([0; 3])));
        image::Rgb([0, 1, 2].map(|c| (128 + 8 * (i32::from(b.0[c]) - i32::from(a.0[c]))).clamp(0, 255) as u8))
    })
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

/// Compares with the golden picture of this name below the folder, and says what differs; or makes it that one. `made` is
/// where the picture lies.
pub fn compare_with_golden(name: &str, actual: &RgbImage, made: &Path) -> Result<(), String> {
    let path = folder().join(format!("{name}.png"));
    if std::env::var("CUMULUS_BLESS").is_ok_and(|bless| bless == "1") {
        return actual.save(&path).map_err(|error| format!("{}: {error}", path.display()));
    }
    let golden = read(&path).map_err(|error| {
        format!("{}: {error}. Look at {}; CUMULUS_BLESS=1 makes it the golden one", path.display(), made.display())
    })?;
    let alike = compare(&golden, actual);
    if alike.is_some_and(is_alike) {
        return Ok(());
    }
    let differs = made.with_extension("difference.png");
    difference(&golden, actual).save(&differs).map_err(|error| format!("{}: {error}", differs.display()))?;
    Err(format!(
        "{name} differs: score and RMS {alike:?}, at least {LEAST_SCORE} and at most {GREATEST_RMS} are allowed; see {} \
         and {}",
        made.display(),
        differs.display()
    ))
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
