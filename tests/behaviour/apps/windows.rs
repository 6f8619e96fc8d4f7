//! The windowed examples, driven as a hand drives them: a real window on a virtual X server, keys, a dragged slider.
//!
//! What must come is waited for. There is no window manager, so that a window lies where the test says, at 0, 0; but for
//! the test of what a window manager does.

mod screen;

use std::{
    fs,
    process::Command,
    thread::sleep,
    time::{Duration, Instant},
};

use bevy_cumulus::settings::CloudPreset;

use crate::support::{gpu::needs_atmosphere, program::Folder};
use screen::{PATIENCE, Part, Picture, SCREEN, Screen, binary, wait};

// Where things are in a window of 640 by 270, or twice as high.
/// Above the haze, which is grey as clouds are.
const SKY: Part = [0, 0, 230, 120];
const HELP: Part = [10, 10, 230, 190];
const PANEL: Part = [250, 170, 610, 260];
const FILE: [usize; 2] = [350, 197];
const LOAD: [usize; 2] = [461, 197];
const SAVE: [usize; 2] = [504, 197];
/// On the slider's rail, whose right end is full cover, once a line below the text box says what was saved. In the
/// higher window.
const COVERAGE: [usize; 2] = [428, 342];

/// Flies over flat ground, with textures that are baked in no time.
const QUICK: [&str; 9] = [
    "--bare",
    "--scene",
    "ground_noon",
    "--quality",
    "low",
    "--set",
    "textures.volume_size=32",
    "--set",
    "textures.map_size=128",
];

/// In the picture that it returns are clouds.
fn fly(more: &[&str]) -> (Screen, Picture) {
    fly_at("640x270", more)
}

fn fly_at(size: &str, more: &[&str]) -> (Screen, Picture) {
    let mut screen = Screen::show("fly_camera", "bevy_cumulus", &[&QUICK[..], &["--size", size], more].concat());
    // The pointer rests where it touches nothing.
    screen.act(&["mousemove", "100", "250"]);
    let clouds = screen.wait_for("clouds", |now| (0.05..0.9).contains(&now.grey(SKY)));
    (screen, clouds)
}

#[test]
fn keys_change_the_sky() {
    needs_atmosphere();
    let (mut screen, day) = fly(&["--sun", "15,90", "--set", "model.coverage=-0.1"]);
    let clouds = day.grey(SKY);
    screen.hold_until(&["c"], "C to bring cloud", |now| now.grey(SKY) > clouds + 0.15);
    screen.hold_until(&["shift", "c"], "Shift C to take it away", |now| now.grey(SKY) < clouds);

    let day = screen.picture().brightness(SKY);
    screen.hold_until(&["shift", "t"], "Shift T to bring the night", |now| now.brightness(SKY) < 0.6 * day);
    screen.hold_until(&["t"], "T to bring the day", |now| now.brightness(SKY) > 0.9 * day);

    let plain = screen.picture().brightness(HELP);
    screen.act(&["key", "h"]);
    screen.wait_for("H to show the help", |now| now.brightness(HELP) < plain - 20.0);
    screen.act(&["key", "h"]);
    screen.wait_for("H to hide it", |now| now.brightness(HELP) > plain - 10.0);

    let before = screen.picture();
    screen.hold_until(&["d"], "D to fly", |now| now.differs(&before, SKY) > 8.0);
    let before = screen.picture();
    screen.press("p", SKY);
    screen.wait_for("P to bring another preset", |now| now.differs(&before, SKY) > 8.0);
}

#[test]
fn p_goes_on_through_skies_that_differ_in_layers_alone() {
    needs_atmosphere();
    let (mut screen, _) = fly(&["--preset", "Cumulus", "--set", "clock.speed=0"]);
    for _ in 0..2 {
        let before = screen.picture();
        screen.act(&["key", "p"]);
        screen.wait_for("P to bring another sky", |now| now.differs(&before, SKY) > 8.0);
    }
}

/// Waits until this part stays as it is: an animation has ended. For longer than a slow frame takes.
fn still(screen: &mut Screen, part: Part) {
    let (mut last, mut times) = (screen.picture(), 0);
    screen.wait_for(&format!("{part:?} to stay as it is"), |now| {
        sleep(Duration::from_millis(300));
        times = if now.differs(&last, part) == 0.0 { times + 1 } else { 0 };
        last = now.clone();
        times == 6
    });
}

/// Whether the triangle before a group's title points down, which is heavier above its middle; one that points right
/// is as heavy below.
fn unfolded(now: &Picture, [x, y]: [usize; 2]) -> bool {
    let [above, below] = [[x - 25, y - 7, x - 11, y], [x - 25, y, x - 11, y + 7]].map(|half| now.brightness(half));
    above > 1.2 * below
}

/// Clicks on a group's title until it is folded, or unfolded. A click that came late, or while titles still moved, is
/// made good by the next.
fn fold(screen: &mut Screen, title: [usize; 2], folded: bool) {
    // Titles move while another group folds, and change when pointed at.
    screen.act(&["mousemove", &title[0].to_string(), &title[1].to_string()]);
    still(screen, PANEL);
    let mut clicked = None::<Instant>;
    wait("a group to fold or unfold", PATIENCE, || {
        screen.check();
        if clicked.is_none_or(|last| last.elapsed() > Duration::from_secs(20)) {
            screen.click(title);
            clicked = Some(Instant::now());
        }
        (unfolded(&screen.picture(), title) != folded).then_some(())
    });
}

#[test]
fn keys_change_quality_and_clock_as_the_panel_shows() {
    needs_atmosphere();
    let (mut screen, _) = fly(&[]);
    screen.act(&["key", "i"]);
    screen.wait_for("I to open the panel", |now| now.brightness(PANEL) < 60.0);
    // Folded, each group's title is 21 pixels below the one before; between the second and the third is one more row.
    let [preset, modelling, sampling, clock] = [0, 1, 4, 5].map(|row| [275, 50 + 21 * row]);
    fold(&mut screen, preset, true);
    fold(&mut screen, modelling, true);
    fold(&mut screen, sampling, false);
    still(&mut screen, PANEL);
    for key in ["2", "3", "4", "1"] {
        screen.press(key, PANEL);
        still(&mut screen, PANEL);
    }
    fold(&mut screen, sampling, true);
    fold(&mut screen, clock, false);
    screen.act(&["mousemove", "100", "250"]);
    // It shows the clock's seconds, which run.
    let before = screen.picture();
    screen.wait_for("the clock to run", |now| now.differs(&before, PANEL) > 0.0);
    screen.act(&["key", "space"]);
    still(&mut screen, PANEL);
    screen.press("n", PANEL);
    still(&mut screen, PANEL);
    screen.act(&["key", "i"]);
    screen.wait_for("I to close the panel", |now| now.brightness(PANEL) > 60.0);
}

/// Puts a name into the panel's text box and presses a button, as often as it takes: what is typed before the box has
/// the keyboard is lost, and only a picture would tell.
fn with_file<T>(screen: &mut Screen, name: &str, button: [usize; 2], mut done: impl FnMut(&Screen) -> Option<T>) -> T {
    let mut tried = None::<Instant>;
    let what = format!("the panel to save or load {name}");
    wait(&what, PATIENCE, || {
        screen.check();
        if tried.is_none_or(|last| last.elapsed() > Duration::from_secs(5)) {
            screen.click(FILE);
            screen.act(&["sleep", "0.5", "key", "End"]);
            screen.act(&[&["key"], &["BackSpace"; 40][..]].concat());
            screen.act(&["type", name]);
            screen.act(&["sleep", "0.3"]);
            screen.click(button);
            tried = Some(Instant::now());
        }
        done(screen)
    })
}

/// Saves what the panel shows, through the panel.
fn save(screen: &mut Screen, name: &str) -> CloudPreset {
    with_file(screen, name, SAVE, |screen| CloudPreset::read(&screen.folder.join(name)).ok())
}

#[test]
fn a_dragged_slider_changes_the_clouds_and_a_saved_preset_loads_back() {
    needs_atmosphere();
    // Few, so that there is room for more: their shade counts as grey too.
    let (mut screen, _) = fly_at("640x540", &["--set", "model.coverage=-0.2"]);
    screen.act(&["key", "i"]);
    screen.wait_for("I to open the panel", |now| now.brightness(PANEL) < 60.0);
    let before = save(&mut screen, "before.clouds.ron");

    // Not of the first frames, which have less.
    let few = screen.picture().grey(SKY);
    let [x, y] = COVERAGE.map(|v| v.to_string());
    screen.act(&["mousemove", &x, &y, "sleep", "0.5", "mousedown", "1", "sleep", "0.5"]);
    screen.act(&["mousemove_relative", "15", "0", "sleep", "0.5", "mousemove_relative", "15", "0"]);
    screen.wait_for("the slider to bring cloud", |now| now.grey(SKY) > few + 0.15);
    // In one frame with the release, the next move would still drag.
    screen.act(&["mouseup", "1", "sleep", "0.7"]);
    let after = save(&mut screen, "after.clouds.ron");
    assert!(after.model.coverage > before.model.coverage + 0.3, "coverage {}", after.model.coverage);
    let mut only = after.clone();
    only.model.coverage = before.model.coverage;
    assert_eq!(only, before, "the slider changes coverage and nothing else");

    with_file(&mut screen, "before.clouds.ron", LOAD, |screen| (screen.picture().grey(SKY) < few + 0.1).then_some(()));
    assert_eq!(save(&mut screen, "again.clouds.ron"), before, "what was saved loads back identical");
}

#[test]
fn a_preset_file_is_read_again_when_it_is_saved() {
    needs_atmosphere();
    let folder = Folder::new();
    let file = folder.join("sky.ron");
    let write = |coverage: &str| {
        let small = "textures: (volume_size: 32, map_size: 128)";
        fs::write(&file, format!("(\n  model: (coverage: {coverage}),\n  {small},\n)")).expect("written");
    };
    write("0.0");
    let (mut screen, clouds) = fly(&["--preset", &file.display().to_string()]);
    let few = clouds.grey(SKY);
    write("0.5");
    screen.wait_for("the file to bring cloud", |now| now.grey(SKY) > few + 0.15);
    write("7");
    let wrong = format!("{}:2:11: model.coverage = 7 is outside its range -1 to 1", file.display());
    let log = screen.folder.join("program.log");
    wait("an error", PATIENCE, || fs::read_to_string(&log).ok().filter(|log| log.contains(&wrong)));
    assert!(screen.picture().grey(SKY) > few + 0.15, "the last good sky is gone");
    write("0.0");
    wait("the good file", PATIENCE, || (screen.picture().grey(SKY) < few + 0.1).then_some(()));
    let log = fs::read_to_string(&log).expect("the program has a log");
    assert_eq!(log.matches("ERROR").count(), 1, "{log}");
}

#[test]
fn a_window_may_be_small_large_hidden_and_shown() {
    needs_atmosphere();
    let (mut screen, _) = fly(&[]);
    let window = screen.window.clone();
    for [width, height] in [[64, 40], [1, 1], [7, 300], [900, 90], [640, 270]] {
        screen.act(&["windowsize", &window, &width.to_string(), &height.to_string()]);
        // Drawn to its last corner, and nothing beyond.
        let corner = [(width - 1) / 2, 0, width, height.min(20)];
        let beyond = [width.max(900), 300, SCREEN[0], SCREEN[1]];
        screen.wait_for(&format!("a picture of {width} by {height}"), |now| {
            now.brightness(corner) > 20.0 && now.brightness(beyond) == 0.0
        });
    }
    screen.act(&["windowunmap", &window]);
    screen.wait_for("the window to go", |now| now.brightness(SKY) == 0.0);
    screen.act(&["windowmap", &window]);
    screen.wait_for("it to come back", |now| now.brightness(SKY) > 20.0);
}

#[test]
fn minimal_shows_a_sky() {
    needs_atmosphere();
    let mut screen = Screen::show("minimal", ".", &[]);
    let above = [0, 0, SCREEN[0], 200];
    screen.wait_for("a sky with clouds", |now| now.brightness(above) > 20.0 && (0.02..0.95).contains(&now.grey(above)));
}

#[test]
fn a_window_manager_enlarges_hides_and_closes_it() {
    needs_atmosphere();
    let mut screen = Screen::show_managed("fly_camera", "bevy_cumulus", &[&QUICK[..], &["--size", "640x270"]].concat());
    screen.wait_for("clouds", |now| (0.05..0.9).contains(&now.grey(SKY)));
    // The desktop is all grey; a window that reaches here shows blue sky.
    let beyond = [660, 30, SCREEN[0] - 10, 150];
    let large = |now: &Picture| now.grey(beyond) < 0.9;
    let small = |now: &Picture| now.grey(beyond) > 0.99 && now.grey(SKY) < 0.9;
    screen.wait_for("the desktop", small);
    screen.act(&["key", "f"]);
    screen.wait_for("F to fill the screen", large);
    screen.act(&["key", "f"]);
    screen.wait_for("F to leave it", small);
    screen.ask(&["-r", ":ACTIVE:", "-b", "add,maximized_vert,maximized_horz"]);
    screen.wait_for("the window to be maximised", large);
    screen.ask(&["-r", ":ACTIVE:", "-b", "remove,maximized_vert,maximized_horz"]);
    screen.wait_for("the window to be as it was", small);
    let window = screen.window.clone();
    screen.act(&["windowminimize", &window]);
    screen.wait_for("the window to go", |now| now.grey(SKY) > 0.99);
    screen.ask(&["-i", "-a", &window]);
    screen.wait_for("the window to come back", small);
    screen.ask(&["-i", "-c", &window]);
    assert!(screen.end().success(), "closing the window is no failure");
}

#[test]
fn without_a_display_it_says_so() {
    for (display, says) in [("", "there is no display"), (":nonsense", "DISPLAY=:nonsense"), (":999", "DISPLAY=:999")] {
        let output = Command::new(binary("fly_camera")).env("DISPLAY", display).output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{display:?}: {said}");
        assert!(said.starts_with("error: ") && said.contains(says) && said.lines().count() == 1, "{display:?}: {said}");
    }
}

#[test]
fn the_settings_show_in_another_inspector() {
    needs_atmosphere();
    let mut screen = Screen::show("resource_inspector", "bevy_cumulus", &[]);
    // Its first window, with the model, is as dark as the sky is bright. Its fourth row is the coverage.
    let (window, sky, coverage) = ([20, 50, 280, 290], [320, 10, 900, 200], [132, 121]);
    let start = screen.wait_for("a window under a sky with clouds", |now| {
        now.brightness(window) < 60.0 && now.brightness(sky) > 60.0 && (0.02..0.8).contains(&now.grey(sky))
    });
    let few = start.grey(sky);
    let [x, y] = coverage.map(|v| v.to_string());
    screen.act(&["mousemove", &x, &y, "sleep", "2", "mousedown", "1", "sleep", "2"]);
    // A tenth for each pixel, and not past the range's end, which would be an error in the log.
    let mut moved = 0;
    wait("more coverage to bring more cloud", PATIENCE, || {
        screen.check();
        if moved < 8 {
            screen.act(&["mousemove_relative", "1", "0", "sleep", "2"]);
            moved += 1;
        }
        (screen.picture().grey(sky) > few + 0.15).then_some(())
    });
    screen.act(&["mouseup", "1"]);
}
