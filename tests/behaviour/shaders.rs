//! Every variant of every pipeline compiles and passes the device's validation.

use std::collections::BTreeSet;

use bevy::{
    camera::Hdr,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{CachedPipelineState, PipelineCache, PipelineDescriptor},
    },
    shader::ShaderDefVal,
};

use crate::{
    gpu::{run_updates, webgpu_limits},
    view::{Sky, cloud_pixels, clouds_app, spawn_sun, spawn_view, until_drawn},
};

/// What tells one variant of a pipeline from another: label, definitions, format drawn to.
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
        let (label, defs, format) = match &pipeline.descriptor {
            PipelineDescriptor::ComputePipelineDescriptor(d) => (&d.label, definitions(&d.shader_defs), None),
            PipelineDescriptor::RenderPipelineDescriptor(d) => {
                let fragment = d.fragment.as_ref();
                let format = fragment.and_then(|f| f.targets.first()?.as_ref().map(|t| t.format));
                (&d.label, fragment.map(|f| definitions(&f.shader_defs)).unwrap_or_default(), format)
            }
            _ => continue,
        };
        let Some(label) = label.as_ref().filter(|label| label.starts_with("cloud_")) else {
            continue;
        };
        let state = &pipeline.state;
        assert!(matches!(state, CachedPipelineState::Ok(_)), "{label} with {defs:?} is {state:?}");
        found.insert((label.to_string(), defs, format.map(|f| format!("{f:?}")).unwrap_or_default()));
    }
    found
}

#[test]
fn every_variant_compiles_and_draws() {
    let mut app = clouds_app();
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let looking = Transform::default().looking_to(Vec3::new(0.0, 0.4, -1.0), Vec3::Y);
    let mut views = Vec::new();
    let mut wanted = BTreeSet::new();
    for sky in [Sky::Black, Sky::Atmosphere] {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            for hdr in [true, false] {
                if sky == Sky::Atmosphere && (!hdr || webgpu_limits()) {
                    // `AtmosphereSettings` requires `Hdr`, and WebGPU's limits exclude it.
                    continue;
                }
                let view = spawn_view(&mut app, UVec2::new(9, 5), looking, sky);
                let mut camera = app.world_mut().entity_mut(view.camera);
                camera.insert(msaa);
                if !hdr {
                    camera.remove::<Hdr>();
                }
                views.push((view, sky, msaa, hdr));
                let mut defs = BTreeSet::new();
                if sky == Sky::Atmosphere {
                    defs.insert("ATMOSPHERE".to_owned());
                }
                if msaa != Msaa::Off {
                    defs.insert("MULTISAMPLED".to_owned());
                }
                for stage in ["cloud_sky", "cloud_march", "cloud_accumulate", "cloud_composite", "cloud_publish"] {
                    wanted.insert((stage.to_owned(), defs.clone(), String::new()));
                }
                let format = if hdr { "Rgba16Float" } else { "Rgba8UnormSrgb" };
                wanted.insert(("cloud_draw".to_owned(), BTreeSet::new(), format.to_owned()));
            }
        }
    }
    until_drawn(&mut app);
    run_updates(&mut app, 2);
    let made = made(&app);
    let missing: Vec<_> = wanted.difference(&made).collect();
    assert!(missing.is_empty(), "not made: {missing:#?}\nof {made:#?}");
    for (view, sky, msaa, hdr) in &views {
        let pixels = cloud_pixels(&app, view);
        let what = format!("{sky:?}, {msaa:?}, HDR {hdr}");
        assert!(pixels.iter().all(|p| p.is_finite()), "{what}");
        assert!(pixels.iter().any(|p| p.w < 0.9), "{what}: no cloud");
    }
}
