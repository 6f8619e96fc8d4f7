//! The names that users' shaders may import (src/lib.wesl), and that nobody is told of others.

use std::time::{Duration, Instant};

use bevy::{
    asset::{AssetId, AssetPlugin, uuid::Uuid},
    prelude::*,
    shader::{ShaderCache, ShaderCacheError, ShaderCacheSource, Source},
};
use bevy_cumulus::CloudsPlugin;
use naga::{
    front::wgsl,
    valid::{Capabilities, ValidationFlags, Validator},
};

use super::{root, texts};

/// What calls a user's model as the renderer does: by the types that its own modules have.
const CALLER: &str =
    "import bevy_cumulus::model::{medium::Medium, model::{model_bounds, density_bound, sample_medium}};

@group(0) @binding(0) var<storage, read_write> output: array<f32>;

@compute @workgroup_size(1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let p = vec3(output[0], output[1], output[2]);
    let medium: Medium = sample_medium(p, 0.0);
    output[id.x] = medium.extinction + dot(medium.phase, medium.phase) + model_bounds().x + density_bound(p, 0.0);
}
";

/// As much of Bevy's modules as a material of the docs imports. They need shader definitions that only a camera has.
const VERTEX_OUTPUT: &str = "struct VertexOutput {
    @builtin(position) position: vec4<f32>, @location(0) world_position: vec4<f32>,
}";
const VIEW: &str = "struct View { viewport: vec4<f32>, world_position: vec3<f32> }
@group(0) @binding(0) var<uniform> view: View;";

/// The crate's modules as an app without a renderer has them, put together and compiled.
struct Compiler {
    app: App,
}

impl Compiler {
    fn new() -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), CloudsPlugin));
        app.finish();
        app.cleanup();
        Self { app }
    }

    /// The entry module with these modules around it, as WGSL that naga takes.
    fn compile(&mut self, entry: &str, modules: &[(&str, &str)]) -> Result<(), String> {
        let start = Instant::now();
        loop {
            self.app.update();
            match self.composed(entry, modules) {
                // The crate's files are still loading, or a module is nowhere.
                Err(ShaderCacheError::ShaderImportNotYetAvailable) if start.elapsed() < Duration::from_secs(20) => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                Err(error) => return Err(error.to_string()),
                Ok(text) => {
                    let module = wgsl::Frontend::new().parse(&text).map_err(|error| error.emit_to_string(&text))?;
                    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
                    return validator.validate(&module).map(|_| ()).map_err(|error| error.emit_to_string(&text));
                }
            }
        }
    }

    fn composed(&self, entry: &str, modules: &[(&str, &str)]) -> Result<String, ShaderCacheError> {
        let mut cache = ShaderCache::<String, ()>::new((), |(), source, _| match source {
            ShaderCacheSource::Wgsl(text) => Ok(text),
            ShaderCacheSource::SpirV(_) => Err(ShaderCacheError::CreateShaderModule("it is binary".to_owned())),
        });
        let replaced = |path: &str| modules.iter().any(|(known, _)| *known == path);
        for (id, shader) in self.app.world().resource::<Assets<Shader>>().iter() {
            if matches!(shader.source, Source::Wesl(_)) && !replaced(&shader.path) {
                cache.set_shader(id, shader.clone());
            }
        }
        let id = |k: usize| AssetId::Uuid { uuid: Uuid::from_u128(k as u128) };
        for (k, (path, text)) in modules.iter().enumerate() {
            cache.set_shader(id(k + 1), Shader::from_wesl((*text).to_owned(), *path));
        }
        cache.set_shader(id(0), Shader::from_wesl(entry.to_owned(), "embedded://a_game/entry.wesl"));
        cache
            .get(
                0,
                id(0),
                &[("MATERIAL_BIND_GROUP", 3)].map(|(name, n)| bevy::shader::ShaderDefVal::UInt(name.into(), n)),
            )
            .map(|text| text.to_string())
    }

    /// A model, where the built-in one stands.
    fn model(&mut self, source: &str) -> Result<(), String> {
        self.compile(CALLER, &[("embedded://bevy_cumulus/model/model.wesl", source)])
    }

    fn material(&mut self, source: &str) -> Result<(), String> {
        let bevy = [
            ("embedded://bevy_pbr/render/forward_io.wesl", VERTEX_OUTPUT),
            ("embedded://bevy_pbr/render/mesh_view_bindings.wesl", VIEW),
        ];
        self.compile(source, &bevy)
    }
}

/// What src/lib.wesl hands on.
fn public_names() -> Vec<String> {
    let text = std::fs::read_to_string(root().join("src/lib.wesl")).expect("the module is there");
    let imports = text.split("public import ").skip(1).filter_map(|rest| rest.split(';').next());
    let last = imports.map(|import| import.rsplit("::").next().expect("a path has an end").to_owned());
    let names = last.flat_map(|names| {
        let names = names.trim_matches(['{', '}']).split(',').map(|name| name.trim().to_owned()).collect::<Vec<_>>();
        names.into_iter().filter(|name| !name.is_empty())
    });
    names.collect()
}

#[test]
fn every_public_name_is_there_and_explained() {
    let names = public_names();
    assert!(names.len() >= 17 && names.contains(&"Medium".to_owned()), "{names:?}");
    // A model that uses all of them. A volume, a map and a sampler can only be sampled.
    let source = format!(
        "import bevy_cumulus::{{{}}};
fn model_bounds() -> vec2<f32> {{ return vec2(map_scale(), planet_radius()); }}
fn density_bound(p: vec3<f32>, lod: f32) -> f32 {{
    return textureSampleLevel(billow_volume, tiling, p, lod).r + textureSampleLevel(wisp_volume, tiling, p, lod).r
        + textureSampleLevel(shape_volume, tiling, p, lod).r + textureSampleLevel(detail_volume, tiling, p, lod).r
        + textureSampleLevel(coverage_map, tiling, map_at(p), lod).r
        + textureSampleLevel(type_map, tiling, map_repeats(p), lod).r
        + textureSampleLevel(gradient, clamping, p.xy, 0.0).r;
}}
fn sample_medium(p: vec3<f32>, lod: f32) -> Medium {{
    var medium = empty_medium();
    medium.phase = ONE_PHASE;
    medium.extinction = altitude(p, 1.0) + up_at(p, 1.0).y + cloud_fade(vec4(1.0), 2.0);
    return medium;
}}
",
        names.join(", ")
    );
    let page = std::fs::read_to_string(root().join("docs/shaders.md")).expect("the page is there");
    for name in &names {
        let uses = source.match_indices(name.as_str()).count();
        assert!(uses >= 2, "{name} is imported and not used: add it to this model");
        assert!(page.contains(&format!("`{name}")), "docs/shaders.md does not name {name}");
    }
    Compiler::new().model(&source).unwrap_or_else(|error| panic!("{error}"));
}

/// The blocks of WGSL of a page or a doc comment, as they would be in a file.
fn blocks(text: &str) -> Vec<String> {
    let plain = |line: &str| {
        let line = line.trim_start();
        line.strip_prefix("/// ").or(line.strip_prefix("//! ")).map_or(line, str::trim_end).to_owned() + "\n"
    };
    let text: String = text.lines().map(plain).collect();
    text.split("```wgsl\n").skip(1).filter_map(|rest| Some(rest.split_once("```")?.0.to_owned())).collect()
}

#[test]
fn what_docs_and_examples_show_compiles() {
    let mut shown = texts(&["examples"], &["wesl"]);
    for (path, text) in texts(&["README.md", "docs", "src"], &["md", "rs"]) {
        shown.extend(blocks(&text).into_iter().map(|block| (path.clone(), block)));
    }
    let mut compiler = Compiler::new();
    let (mut models, mut materials) = (0, 0);
    for (path, source) in shown {
        let compiled = if source.contains("fn sample_medium") {
            models += 1;
            compiler.model(&source)
        } else if source.contains("@fragment") {
            materials += 1;
            compiler.material(&source)
        } else {
            // A few lines of what goes into a fragment's function.
            assert!(source.contains("cloud_fade("), "{}: nobody compiles this:\n{source}", path.display());
            Ok(())
        };
        compiled.unwrap_or_else(|error| panic!("{}: {error}\n{source}", path.display()));
    }
    // docs/shaders.md, ModelShader and the rings; docs/transparency.md and the glass.
    assert!(models >= 3 && materials >= 2, "{models} models, {materials} materials");
}

#[test]
fn nobody_is_told_to_import_what_may_move() {
    let mut told = texts(&["README.md", "CHANGELOG.md", "docs", "examples"], &["md", "rs", "wesl"]);
    for (path, text) in texts(&["src"], &["rs"]) {
        let comments = text.lines().filter(|line| line.trim_start().starts_with("//"));
        told.push((path, comments.map(|line| format!("{line}\n")).collect()));
    }
    let mut imports = 0;
    for (path, text) in told {
        for import in text.split("import ").skip(1) {
            let import: String = import.split(';').next().unwrap_or_default().split_whitespace().collect();
            let own = import.starts_with("package::") && path.to_string_lossy().contains("examples");
            let inside = import.strip_prefix("bevy_cumulus::");
            imports += usize::from(inside.is_some());
            let deep = inside.is_some_and(|names| names.contains("::"));
            assert!(!own && !deep, "{}: import {import}", path.display());
        }
    }
    assert!(imports >= 6, "only {imports} imports of ours are shown");
}
