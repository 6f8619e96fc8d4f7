//! Clear zones, storms and hills.

use bevy::{prelude::*, render::render_resource::TextureFormat};
use bevy_cumulus::{
    prelude::*,
    weather::{Steering, StormCell, Terrain, orographic},
};

use super::{channel, made, small};

const SIDE: usize = 128;

fn overcast() -> WeatherMap {
    made(&WeatherRecipe { cover: 8.0, ..small() })
}

/// Distance in repeats, over the seams too.
fn distance(n: usize, centre: Vec2) -> f32 {
    let place = (Vec2::new((n % SIDE) as f32, (n / SIDE) as f32) + 0.5) / SIDE as f32;
    let offset = place - centre;
    (offset - offset.round()).length()
}

#[test]
fn a_clear_zone_clears_its_disc_over_the_seams_and_nothing_else() {
    let before = overcast();
    let (centre, radius) = (Vec2::new(0.02, 0.97), 0.2);
    let mut after = before.clone();
    after.clear_zone(centre, radius, 0.5);
    for (n, (a, b)) in after.texels().iter().zip(before.texels()).enumerate() {
        let d = distance(n, centre) / radius;
        if d < 0.5 {
            assert_eq!(a[0], 0, "texel {n}, {d} radii away");
        } else if d > 1.0 {
            assert_eq!(a, b, "texel {n}, {d} radii away");
        } else {
            assert!(a[0] <= b[0]);
        }
        assert_eq!(a[1..], b[1..]);
    }
}

#[test]
fn softness_fades_a_clear_zone() {
    let before = overcast();
    let partly = |softness| {
        let mut map = before.clone();
        map.clear_zone(Vec2::splat(0.5), 0.3, softness);
        let pairs = map.texels().iter().zip(before.texels());
        pairs.filter(|(a, b)| a[0] > 0 && a[0] < b[0]).count()
    };
    assert_eq!(partly(0.0), 0);
    assert!(partly(0.3) > 200 && 2 * partly(1.0) > 3 * partly(0.3), "{} {}", partly(0.3), partly(1.0));
}

#[test]
fn nonsense_changes_nothing() {
    let before = overcast();
    let mut map = before.clone();
    for (centre, radius) in [
        (Vec2::NAN, 0.2),
        (Vec2::INFINITY, 0.2),
        (Vec2::ZERO, f32::NAN),
        (Vec2::ZERO, f32::INFINITY),
        (Vec2::ZERO, 0.0),
        (Vec2::ZERO, -1.0),
    ] {
        map.clear_zone(centre, radius, 0.5);
        map.stamp_storm(centre, radius, &StormCell::default());
    }
    assert!(map == before);
}

/// Coverage, height and base at a place given in radii from the centre.
fn at(map: &WeatherMap, centre: Vec2, radius: f32, offset: Vec2) -> Vec3 {
    map.sample(centre + offset * radius)
}

#[test]
fn a_storm_has_a_tower_an_anvil_ahead_and_smaller_towers_behind() {
    // Over a corner, so that all of it crosses a seam.
    let (centre, radius) = (Vec2::new(0.01, 0.01), 0.06);
    let mut map = WeatherMap::clear(UVec2::splat(512));
    map.stamp_storm(centre, radius, &StormCell::default());
    let tower = at(&map, centre, radius, Vec2::ZERO);
    assert!(tower.x > 0.95 && tower.y > 0.9 && tower.z < 0.05, "tower {tower}");
    let anvil = at(&map, centre, radius, Vec2::new(2.4, 0.0));
    assert!(anvil.x > 0.3 && (anvil.y - 0.25).abs() < 0.1 && (anvil.z - 0.75).abs() < 0.1, "anvil {anvil}");
    let flank = at(&map, centre, radius, Vec2::new(-1.45, 0.95));
    assert!(flank.x > 0.3 && flank.y < 0.6 && flank.z < 0.3, "flank {flank}");
    assert_eq!(at(&map, centre, radius, Vec2::new(-3.0, -2.0)).x, 0.0, "behind, on the other side");
    assert_eq!(at(&map, centre, radius, Vec2::new(0.0, 5.0)).x, 0.0, "far off");
}

#[test]
fn a_storm_takes_height_direction_anvil_and_flank_from_its_cell() {
    let (centre, radius) = (Vec2::splat(0.5), 0.06);
    let stamped = |cell: StormCell| {
        let mut map = WeatherMap::clear(UVec2::splat(256));
        map.stamp_storm(centre, radius, &cell);
        map
    };
    let low = stamped(StormCell { height: 0.5, base: 0.2, ..Default::default() });
    let tower = at(&low, centre, radius, Vec2::ZERO);
    assert!((tower.y - 0.5).abs() < 0.05 && (tower.z - 0.2).abs() < 0.03, "{tower}");
    let turned = stamped(StormCell { anvil_direction: 90.0, ..Default::default() });
    assert!(at(&turned, centre, radius, Vec2::new(0.0, 2.4)).x > 0.3);
    assert_eq!(at(&turned, centre, radius, Vec2::new(3.5, 0.0)).x, 0.0);
    let bare = stamped(StormCell { anvil: 0.0, flank: 0.0, ..Default::default() });
    assert_eq!(at(&bare, centre, radius, Vec2::new(2.0, 0.0)).x, 0.0);
    assert_eq!(at(&bare, centre, radius, Vec2::new(-1.45, 0.95)).x, 0.0);
    assert!(stamped(StormCell { seed: 2, ..Default::default() }) != stamped(StormCell::default()));
}

/// A ridge 1500 m high along v, in the middle of the map, which the wind crosses towards +u.
fn ridge() -> Terrain {
    let height = |n: usize| 1500.0 * (1.0 - ((n % 64) as f32 / 64.0 - 0.5).abs() * 8.0).max(0.0);
    Terrain::new(UVec2::splat(64), (0..64 * 64).map(height).collect()).unwrap()
}

fn mean_coverage(map: &WeatherMap, u: std::ops::Range<f32>) -> f32 {
    let all = channel(map, 0);
    let inside: Vec<f32> =
        (0..all.len()).filter(|n| u.contains(&((n % SIDE) as f32 / SIDE as f32))).map(|n| all[n]).collect();
    inside.iter().sum::<f32>() / inside.len() as f32
}

#[test]
fn hills_make_cloud_to_windward_and_clear_the_lee() {
    let air = Steering { wind_speed: 10.0, temperature: 15.0, dew_point: 10.0, hour: 6.0, ..Default::default() };
    let scale = 100_000.0;
    let over = |mut map: WeatherMap, air: &Steering| {
        orographic(&mut map, &ridge(), air, scale).unwrap();
        map
    };
    let clear = WeatherMap::clear(UVec2::splat(SIDE as u32));
    let map = over(clear.clone(), &air);
    assert!(mean_coverage(&map, 0.45..0.5) > 0.8, "windward {}", mean_coverage(&map, 0.45..0.5));
    assert_eq!(mean_coverage(&map, 0.0..0.3), 0.0, "over the plain");
    let overcast = over(overcast(), &air);
    assert!(mean_coverage(&overcast, 0.58..0.64) < 0.35, "lee {}", mean_coverage(&overcast, 0.58..0.64));
    assert!(mean_coverage(&overcast, 0.0..0.3) > 0.7, "over the plain");
    // The other way round, from the other side.
    let back = over(clear.clone(), &Steering { wind_direction: 180.0, ..air.clone() });
    assert!(mean_coverage(&back, 0.52..0.57) > 0.8 && mean_coverage(&back, 0.4..0.45) < 0.1);
    let dry = over(clear.clone(), &Steering { dew_point: -15.0, ..air.clone() });
    assert_eq!(dry.cover(), 0.0, "dry air");
    let calm = over(clear.clone(), &Steering { wind_speed: 0.0, ..air });
    assert_eq!(calm.cover(), 0.0, "calm");
}

#[test]
fn terrain_comes_from_pictures_and_tells_what_is_wrong() {
    let size = bevy::render::render_resource::Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
    let picture = |data: Vec<u8>, format| {
        Image::new(size, bevy::render::render_resource::TextureDimension::D2, data, format, default())
    };
    let terrain = Terrain::from_image(&picture(vec![0, 255], TextureFormat::R8Unorm), 100.0, 300.0).unwrap();
    assert!((terrain.height(Vec2::new(0.25, 0.5)) - 100.0).abs() < 0.01);
    assert!((terrain.height(Vec2::new(0.75, 0.5)) - 300.0).abs() < 0.01);
    assert!((terrain.height(Vec2::new(1.0, 0.5)) - 200.0).abs() < 0.01, "filtered over the seam");
    let short = Terrain::new(UVec2::new(2, 2), vec![1.0; 3]).unwrap_err().to_string();
    assert_eq!(short, "the terrain has 3 heights; 2 × 2 needs 4, and at least one");
    assert!(Terrain::new(UVec2::ZERO, vec![]).is_err());
    let nan = Terrain::new(UVec2::new(2, 1), vec![1.0, f32::NAN]).unwrap_err().to_string();
    assert_eq!(nan, "the terrain's height at (1, 0) is NaN");
    let packed = Terrain::from_image(&picture(vec![0; 8], TextureFormat::Rgba8Snorm), 0.0, 1.0);
    assert!(packed.unwrap_err().to_string().contains("Rgba8Snorm"));
}
