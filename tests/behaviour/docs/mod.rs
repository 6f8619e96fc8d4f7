//! What README, docs/ and examples say: it compiles, and leads somewhere.

mod pages;
mod settings_reference;
mod shaders;

use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files below these files and folders that end so, with their text.
fn texts(places: &[&str], endings: &[&str]) -> Vec<(PathBuf, String)> {
    fn add(place: &Path, endings: &[&str], found: &mut Vec<(PathBuf, String)>) {
        if place.is_dir() {
            let entries = std::fs::read_dir(place).expect("the folder can be read");
            let mut entries: Vec<_> = entries.map(|entry| entry.expect("it can be read").path()).collect();
            entries.sort();
            entries.iter().for_each(|entry| add(entry, endings, found));
        } else if place.extension().is_some_and(|end| endings.iter().any(|known| *known == end)) {
            let text = std::fs::read_to_string(place).unwrap_or_else(|error| panic!("{}: {error}", place.display()));
            found.push((place.to_owned(), text));
        }
    }
    let mut found = Vec::new();
    for place in places {
        let before = found.len();
        add(&root().join(place), endings, &mut found);
        assert!(found.len() > before, "there is nothing at {place}");
    }
    found
}
