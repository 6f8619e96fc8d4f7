//! Order: nothing of ours runs in an order that the schedule leaves open.

use std::collections::{BTreeSet, HashMap};

use bevy::{
    core_pipeline::schedule::Core3d,
    ecs::schedule::{InternedScheduleLabel, Schedules, SystemKey},
    prelude::*,
    render::RenderApp,
};

use bevy_cumulus::prelude::*;

use crate::support::app::{Sky, new_clouds_app_with, spawn_sun, spawn_view, until_drawn};

const OURS: &str = "bevy_cumulus::";
/// Systems of others that hold the whole world, which conflicts with all that runs beside them: Bevy's sync points, and
/// egui's, which touch nothing of ours.
const WHOLE_WORLD: [&str; 2] = ["bevy_ecs::apply_deferred", "bevy_egui::"];

/// An app that draws, with all of our plugins.
fn drawn() -> App {
    let mut app = new_clouds_app_with((
        CloudsPlugin,
        CloudFieldPlugin,
        #[cfg(feature = "inspector")]
        bevy_cumulus::inspector::CloudInspectorPlugin,
    ));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    spawn_view(&mut app, UVec2::new(8, 8), Transform::default(), Sky::Atmosphere);
    until_drawn(&mut app);
    app
}

/// Conflicts of our systems whose order is open, in words, and how many systems of ours the schedule has.
fn open_conflicts(world: &World, schedule: &Schedule) -> (Vec<String>, usize) {
    let label = schedule.label();
    let names: HashMap<SystemKey, String> = schedule
        .systems()
        .unwrap_or_else(|_| panic!("{label:?} is not built"))
        .map(|(key, system)| (key, system.name().to_string()))
        .collect();
    let ours = names.values().filter(|name| name.contains(OURS)).count();
    let found = schedule
        .graph()
        .conflicting_systems()
        .iter()
        .filter_map(|(a, b, components)| {
            let [a, b] = [a, b].map(|key| names.get(key).map_or("?", String::as_str));
            let on: Vec<String> =
                components.iter().filter_map(|id| Some(world.components().get_name(*id)?.to_string())).collect();
            let is_held = on.is_empty() && WHOLE_WORLD.iter().any(|other| a.starts_with(other) || b.starts_with(other));
            (!is_held && (a.contains(OURS) || b.contains(OURS)))
                .then(|| format!("{label:?}: {a} and {b} conflict on {on:?}"))
        })
        .collect();
    (found, ours)
}

/// The same of every schedule of a world; and the names of those that have systems of ours.
fn all_open_conflicts(world: &mut World) -> (Vec<String>, BTreeSet<String>) {
    let labels: Vec<InternedScheduleLabel> =
        world.resource::<Schedules>().iter().map(|(_, schedule)| schedule.label()).collect();
    let (mut found, mut with_ours) = (Vec::new(), BTreeSet::new());
    for label in labels {
        world.schedule_scope(label, |world, schedule| {
            // One that has not run, such as a window's, is built here.
            schedule.initialize(world).unwrap_or_else(|error| panic!("{label:?} cannot be built: {error}"));
            let (conflicts, ours) = open_conflicts(world, schedule);
            found.extend(conflicts);
            if ours > 0 {
                with_ours.insert(format!("{label:?}"));
            }
        });
    }
    (found, with_ours)
}

#[test]
fn no_system_of_ours_is_ambiguous() {
    let mut app = drawn();
    let (mut found, main) = all_open_conflicts(app.world_mut());
    let (of_render, render) = all_open_conflicts(app.sub_app_mut(RenderApp).world_mut());
    found.extend(of_render);
    // Else names changed, and ours were not looked at.
    for label in ["First", "PreStartup", "PreUpdate", "Last"] {
        assert!(main.contains(label), "{label} has no system of ours: {main:?}");
    }
    if cfg!(feature = "inspector") {
        assert!(main.contains("EguiPrimaryContextPass") && main.contains("PostUpdate"), "no panel: {main:?}");
    }
    for label in ["RenderStartup", "ExtractSchedule", "Render", "RenderGraph", "Core3d"] {
        assert!(render.contains(label), "{label} has no system of ours: {render:?}");
    }
    println!("looked at {main:?} and {render:?}");
    assert!(found.is_empty(), "order left open:\n{}", found.join("\n"));
}

#[test]
fn an_open_order_is_seen() {
    // Named as systems of ours are, since the tests' own crate is not called so.
    mod bevy_cumulus {
        use bevy::prelude::*;
        #[derive(Resource, Default)]
        pub struct Shared;
        pub fn one(_: ResMut<Shared>) {}
        pub fn other(_: ResMut<Shared>) {}
    }
    let mut app = App::new();
    app.init_resource::<bevy_cumulus::Shared>().add_systems(Update, bevy_cumulus::one);
    assert_eq!(all_open_conflicts(app.world_mut()), (Vec::new(), BTreeSet::from(["Update".to_owned()])));
    app.add_systems(Update, bevy_cumulus::other);
    let (found, _) = all_open_conflicts(app.world_mut());
    assert!(found.len() == 1 && found[0].contains("Shared"), "{found:?}");
}

#[test]
fn passes_run_after_the_opaque_scene_and_before_tone_mapping() {
    // Recording commands conflicts with nothing, so ambiguity detection does not see this order.
    let app = drawn();
    let schedules = app.sub_app(RenderApp).world().resource::<Schedules>();
    let order: Vec<String> = schedules
        .get(Core3d)
        .expect("Core3d is there")
        .systems()
        .expect("Core3d has run")
        .map(|(_, system)| system.name().to_string())
        .collect();
    let wanted = [
        "::main_opaque_pass_3d",
        "::main_transmissive_pass_3d",
        "::cloud_sky",
        "::cloud_light",
        "::cloud_accumulate",
        "::cloud_composite",
        "::main_transparent_pass_3d",
        "::cloud_draw_over<false>",
        "::temporal_anti_alias",
        "::cloud_draw_over<true>",
        "::tonemapping",
        "::upscaling",
    ];
    let places = wanted.map(|name| {
        order
            .iter()
            .position(|system| system.ends_with(name))
            .unwrap_or_else(|| panic!("{name} is not in Core3d: {order:#?}"))
    });
    assert!(places.is_sorted(), "{wanted:?} run at {places:?}");
    // The sky is drawn before the pass that may draw clouds.
    let sky = order.iter().position(|system| system.ends_with("::render_sky"));
    assert!(sky.is_some_and(|sky| sky < places[6]), "render_sky runs at {sky:?}");
}
