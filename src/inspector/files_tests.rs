use bevy_egui::egui::{Event, Pos2};

use super::{
    super::fields::tests::{Screen, click, find},
    *,
};
use crate::textures::{CloudTextureFault, CloudTextureSlot};

/// A path in a folder of this test's own.
fn temporary(name: &str) -> String {
    let folder = std::env::temp_dir().join(format!("bevy_cumulus_inspector_{}_{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder.join("sky.clouds.ron").display().to_string()
}

#[test]
fn a_saved_preset_is_the_one_that_loads() {
    let path = temporary("round_trip");
    let preset = CloudPreset {
        model: CloudModel { coverage: 0.37, wind: Vec3::new(-1.5, 0.0, 20.0), ..CloudModel::default() },
        sun_elevation: Some(12.0),
        ..CloudPreset::default()
    };
    write(&preset, &path).expect("written");
    let mut state = PresetState { path: format!(" {path} "), ..PresetState::default() };
    assert_eq!(state.load(), Some(preset));
    assert_eq!(state.said, Some(Ok(format!("loaded {path}"))));
}

#[test]
fn what_cannot_be_loaded_or_saved_is_explained() {
    let path = temporary("wrong");
    std::fs::write(&path, "(model: (coverage: 7))").expect("written");
    let mut state = PresetState { path: path.clone(), ..PresetState::default() };
    assert_eq!(state.load(), None);
    let said = |state: &PresetState| state.said.clone().and_then(Result::err).expect("an error");
    assert!(said(&state).contains("model.coverage = 7 is outside its range -1 to 1"), "{}", said(&state));
    assert!(said(&state).contains(&path), "{}", said(&state));

    state.path = "no/such/sky.clouds.ron".to_owned();
    assert_eq!(state.load(), None);
    assert!(said(&state).starts_with("no/such/sky.clouds.ron: "), "{}", said(&state));
    state.save(&CloudPreset::default());
    assert!(said(&state).starts_with("no/such/sky.clouds.ron: "), "{}", said(&state));

    let bad = CloudPreset { model: CloudModel { top: -100.0, ..CloudModel::default() }, ..CloudPreset::default() };
    state.path.clone_from(&path);
    state.save(&bad);
    assert!(said(&state).contains("model.top = -100 must be above"), "{}", said(&state));
    assert_eq!(std::fs::read_to_string(&path).expect("still there"), "(model: (coverage: 7))");

    for wrong in ["", "sky.txt", ".clouds.ron", "folder/.clouds.ron"] {
        state.path = wrong.to_owned();
        state.save(&CloudPreset::default());
        assert!(said(&state).contains("must end in .clouds.ron"), "{wrong:?}: {}", said(&state));
    }
}

#[test]
fn a_built_in_preset_is_chosen_by_a_click_even_where_it_is_in_use() {
    let overcast = CloudPreset::named("overcast").expect("a preset");
    for current in [CloudPreset::default(), CloudPreset { sun_elevation: Some(-3.0), ..overcast.clone() }] {
        let (mut screen, mut state) = (Screen::new(), PresetState::default());
        let texts = screen.frame(vec![], |ui| assert_eq!(state.ui(ui, &current), None));
        let mut chosen = None;
        for events in click(find(&texts, "Overcast")) {
            screen.frame(events, |ui| chosen = chosen.take().or(state.ui(ui, &current)));
        }
        assert_eq!(chosen.as_ref(), Some(&overcast));
    }
}

#[test]
fn tooltips_say_for_which_sun_a_preset_is() {
    let preset = |sun_elevation| CloudPreset { sun_elevation, ..CloudPreset::default() };
    assert!(sun_advice(&preset(Some(3.4))).starts_with("Made for a sun 3° above the horizon. "));
    assert!(sun_advice(&preset(None)).starts_with("Made for any sun. "));
}

#[test]
fn the_brightest_light_is_saved_as_the_sun() {
    let light = |illuminance, elevation: f32| {
        let place = Transform::from_rotation(Quat::from_euler(EulerRot::YXZ, 0.7, -elevation.to_radians(), 0.0));
        (DirectionalLight { illuminance, ..default() }, GlobalTransform::from(place))
    };
    let (moon, sun) = (light(0.3, 71.0), light(90_000.0, 12.34));
    let saved = |lights: &[(DirectionalLight, GlobalTransform)]| {
        let (model, lighting, textures) = default();
        current(
            &model,
            &CloudLayers::default(),
            &lighting,
            &textures,
            lights.iter().map(|(light, place)| (light, place)),
        )
        .sun_elevation
    };
    assert_eq!(saved(&[]), None);
    assert_eq!(saved(&[moon, sun, moon]), Some(12.34));
    // As it comes back from a file.
    assert_eq!(saved(&[light(1.0, saved(&[sun]).expect("a sun"))]), Some(12.34));
    assert_eq!(saved(&[light(1.0, -4.0)]), Some(-4.0));
    assert_eq!(saved(&[light(1.0, 90.0)]), Some(90.0));
}

#[test]
fn only_paths_below_the_assets_are_loaded() {
    assert_eq!(asset_path(" maps/a.png ").map(|path| path.to_string()), Ok("maps/a.png".to_owned()));
    for (path, why) in
        [("", "give the path"), ("/etc/a.png", "outside"), ("../a.png", "outside"), ("a#", "not an asset")]
    {
        let error = asset_path(path).expect_err(path);
        assert!(error.contains(why), "{path:?}: {error}");
    }
}

/// An asset server over a folder that need not exist.
fn server() -> App {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), AssetPlugin::default())).init_asset::<Image>();
    app
}

#[test]
fn a_slot_is_loaded_cleared_and_its_error_shown() {
    let app = server();
    let server = app.world().resource::<AssetServer>();
    let (mut screen, mut state, mut slots) = (Screen::new(), SlotsState::default(), CloudTextureSlots::default());
    state.hear(&CloudTextureError {
        slot: CloudTextureSlot::TypeMap,
        file: "b.png".to_owned(),
        fault: CloudTextureFault::NotLoaded { reason: "no such file".to_owned() },
    });
    let mut draw = |slots: &mut CloudTextureSlots, state: &mut SlotsState, events: Vec<Event>| {
        let mut changed = false;
        let texts = screen.frame(events, |ui| changed |= state.ui(ui, slots, server));
        (changed, texts)
    };
    let (changed, texts) = draw(&mut slots, &mut state, vec![]);
    assert!(!changed);
    find(&texts, "textures.type_map: b.png did not load: no such file");

    // Without a path the button says so; the first slot is the first of its kind.
    let press = |texts: &[(String, Pos2)], button: &str| click(find(texts, button));
    for events in press(&texts, "Load") {
        assert!(!draw(&mut slots, &mut state, events).0);
    }
    let (_, texts) = draw(&mut slots, &mut state, vec![]);
    find(&texts, "textures.billow: give the path of an image");

    state.paths.insert("billow", "noise/mine.ktx2".to_owned());
    let changed = press(&texts, "Load").map(|events| draw(&mut slots, &mut state, events).0);
    assert_eq!(changed, [false, false, true]);
    let (_, texts) = draw(&mut slots, &mut state, vec![]);
    find(&texts, "noise/mine.ktx2");
    assert!(slots.billow.is_some() && slots.wisp.is_none());
    assert!(!state.errors.contains_key("billow"));

    let changed = press(&texts, "Clear").map(|events| draw(&mut slots, &mut state, events).0);
    assert_eq!(changed, [false, false, true]);
    assert_eq!(slots, CloudTextureSlots::default());
}
