use bevy::ecs::system::RunSystemOnce;
use bevy_egui::egui::{Event, Key, Pos2};

use super::{
    super::fields::tests::{Screen, click, find, press},
    *,
};

fn edit<R>(screen: &mut Screen, section: &mut Section<R>, now: &R, events: Vec<Event>, held: bool) -> (Option<R>, Texts)
where
    R: Resource<Mutability = Mutable> + Validate + Struct + Clone + PartialEq + Default,
{
    let mut good = None;
    let texts = screen.frame(events, |ui| {
        if let Some(value) = section.edit(ui, now, held) {
            good = Some(value);
        }
    });
    (good, texts)
}

type Texts = Vec<(String, Pos2)>;

/// Types a number into the box of the model's first number, which stands behind a switch, and returns what became of it.
fn type_first<R>(screen: &mut Screen, section: &mut Section<R>, now: &R, number: &str) -> (Option<R>, Texts)
where
    R: Resource<Mutability = Mutable> + Validate + Struct + Clone + PartialEq + Default,
{
    let tabs = [vec![], press(Key::Tab), vec![], press(Key::Tab), vec![], press(Key::Tab), vec![], vec![]];
    for events in tabs {
        edit(screen, section, now, events, false);
    }
    edit(screen, section, now, vec![Event::Text(number.to_owned())], false);
    edit(screen, section, now, press(Key::Enter), false)
}

fn says(texts: &Texts, part: &str) -> bool {
    texts.iter().any(|(text, _)| text.contains(part))
}

#[test]
fn a_good_edit_is_returned_once() {
    let (mut screen, mut section, now) = (Screen::new(), Section::default(), CloudModel::default());
    let (good, _) = type_first(&mut screen, &mut section, &now, "900");
    let good = good.expect("the edit");
    assert_eq!(good, CloudModel { bottom: 900.0, ..now });
    assert_eq!(edit(&mut screen, &mut section, &good, vec![], false).0, None);
}

#[test]
fn a_bad_edit_is_explained_and_kept_back() {
    let (mut screen, mut section, now) = (Screen::new(), Section::default(), CloudModel::default());
    let (good, _) = type_first(&mut screen, &mut section, &now, "9000");
    assert_eq!(good, None);
    let (good, texts) = edit(&mut screen, &mut section, &now, vec![], false);
    assert_eq!(good, None);
    assert!(says(&texts, "model.top = 3300 must be above model.bottom = 9000"), "{texts:?}");
    // Another change to the resource has the last word.
    let now = CloudModel { coverage: 0.3, ..now };
    edit(&mut screen, &mut section, &now, vec![], false);
    let (good, texts) = edit(&mut screen, &mut section, &now, vec![], false);
    assert_eq!(good, None);
    assert!(!says(&texts, "must be above"), "{texts:?}");
}

#[test]
fn a_held_edit_is_returned_when_let_go() {
    let (mut screen, mut section, now) = (Screen::new(), Section::default(), CloudQuality::default());
    // The first two fields are choices; the third a slider.
    for events in [vec![], press(Key::Tab), vec![], press(Key::Tab), vec![], press(Key::Tab), vec![]] {
        assert_eq!(edit(&mut screen, &mut section, &now, events, true).0, None);
    }
    assert_eq!(edit(&mut screen, &mut section, &now, press(Key::ArrowRight), true).0, None);
    assert_eq!(edit(&mut screen, &mut section, &now, vec![], true).0, None);
    let good = edit(&mut screen, &mut section, &now, vec![], false).0.expect("the held edit");
    assert!(good.step > now.step);
    assert_eq!(CloudQuality { step: now.step, ..good }, now);
}

#[test]
fn reset_returns_the_defaults() {
    let (mut screen, mut section) = (Screen::new(), Section::default());
    let now = CloudLighting { octaves: 2, powder: 0.7, ..CloudLighting::default() };
    let (_, texts) = edit(&mut screen, &mut section, &now, vec![], false);
    let [.., last] = click(find(&texts, "Reset")).map(|events| edit(&mut screen, &mut section, &now, events, false).0);
    assert_eq!(last, Some(CloudLighting::default()));
}

#[test]
fn sizes_settle_on_powers_of_two() {
    for (set, settled) in [(100, 128), (33, 32), (181, 128), (182, 256), (256, 256)] {
        let mut textures = CloudTextures { volume_size: set, map_size: 1000, ..CloudTextures::default() };
        assert_eq!(settle(&mut textures), Ok(()));
        assert_eq!((textures.volume_size, textures.map_size), (settled, 1024), "{set}");
    }
    let mut model = CloudModel { top: 0.0, ..CloudModel::default() };
    assert!(matches!(settle(&mut model), Err(SettingsError::InvertedAltitudes { .. })));
    assert_eq!(model.top, 0.0);
}

#[derive(Resource)]
struct Shows(Screen, Section<CloudModel>);

/// Draws the section in a system; whether that counts as a change of the resource.
fn changes(world: &mut World, events: Vec<Event>) -> bool {
    fn draw(events: In<Vec<Event>>, mut shows: ResMut<Shows>, mut model: Option<ResMut<CloudModel>>) {
        let Shows(screen, section) = &mut *shows;
        screen.frame(events.0, |ui| section.ui(ui, model.as_mut(), When::AtOnce));
    }
    world.clear_trackers();
    world.run_system_once_with(draw, events).expect("a system");
    world.is_resource_changed::<CloudModel>()
}

#[test]
fn looking_at_a_setting_does_not_change_it() {
    let mut world = World::new();
    world.init_resource::<CloudModel>();
    world.insert_resource(Shows(Screen::new(), Section::default()));
    let over = vec![Event::PointerMoved(Pos2::new(300.0, 60.0))];
    for events in [vec![], press(Key::Tab), vec![], press(Key::Tab), vec![], over, vec![]] {
        assert!(!changes(&mut world, events));
    }
    assert!(changes(&mut world, press(Key::ArrowRight)));
    assert!(world.resource::<CloudModel>().bottom > 1300.0);
    assert!(!changes(&mut world, vec![]));
}

#[test]
fn quality_names_are_known() {
    assert!(QUALITIES.iter().all(|name| CloudQuality::named(name).is_some()));
}

#[test]
fn a_debug_view_is_chosen_from_its_box() {
    let (mut screen, mut now) = (Screen::new(), CloudDebugView::None);
    let mut changed = 0;
    let mut draw = |screen: &mut Screen, events| {
        screen.frame(events, |ui| {
            if let Some(chosen) = choose_debug_view(ui, now) {
                now = chosen;
                changed += 1;
            }
        })
    };
    let mut texts = draw(&mut screen, vec![]);
    for choice in ["none", "type map"] {
        // The list takes a frame to be measured and one to be drawn.
        for events in click(find(&texts, choice)).into_iter().chain([vec![], vec![]]) {
            texts = draw(&mut screen, events);
        }
    }
    assert_eq!((now, changed), (CloudDebugView::TypeMap, 1));
}
