//! Zones of more cloud or none.

use bevy::{math::DVec3, prelude::*};
use bevy_cumulus::testing::model_bindings;
use bevy_cumulus::{prelude::*, settings::Validate, textures::CloudTextureStatus};

use crate::support::{
    app::{Sky, cloud_pixels, clouds_app, is_baked, spawn_sun, spawn_view, until_drawn},
    gpu::{run_compute_with, run_until, run_updates, times_logged},
    shared::SharedApp,
};

const ASK: &str = "
import bevy_cumulus::model::model::{density_bound, sample_medium};

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x * 4u;
    if i >= arrayLength(&values) {
        return;
    }
    let p = vec3<f32>(values[i], values[i + 1u], values[i + 2u]);
    results[id.x * 2u] = density_bound(p, values[i + 3u]);
    results[id.x * 2u + 1u] = sample_medium(p, 3.0).density;
}
";

/// Places on the ground around a camera at the origin, in a square, and what stands over each half way up the layer.
struct Ground {
    places: Vec<Vec2>,
    /// Bound within 2^lod metres, and density.
    answers: Vec<[f32; 2]>,
}

const LOD: f32 = 9.0;
const HEIGHT: f32 = 1000.0;

fn ask(app: &mut App) -> Ground {
    // So that transforms have reached their globals.
    app.update();
    let places: Vec<Vec2> =
        (0..96 * 96).map(|i| Vec2::new((i % 96) as f32, (i / 96) as f32) * 400.0 - 19_200.0).collect();
    let curve = |at: Vec2| at.length_squared() / (2.0 * 6.36e6);
    let questions: Vec<f32> = places.iter().flat_map(|at| [at.x, HEIGHT - curve(*at), at.y, LOD]).collect();
    let group = model_bindings(app, DVec3::ZERO).expect("the model can be bound");
    let answers = run_compute_with(app, ASK, Some(&group), &questions, 2 * places.len(), places.len() as u32);
    Ground { places, answers: answers.as_chunks().0.to_vec() }
}

impl Ground {
    /// Share of places at these distances from `centre` that have cloud.
    fn share(&self, centre: Vec2, distances: std::ops::Range<f32>) -> f32 {
        let there: Vec<f32> = (self.places.iter().zip(&self.answers))
            .filter(|(at, _)| distances.contains(&at.distance(centre)))
            .map(|(_, [_, density])| *density)
            .collect();
        assert!(there.len() > 50, "{} places", there.len());
        there.iter().filter(|density| **density > 0.0).count() as f32 / there.len() as f32
    }
}

fn model_app(layered: bool) -> SharedApp {
    let mut app = clouds_app();
    // Cloud nearly everywhere at this height, and no lean of tops that shifts it.
    let model =
        CloudModel { bottom: 600.0, top: 1400.0, coverage: 0.3, wind_skew: 0.0, noise_strength: 0.3, ..default() };
    if layered {
        let layer = CloudLayer { base: 600.0, base_rise: 0.0, thickness: 800.0, wind_skew: 0.0, ..default() };
        let map = WeatherRecipe { cover: 5.0, height_variation: 0.0, ..default() };
        app.insert_resource(CloudModel { enabled: false, ..model });
        app.insert_resource(CloudLayers(vec![CloudLayer { map, shape_strength: 0.3, peak_height: 0.5, ..layer }]));
    } else {
        app.insert_resource(model);
    }
    // Layers are there once their maps are.
    for _ in 0..2 {
        run_updates(&mut app, 4);
        run_until(&mut app, "the textures are there", 900, |app| is_baked(app));
    }
    app
}

#[test]
fn a_zone_clears_the_sky_above_it_and_only_there() {
    for layered in [false, true] {
        let mut app = model_app(layered);
        let before = ask(&mut app);
        let centre = Vec2::new(6000.0, -4000.0);
        let zone = CloudZone { radius: 6000.0, edge: 2000.0, strength: -1.0 };
        let transform = Transform::from_xyz(centre.x, 700.0, centre.y);
        let entity = app.world_mut().spawn((zone, transform)).id();
        let cleared = ask(&mut app);
        let shares = |ground: &Ground, at| [ground.share(at, 0.0..3900.0), ground.share(at, 6200.0..12_000.0)];
        println!("layered {layered}: {:?}, then {:?}", shares(&before, centre), shares(&cleared, centre));
        assert!(shares(&before, centre).iter().all(|share| *share > 0.3), "there is no cloud to clear");
        assert_eq!(shares(&cleared, centre)[0], 0.0);
        for ((at, before), now) in before.places.iter().zip(&before.answers).zip(&cleared.answers) {
            if at.distance(centre) > 6100.0 {
                assert_eq!(before[1], now[1], "{at} is far from the zone");
            }
            assert!(now[1] <= before[1] && now[1] <= now[0] + 1e-5, "{at}: {before:?}, {now:?}");
        }
        // Where the whole reach is clear the bound says so, and rays leap across.
        let inside = |at: &Vec2| at.distance(centre) < 2500.0;
        let bounds = cleared.places.iter().zip(&cleared.answers).filter(|(at, _)| inside(at)).map(|(_, a)| a[0]);
        assert!(bounds.clone().count() > 50 && bounds.clone().all(|bound| bound == 0.0));
        // It goes where its entity goes.
        let there = Vec2::new(-9000.0, 5000.0);
        app.world_mut().entity_mut(entity).insert(Transform::from_xyz(there.x, 0.0, there.y));
        let moved = ask(&mut app);
        assert_eq!(moved.share(there, 0.0..3900.0), 0.0);
        assert_eq!(moved.share(centre, 0.0..3900.0), shares(&before, centre)[0]);
        // More cloud is the other way round, and the bound holds.
        app.world_mut().entity_mut(entity).insert(CloudZone { strength: 1.0, ..zone });
        let closed = ask(&mut app);
        println!("closed: {}", closed.share(there, 0.0..3900.0));
        assert!(
            closed.share(there, 0.0..3900.0) > 0.97
                && closed.share(there, 0.0..3900.0) > before.share(there, 0.0..3900.0)
        );
        assert!(closed.answers.iter().all(|[bound, density]| *density <= bound + 1e-5));
    }
}

#[test]
fn zones_are_checked_and_followed_without_beginning_anew() {
    let zone = CloudZone { radius: 100.0, edge: 101.0, ..default() };
    assert_eq!(zone.validate().unwrap_err().to_string(), "zone.edge = 101 is outside its range 0 to zone.radius = 100");
    let wild = CloudZone { strength: -1.5, ..default() };
    assert_eq!(wild.validate().unwrap_err().to_string(), "zone.strength = -1.5 is outside its range -1 to 1");

    let mut app = clouds_app();
    app.insert_resource(CloudModel { coverage: 0.3, ..default() });
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 1.0, -0.3), Vec3::Z);
    let view = spawn_view(&mut app, UVec2::new(48, 27), looking, Sky::Black);
    until_drawn(&mut app);
    run_updates(&mut app, 4);
    run_until(&mut app, "the textures are there", 900, |app| !app.world().resource::<CloudTextureStatus>().baking);
    let mean = |app: &App| {
        let pixels = cloud_pixels(app, &view);
        pixels.iter().map(|p| p.w).sum::<f32>() / pixels.len() as f32
    };
    run_updates(&mut app, 8);
    let cloudy = mean(&app);
    // A zone that cannot be is told of once, and left out.
    let logged = times_logged("zone.strength = -1.5");
    let entity = app.world_mut().spawn((wild, Transform::default())).id();
    run_updates(&mut app, 3);
    assert_eq!((times_logged("zone.strength = -1.5"), mean(&app) < 0.9), (logged + 1, true));
    // A new one shows at once: frames held without it are dropped.
    app.world_mut().entity_mut(entity).insert(CloudZone { radius: 30_000.0, edge: 1000.0, strength: -1.0 });
    run_updates(&mut app, 1);
    println!("transmittance {cloudy} without and {} with it", mean(&app));
    assert!(cloudy < 0.8 && mean(&app) == 1.0, "{cloudy} and {}", mean(&app));
    // Far away it counts for nothing.
    app.world_mut().entity_mut(entity).insert(Transform::from_xyz(1e6, 0.0, 0.0));
    run_updates(&mut app, 9);
    assert!((mean(&app) - cloudy).abs() < 0.05, "{cloudy} and {}", mean(&app));
    // More than eight are told of.
    for k in 0..9 {
        app.world_mut().spawn((CloudZone::default(), Transform::from_xyz(1000.0 * k as f32, 0.0, 0.0)));
    }
    let logged = times_logged("more than 8 zones");
    run_updates(&mut app, 3);
    assert_eq!(times_logged("more than 8 zones"), logged + 1);
}

#[test]
fn a_zone_shows_from_orbit_as_far_as_clouds_do() {
    let mut app = clouds_app();
    app.insert_resource(CloudModel { coverage: 0.4, ..default() });
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    // Farther along the ground than `max_distance`, and well within what is seen from here.
    let place = Vec3::new(150_000.0, 0.0, 0.0);
    let looking = Transform::from_xyz(0.0, 200_000.0, 0.0).looking_at(place, Vec3::Z);
    let view = spawn_view(&mut app, UVec2::new(9, 9), looking, Sky::Black);
    let narrow = PerspectiveProjection { fov: 0.03, ..default() };
    app.world_mut().entity_mut(view.camera).insert(Projection::Perspective(narrow));
    until_drawn(&mut app);
    run_updates(&mut app, 4);
    run_until(&mut app, "the textures are there", 900, |app| !app.world().resource::<CloudTextureStatus>().baking);
    let thinnest = |app: &mut App| {
        run_updates(app, 8);
        cloud_pixels(app, &view).iter().map(|p| p.w).fold(1.0, f32::min)
    };
    let before = thinnest(&mut app);
    let zone = CloudZone { radius: 30_000.0, edge: 1000.0, strength: -1.0 };
    app.world_mut().spawn((zone, Transform::from_translation(place)));
    let cleared = thinnest(&mut app);
    println!("transmittance at least {before} without and {cleared} with it");
    assert!(before < 0.5 && cleared == 1.0, "{before} and {cleared}");
}
