//! Order: nothing of ours runs in an order that the schedule leaves open.

use std::collections::HashMap;

use bevy::{
    core_pipeline::schedule::Core3d,
    ecs::schedule::{InternedScheduleLabel, ScheduleLabel, Schedules, SystemKey},
    prelude::*,
    render::{ExtractSchedule, Render, RenderApp, renderer::RenderGraph},
};

use bevy_cumulus::prelude::*;

use crate::view::{Sky, clouds_app_with, spawn_sun, spawn_view, until_drawn};

const OURS: &str = "bevy_cumulus::";

/// An app that draws, so that every schedule has been built.
fn drawn() -> App {
    let mut app = clouds_app_with((CloudsPlugin, CloudFieldPlugin));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    spawn_view(&mut app, UVec2::new(8, 8), Transform::default(), Sky::Atmosphere);
    until_drawn(&mut app);
    app
}

/// Conflicts of our systems whose order is open, in words, and how many systems of ours the schedule has.
fn open_conflicts(world: &World, label: InternedScheduleLabel) -> (Vec<String>, usize) {
    let schedule = world.resource::<Schedules>().get(label).unwrap_or_else(|| panic!("there is no schedule {label:?}"));
    let names: HashMap<SystemKey, String> = schedule
        .systems()
        .unwrap_or_else(|_| panic!("{label:?} has not run"))
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
            (a.contains(OURS) || b.contains(OURS)).then(|| format!("{label:?}: {a} and {b} conflict on {on:?}"))
        })
        .collect();
    (found, ours)
}

#[test]
fn no_system_of_ours_is_ambiguous() {
    let app = drawn();
    let main = [First.intern(), PreStartup.intern(), PreUpdate.intern(), Last.intern()];
    let render = [ExtractSchedule.intern(), Render.intern(), RenderGraph.intern(), Core3d.intern()];
    let render_world = app.sub_app(RenderApp).world();
    let worlds = main.map(|label| (app.world(), label)).into_iter().chain(render.map(|label| (render_world, label)));
    let mut found = Vec::new();
    for (world, label) in worlds {
        let (conflicts, ours) = open_conflicts(world, label);
        assert!(ours > 0, "{label:?} has no system of ours: names changed, or a list here is old");
        found.extend(conflicts);
    }
    assert!(found.is_empty(), "order left open:\n{}", found.join("\n"));
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
