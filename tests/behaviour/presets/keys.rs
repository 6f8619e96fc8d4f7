//! Which preset the key of `fly_camera` brings next.

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use bevy_cumulus::prelude::*;

#[path = "../../../examples/fly_camera/presets.rs"]
mod presets;

use presets::Presets;

/// Presses the key, and says which preset is in use then.
fn press(world: &mut World, presets: &mut Presets) -> Option<&'static str> {
    let of = |world: &World| {
        (
            world.resource::<CloudModel>().clone(),
            world.resource::<CloudLayers>().clone(),
            world.resource::<CloudLighting>().clone(),
        )
    };
    let (model, layers, lighting) = of(world);
    let next = presets.next(&model, &layers, &lighting).expect("there are presets");
    let apply = |In(preset): In<CloudPreset>,
                 (mut model, mut layers): (ResMut<CloudModel>, ResMut<CloudLayers>),
                 (mut lighting, mut textures): (ResMut<CloudLighting>, ResMut<CloudTextures>)| {
        preset.apply_to(&mut model, &mut layers, &mut lighting, &mut textures);
    };
    world.run_system_once_with(apply, next).expect("the settings are there");
    let (model, layers, lighting) = of(world);
    presets.name(&model, &layers, &lighting)
}

fn world() -> World {
    let mut world = World::new();
    world.init_resource::<CloudModel>();
    world.init_resource::<CloudLayers>();
    world.init_resource::<CloudLighting>();
    world.init_resource::<CloudTextures>();
    world
}

/// All names, beginning with the one at `first`, or with the first of all after a whole round.
fn names_from(first: usize) -> Vec<&'static str> {
    let names: Vec<_> = CloudPreset::names().collect();
    names.iter().cycle().skip(first).take(names.len()).copied().collect()
}

#[test]
fn the_key_visits_every_preset_once_a_round() {
    let (mut world, mut presets) = (world(), Presets::new());
    let names = names_from(0);
    // A sky of one's own: the first is next.
    world.resource_mut::<CloudModel>().coverage = 0.123;
    for round in 0..2 {
        let seen: Vec<_> = names.iter().map(|_| press(&mut world, &mut presets)).collect();
        assert_eq!(seen, names.iter().map(|name| Some(*name)).collect::<Vec<_>>(), "round {round}");
    }
}

#[test]
fn the_key_goes_on_from_the_sky_in_use() {
    for (i, name) in CloudPreset::names().enumerate() {
        let (mut world, mut presets) = (world(), Presets::new());
        CloudPreset::named(name).expect("it is built in").apply(&mut world);
        assert_eq!(press(&mut world, &mut presets), names_from(i + 1).first().copied(), "after {name}");
    }
    // Changed since: after the one chosen last.
    let (mut world, mut presets) = (world(), Presets::new());
    let names = names_from(0);
    // A sky of one's own: the first is next.
    world.resource_mut::<CloudModel>().coverage = 0.123;
    for name in &names[..6] {
        assert_eq!(press(&mut world, &mut presets), Some(*name));
    }
    world.resource_mut::<CloudLayers>().0[0].coverage = 0.01;
    assert_eq!(press(&mut world, &mut presets), Some(names[6]));
}

#[test]
fn what_is_so_already_does_not_count_as_changed() {
    let mut world = world();
    let cumulus = CloudPreset::named("Cumulus").expect("it is built in");
    cumulus.apply(&mut world);
    world.clear_trackers();
    let mut presets = Presets::new();
    while press(&mut world, &mut presets) != Some("Cumulonimbus") {}
    assert!(world.is_resource_changed::<CloudLayers>() && !world.is_resource_changed::<CloudTextures>());
}
