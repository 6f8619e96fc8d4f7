//! The presets of commit eba2f38, which are kept for measuring alone (`scripts/report baseline` and `frozen`): all are there in
//! the old form, which never changes, and in today's, which must be read without a complaint.

use std::{fs, path::PathBuf};

use bevy_cumulus::prelude::*;

/// Of names and contents of the old form.
const HASH: u64 = 0xf6b5_3636_c003_aff0;

fn folder(form: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scripts/measure/frozen").join(form)
}

/// Names of the files in a folder, sorted.
fn names(form: &str) -> Vec<String> {
    let files = fs::read_dir(folder(form)).expect("the folder is there");
    let mut names: Vec<String> =
        files.map(|file| file.expect("it can be read").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn every_frozen_preset_is_read_in_todays_form() {
    let names = names("current");
    assert_eq!(names.len(), 23, "{names:?}");
    for name in names {
        let preset =
            CloudPreset::read(&folder("current").join(&name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        preset.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(preset != CloudPreset::default(), "{name} says nothing");
    }
}

#[test]
fn the_old_form_is_never_edited() {
    let names = names("eba2f38");
    assert_eq!(names, self::names("current"));
    // FNV-1a of names and contents.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for name in names {
        let text = fs::read(folder("eba2f38").join(&name)).expect("it can be read");
        for byte in name.bytes().chain(text) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
    assert_eq!(hash, HASH, "a preset of eba2f38 is not as it was there");
}
