use bevy::reflect::TypeInfo;
use bevy::reflect::Typed;
use bevy_egui::egui::{Event, Key, Pos2};

use super::{
    super::fields::{
        tests::{Screen, click, find, press},
        words,
    },
    *,
};

type Texts = Vec<(String, Pos2)>;

/// The list as an app would have it: what is changed to something good is taken.
struct List {
    screen: Screen,
    state: LayersState,
    layers: CloudLayers,
    presets: Vec<(&'static str, CloudPreset)>,
}

impl List {
    fn of(names: &[&str]) -> Self {
        let named = |name: &&str| CloudLayer { name: (*name).to_owned(), ..default() };
        let layers = CloudLayers(names.iter().map(named).collect());
        Self { screen: Screen::new(), state: LayersState::default(), layers, presets: Vec::new() }
    }

    fn frame(&mut self, events: Vec<Event>) -> Texts {
        let Self { screen, state, layers, presets } = self;
        let mut good = None;
        let texts = screen.frame(events, |ui| good = good.take().or(state.edit(ui, layers, presets)));
        if let Some(good) = good {
            good.validate().expect("only good layers are taken");
            *layers = good;
        }
        texts
    }

    /// Clicks on the `n`-th text of these words, and gives lists and sections time to open.
    fn click(&mut self, text: &str, n: usize) -> Texts {
        let texts = self.frame(vec![]);
        let at =
            texts.iter().filter(|(shown, _)| shown == text).nth(n).unwrap_or_else(|| panic!("{text} in {texts:?}")).1;
        for events in click(at) {
            self.frame(events);
        }
        (0..8).map(|_| self.frame(vec![])).last().unwrap_or_default()
    }

    fn names(&self) -> Vec<&str> {
        self.layers.0.iter().map(|layer| &*layer.name).collect()
    }
}

#[test]
fn layers_are_moved_copied_and_removed() {
    let mut list = List::of(&["a", "b", "c"]);
    for (button, n, names) in [
        ("Up", 0, "abc"),
        ("Up", 2, "acb"),
        ("Down", 0, "cab"),
        ("Down", 2, "cab"),
        ("Copy", 1, "caab"),
        ("Remove", 0, "aab"),
        ("Remove", 2, "aa"),
    ] {
        list.click(button, n);
        assert_eq!(list.names().concat(), names, "{button} {n}");
    }
}

#[test]
fn layers_are_added_from_kinds_and_presets_up_to_the_most() {
    let mut list = List::of(&[]);
    let tower = CloudLayer { name: "tower".to_owned(), thickness: 9000.0, ..default() };
    list.presets = vec![("Storm", CloudPreset { layers: CloudLayers(vec![tower.clone()]), ..default() })];
    for (choice, count) in [("Volume: cloud with a body", 1), ("Sheet: thin high cloud", 2), ("Storm: tower", 3)] {
        list.click("Add a layer", 0);
        list.click(choice, 0);
        assert_eq!(list.layers.0.len(), count, "{choice}");
    }
    assert_eq!(list.layers.0[1].kind, LayerKind::Sheet);
    assert_eq!(list.layers.0[2], tower);
    while list.layers.0.len() < MAX_LAYERS {
        list.click("Copy", 0);
    }
    let texts = list.click("Copy", 0);
    assert_eq!(list.layers.0.len(), MAX_LAYERS);
    find(&texts, "8 layers are the most");
    let texts = list.click("Add a layer", 0);
    assert!(!texts.iter().any(|(text, _)| text == "Sheet: thin high cloud"), "the list opens");
}

#[test]
fn a_layer_is_hidden_and_renamed() {
    let mut list = List::of(&["low"]);
    let title = "1200 to 2900 m";
    list.click(title, 0);
    // The list of what can be added comes first, then the switch.
    for events in [press(Key::Tab), vec![], press(Key::Tab), vec![], press(Key::Space), vec![]] {
        list.frame(events);
    }
    // Where the focus was before is the click's affair: any of the line's switches is this layer's.
    let name = find(&list.frame(vec![]), "name");
    let texts = list.frame(vec![]);
    let text =
        texts.iter().filter(|(shown, _)| shown == "low").map(|(_, at)| *at).find(|at| (at.y - name.y).abs() < 4.0);
    for events in click(text.expect("a box with the name")) {
        list.frame(events);
    }
    list.frame(vec![Event::Text(" deck".to_owned())]);
    assert_eq!(list.names(), ["low"], "taken while it was typed");
    list.frame(press(Key::Enter));
    assert!(list.names()[0].contains(" deck"), "{:?}", list.names());
}

#[test]
fn every_field_of_a_layer_has_its_place_and_a_widget() {
    let mut list = List::of(&["all"]);
    list.click("1200 to 2900 m", 0);
    list.click("Map", 0);
    for (title, _) in GROUPS {
        list.click(title, 0);
    }
    let texts = list.frame(vec![]);
    let declared = |info: &'static TypeInfo| match info {
        TypeInfo::Struct(info) => info.field_names().to_vec(),
        other => panic!("{other:?}"),
    };
    let layer = declared(CloudLayer::type_info());
    for name in layer.iter().filter(|name| **name != "enabled" && **name != "map") {
        find(&texts, &words(name));
    }
    for name in declared(WeatherRecipe::type_info()) {
        find(&texts, &words(name));
    }
    assert!(!texts.iter().any(|(text, _)| text == "set in code"), "{texts:?}");
    // Names in groups are fields, or one would be missing from all.
    for name in GROUPS.iter().flat_map(|(_, names)| *names) {
        assert!(layer.contains(name), "{name} is no field");
    }
    assert_eq!(list.layers, List::of(&["all"]).layers, "looking changes something");
}

#[test]
fn a_bad_layer_is_explained_and_kept_back() {
    let mut list = List::of(&["a"]);
    list.layers.0[0].far_start = 70_000.0;
    list.click("Copy", 0);
    assert_eq!(list.layers.0.len(), 1);
    let texts = list.frame(vec![]);
    let says = "layers.0.far_end = 60000 must be above layers.0.far_start = 70000; the last good value stays";
    find(&texts, says);
}

#[test]
fn sizes_of_maps_settle_on_powers_of_two() {
    let mut layers = CloudLayers(vec![CloudLayer { map: WeatherRecipe { size: 100, ..default() }, ..default() }]);
    assert_eq!(settle(&mut layers), Ok(()));
    assert_eq!(layers.0[0].map.size, 128);
}
