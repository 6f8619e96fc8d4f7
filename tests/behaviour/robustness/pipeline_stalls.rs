//! A slider that moves makes no frame wait: nothing is compiled for it, and the clouds stay while it moves.

use std::{collections::BTreeMap, time::Instant};

use bevy::{
    prelude::*,
    render::{RenderApp, render_resource::PipelineCache},
};
use bevy_cumulus::{prelude::*, textures::CloudTextureStatus};

use crate::support::{
    app::{Sky, new_clouds_app, spawn_sun, spawn_view, until_drawn},
    gpu::{pipelines_are_there, run_until, run_updates},
};

/// What fields are set to, where it is of their type and in their range.
const VALUES: [&str; 37] = [
    "10",
    "0.03",
    "0.05",
    "0.37",
    "0.45",
    "2",
    "3",
    "64",
    "128",
    "600",
    "650",
    "2000",
    "7000",
    "20000",
    "true",
    "false",
    "1,2,3",
    "0.5,0.6,0.7",
    "isotropic",
    "rayleigh",
    "cornette_shanks",
    "schlick",
    "two_lobe",
    "mie",
    "ice",
    "table",
    "subtract",
    "sheet",
    "red",
    "full",
    "quarter",
    "half",
    "off",
    "sliding_window",
    "four",
    "naive",
    "energy_conserving",
];

fn pipelines(app: &App) -> usize {
    app.sub_app(RenderApp).world().resource::<PipelineCache>().pipelines().count()
}

/// Values for a path: those that any may take, or texts where any text would do.
fn values(path: &str) -> &'static [&'static str] {
    match path {
        "layers.0.name" => &["lower deck"],
        "layers.0.map_file" => &["textures/blue_noise.png"],
        _ => &VALUES,
    }
}

/// Runs a frame; how long it took (ms).
fn frame(app: &mut App) -> f64 {
    let start = Instant::now();
    run_updates(app, 1);
    start.elapsed().as_secs_f64() * 1e3
}

#[test]
fn no_setting_compiles_anything_or_takes_the_clouds_away() {
    let mut app = new_clouds_app();
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 0.4, -1.0), Vec3::Y);
    spawn_view(&mut app, UVec2::new(32, 18), looking, Sky::Black);
    until_drawn(&mut app);
    run_updates(&mut app, 4);
    let before = pipelines(&app);
    // One layer for paths to lead to; it compiles nothing either.
    let map = WeatherRecipe { size: 64, ..default() };
    app.insert_resource(CloudLayers(vec![CloudLayer { map, ..default() }]));
    run_updates(&mut app, 2);
    until_drawn(&mut app);
    assert_eq!(pipelines(&app), before, "a layer asks for another pipeline");
    let mut still: Vec<f64> = (0..40).map(|_| frame(&mut app)).collect();
    still.sort_by(f64::total_cmp);

    let world = app.world();
    let start = CloudSettings {
        model: world.resource::<CloudModel>().clone(),
        layers: world.resource::<CloudLayers>().clone(),
        lighting: world.resource::<CloudLighting>().clone(),
        quality: world.resource::<CloudQuality>().clone(),
        textures: world.resource::<CloudTextures>().clone(),
        clock: world.resource::<CloudClock>().clone(),
    };
    let mut worst = BTreeMap::<String, (f64, String)>::new();
    // Another method is another renderer, compiled when it is first asked for.
    let asked = |path: &String| path != "quality.method" && !path.starts_with("layers.1.");
    for path in start.paths().into_iter().filter(asked) {
        let mut tried = 0;
        // Until its own map is made a layer shows the one before, which is not what was asked for.
        let makes_map = path.starts_with("layers.0.map");
        for value in values(&path) {
            let mut settings = start.clone();
            if settings.set(&path, value).is_err() || settings.validate().is_err() || settings == start {
                continue;
            }
            // Two numbers are a drag, and one is enough of what bakes; choices are all tried.
            let enough = if path.starts_with("textures.") || makes_map { 1 } else { 2 };
            if tried == enough && value.starts_with(|c: char| c.is_ascii_digit()) {
                continue;
            }
            tried += 1;
            app.insert_resource(settings.model)
                .insert_resource(settings.layers)
                .insert_resource(settings.lighting)
                .insert_resource(settings.quality)
                .insert_resource(settings.textures)
                .insert_resource(settings.clock);
            for _ in 0..2 {
                let took = frame(&mut app);
                let root = path.split('.').next().unwrap_or_default().to_owned();
                let entry = worst.entry(root).or_default();
                if took > entry.0 {
                    *entry = (took, format!("{path} = {value}"));
                }
                let ready = makes_map || app.world().resource::<CloudStatus>().is_ready();
                assert!(ready, "{path} = {value} takes the clouds away");
            }
            assert_eq!(pipelines(&app), before, "{path} = {value} asks for another pipeline");
            assert!(pipelines_are_there(&app), "{path} = {value} compiles a pipeline again");
        }
        assert!(tried > 0, "no value here is one of {path}");
        run_until(&mut app, "the bake", 400, |app| {
            let status = app.world().resource::<CloudStatus>();
            !app.world().resource::<CloudTextureStatus>().baking && status.is_ready()
        });
    }
    // Times are the machine's, so they are told and not judged.
    println!("still: median {:.1} ms, worst {:.1} ms", still[still.len() / 2], still[still.len() - 1]);
    for (root, (took, what)) in worst {
        println!("{root}: worst {took:.1} ms, {:.1} medians ({what})", took / still[still.len() / 2]);
    }
}
