use super::*;

fn close(found: f64, wanted: f64, within: f64) {
    assert!((found - wanted).abs() <= within, "{found} instead of {wanted}");
}

#[test]
fn a_picture_equals_itself() {
    let picture = plain([200, 190, 180], [5000.0, 4800.0, 4500.0, 0.2]);
    let (errors, map) = Truth::exact(picture.clone()).unwrap().judge(&picture).unwrap();
    assert_eq!(errors, Errors { luminance: 1.0, ..Errors::default() });
    assert!(map.values.iter().all(|v| *v == 0.0));
}

#[test]
fn a_known_offset_gives_known_errors() {
    let truth = Truth::exact(plain([200; 3], [1000.0, 1000.0, 1000.0, 0.2])).unwrap();
    let (errors, _) = truth.judge(&plain([200; 3], [1100.0, 1100.0, 1100.0, 0.3])).unwrap();
    close(errors.luminance, 1.1, 1e-6);
    close(errors.rel_mse, 0.01 / (1.0 + FLOOR * FLOOR), 1e-6);
    close(errors.transmittance, 0.1, 1e-6);
    assert_eq!(errors.flip, 0.0, "what is shown is the same");
}

#[test]
fn black_against_white_is_the_worst_flip() {
    let truth = Truth::exact(plain([0; 3], [1.0, 1.0, 1.0, 0.0])).unwrap();
    let (errors, _) = truth.judge(&plain([255; 3], [1.0, 1.0, 1.0, 0.0])).unwrap();
    assert!(errors.flip > 0.9 && errors.flip <= 1.0, "{}", errors.flip);
}

#[test]
fn only_cloud_counts() {
    let mut truth = plain([100; 3], [1000.0, 1000.0, 1000.0, 0.5]);
    for (x, _, pixel) in truth.cloud.enumerate_pixels_mut() {
        if x < 8 {
            pixel.0[3] = 0.99;
        }
    }
    let mut test = truth.clone();
    for (x, _, pixel) in test.cloud.enumerate_pixels_mut() {
        if x < 8 {
            pixel.0[0] = 9e9;
        }
    }
    for (x, _, pixel) in test.shown.enumerate_pixels_mut() {
        if x == 0 {
            *pixel = image::Rgb([255; 3]);
        }
    }
    let truth = Truth::exact(truth).unwrap();
    close(truth.cover(), 0.5, 0.0);
    let (errors, _) = truth.judge(&test).unwrap();
    assert_eq!((errors.rel_mse, errors.luminance), (0.0, 1.0));
    assert!(errors.flip_all > 2.0 * errors.flip, "the wrong pixels are outside the cloud: {errors:?}");
}

/// Noise of the truth, however strong, is not counted as the picture's error.
#[test]
fn noise_of_the_truth_cancels() {
    let half = |sign: f32| {
        let mut picture = plain([100; 3], [1000.0, 1000.0, 1000.0, 0.5]);
        for (x, y, pixel) in picture.cloud.enumerate_pixels_mut() {
            // Two patterns whose product has the mean 0, as independent noise has.
            let strength = if sign > 0.0 { (x % 2) as f32 - 0.5 } else { (y % 2) as f32 - 0.5 };
            pixel.0[..3].iter_mut().for_each(|v| *v += 600.0 * strength);
        }
        picture
    };
    let truth = Truth::of_halves(half(1.0), half(-1.0)).unwrap();
    let (errors, _) = truth.judge(&plain([100; 3], [1000.0, 1000.0, 1000.0, 0.5])).unwrap();
    close(errors.rel_mse, 0.0, 2e-3);
    let (one, _) = Truth::exact(half(1.0)).unwrap().judge(&plain([100; 3], [1000.0, 1000.0, 1000.0, 0.5])).unwrap();
    assert!(one.rel_mse > 0.05, "against one half alone the noise counts: {}", one.rel_mse);
    close(errors.luminance, 1.0, 1e-3);
}

#[test]
fn a_clear_sky_is_refused() {
    let clear = plain([100; 3], [0.0, 0.0, 0.0, 1.0]);
    assert!(Truth::exact(clear.clone()).unwrap().judge(&clear).is_err());
}
