//! Pictures compared with those that were last approved, in `tests/goldens/`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::{ImageReader, RgbImage};

/// Least mean structural similarity (hybrid of MSSIM on luma and RMS on chroma; 1 is the same). One machine repeats its
/// pictures to the bit. Software renderers differ by version and by what SIMD the CPU has: with other code for
/// filtering and mip levels (lavapipe 25, `GALLIVM_PERF=no_quad_lod,no_aos_sampling,nopt`) single pixels differ by 2
/// levels, 0.15 in the mean; the limits leave five times that. `model.density=1.3` scores 0.990.
pub const LEAST_SCORE: f64 = 0.994;

/// Greatest root of the mean squared difference, in levels of 255: catches a change of brightness, to which
/// structure is blind. `model.density=1.3` has 1.9, `model.coverage=0.05` 1.5.
pub const GREATEST_RMS: f64 = 0.7;

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

pub fn rms(a: &RgbImage, b: &RgbImage) -> f64 {
    let squares = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    (squares.sum::<f64>() / a.as_raw().len() as f64).sqrt()
}

/// Score and root mean square of the differences; `None` where the sizes differ.
pub fn compare(golden: &RgbImage, actual: &RgbImage) -> Option<(f64, f64)> {
    let score = image_compare::rgb_hybrid_compare(golden, actual).ok()?.score;
    Some((score, rms(golden, actual)))
}

pub fn is_alike((score, rms): (f64, f64)) -> bool {
    score >= LEAST_SCORE && rms <= GREATEST_RMS
}

/// Differences eight times as strong, around grey.
pub fn difference(golden: &RgbImage, actual: &RgbImage) -> RgbImage {
    RgbImage::from_fn(golden.width(), golden.height(), |x, y| {
        let (a, b) = (golden.get_pixel(x, y), actual.get_pixel_checked(x, y).unwrap_or(&image::Rgb([0; 3])));
        image::Rgb([0, 1, 2].map(|c| (128 + 8 * (i32::from(b.0[c]) - i32::from(a.0[c]))).clamp(0, 255) as u8))
    })
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
