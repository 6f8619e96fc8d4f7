//! Every variant of every pipeline but the path tracer's compiles and passes the device's validation. Those take a software
//! driver minutes each: the path tracer's own tests and the headless example compile them, with MSAA over a plain sky only.

use std::collections::BTreeSet;

use bevy::{
    camera::Hdr,
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{CachedPipelineState, PipelineCache, PipelineDescriptor, TextureFormat},
        renderer::{RenderAdapter, RenderDevice},
        settings::WgpuFeatures,
    },
    shader::ShaderDefVal,
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{Sky, View, cloud_pixels, new_clouds_app, spawn_sun, spawn_view, until_drawn},
    gpu::{run_updates, webgpu_limits},
};

/// What tells one variant of a pipeline from another: label, definitions, what it draws into.
type Variant = (String, BTreeSet<String>, String);

fn definitions(defs: &[ShaderDefVal]) -> BTreeSet<String> {
    defs.iter()
        .filter_map(|def| match def {
            ShaderDefVal::Bool(name, true) => Some(name.to_string()),
            _ => None,
        })
        .collect()
}

/// Our pipelines that are made; fails where one is not.
fn made(app: &App) -> BTreeSet<Variant> {
    let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
    let mut found = BTreeSet::new();
    for pipeline in cache.pipelines() {
        let (label, defs, target) = match &pipeline.descriptor {
            PipelineDescriptor::ComputePipelineDescriptor(d) => (&d.label, definitions(&d.shader_defs), None),
            PipelineDescriptor::RenderPipelineDescriptor(d) => {
                let fragment = d.fragment.as_ref();
                let format = fragment.and_then(|f| f.targets.first()?.as_ref().map(|t| t.format));
                let target = format.map(|format| drawn_into(format, d.multisample.count));
                (&d.label, fragment.map(|f| definitions(&f.shader_defs)).unwrap_or_default(), target)
            }
            _ => continue,
        };
        let Some(label) = label.as_ref().filter(|label| label.starts_with("cloud_")) else {
            continue;
        };
        let state = &pipeline.state;
        assert!(matches!(state, CachedPipelineState::Ok(_)), "{label} with {defs:?} is {state:?}");
        found.insert((label.to_string(), defs, target.unwrap_or_default()));
    }
    found
}

fn drawn_into(format: TextureFormat, samples: u32) -> String {
    format!("{format:?}, {samples} samples")
}

/// Whether this device draws into what cameras have with so many samples. WebGPU promises 1 and 4.
fn draws_with(app: &App, msaa: Msaa) -> bool {
    let world = app.sub_app(RenderApp).world();
    let (adapter, device) = (world.resource::<RenderAdapter>(), world.resource::<RenderDevice>());
    let formats = [TextureFormat::Rgba16Float, TextureFormat::Rgba8UnormSrgb, CORE_3D_DEPTH_FORMAT];
    let supported = |format| adapter.get_texture_format_features(format).flags.sample_count_supported(msaa.samples());
    matches!(msaa, Msaa::Off | Msaa::Sample4)
        || device.features().contains(WgpuFeatures::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES)
            && formats.into_iter().all(supported)
}

/// A view, and what its pipelines depend on.
struct Case {
    view: View,
    sky: Sky,
    msaa: Msaa,
    hdr: bool,
}

impl Case {
    fn spawn(app: &mut App, sky: Sky, msaa: Msaa, hdr: bool) -> Self {
        let looking = Transform::default().looking_to(Vec3::new(0.0, 0.4, -1.0), Vec3::Y);
        let size = UVec2::new(9, 5);
        let view = spawn_view(app, size, looking, sky);
        let depth = app.world_mut().resource_mut::<Assets<Image>>().add(CloudDepth::image(size.x, size.y));
        let mut camera = app.world_mut().entity_mut(view.camera);
        camera.insert((msaa, CloudDepth(depth)));
        if !hdr {
            camera.remove::<Hdr>();
        }
        Self { view, sky, msaa, hdr }
    }

    /// Every pipeline that it needs to show this in this way.
    fn wanted(&self, debug: CloudDebugView) -> Vec<Variant> {
        let mut defs = BTreeSet::new();
        if self.sky == Sky::Atmosphere {
            // A device whose textures do not suffice for the second has none of Bevy's atmosphere either.
            defs.extend(["ATMOSPHERE", "AIR_MARCHED"].map(str::to_owned));
        }
        if self.msaa != Msaa::Off {
            defs.insert("MULTISAMPLED".to_owned());
        }
        let variant = |label: &str, defs: &BTreeSet<String>| (label.to_owned(), defs.clone(), String::new());
        let after = ["cloud_sky", "cloud_accumulate", "cloud_blend", "cloud_composite", "cloud_publish", "cloud_depth"];
        let mut wanted: Vec<Variant> = after.into_iter().map(|label| variant(label, &defs)).collect();
        let format = if self.hdr { TextureFormat::Rgba16Float } else { TextureFormat::Rgba8UnormSrgb };
        wanted.push(("cloud_draw".to_owned(), BTreeSet::new(), drawn_into(format, self.msaa.samples())));
        match debug {
            CloudDebugView::Steps => defs.extend(["DEBUG_VIEW".to_owned()]),
            CloudDebugView::CoverageMap => defs.extend(["DEBUG_VIEW", "DEBUG_MAP"].map(str::to_owned)),
            _ => {}
        }
        wanted.push(variant("cloud_march", &defs));
        wanted
    }
}

fn spawn_cases(app: &mut App) -> Vec<Case> {
    let mut cases = Vec::new();
    for sky in [Sky::Black, Sky::Atmosphere] {
        for msaa in [Msaa::Off, Msaa::Sample2, Msaa::Sample4, Msaa::Sample8] {
            for hdr in [true, false] {
                // `AtmosphereSettings` requires `Hdr`, and WebGPU's limits exclude it.
                let has_sky = hdr && !webgpu_limits();
                if draws_with(app, msaa) && (sky == Sky::Black || has_sky) {
                    cases.push(Case::spawn(app, sky, msaa, hdr));
                }
            }
        }
    }
    cases
}

#[test]
fn every_variant_compiles_and_draws() {
    let mut app = new_clouds_app();
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let cases = spawn_cases(&mut app);
    app.insert_resource(CloudQuality::default());
    for debug in [CloudDebugView::None, CloudDebugView::Steps, CloudDebugView::CoverageMap] {
        for case in &cases {
            app.world_mut().get_mut::<CloudView>(case.view.camera).expect("it shows clouds").debug = debug;
        }
        // From the next frame on it counts whether their shaders are there.
        run_updates(&mut app, 1);
        until_drawn(&mut app);
        run_updates(&mut app, 2);
        let made = made(&app);
        for Case { view, sky, msaa, hdr } in &cases {
            let what = format!("{debug:?}, {sky:?}, {msaa:?}, HDR {hdr}");
            let pixels = cloud_pixels(&app, view);
            assert!(pixels.iter().all(|p| p.is_finite()), "{what}");
            assert!(pixels.iter().any(|p| p.w < 0.9), "{what}: no cloud");
        }
        let wanted: BTreeSet<Variant> = cases.iter().flat_map(|case| case.wanted(debug)).collect();
        let missing: Vec<_> = wanted.difference(&made).collect();
        assert!(missing.is_empty(), "{debug:?}: not made: {missing:#?}\nof {made:#?}");
    }
    let samples: BTreeSet<u32> = cases.iter().map(|case| case.msaa.samples()).collect();
    println!("{} views, of {samples:?} samples", cases.len());
}
