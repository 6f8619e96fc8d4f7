//! What a recipe makes.

use bevy_cumulus::{prelude::*, settings::SettingsError};

use super::{channel, made, small};

/// Everything at once, in odd directions.
fn busy() -> WeatherRecipe {
    WeatherRecipe {
        seed: 7,
        streets: 0.6,
        street_direction: 33.0,
        front: 0.5,
        front_direction: 120.0,
        clearings: 0.5,
        ripples: 0.4,
        ripple_direction: -51.0,
        streaks: 0.4,
        streak_direction: 77.0,
        open_cells: 0.3,
        ..small()
    }
}

#[test]
fn the_cover_is_met_for_every_kind_of_map() {
    for recipe in [small(), busy(), WeatherRecipe { softness: 0.0, regularity: 1.0, raggedness: 0.0, ..small() }] {
        for cover in [0.0, 0.02, 0.5, 1.0, 2.5, 4.0, 6.0, 7.0, 7.6, 8.0] {
            let map = made(&WeatherRecipe { cover, ..recipe.clone() });
            let share = cover / 8.0;
            assert!((map.cover() - share).abs() < 0.001, "{cover} oktas: {map:?}");
        }
    }
}

#[test]
fn overcast_is_nowhere_thin_and_a_clear_sky_empty() {
    let least = |cover| {
        let map = made(&WeatherRecipe { cover, ..small() });
        map.texels().iter().map(|texel| texel[0]).min().unwrap()
    };
    assert!(least(8.0) > 180, "{}", least(8.0));
    assert_eq!(least(7.0), 0);
    let clear = made(&WeatherRecipe { cover: 0.0, ..small() });
    assert!(clear.texels().iter().all(|texel| texel[0] == 0));
}

/// Mean and greatest step from each column to the next, the last one's to the first column; then the same of rows.
fn steps(map: &WeatherMap, n: usize) -> [Vec<(f32, f32)>; 2] {
    let (size, values) = (map.size().x as usize, channel(map, n));
    let step = |a: usize, b: usize| (values[a] - values[b]).abs();
    let line = |of: &dyn Fn(usize) -> f32| {
        let all: Vec<f32> = (0..size).map(of).collect();
        (all.iter().sum::<f32>() / size as f32, all.iter().copied().fold(0.0, f32::max))
    };
    let columns = (0..size).map(|x| line(&|y| step(y * size + x, y * size + (x + 1) % size))).collect();
    let rows = (0..size).map(|y| line(&|x| step(y * size + x, (y + 1) % size * size + x))).collect();
    [columns, rows]
}

#[test]
fn no_seam_where_the_map_repeats() {
    for recipe in [small(), busy(), WeatherRecipe { seed: 3, front_direction: 65.0, softness: 1.0, ..busy() }] {
        let map = made(&recipe);
        for n in 0..3 {
            for line in steps(&map, n) {
                let (&(mean, greatest), inside) = line.split_last().unwrap();
                let most = |of: fn(&(f32, f32)) -> f32| inside.iter().map(of).fold(0.0, f32::max);
                assert!(mean <= most(|s| s.0), "channel {n}: mean step {mean} at the seam of {recipe:?}");
                assert!(greatest <= most(|s| s.1), "channel {n}: step {greatest} at the seam of {recipe:?}");
            }
        }
    }
}

/// FNV-1a.
fn hash(map: &WeatherMap) -> u64 {
    let mix = |h: u64, b: &u8| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3);
    map.texels().as_flattened().iter().fold(0xcbf2_9ce4_8422_2325, mix)
}

#[test]
fn a_seed_makes_the_same_map_on_every_machine() {
    let found = [small(), busy(), WeatherRecipe { seed: 2, ..small() }].map(|recipe| hash(&made(&recipe)));
    assert_eq!(
        found,
        [3299203397741853133, 15055674520865172413, 10714575111268971314],
        "new numbers only where a new look is meant"
    );
}

/// Which of red, green and blue differ.
fn changed(a: &WeatherMap, b: &WeatherMap) -> [bool; 3] {
    [0, 1, 2].map(|n| channel(a, n) != channel(b, n))
}

#[test]
fn controls_change_their_channel_and_no_other() {
    const RED: [bool; 3] = [true, false, false];
    const NONE: [bool; 3] = [false; 3];
    type Change = fn(&mut WeatherRecipe);
    let changes: [(&str, Change, [bool; 3]); 27] = [
        ("cover", |r| r.cover = 5.0, RED),
        ("softness", |r| r.softness = 0.2, RED),
        ("clumping", |r| r.clumping = 0.9, RED),
        ("clump_size", |r| r.clump_size = 5000.0, RED),
        ("streets", |r| r.streets = 0.5, RED),
        ("clearings", |r| r.clearings = 0.5, RED),
        ("ripples", |r| r.ripples = 0.5, RED),
        ("streaks", |r| r.streaks = 0.5, RED),
        ("open_cells", |r| r.open_cells = 0.5, [true, true, false]),
        ("height_variation", |r| r.height_variation = 0.3, [false, true, false]),
        ("height_size", |r| r.height_size = 3000.0, [false, true, false]),
        ("base_variation", |r| r.base_variation = 0.8, [false, false, true]),
        ("base_size", |r| r.base_size = 3000.0, [false, false, true]),
        // Cells are shapes: they have an outline and a height.
        ("cell_size", |r| r.cell_size = 3000.0, [true, true, false]),
        ("regularity", |r| r.regularity = 0.9, [true, true, false]),
        ("raggedness", |r| r.raggedness = 0.9, [true, true, false]),
        ("front", |r| r.front = 0.5, [true, true, false]),
        ("seed", |r| r.seed = 9, [true; 3]),
        ("street_direction", |r| r.street_direction = 90.0, NONE),
        ("street_spacing", |r| r.street_spacing = 900.0, NONE),
        ("front_position", |r| r.front_position = 0.1, NONE),
        ("front_direction", |r| r.front_direction = 90.0, NONE),
        ("front_width", |r| r.front_width = 900.0, NONE),
        ("clearing_size", |r| r.clearing_size = 900.0, NONE),
        ("ripple_wavelength", |r| r.ripple_wavelength = 1500.0, NONE),
        ("ripple_direction", |r| r.ripple_direction = 90.0, NONE),
        (
            "streak_width, _length, _direction",
            |r| (r.streak_width, r.streak_length, r.streak_direction) = (900.0, 5000.0, 9.0),
            NONE,
        ),
    ];
    let before = made(&small());
    for (name, change, expected) in changes {
        let mut recipe = small();
        change(&mut recipe);
        assert_eq!(changed(&before, &made(&recipe)), expected, "{name}");
    }
}

#[test]
fn softness_moves_no_edge() {
    let outline = |softness| {
        let map = made(&WeatherRecipe { softness, ..small() });
        map.texels().iter().map(|texel| texel[0] > 0).collect::<Vec<_>>()
    };
    assert!(outline(0.0) == outline(1.0));
}

/// Places where cloud begins or ends from one texel of a row to the next, and of a column.
fn edges(map: &WeatherMap) -> [usize; 2] {
    let (size, red) = (map.size().x as usize, channel(map, 0));
    let cloud = |x: usize, y: usize| red[(y % size) * size + x % size] > 0.0;
    let count =
        |dx, dy| (0..size * size).filter(|n| cloud(n % size, n / size) != cloud(n % size + dx, n / size + dy)).count();
    [count(1, 0), count(0, 1)]
}

#[test]
fn rows_lie_along_their_direction() {
    let base = WeatherRecipe { cover: 4.0, clumping: 0.0, raggedness: 0.2, ..small() };
    let along = |degrees| {
        [
            WeatherRecipe { streets: 1.0, street_direction: degrees, ..base.clone() },
            WeatherRecipe { streaks: 1.0, streak_direction: degrees, ..base.clone() },
            // A ripple's direction is across its crests.
            WeatherRecipe { ripples: 1.0, ripple_direction: degrees + 90.0, ripple_wavelength: 2000.0, ..base.clone() },
        ]
    };
    for (x, y) in along(0.0).into_iter().zip(along(90.0)) {
        let [[across_x, along_x], [along_y, across_y]] = [edges(&made(&x)), edges(&made(&y))];
        assert!(along_x * 10 > across_x * 13, "rows along u: {across_x} edges along, {along_x} across, {x:?}");
        assert!(along_y * 10 > across_y * 13, "rows along v: {across_y} edges along, {along_y} across, {y:?}");
    }
}

#[test]
fn sizes_and_raggedness_set_how_many_edges_there_are() {
    let edges = |recipe: WeatherRecipe| edges(&made(&recipe)).iter().sum::<usize>() as f32;
    let large = edges(WeatherRecipe { cell_size: 4000.0, ..small() });
    assert!(edges(WeatherRecipe { cell_size: 1500.0, ..small() }) > 1.6 * large);
    let smooth = edges(WeatherRecipe { cell_size: 4000.0, raggedness: 0.0, ..small() });
    assert!(edges(WeatherRecipe { cell_size: 4000.0, raggedness: 1.0, ..small() }) > 1.4 * smooth);
}

/// Variance of the cover of blocks of 16 texels a side.
fn unevenness(map: &WeatherMap) -> f32 {
    let (size, red) = (map.size().x as usize, channel(map, 0));
    let mut blocks = vec![0.0; (size / 16) * (size / 16)];
    for (n, _) in red.iter().enumerate().filter(|(_, c)| **c > 0.0) {
        blocks[(n / size / 16) * (size / 16) + n % size / 16] += 1.0 / 256.0;
    }
    let mean = blocks.iter().sum::<f32>() / blocks.len() as f32;
    blocks.iter().map(|b| (b - mean) * (b - mean)).sum::<f32>() / blocks.len() as f32
}

#[test]
fn clumps_clearings_and_fronts_gather_cloud_and_regular_cells_spread_it() {
    let base = WeatherRecipe { clumping: 0.0, cell_size: 1200.0, ..small() };
    let even = unevenness(&made(&base));
    for (name, recipe) in [
        ("clumping", WeatherRecipe { clumping: 1.0, ..base.clone() }),
        ("clearings", WeatherRecipe { clearings: 1.0, cover: 5.0, ..base.clone() }),
        ("front", WeatherRecipe { front: 1.0, ..base.clone() }),
    ] {
        let uneven = unevenness(&made(&recipe));
        assert!(uneven > 2.0 * even, "{name}: {uneven}, without it {even}");
    }
    let regular = unevenness(&made(&WeatherRecipe { regularity: 1.0, ..base }));
    assert!(regular < 0.7 * even, "{regular}, scattered {even}");
}

#[test]
fn a_front_lies_where_it_was_put_and_is_tall() {
    for position in [0.25, 0.6] {
        let recipe = WeatherRecipe { front: 1.0, front_position: position, front_width: 4000.0, cover: 2.0, ..small() };
        let map = made(&recipe);
        let mean_at = |u: f32| {
            let column = (u.rem_euclid(1.0) * 128.0) as usize;
            let texels = map.texels();
            let sum = |n: usize| (0..128).map(|y| f32::from(texels[y * 128 + column][n])).sum::<f32>() / 128.0 / 255.0;
            (sum(0), sum(1))
        };
        let (band, elsewhere) = (mean_at(position), mean_at(position + 0.5));
        assert!(band.0 > 0.6 && elsewhere.0 < 0.15, "cover {band:?} on the front, {elsewhere:?} off it");
        assert!(band.1 > elsewhere.1 + 0.2, "height {band:?} on the front, {elsewhere:?} off it");
    }
}

#[test]
fn the_middle_of_an_open_cell_is_clear_and_of_a_closed_one_cloudy() {
    // Closed cells are islands in clear sky; open ones clear islands in cloud: at half cover, sky and cloud change places.
    let recipe = |open_cells| WeatherRecipe {
        open_cells,
        cover: 4.0,
        regularity: 1.0,
        raggedness: 0.0,
        clumping: 0.0,
        cell_size: 3200.0,
        ..small()
    };
    let deepest = |map: &WeatherMap, cloudy: bool| {
        // The farthest that one can be from the other kind, in texels.
        let red = channel(map, 0);
        let is = |x: i32, y: i32| (red[(y.rem_euclid(128) * 128 + x.rem_euclid(128)) as usize] > 0.0) == cloudy;
        let clear_to = |x, y| {
            (0..30)
                .find(|&d| {
                    (-d..=d).any(|k| !is(x + k, y + d) || !is(x + k, y - d) || !is(x + d, y + k) || !is(x - d, y + k))
                })
                .unwrap_or(30)
        };
        let mut all: Vec<i32> = (0..128 * 128).map(|n| (n % 128, n / 128)).map(|(x, y)| clear_to(x, y)).collect();
        all.sort_unstable();
        all[all.len() * 99 / 100]
    };
    let (closed, open) = (made(&recipe(0.0)), made(&recipe(1.0)));
    assert!(deepest(&closed, true) > deepest(&closed, false), "closed");
    assert!(deepest(&open, false) > deepest(&open, true), "open");
}

#[test]
fn variation_spreads_heights_and_bases() {
    let range = |recipe: &WeatherRecipe, n| {
        let all = channel(&made(recipe), n);
        let (low, high) = all.iter().fold((1.0_f32, 0.0_f32), |(low, high), &x| (low.min(x), high.max(x)));
        (low, high)
    };
    assert_eq!(range(&WeatherRecipe { height_variation: 0.0, ..small() }, 1), (1.0, 1.0));
    assert_eq!(range(&WeatherRecipe { base_variation: 0.0, ..small() }, 2), (0.0, 0.0));
    let (low, high) = range(&WeatherRecipe { height_variation: 1.0, ..small() }, 1);
    assert!(low < 0.1 && high > 0.75, "heights {low} to {high}");
    let (low, high) = range(&WeatherRecipe { base_variation: 1.0, ..small() }, 2);
    assert!(low < 0.1 && high > 0.9, "bases {low} to {high}");
}

#[test]
fn bad_recipes_name_field_and_range() {
    let error = |recipe: WeatherRecipe| recipe.generate().expect_err("a bad recipe").to_string();
    assert_eq!(error(WeatherRecipe { cover: 9.0, ..small() }), "weather.cover = 9 is outside its range 0 to 8");
    assert_eq!(error(WeatherRecipe { size: 4096, ..small() }), "weather.size = 4096 is outside its range 64 to 2048");
    assert!(error(WeatherRecipe { scale: f32::NAN, ..small() }).contains("weather.scale = NaN"));
    let odd = WeatherRecipe { size: 100, ..small() }.generate();
    let named = |field: &str| field == "weather.size";
    assert!(matches!(&odd, Err(SettingsError::NotPowerOfTwo { field, value: 100, .. }) if named(field)), "{odd:?}");
}

#[test]
fn the_ends_of_every_range_make_a_map() {
    let coarse = WeatherRecipe {
        size: 64,
        cell_size: 200_000.0,
        street_spacing: 200_000.0,
        streak_width: 200_000.0,
        streak_length: 1e6,
        front_width: 250_000.0,
        clump_size: 1e6,
        scale: 500.0,
        ..busy()
    };
    let fine = WeatherRecipe {
        size: 64,
        cell_size: 50.0,
        street_spacing: 100.0,
        streak_width: 50.0,
        streak_length: 100.0,
        front_width: 200.0,
        clump_size: 200.0,
        scale: 1e6,
        clearing_size: 200.0,
        ripple_wavelength: 50.0,
        ..busy()
    };
    for recipe in [coarse, fine] {
        assert!((made(&recipe).cover() - 0.375).abs() < 0.01, "{recipe:?}");
    }
}

#[test]
fn recipes_are_read_from_ron_and_mistakes_told() {
    let read: WeatherRecipe = ron::from_str("(cover: 5.5, streets: 0.7)").unwrap();
    assert_eq!(read, WeatherRecipe { cover: 5.5, streets: 0.7, ..Default::default() });
    let error = ron::from_str::<WeatherRecipe>("(cover: 5.5,\n streats: 0.7)").unwrap_err();
    assert!(error.to_string().contains("streats") && error.span.start.line == 2, "{error}");
}
