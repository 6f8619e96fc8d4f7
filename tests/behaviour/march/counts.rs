//! Counts of steps, media sampled and textures read: those of a closed form, to the digit, and the same every time.

use std::{fs, path::Path};

use bevy::{math::DVec3, prelude::*, render::render_resource::TextureUsages};
use bevy_cumulus::{
    CloudCounts, CloudFrame,
    prelude::*,
    reference::planet::{PLANET_RADIUS, shell_intervals},
};
use serde_json::Value;

use crate::support::{
    app::{Sky, View, clouds_of_a_larger_map, read_image, spawn_sun, spawn_view, until_drawn},
    gpu::run_updates,
    half::from_half,
    program::{Folder, command},
    scene::{exact, settle, slab_app},
    shared::SharedApp,
};

const VIEWS: [CloudDebugView; 3] = [CloudDebugView::StepCount, CloudDebugView::SampleCount, CloudDebugView::ReadCount];

/// A camera whose frames are kept as they are marched.
struct Counted {
    app: SharedApp,
    view: View,
    frame: Handle<Image>,
}

impl Counted {
    fn new(mut app: SharedApp, size: UVec2, looking: Transform) -> Self {
        let view = spawn_view(&mut app, size, looking, Sky::Black);
        let mut image = CloudFrame::image(size.x, size.y);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let frame = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.world_mut().entity_mut(view.camera).insert(CloudFrame(frame.clone()));
        until_drawn(&mut app);
        Self { app, view, frame }
    }

    /// Steps, samples and reads of the fifth frame of a history.
    fn counts(&mut self) -> [CloudCounts; 3] {
        VIEWS.map(|debug| {
            self.change(|view| view.debug = debug);
            run_updates(&mut self.app, 1);
            until_drawn(&mut self.app);
            settle(&mut self.app);
            self.change(|view| view.reset += 1);
            run_updates(&mut self.app, 5);
            let texels: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(&self.app, &self.frame));
            let texels: Vec<[f32; 4]> = texels.into_iter().map(|t| t.map(|half| from_half(half) as f32)).collect();
            CloudCounts::of(&texels)
        })
    }

    fn change(&mut self, change: impl FnOnce(&mut CloudView)) {
        change(&mut self.app.world_mut().get_mut::<CloudView>(self.view.camera).expect("it shows clouds"));
    }
}

/// Of a uniform slab each step samples once, and so many times more towards the sun above it. No texture is read but the
/// scene's depth, and how far the last frame saw here and beside it.
#[test]
fn counts_of_a_slab_are_those_of_the_closed_form() {
    const BOTTOM: f32 = 1000.0;
    const TOP: f32 = 3000.0;
    let mut app = slab_app(BOTTOM, TOP, 1e-4);
    app.insert_resource(CloudLighting { diffusion: 0.0, ambient_strength: 0.0, ..default() });
    let mut counted = Counted::new(app, UVec2::ONE, Transform::default());
    let narrow = PerspectiveProjection { fov: 0.0005, ..default() };
    counted.app.world_mut().entity_mut(counted.view.camera).insert(Projection::Perspective(narrow));
    // The last takes more steps than a half float counts.
    for (degrees, step, lights) in [(90.0, 30.0, 0), (40.0, 30.0, 6), (40.0, 30.0, 2), (15.0, 70.0, 3), (5.0, 5.0, 1)] {
        let mu = f64::to_radians(degrees).sin();
        let direction = DVec3::new(0.0, mu, -(1.0 - mu * mu).sqrt()).as_vec3();
        let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(direction, Vec3::X);
        counted.app.world_mut().entity_mut(counted.view.camera).insert(looking);
        counted.app.insert_resource(CloudQuality {
            step,
            step_growth: 0.0,
            long_step: 1,
            max_steps: 8192,
            max_distance: 2e6,
            density_skip: 0.0,
            light_steps: lights,
            // Even one reaches through the slab: they shrink to fit.
            light_step: 2.0 * (TOP - BOTTOM),
            light_growth: 1.0,
            ..exact(MarchResolution::Full)
        });
        let way: f64 =
            shell_intervals(10.0, mu, BOTTOM.into(), TOP.into(), PLANET_RADIUS, 2e6).iter().map(|[a, b]| b - a).sum();
        let expected = (way / f64::from(step)).ceil() as u64;
        let [steps, samples, reads] = counted.counts();
        println!("{degrees}°, {step} m, {lights} light steps: {steps:?}, {samples:?}, {reads:?}");
        assert_eq!((steps.rays, steps.total, steps.most), (1, expected, expected), "{degrees}°: steps");
        assert_eq!(samples.total, expected * u64::from(1 + lights), "{degrees}°, {lights} light steps: samples");
        assert_eq!(reads.total, 3, "{degrees}°: reads");
    }
}

#[test]
fn counts_of_the_built_in_clouds_repeat_to_the_digit() {
    let mut app = clouds_of_a_larger_map();
    app.insert_resource(CloudQuality::high());
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(0.4));
    let mut counted = Counted::new(app, UVec2::new(33, 18), up);
    let first = counted.counts();
    let [steps, samples, reads] = first;
    println!("{first:?}");
    // Half the size, rounded up.
    assert!(first.iter().all(|counts| counts.rays == 17 * 9), "{first:?}");
    assert!(0 < steps.total && steps.total < samples.total && samples.total < reads.total, "{first:?}");
    assert_eq!(counted.counts(), first);
    // Each lit sample asks more often towards the sun; six steps reach through the layer as it is.
    counted.app.insert_resource(CloudQuality { light_steps: 12, ..CloudQuality::high() });
    let [same_steps, more_samples, more_reads] = counted.counts();
    assert_eq!(same_steps, steps);
    assert!(more_samples.total > samples.total && more_reads.total > reads.total, "{more_samples:?}, {samples:?}");
    // A block's texel a frame.
    let sparse = CloudQuality { temporal: TemporalMode::Upscale, resolution: MarchResolution::Full, ..default() };
    counted.app.insert_resource(CloudQuality { block: UpscaleBlock::Four, ..sparse });
    let [sparse, ..] = counted.counts();
    assert!((9 * 5..33 * 18 / 2).contains(&sparse.rays), "{sparse:?}");
}

#[test]
fn headless_writes_the_same_counts_every_time() {
    let count = || {
        let folder = Folder::new();
        let output = command()
            .args(["--size", "16x9", "--frames", "3", "--no-sky", "--no-land", "--counts", "counts.json"])
            .args(["--set", "textures.volume_size=32", "--set", "textures.map_size=64"])
            .current_dir(&*folder)
            .output()
            .expect("the example starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = fs::read_to_string(folder.join("counts.json")).expect("the file is there");
        serde_json::from_str::<Value>(&text).expect("the file is JSON")
    };
    let first = count();
    assert_eq!(first["rays"], 8 * 5);
    for key in ["steps", "samples", "reads"] {
        let number = |part: &str| first[key][part].as_f64().expect("a number");
        assert!(number("total") > 0.0 && number("most") >= number("mean"), "{key}: {}", first[key]);
        assert!((number("mean") * 40.0 / number("total") - 1.0).abs() < 1e-9, "{key}: {}", first[key]);
    }
    assert_eq!(count(), first);
}

/// A texture read that nobody counts would make every count too small.
#[test]
fn every_texture_read_of_the_model_and_the_march_is_counted() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut reads = 0;
    for folder in ["model", "render/march"] {
        for entry in fs::read_dir(root.join(folder)).expect("the folder is there") {
            let path = entry.expect("it can be read").path();
            if path.extension().is_none_or(|extension| extension != "wesl") {
                continue;
            }
            let text = fs::read_to_string(&path).expect("a shader is text");
            let lines: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
            for (i, line) in lines.iter().enumerate() {
                let found = line.matches("textureSample").count() + line.matches("textureLoad").count();
                if found > 0 {
                    reads += found;
                    let before = i.checked_sub(1).map_or("", |before| lines[before]);
                    assert_eq!(found, 1, "{}: two reads in {line}", path.display());
                    assert_eq!(before.trim(), "@if(COUNTS) count_read();", "{}: before {line}", path.display());
                }
            }
        }
    }
    assert!(reads > 20, "only {reads} reads were found");
}
