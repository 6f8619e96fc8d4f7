//! Pictures as they were when last approved.
//!
//! Each is made by the headless example and compared with `tests/goldens/NAME.png`. After a change of the look that is
//! meant, `CUMULUS_BLESS=1 cargo test --test behaviour goldens` writes them anew: look at each before it is committed.

use std::{collections::BTreeMap, fs, path::PathBuf, sync::LazyLock};

use image::RgbImage;

use crate::support::{
    golden::{compare, compare_with_golden, failures, folder, is_alike, read},
    gpu::needs_atmosphere,
    program::command,
};

/// What every picture has in common: small, and made from small textures.
#[rustfmt::skip]
const SMALL: [&str; 10] = [
    "--size", "128x72", "--frames", "4", "--quality", "medium",
    "--set", "textures.volume_size=32", "--set", "textures.map_size=128",
];

/// Where the picture of this name is made.
fn made(name: &str) -> PathBuf {
    failures().join(format!("{name}.png"))
}

/// Renders the pictures of these names and options, which share what a batch of the headless example must share.
fn render(group: &str, pictures: &[(&str, &str)]) -> Result<(), String> {
    let line = |(name, options): &(&str, &str)| format!("{options} --out {}\n", made(name).display());
    let batch = failures().join(format!("{group}.batch"));
    fs::write(&batch, pictures.iter().map(line).collect::<String>()).map_err(|error| error.to_string())?;
    let output = command().args(SMALL).arg("--batch").arg(&batch).output().map_err(|error| error.to_string())?;
    let said = String::from_utf8_lossy(&output.stderr);
    output.status.success().then_some(()).ok_or_else(|| format!("{group} failed: {said}"))
}

type Batch = LazyLock<Result<(), String>>;

fn check(batch: &Batch, name: &str) {
    batch.as_ref().unwrap_or_else(|error| panic!("{error}"));
    let made = made(name);
    let actual = read(&made).unwrap_or_else(|error| panic!("{}: {error}", made.display()));
    compare_with_golden(name, &actual, &made).unwrap_or_else(|differs| panic!("{differs}"));
}

/// A test for each picture, and for the whole: groups of pictures that one run of the example makes.
macro_rules! goldens {
    ($($batch:ident { $($name:ident: $options:expr;)* })*) => {
        $(static $batch: Batch = LazyLock::new(|| {
            needs_atmosphere();
            render(stringify!($batch), &[$((stringify!($name), $options)),*])
        });

        $(#[test]
        fn $name() {
            check(&$batch, stringify!($name));
        })*)*

        #[test]
        fn no_golden_is_left_over() {
            let known = [$($(stringify!($name)),*),*];
            for entry in fs::read_dir(folder()).expect("the goldens are there") {
                let path = entry.expect("the folder can be read").path();
                if path.is_dir() {
                    // Those of the presets, which have a test of their own.
                    continue;
                }
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                assert!(known.contains(&name.as_str()), "{} belongs to no test", path.display());
            }
        }
    };
}

goldens! {
    PLAIN_GROUND {
        ground_noon: "--scene ground_noon";
        ground_backlit: "--scene ground_backlit";
        overcast: "--scene overcast";
        sunset: "--scene sunset";
        inside: "--scene ground_noon --camera 0,2100,0,40,4";
        above: "--scene ground_noon --camera 0,7000,0,0,-22";
        between: "--scene between";
        orbit: "--scene orbit";
        limb: "--scene limb";
    }
    WITHOUT_SKY {
        ground_without_sky: "--scene ground_noon --no-sky";
        above_without_sky: "--scene sunset --camera 0,6000,0,90,-18 --no-sky";
    }
    HILLS {
        hills: "--scene hills";
        hills_in_cloud: "--scene hills_in_cloud";
    }
    SPLIT {
        split_screen: "--scene split_screen";
    }
}

#[test]
fn a_small_change_of_the_look_is_seen() {
    let changes = [("as_it_is", ""), ("denser", "--set model.density=1.3"), ("more", "--set model.coverage=0.05")];
    let lines = changes.map(|(name, change)| (name, format!("--scene ground_noon --no-sky {change}")));
    let lines: Vec<(&str, &str)> = lines.iter().map(|(name, options)| (*name, options.as_str())).collect();
    render("changes", &lines).unwrap_or_else(|error| panic!("{error}"));
    let pictures: BTreeMap<&str, RgbImage> =
        changes.map(|(name, _)| (name, read(&made(name)).expect("it was written"))).into();
    let golden = &pictures["as_it_is"];
    assert_eq!(compare(golden, golden), Some((1.0, 0.0)));
    for (name, change) in &changes[1..] {
        let alike = compare(golden, &pictures[name]).expect("both have the same size");
        assert!(!is_alike(alike), "{change} passes for the same: {alike:?}");
    }
}
