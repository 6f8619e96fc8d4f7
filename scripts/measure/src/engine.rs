//! Drives the `headless` example: many pictures in one process, so that textures are baked once.

use std::{
    collections::hash_map::DefaultHasher,
    fs::{self, File},
    hash::{Hash as _, Hasher as _},
    io::{BufRead as _, BufReader, Write as _},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    slice,
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context as _, Error, Result, anyhow, bail, ensure};
use serde_json::Value;

use crate::{picture::Picture, progress::Progress};

/// Passes whose time is the clouds' cost. Writing `CloudBuffer` is not one: only measuring asks for it.
pub const PASSES: [&str; 4] = ["cloud_sky", "cloud_march", "cloud_accumulate", "cloud_composite"];

/// Where the renderer is, and where its files go.
pub struct Engine {
    pub headless: PathBuf,
    /// The folder whose `assets` it reads, if not the one that the environment names.
    pub assets: Option<PathBuf>,
    pub out: PathBuf,
    /// The scenes' fields of view are divided by this.
    pub zoom: f64,
    /// When to stop, to go on another time.
    pub deadline: Option<Instant>,
}

/// One picture to be made.
#[derive(Clone, Debug)]
pub struct Job {
    /// Name of its files, without ending.
    pub name: String,
    /// Options of `headless`.
    pub options: String,
    pub frames: u32,
    /// Whether the picture is wanted, or only what it took.
    pub picture: bool,
}

/// GPU time of a job (ms a frame).
#[derive(Clone, Debug, Default)]
pub struct Cost {
    /// Each pass of `PASSES`: median of the frames, or the least where [`is_software`]; empty where the device has no
    /// timestamps.
    pub passes: Vec<(&'static str, f64)>,
    pub adapter: String,
}

impl Cost {
    /// Of all passes.
    pub fn total(&self) -> Option<f64> {
        (!self.passes.is_empty()).then(|| self.passes.iter().map(|(_, ms)| ms).sum())
    }

    /// Of the march alone.
    pub fn march(&self) -> Option<f64> {
        self.passes.iter().find(|(name, _)| *name == "cloud_march").map(|(_, ms)| *ms)
    }
}

impl Engine {
    fn command(&self, headless: &Path) -> Command {
        let mut command = Command::new(headless);
        if let Some(assets) = &self.assets {
            command.env("BEVY_ASSET_ROOT", assets);
        }
        command
    }

    /// Every setting that these options amount to, without rendering.
    pub fn effective(&self, options: &str) -> Result<Value> {
        let output = self
            .command(&self.headless)
            .arg("--effective")
            .args(options.split_whitespace())
            .output()
            .with_context(|| format!("cannot start {}", self.headless.display()))?;
        ensure!(output.status.success(), "headless {options}: {}", String::from_utf8_lossy(&output.stderr).trim());
        serde_json::from_slice(&output.stdout).context("headless --effective")
    }

    /// Options for the middle of a scene's view, as large as the zoom says; none without zoom.
    pub fn view(&self, scene: &str) -> Result<String> {
        if self.zoom == 1.0 {
            return Ok(String::new());
        }
        let camera = &self.effective(&format!("--scene {scene}"))?["camera"];
        let number = |value: &Value| value.as_f64().with_context(|| format!("headless --effective: camera {camera}"));
        let [x, y, z] = [0, 1, 2].map(|i| number(&camera["position"][i]));
        let (yaw, pitch, fov) = (number(&camera["yaw"])?, number(&camera["pitch"])?, number(&camera["fov"])?);
        // So much smaller that the middle pixels keep their shape: a picture plane is flat.
        let fov = 2.0 * ((fov.to_radians() / 2.0).tan() / self.zoom).atan().to_degrees();
        Ok(format!("--camera {},{},{},{yaw},{pitch},{fov}", x?, y?, z?))
    }

    /// Frames after which a picture with these options is finished: its window is full.
    pub fn frames(&self, options: &str) -> Result<u32> {
        Ok(finished_after(&self.effective(options)?["quality"]))
    }

    /// The folder of a scene's files.
    pub fn folder(&self, scene: &str) -> PathBuf {
        self.out.join(scene)
    }

    /// Renders jobs that share scene, size and textures, in this order; those that a run which was cut off has done are kept.
    pub fn render(&self, scene: &str, size: &str, jobs: &[Job], progress: &Progress) -> Result<()> {
        self.render_sharing("", scene, size, jobs, progress)
    }

    /// The same with options that all jobs share.
    pub fn render_sharing(
        &self,
        shared: &str,
        scene: &str,
        size: &str,
        jobs: &[Job],
        progress: &Progress,
    ) -> Result<()> {
        let options = format!("--scene {scene} --size {size} {} {shared}", self.view(scene)?);
        self.render_in(scene, &options, jobs, progress)
    }

    /// Renders jobs that have these options in common into a folder of this name.
    pub fn render_in(&self, name: &str, common: &str, jobs: &[Job], progress: &Progress) -> Result<()> {
        let folder = self.folder(name);
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let stamps: Vec<String> = jobs.iter().map(|job| self.stamp(job, common)).collect::<Result<_>>()?;
        let is_done = |(job, stamp): &(&Job, &String)| {
            fs::read_to_string(done_path(&folder, job)).is_ok_and(|found| found == **stamp)
        };
        let (done, left): (Vec<_>, Vec<_>) = jobs.iter().zip(&stamps).partition(is_done);
        progress.skip(done.len());
        if left.is_empty() {
            return Ok(());
        }
        let left_jobs: Vec<&Job> = left.iter().map(|(job, _)| *job).collect();
        let mut child = self.spawn(&folder, common, &left_jobs, false)?;
        // One line for each job that is done.
        let mut left = left.into_iter();
        self.each_line(&mut child, || {
            let Some((job, stamp)) = left.next() else { return Ok(()) };
            fs::write(done_path(&folder, job), stamp)
                .with_context(|| format!("cannot write to {}", folder.display()))?;
            progress.done(&format!("{name}: {}", job.name));
            Ok(())
        })?;
        if !child.wait().context("headless")?.success() { Err(failed(&folder)) } else { Ok(()) }
    }

    /// Starts a batch; a `paced` one begins each picture when a line comes in.
    fn spawn(&self, folder: &Path, common: &str, jobs: &[&Job], paced: bool) -> Result<Child> {
        let mut lines = String::new();
        for Job { name, options, frames, picture } in jobs {
            lines += &format!("{options} --frames {frames} --timings {name}.json");
            lines += &if *picture { format!(" --out {name}.png --cloud {name}.exr\n") } else { "\n".to_owned() };
        }
        let batch = folder.join("batch.txt");
        fs::write(&batch, lines).with_context(|| format!("cannot write {}", batch.display()))?;
        let log_path = folder.join("headless.log");
        let log = File::create(&log_path).with_context(|| format!("cannot write {}", log_path.display()))?;
        self.command(&fs::canonicalize(&self.headless)?)
            .current_dir(folder)
            .args(["--batch", "batch.txt"])
            .args(paced.then_some("--paced"))
            .args(common.split_whitespace())
            .stdin(if paced { Stdio::piped() } else { Stdio::null() })
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .with_context(|| format!("cannot start {}", self.headless.display()))
    }

    /// Whether an earlier run has done all of these jobs.
    pub fn is_done(&self, name: &str, common: &str, jobs: &[Job]) -> Result<bool> {
        let folder = self.folder(name);
        for job in jobs {
            let stamp = self.stamp(job, common)?;
            if !fs::read_to_string(done_path(&folder, job)).is_ok_and(|found| found == stamp) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Starts jobs of which each waits for its turn.
    pub fn start<'a>(&'a self, name: &str, common: &'a str, jobs: &'a [Job]) -> Result<Paced<'a>> {
        let folder = self.folder(name);
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let mut child = self.spawn(&folder, common, &jobs.iter().collect::<Vec<_>>(), true)?;
        let lines = lines_of(&mut child)?;
        Ok(Paced { engine: self, folder, common, left: jobs.iter(), child, lines })
    }

    /// Calls `take` at each line that the child prints; ends it where the time is up.
    fn each_line(&self, child: &mut Child, mut take: impl FnMut() -> Result<()>) -> Result<()> {
        let lines = lines_of(child)?;
        loop {
            match lines.recv_timeout(self.time_left()) {
                Ok(_) => take()?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
                Err(RecvTimeoutError::Timeout) => {
                    child.kill().and_then(|()| child.wait()).context("cannot end headless")?;
                    bail!("the time is up (--minutes); the same command goes on from here");
                }
            }
        }
    }

    fn time_left(&self) -> Duration {
        self.deadline.map_or(Duration::MAX, |end| end.saturating_duration_since(Instant::now()))
    }

    /// What a job's files follow from: they are those of another run only where all of it is the same.
    fn stamp(&self, job: &Job, common: &str) -> Result<String> {
        let built = fs::metadata(&self.headless)?;
        let mut hasher = DefaultHasher::new();
        (built.len(), built.modified().ok(), job.frames, job.picture).hash(&mut hasher);
        Ok(format!("{:016x} {common} {}", hasher.finish(), job.options))
    }

    /// The picture that a job made.
    pub fn picture(&self, scene: &str, job: &str) -> Result<Picture> {
        Picture::read(&self.folder(scene).join(job))
    }

    /// What a job took.
    pub fn cost(&self, scene: &str, job: &str) -> Result<Cost> {
        let path = self.folder(scene).join(job).with_extension("json");
        let timings = read_json(&path)?;
        let software = is_software(timings["adapter"].as_str().unwrap_or_default());
        Ok(cost_of(&timings, &PASSES, if software { "min" } else { "median" }))
    }

    /// The name of the preset whose quality this one has, such as `high`; the default quality's, where none is given.
    pub fn quality_preset(&self, quality: Option<&Value>) -> Result<Option<&'static str>> {
        let own = match quality {
            Some(quality) => quality.clone(),
            None => self.effective("")?["quality"].take(),
        };
        for name in QUALITIES {
            if self.effective(&format!("--quality {name}"))?["quality"] == own {
                return Ok(Some(name));
            }
        }
        Ok(None)
    }
}

/// The presets that march, in the order of their cost.
pub const QUALITIES: [&str; 4] = ["low", "medium", "high", "ultra"];

/// A name as a heading has it: `High` of `high`.
pub fn title(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A renderer that waits for its turn before each picture.
pub struct Paced<'a> {
    engine: &'a Engine,
    folder: PathBuf,
    common: &'a str,
    left: slice::Iter<'a, Job>,
    child: Child,
    lines: Receiver<String>,
}

impl Paced<'_> {
    /// Renders the next job, and waits until it is done.
    pub fn take_turn(&mut self) -> Result<()> {
        let job = self.left.next().context("there is no job left")?;
        let stdin = self.child.stdin.as_mut().context("headless has no stdin")?;
        // One that has ended takes no line; its log says why.
        let asked = stdin.write_all(b"\n").and_then(|()| stdin.flush());
        match self.lines.recv_timeout(self.engine.time_left()) {
            Ok(_) if asked.is_ok() => {
                let stamp = self.engine.stamp(job, self.common)?;
                fs::write(done_path(&self.folder, job), stamp)
                    .with_context(|| format!("cannot write to {}", self.folder.display()))
            }
            Err(RecvTimeoutError::Timeout) => bail!("the time is up (--minutes); the same command goes on from here"),
            _ => Err(failed(&self.folder)),
        }
    }
}

impl Drop for Paced<'_> {
    /// Ends it: after its last job nothing is lost, and before that nobody waits for it.
    fn drop(&mut self) {
        let _ = self.child.kill().and_then(|()| self.child.wait());
    }
}

/// The lines that a child prints, as they come.
fn lines_of(child: &mut Child) -> Result<Receiver<String>> {
    let stdout = child.stdout.take().ok_or_else(|| anyhow!("headless has no stdout"))?;
    let (sender, lines) = channel();
    thread::spawn(move || BufReader::new(stdout).lines().map_while(Result::ok).try_for_each(|l| sender.send(l)));
    Ok(lines)
}

/// What a renderer's log says last.
fn failed(folder: &Path) -> Error {
    let log = fs::read_to_string(folder.join("headless.log")).unwrap_or_default();
    let tail: Vec<&str> = log.lines().rev().take(5).collect();
    anyhow!("headless failed in {}: {}", folder.display(), tail.into_iter().rev().collect::<Vec<_>>().join(" / "))
}

/// Frames after which a picture of this quality no longer changes but for noise; four at least, for the median of their
/// times.
fn finished_after(quality: &Value) -> u32 {
    let window = quality["window"].as_u64().unwrap_or(8) as u32;
    let frames = match quality["temporal"].as_str() {
        Some("Off") => 1,
        // Each texel is marched in one frame of a block.
        Some("Upscale") => window * if quality["block"] == "Four" { 16 } else { 4 },
        // What the first frame leaves of itself then is e⁻³.
        Some("Exponential") => (3.0 / quality["alpha"].as_f64().unwrap_or(0.05)).ceil() as u32,
        _ => window,
    };
    frames.max(4)
}

/// Says that a job's other files are whole.
fn done_path(folder: &Path, job: &Job) -> PathBuf {
    folder.join(&job.name).with_extension("done")
}

/// A file that `headless` wrote.
pub fn read_json(path: &Path) -> Result<Value> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

/// GPU time of these passes in a timings file: the frames' `min` or `median`.
pub fn cost_of(timings: &Value, names: &[&'static str], which: &str) -> Cost {
    let time = |name: &&'static str| Some((*name, timings["passes"][*name][which].as_f64()?));
    let passes: Vec<_> = names.iter().filter_map(time).collect();
    Cost {
        // One missing makes the sum meaningless.
        passes: if passes.len() == names.len() { passes } else { Vec::new() },
        adapter: timings["adapter"].as_str().unwrap_or("unknown").to_owned(),
    }
}

/// Whether a driver runs on the processor. It then shares it with whatever else runs, which only ever adds time: the
/// quickest frame is nearest to the truth. (The processor's own time of a process was no steadier on a virtual machine.)
pub fn is_software(adapter: &str) -> bool {
    let name = adapter.to_lowercase();
    ["llvmpipe", "lavapipe", "swiftshader"].iter().any(|known| name.contains(known))
}

/// The middle of some numbers.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let upper = *values.get(middle)?;
    Some(if values.len() % 2 == 1 { upper } else { (values[middle - 1] + upper) / 2.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn software_drivers_are_known() {
        assert!(is_software("llvmpipe (LLVM 15.0.6, 256 bits) (Vulkan)"));
        assert!(!is_software("NVIDIA H100 (Vulkan)"));
    }

    #[test]
    fn a_picture_is_finished_when_all_its_samples_are_there() {
        let of = |temporal: &str, block: &str| {
            finished_after(&serde_json::json!({ "window": 8, "alpha": 0.05, "temporal": temporal, "block": block }))
        };
        let found = [("Off", "Two"), ("SlidingWindow", "Two"), ("Upscale", "Two"), ("Upscale", "Four")];
        assert_eq!(found.map(|(temporal, block)| of(temporal, block)), [4, 8, 32, 128]);
        assert_eq!(of("Exponential", "Two"), 60);
    }

    #[test]
    fn a_cost_is_whole_or_none() {
        let timings = serde_json::json!({ "adapter": "a GPU", "passes": {
            "cloud_march": { "min": 1.0, "median": 2.0 }, "cloud_sky": { "min": 0.5, "median": 0.5 }, "cloud_depth": null } });
        let cost = cost_of(&timings, &["cloud_march", "cloud_sky"], "median");
        assert_eq!((cost.total(), cost.march(), cost.adapter.as_str()), (Some(2.5), Some(2.0), "a GPU"));
        assert_eq!(cost_of(&timings, &["cloud_march", "cloud_depth"], "min").total(), None);
    }

    #[test]
    fn median_of_odd_even_and_none() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(Vec::new()), None);
    }
}
