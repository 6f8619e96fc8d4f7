use bevy_egui::egui::{Context, Event, Key, Modifiers, Pos2, RawInput, Rect, Shape, vec2};

use super::*;
use crate::settings::{CloudClock, CloudLighting, CloudModel, CloudQuality, CloudTextures, Erosion, Validate};

/// A window without a GPU: takes events, draws one frame, and says which texts stand where.
pub(in crate::inspector) struct Screen(Context, f64);

impl Screen {
    pub fn new() -> Self {
        Self(Context::default(), 0.0)
    }

    pub fn frame(&mut self, events: Vec<Event>, mut draw: impl FnMut(&mut Ui)) -> Vec<(String, Pos2)> {
        self.1 += 0.1;
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(900.0, 2000.0))),
            time: Some(self.1),
            events,
            ..RawInput::default()
        };
        let mut output = self.0.run_ui(input, |ui| draw(ui));
        // egui insists that somebody uploads the fonts.
        output.textures_delta.clear();
        let texts = output.shapes.into_iter().filter_map(|clipped| match clipped.shape {
            Shape::Text(text) => Some((text.galley.text().to_owned(), text.visual_bounding_rect().center())),
            _ => None,
        });
        texts.collect()
    }
}

pub(in crate::inspector) fn press(key: Key) -> Vec<Event> {
    let event = |pressed| Event::Key { key, physical_key: None, pressed, repeat: false, modifiers: Modifiers::NONE };
    vec![event(true), event(false)]
}

/// A click needs a frame for each half.
pub(in crate::inspector) fn click(at: Pos2) -> [Vec<Event>; 3] {
    use bevy_egui::egui::PointerButton::Primary;
    let button = |pressed| Event::PointerButton { pos: at, button: Primary, pressed, modifiers: Modifiers::NONE };
    [vec![Event::PointerMoved(at)], vec![button(true)], vec![button(false)]]
}

pub(in crate::inspector) fn find(texts: &[(String, Pos2)], text: &str) -> Pos2 {
    texts.iter().find(|(shown, _)| shown == text).map(|(_, at)| *at).unwrap_or_else(|| panic!("{text} in {texts:?}"))
}

/// Plays each list of events in a frame of its own; whether any of them changed the value.
fn play<V: Reflect>(screen: &mut Screen, value: &mut V, frames: impl IntoIterator<Item = Vec<Event>>) -> bool {
    let mut changed = false;
    for events in frames {
        screen.frame(events, |ui| changed |= struct_ui(ui, value.as_partial_reflect_mut()));
    }
    changed
}

fn declared(value: &dyn PartialReflect) -> Vec<&'static NamedField> {
    match value.get_represented_type_info() {
        Some(TypeInfo::Struct(info)) => info.iter().collect(),
        _ => Vec::new(),
    }
}

fn has_a_widget_for_every_field<R: Validate + Default>() {
    let mut value = R::default();
    let texts = Screen::new().frame(vec![], |ui| {
        assert!(!struct_ui(ui, value.as_partial_reflect_mut()), "nothing was touched");
    });
    let declared = declared(R::default().as_partial_reflect());
    assert!(declared.len() > 1);
    for field in declared {
        find(&texts, &field.name().replace('_', " "));
    }
    assert!(!texts.iter().any(|(text, _)| text == "set in code" || text == "not a struct"), "{texts:?}");
}

#[test]
fn every_setting_has_a_widget() {
    has_a_widget_for_every_field::<CloudModel>();
    has_a_widget_for_every_field::<CloudLighting>();
    has_a_widget_for_every_field::<CloudQuality>();
    has_a_widget_for_every_field::<CloudTextures>();
    has_a_widget_for_every_field::<CloudClock>();
}

#[test]
fn a_slider_changes_its_own_field_within_its_range() {
    let (mut screen, mut model) = (Screen::new(), CloudModel::default());
    // The first field is a switch.
    assert!(!play(&mut screen, &mut model, [vec![], press(Key::Tab), vec![], press(Key::Tab), vec![]]));
    assert_eq!(model, CloudModel::default());
    assert!(play(&mut screen, &mut model, [press(Key::ArrowRight)]));
    assert!(model.bottom > CloudModel::default().bottom, "{}", model.bottom);
    assert_eq!(CloudModel { bottom: CloudModel::default().bottom, ..model.clone() }, CloudModel::default());
    // Far past the end of the range.
    play(&mut screen, &mut model, (0..3000).map(|_| press(Key::ArrowLeft)));
    assert_eq!(model.bottom, -400.0);
}

#[test]
fn a_number_is_typed_in_and_kept_within_its_range() {
    let (mut screen, mut model) = (Screen::new(), CloudModel::default());
    // The stop after the slider is its number box, which opens with all of it selected.
    let tab = || [press(Key::Tab), vec![]];
    play(&mut screen, &mut model, [vec![]].into_iter().chain([tab(), tab(), tab(), [vec![], vec![]]].concat()));
    let typed = vec![Event::Text("99999999".to_owned())];
    assert!(!play(&mut screen, &mut model, [typed]), "taken while it was being typed");
    assert!(play(&mut screen, &mut model, [press(Key::Enter), vec![]]));
    assert_eq!(model.bottom, 30_000.0);
}

#[test]
fn a_bad_value_from_elsewhere_is_shown_and_left_alone() {
    let (mut screen, mut model) = (Screen::new(), CloudModel { density: 1234.0, ..CloudModel::default() });
    assert!(!play(&mut screen, &mut model, [vec![], vec![]]));
    assert_eq!(model.density, 1234.0);
}

#[test]
fn a_choice_is_clicked() {
    let (mut screen, mut model) = (Screen::new(), CloudModel::default());
    let draw = |screen: &mut Screen, model: &mut CloudModel, events| {
        screen.frame(events, |ui| _ = struct_ui(ui, model.as_partial_reflect_mut()))
    };
    let mut texts = draw(&mut screen, &mut model, vec![]);
    for choice in ["remap", "subtract"] {
        // The list takes a frame to be measured and one to be drawn.
        for events in click(find(&texts, choice)).into_iter().chain([vec![], vec![]]) {
            texts = draw(&mut screen, &mut model, events);
        }
    }
    assert_eq!(model, CloudModel { erosion: Erosion::Subtract, ..CloudModel::default() });
}

#[derive(Reflect, Default, PartialEq, Debug, Clone)]
struct Others {
    /// A switch.
    on: bool,
    /// Where.
    #[reflect(@-10.0..=10.0_f32)]
    at: DVec3,
    /// Cannot be edited.
    letter: char,
    /// A text.
    name: String,
}

#[test]
fn a_switch_and_a_vector_are_edited() {
    let (mut screen, mut value) = (Screen::new(), Others::default());
    assert!(play(&mut screen, &mut value, [vec![], press(Key::Tab), vec![], press(Key::Space), vec![]]));
    assert_eq!(value, Others { on: true, ..Others::default() });
    play(&mut screen, &mut value, [press(Key::Tab), vec![], press(Key::Tab), vec![], vec![]]);
    assert!(play(&mut screen, &mut value, [vec![Event::Text("-12.5".to_owned())], press(Key::Enter), vec![]]));
    assert_eq!(value, Others { on: true, at: DVec3::new(0.0, -10.0, 0.0), ..Others::default() });
}

#[test]
fn a_field_of_another_type_is_named_not_hidden() {
    let mut value = Others::default();
    let texts = Screen::new().frame(vec![], |ui| _ = struct_ui(ui, value.as_partial_reflect_mut()));
    find(&texts, "letter");
    find(&texts, "set in code");
}

#[test]
fn a_text_is_taken_when_it_is_entered() {
    let (mut screen, mut value) = (Screen::new(), Others::default());
    for _ in 0..5 {
        play(&mut screen, &mut value, [vec![], press(Key::Tab), vec![]]);
    }
    let typed = |text: &str| vec![Event::Text(text.to_owned())];
    assert!(!play(&mut screen, &mut value, [typed("low "), vec![], typed("deck"), vec![]]), "taken while it was typed");
    assert!(play(&mut screen, &mut value, [press(Key::Enter), vec![]]));
    assert_eq!(value, Others { name: "low deck".to_owned(), ..Others::default() });
    assert!(!play(&mut screen, &mut value, [vec![], vec![]]));
}

#[derive(Reflect, Default, PartialEq, Debug, Clone)]
struct Outer {
    /// A struct in it.
    inner: Others,
    /// An image.
    image: Option<Handle<Image>>,
}

#[test]
fn a_struct_within_is_opened_and_edited_and_an_image_cleared() {
    let mut value = Outer { image: Some(Handle::default()), ..Outer::default() };
    let mut screen = Screen::new();
    let draw = |screen: &mut Screen, value: &mut Outer, events| {
        let mut changed = false;
        let texts = screen.frame(events, |ui| changed |= struct_ui(ui, value.as_partial_reflect_mut()));
        (changed, texts)
    };
    let (_, texts) = draw(&mut screen, &mut value, vec![]);
    assert!(!texts.iter().any(|(text, _)| text == "letter"), "it is open");
    // The label of the row is the first of this name, the section the second.
    let section = texts.iter().rfind(|(text, _)| text == "inner").expect("a section").1;
    for events in click(section).into_iter().chain(vec![vec![]; 8]) {
        assert!(!draw(&mut screen, &mut value, events).0);
    }
    let (_, texts) = draw(&mut screen, &mut value, vec![]);
    find(&texts, "letter");
    let clear = find(&texts, "Clear");
    assert!(click(clear).into_iter().fold(false, |changed, events| changed | draw(&mut screen, &mut value, events).0));
    assert_eq!(value, Outer::default());
}

#[test]
fn wide_ranges_are_logarithmic() {
    for (range, expected) in [
        (0.0..=1.0, false),
        (0.5..=5000.0, true),
        (1.0..=1000.0, false),
        (-400.0..=30_000.0, false),
        (-1.0e4..=1.0e4, true),
    ] {
        assert_eq!(is_logarithmic(&range), expected, "{range:?}");
    }
}

#[test]
fn documentation_becomes_plain_text() {
    let docs = " How noise erodes\n the `profile`. Default [`Erosion::Remap`], see [`check`](super::check) [0, 1].";
    assert_eq!(plain_docs(Some(docs)), "How noise erodes the profile. Default Erosion::Remap, see check [0, 1].");
    assert_eq!(plain_docs(None), "");
    assert_eq!(plain_docs(Some("open [`end")), "open [end");
}

#[test]
fn every_setting_has_a_tooltip() {
    let settings = crate::CloudSettings::default();
    let layer = crate::CloudLayer::default();
    let all: [&dyn PartialReflect; 7] = [
        &settings.model,
        &settings.lighting,
        &settings.quality,
        &settings.textures,
        &settings.clock,
        &layer,
        &layer.map,
    ];
    for value in all {
        for field in declared(value) {
            assert!(plain_docs(field.docs()).len() > 5, "{} has no documentation", field.name());
        }
    }
}
