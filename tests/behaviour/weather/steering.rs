//! From the state of the air to a recipe.

use bevy_cumulus::{
    prelude::*,
    weather::{LclFormula, Steering, lifting_condensation_level, relative_humidity, stratiform_cover},
};

fn lcl(t: f32, d: f32, formula: LclFormula) -> f32 {
    lifting_condensation_level(t, d, formula)
}

/// Lifts a parcel metre by metre until it is saturated: its temperature falls by g/cp, its vapour pressure with the pressure.
fn lifted(t: f64, d: f64) -> f64 {
    let saturated = |celsius: f64| 6.112 * (17.67 * celsius / (celsius + 243.5)).exp();
    let (lapse, exponent) = (9.81 / 1005.0, 1005.0 / 287.0);
    let is_saturated = |z: f64| {
        let now = t - lapse * z;
        saturated(d) * ((now + 273.15) / (t + 273.15)).powf(exponent) >= saturated(now)
    };
    (0..20_000).map(f64::from).find(|&z| is_saturated(z)).unwrap()
}

#[test]
fn the_condensation_level_is_that_of_the_papers() {
    assert_eq!(lcl(20.0, 12.0, LclFormula::Espy), 1000.0);
    for (t, d) in [(20.0, 12.0), (30.0, 20.0), (5.0, 1.0), (25.0, 8.0)] {
        let exact = lifted(t, d);
        for (formula, tolerance) in [(LclFormula::Espy, 0.06), (LclFormula::Bolton, 0.02), (LclFormula::Lawrence, 0.09)]
        {
            let found = lcl(t as f32, d as f32, formula);
            // Lawrence gives his second rule for humidity above a half.
            if formula == LclFormula::Lawrence && relative_humidity(t as f32, d as f32) < 0.5 {
                continue;
            }
            assert!(
                (f64::from(found) / exact - 1.0).abs() < tolerance,
                "{formula:?} at {t}/{d}: {found}, lifted {exact}"
            );
        }
    }
    for formula in [LclFormula::Espy, LclFormula::Bolton, LclFormula::Lawrence] {
        assert!(lcl(15.0, 15.0, formula).abs() < 0.5, "{formula:?}: saturated air");
        assert_eq!(lcl(10.0, 15.0, formula).max(0.5), 0.5, "{formula:?}: no negative height");
        assert!(lcl(30.0, 5.0, formula) > lcl(30.0, 15.0, formula), "{formula:?}: drier is higher");
    }
}

#[test]
fn humidity_by_bolton() {
    assert_eq!(relative_humidity(20.0, 20.0), 1.0);
    // 14.02 hPa over 23.37 hPa.
    assert!((relative_humidity(20.0, 12.0) - 0.600).abs() < 0.002, "{}", relative_humidity(20.0, 12.0));
}

#[test]
fn cover_by_sundqvist() {
    assert_eq!(stratiform_cover(0.5, 0.75), 0.0);
    assert_eq!(stratiform_cover(0.75, 0.75), 0.0);
    // 1 − √(0.1/0.25)
    assert!((stratiform_cover(0.9, 0.75) - 0.36754).abs() < 1e-4);
    assert_eq!(stratiform_cover(1.0, 0.75), 1.0);
    assert_eq!(stratiform_cover(1.7, 0.75), 1.0);
    assert!(stratiform_cover(0.995, 1.0).is_finite());
}

fn steer(air: Steering) -> (WeatherRecipe, bevy_cumulus::weather::LayerHints) {
    air.steer(&WeatherRecipe { clearings: 0.3, seed: 5, ..Default::default() }).expect("good air")
}

fn at(hour: f32) -> (WeatherRecipe, bevy_cumulus::weather::LayerHints) {
    steer(Steering { hour, ..Default::default() })
}

#[test]
fn cumulus_comes_with_the_heat_of_the_day_and_goes_with_it() {
    let cover: Vec<f32> = (0..24).map(|hour| at(hour as f32).1.convective).collect();
    assert_eq!(&cover[..7], [0.0; 7], "before and at dawn");
    let highest = cover.iter().copied().fold(0.0, f32::max);
    let when = cover.iter().position(|&c| c == highest).unwrap();
    assert!((12..=16).contains(&when) && (1.5..=4.0).contains(&highest), "{highest} oktas at {when} h: {cover:?}");
    assert!(cover[18] < highest && cover[20..].iter().all(|&c| c == 0.0), "evening: {cover:?}");
    let depths: Vec<f32> = (0..24).map(|hour| at(hour as f32).1.mixed_layer).collect();
    assert!(depths.windows(2).all(|pair| pair[1] >= pair[0]), "the mixed layer grows: {depths:?}");
    assert!((1000.0..3000.0).contains(&depths[15]), "{depths:?}");
}

#[test]
fn heat_flux_is_half_a_sine_of_the_day() {
    let flux = |hour| Steering { hour, day_length: 12.0, noon_heat_flux: 200.0, ..Default::default() }.heat_flux();
    assert!((flux(12.0) - 200.0).abs() < 0.1 && (flux(8.0) - 100.0).abs() < 0.1);
    assert!(flux(6.0).abs() < 1e-3 && flux(3.0).abs() < 1e-3 && flux(18.5).abs() < 1e-3);
    assert_eq!(Steering { day_length: 0.0, ..Default::default() }.heat_flux(), 0.0);
}

#[test]
fn the_base_follows_the_air() {
    let (_, moist) = steer(Steering { dew_point: 20.0, ..Default::default() });
    let (_, dry) = steer(Steering { dew_point: 5.0, ..Default::default() });
    assert!(moist.base < 350.0 && dry.base > 1900.0, "{} {}", moist.base, dry.base);
    assert!(dry.convective < moist.convective, "air too dry for the mixed layer to reach its level");
    for hints in [moist, dry] {
        assert!(hints.top > hints.base);
    }
    let (_, capped) = steer(Steering { lid: 1800.0, ..Default::default() });
    assert!(capped.top <= 1800.0 && capped.mixed_layer <= 1800.0);
}

#[test]
fn humidity_aloft_brings_an_even_layer() {
    let (dry, _) = steer(Steering::default());
    let (moist, hints) = steer(Steering { humidity_aloft: 0.97, ..Default::default() });
    assert!((hints.stratiform - 8.0 * stratiform_cover(0.97, 0.75)).abs() < 1e-4);
    assert!(moist.cover > dry.cover && moist.regularity > dry.regularity);
    assert!(moist.height_variation < dry.height_variation && moist.clumping < dry.clumping);
    let (wet, _) = steer(Steering { humidity_aloft: 1.0, ..Default::default() });
    assert_eq!(wet.cover, 8.0);
}

#[test]
fn wind_makes_streets_along_it_and_calm_or_strong_heat_none() {
    let windy = Steering { wind_speed: 9.0, wind_direction: 40.0, noon_heat_flux: 150.0, ..Default::default() };
    let (recipe, hints) = steer(windy.clone());
    assert!(recipe.streets > 0.5, "{}", recipe.streets);
    assert_eq!(recipe.street_direction, 40.0);
    assert!((recipe.street_spacing / hints.mixed_layer - 2.8).abs() < 0.01);
    for (why, air) in [
        ("calm", Steering { wind_speed: 2.0, ..windy.clone() }),
        ("night", Steering { hour: 2.0, ..windy.clone() }),
        ("free convection", Steering { wind_speed: 4.5, noon_heat_flux: 500.0, ..windy }),
    ] {
        assert_eq!(steer(air).0.streets, 0.0, "{why}");
    }
}

#[test]
fn what_is_not_weather_stays() {
    let (recipe, _) = steer(Steering::default());
    assert_eq!((recipe.seed, recipe.clearings), (5, 0.3));
    assert!(recipe.generate().is_ok());
}

#[test]
fn every_corner_of_the_ranges_makes_a_good_recipe() {
    for temperature in [-60.0, 60.0] {
        for dew_point in [-70.0, 40.0] {
            for (wind_speed, roughness) in [(0.0, 5.0), (100.0, 0.00001)] {
                for (hour, day_length, noon_heat_flux) in [(0.0, 0.0, 0.0), (12.0, 24.0, 1000.0), (24.0, 24.0, 0.0)] {
                    for stability in [0.0005, 0.05] {
                        let lid = 20_000.0;
                        let air = Steering {
                            temperature,
                            dew_point,
                            wind_speed,
                            roughness,
                            hour,
                            day_length,
                            noon_heat_flux,
                            stability,
                            lid,
                            ..Default::default()
                        };
                        let (recipe, hints) = steer(air.clone());
                        let size = WeatherRecipe { size: 64, ..recipe };
                        assert!(size.generate().is_ok(), "{air:?}: {:?}", size.generate());
                        assert!(hints.base.is_finite() && hints.top > hints.base, "{air:?}: {hints:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn bad_air_is_told() {
    let air = Steering { humidity_aloft: 1.5, ..Default::default() };
    let error = air.steer(&WeatherRecipe::default()).unwrap_err().to_string();
    assert_eq!(error, "steering.humidity_aloft = 1.5 is outside its range 0 to 1");
}
