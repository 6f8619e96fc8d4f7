//! The reference pictures: made once, then kept until something that they depend on changes.

use std::{
    collections::hash_map::DefaultHasher,
    fs,
    hash::{Hash as _, Hasher as _},
    path::{Path, PathBuf},
};

use anyhow::{Context as _, Result, anyhow, ensure};
use serde_json::Value;

use crate::{
    engine::{Engine, Job},
    machine::Machine,
    metrics::Truth,
    picture::Picture,
    progress::Progress,
    taken::Taken,
};

/// Sources that the path-traced picture follows from. What only the march reads is left out, so that tuning it keeps
/// the references.
const SOURCES: [&str; 16] = [
    "src/model",
    "src/textures",
    "src/weather",
    "src/render/sky",
    "src/render/frame.rs",
    "src/render/frame.wesl",
    "src/render/phase_slots.rs",
    "src/phases",
    "src/reference/path_tracer",
    "src/reference/phase.rs",
    "src/reference/phase_table.rs",
    "src/reference/mie.rs",
    "src/reference/ice.rs",
    "src/render/march/phase.wesl",
    "src/render/march/table.wesl",
    "src/render/march/aerial.wesl",
];
/// What a stand-in follows from.
const ALL_SOURCES: [&str; 1] = ["src"];
/// Where the scenes are.
const SCENES: &str = "examples/common";

/// Settings of the lighting that only the march has.
const MARCH_ONLY: [&str; 10] = [
    "octaves",
    "attenuation",
    "contribution",
    "eccentricity",
    "diffusion",
    "diffusion_asymmetry",
    "phase_limit",
    "ambient_strength",
    "ambient_tint",
    "powder",
];

/// How references are made.
#[derive(Clone)]
pub struct Recipe {
    /// `reference`, or a preset in its stead.
    pub quality: String,
    /// Samples a pixel of both halves together.
    pub samples: u32,
    /// Options that make the samples of the first and of the second half differ.
    pub halves: [String; 2],
    pub repository: PathBuf,
    /// Where they are kept.
    pub cache: PathBuf,
    /// Make them anew.
    pub fresh: bool,
}

impl Recipe {
    pub fn is_stand_in(&self) -> bool {
        self.quality != "reference"
    }

    /// What a report says of a run with it.
    pub fn taken(&self, size: String, zoom: f64, machine: Machine, seconds: u64) -> Taken {
        let stand_in = self.is_stand_in().then(|| self.quality.clone());
        Taken { size, zoom, samples: self.samples, stand_in, machine, seconds }
    }

    /// The truth of a scene; `more` are further options, such as another cut-off distance.
    pub fn make(&self, engine: &Engine, scene: &str, size: &str, more: &str, progress: &Progress) -> Result<Truth> {
        let options = format!("--quality {} {more}", self.quality);
        let key = self.key(engine, scene, size, &options)?;
        let kept = self.cache.join(format!("{scene}-{size}-{}-{key:016x}", self.samples));
        let names = ["a", "b"];
        let have =
            names.iter().all(|name| ["png", "exr"].iter().all(|end| kept.join(name).with_extension(end).is_file()));
        if have && !self.fresh {
            progress.skip(names.len());
        } else {
            eprintln!("making {}", kept.display());
            self.render(engine, scene, size, &options, &kept, progress)?;
        }
        let [a, b] = names.map(|name| Picture::read(&kept.join(name)));
        if self.is_stand_in() { Truth::exact(a?) } else { Truth::of_halves(a?, b?) }
    }

    fn render(
        &self,
        engine: &Engine,
        scene: &str,
        size: &str,
        options: &str,
        kept: &Path,
        progress: &Progress,
    ) -> Result<()> {
        let frames = if self.is_stand_in() { engine.frames(options)? } else { self.samples.div_ceil(2) };
        let jobs: Vec<Job> = ["a", "b"]
            .into_iter()
            .zip(&self.halves)
            .map(|(name, half)| Job {
                name: format!("reference_{name}"),
                options: format!("{options} {half}"),
                frames,
                picture: true,
            })
            .collect();
        engine.render(scene, size, &jobs, progress)?;
        fs::create_dir_all(kept).with_context(|| format!("cannot make {}", kept.display()))?;
        for name in ["a", "b"] {
            for end in ["png", "exr", "json"] {
                let from = engine.folder(scene).join(format!("reference_{name}.{end}"));
                fs::copy(&from, kept.join(name).with_extension(end))
                    .with_context(|| format!("cannot keep {}", from.display()))?;
            }
        }
        Ok(())
    }

    /// A number that changes with everything the picture depends on.
    fn key(&self, engine: &Engine, scene: &str, size: &str, options: &str) -> Result<u64> {
        let mut settings =
            engine.effective(&format!("--scene {scene} --size {size} {options} {}", engine.view(scene)?))?;
        if !self.is_stand_in() {
            forget_march(&mut settings);
        }
        let mut hasher = DefaultHasher::new();
        (settings.to_string(), &self.quality, self.samples, &self.halves).hash(&mut hasher);
        let sources: &[&str] = if self.is_stand_in() { &ALL_SOURCES } else { &SOURCES };
        for source in sources.iter().chain([&SCENES]) {
            let path = self.repository.join(source);
            // One that was moved would no longer be hashed, and an old picture taken for the truth.
            ensure!(path.exists(), "there is no {}, which references follow from (truth.rs lists it)", path.display());
            hash_files(&path, &mut hasher)?;
        }
        Ok(hasher.finish())
    }
}

/// Takes out the settings that only the march reads.
fn forget_march(settings: &mut Value) {
    if let Some(lighting) = settings["lighting"].as_object_mut() {
        MARCH_ONLY.iter().for_each(|name| drop(lighting.remove(*name)));
    }
    if let Some(quality) = settings["quality"].as_object_mut() {
        quality.retain(|name, _| name == "max_distance" || name == "lod_bias");
    }
    if let Some(all) = settings.as_object_mut() {
        all.remove("frames");
    }
}

/// Hashes a file, or all files of a folder by name; where there is none, nothing.
fn hash_files(path: &Path, hasher: &mut DefaultHasher) -> Result<()> {
    if path.is_dir() {
        let entries = fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
        let mut paths: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
        paths.sort();
        paths.iter().try_for_each(|path| hash_files(path, hasher))
    } else if path.is_file() {
        let bytes = fs::read(path).map_err(|error| anyhow!("cannot read {}: {error}", path.display()))?;
        (path.file_name().map(|name| name.to_owned()), bytes).hash(hasher);
        Ok(())
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A file that is moved would no longer be hashed, and an old picture taken for the truth.
    #[test]
    fn every_source_is_there() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        for source in SOURCES.iter().chain(&ALL_SOURCES).chain([&SCENES]) {
            assert!(root.join(source).exists(), "{source}");
        }
    }

    #[test]
    fn tuning_the_march_keeps_the_key_and_the_sky_does_not() {
        let with = |octaves: u32, step: f64, g: f64| {
            let mut all = json!({ "lighting": { "octaves": octaves, "g": g },
                "quality": { "step": step, "max_distance": 9e4 }, "frames": 8 });
            forget_march(&mut all);
            all.to_string()
        };
        assert_eq!(with(8, 90.0, 0.8), with(4, 10.0, 0.8));
        assert_ne!(with(8, 90.0, 0.8), with(8, 90.0, 0.7));
    }
}
