//! What is rendered of each scene by the code of commit eba2f38, and by today's: the one place to change where scenes,
//! presets or settings are renamed, and then only the column `new`.

/// A scene as options of `headless`, once for each of the two programs. `PRESETS` stands for the folder of frozen presets in
/// that program's form.
pub struct Scene {
    pub name: &'static str,
    pub old: &'static str,
    pub new: &'static str,
}

const fn scene(name: &'static str, old: &'static str, new: &'static str) -> Scene {
    Scene { name, old, new }
}

pub const SCENES: [Scene; 9] = [
    scene("ground_noon", "--scene ground_noon", "--scene ground_noon --preset PRESETS/fair_weather.clouds.ron"),
    scene(
        "ground_backlit",
        "--scene ground_backlit",
        "--scene ground_backlit --preset PRESETS/fair_weather.clouds.ron",
    ),
    scene("overcast", "--scene overcast", "--scene overcast --preset PRESETS/overcast.clouds.ron"),
    scene("sunset", "--scene sunset", "--scene sunset --preset PRESETS/sunset.clouds.ron"),
    scene("hills", "--scene hills", "--scene hills --preset PRESETS/fair_weather.clouds.ron"),
    scene("inside", "--scene inside", "--scene inside --preset PRESETS/fair_weather.clouds.ron"),
    scene("above", "--scene above", "--scene above --preset PRESETS/fair_weather.clouds.ron"),
    scene(
        "broken",
        "--preset PRESETS/broken.clouds.ron --camera 0,2,0,0,16 --sun 50,130",
        "--scene broken --preset PRESETS/broken.clouds.ron",
    ),
    scene(
        "storm",
        "--preset PRESETS/storm.clouds.ron --camera 0,2,0,0,14 --sun 35,60",
        "--scene storm --preset PRESETS/storm.clouds.ron",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn names_are_told_apart_and_presets_are_there() {
        let mut names: Vec<&str> = SCENES.iter().map(|scene| scene.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SCENES.len());
        let frozen = Path::new(env!("CARGO_MANIFEST_DIR")).join("frozen");
        for scene in &SCENES {
            for (folder, options) in [("eba2f38", scene.old), ("current", scene.new)] {
                for word in options.split_whitespace().filter_map(|word| word.strip_prefix("PRESETS/")) {
                    assert!(frozen.join(folder).join(word).is_file(), "{}: there is no {folder}/{word}", scene.name);
                }
            }
        }
    }
}
