//! Whether a user's model compiles: asked before it takes the place of one that does.
//!
//! It is put together with what it imports as the pipelines' shaders will be, by Bevy's own [`ShaderCache`], and checked by
//! naga, which is what the renderer compiles it with.

use bevy::{
    asset::{AssetId, uuid::Uuid},
    prelude::*,
    shader::{ShaderCache, ShaderCacheError, ShaderCacheSource, Source, ValidateShader},
};
use naga::{
    front::wgsl,
    valid::{Capabilities, ValidationFlags, Validator},
};

use super::{MODEL_PATH, ModelShaderError, lines};
use crate::{PUBLIC_SHADER, PUBLIC_SHADER_PATH};

/// What became of a source.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Verdict {
    /// It compiles.
    Good,
    /// It does not.
    Bad(ModelShaderError),
    /// A module that it imports is not loaded.
    Waits,
}

/// Modules that a model may import, as they were when the crate was built: at the app's start they are not loaded yet.
const LIBRARY: [(&str, &str); 10] = [
    (PUBLIC_SHADER_PATH, PUBLIC_SHADER),
    ("embedded://bevy_cumulus/counts.wesl", include_str!("../counts.wesl")),
    ("embedded://bevy_cumulus/model/medium.wesl", include_str!("medium.wesl")),
    ("embedded://bevy_cumulus/model/planet.wesl", include_str!("planet.wesl")),
    ("embedded://bevy_cumulus/model/data.wesl", include_str!("data.wesl")),
    ("embedded://bevy_cumulus/model/zones.wesl", include_str!("zones.wesl")),
    ("embedded://bevy_cumulus/model/map.wesl", include_str!("map.wesl")),
    ("embedded://bevy_cumulus/model/places.wesl", include_str!("places.wesl")),
    ("embedded://bevy_cumulus/model/profile.wesl", include_str!("profile.wesl")),
    ("embedded://bevy_cumulus/model/layer.wesl", include_str!("layer.wesl")),
];

/// Functions of a model: name, what the renderer calls it with, what it gives, and whether it must be there.
const FUNCTIONS: [(&str, &str, &str, bool); 8] = [
    ("model_bounds", "", "vec2<f32>", true),
    ("model_deck", "0u", "vec2<f32>", true),
    ("model_part", "0u", "vec2<f32>", true),
    ("density_bound", "vec3<f32>(0.0), 0.0", "f32", true),
    ("sample_medium", "vec3<f32>(0.0), 0.0", "Medium", true),
    ("sample_part", "0u, vec3<f32>(0.0), 0.0", "Medium", true),
    ("extinction_bound", "vec3<f32>(0.0), 0.0", "f32", false),
    ("debug_value", "vec3<f32>(0.0), 0.0, 0u", "f32", false),
];

/// Checks a model's source; `others` are all shaders of the app.
pub(super) fn check<'a>(source: &str, others: impl Iterator<Item = (AssetId<Shader>, &'a Shader)>) -> Verdict {
    let there = |name: &str| lines::declares(source, name);
    if let Some((name, ..)) = FUNCTIONS.iter().find(|(name, .., needed)| *needed && !there(name)) {
        return bad(None, format!("there is no function {name}"));
    }
    let mut cache = ShaderCache::<String, ()>::new((), composed);
    for (id, shader) in others {
        if matches!(shader.source, Source::Wesl(_)) && shader.path != MODEL_PATH && !is_library(&shader.path) {
            cache.set_shader(id, shader.clone());
        }
    }
    let callers = callers(there);
    let own = [(MODEL_PATH, source), ("embedded://bevy_cumulus/model/callers.wesl", &callers)];
    for (k, (path, text)) in (1..).zip(LIBRARY.into_iter().chain(own)) {
        cache.set_shader(place(k), Shader::from_wesl(text.to_owned(), path));
    }
    match cache.get(0, place(LIBRARY.len() as u128 + 2), &[]) {
        Ok(text) => validate(source, &text),
        Err(ShaderCacheError::ShaderImportNotYetAvailable | ShaderCacheError::ShaderNotLoaded(_)) => Verdict::Waits,
        Err(error) => refused(source, &error.to_string()),
    }
}

/// What the composer says. It names the line, or only the declaration that it was at.
fn refused(source: &str, message: &str) -> Verdict {
    let quoted = |before: &str| message.split_once(before)?.1.split('`').next();
    // The other lines show where it was in the callers' text.
    let what = message.lines().find_map(|line| line.strip_prefix("error: ")).unwrap_or(message);
    let within = quoted("in declaration of `");
    if let Some(verdict) = within.and_then(|name| of_caller(source, name, what)) {
        return verdict;
    }
    let word =
        ["declaration of `", "arguments to `", "has no declaration `"].into_iter().find_map(quoted).map(lines::plain);
    let line = lines::named(message, MODEL_PATH)
        .or_else(|| lines::of_word(source, &word?, within))
        .or_else(|| lines::of(source, within?));
    bad(line, what.to_owned())
}

/// Where a caller is wrong, the function that it calls is of another type than the renderer's.
fn of_caller(source: &str, caller: &str, reason: &str) -> Option<Verdict> {
    let called = caller.strip_prefix("calls_")?;
    let (name, values, gives, _) = FUNCTIONS.iter().find(|(name, ..)| *name == called)?;
    Some(bad(lines::of(source, name), format!("{name} must give {gives} for ({values}): {reason}")))
}

fn bad(line: Option<usize>, reason: String) -> Verdict {
    Verdict::Bad(ModelShaderError { line, reason: lines::plain(&reason) })
}

fn place(k: u128) -> AssetId<Shader> {
    AssetId::Uuid { uuid: Uuid::from_u128(k) }
}

fn is_library(path: &str) -> bool {
    LIBRARY.iter().any(|(known, _)| *known == path)
}

fn composed(_: &(), source: ShaderCacheSource, _: &ValidateShader) -> Result<String, ShaderCacheError> {
    match source {
        ShaderCacheSource::Wgsl(text) => Ok(text),
        ShaderCacheSource::SpirV(_) => {
            Err(ShaderCacheError::CreateShaderModule("a binary cannot be imported".to_owned()))
        }
    }
}

/// A shader that calls the model as the renderer does: a function for each of its functions.
fn callers(there: impl Fn(&str) -> bool) -> String {
    let mut imports = String::from("import package::model::medium::Medium;\n");
    let mut calls = String::new();
    for (name, values, gives, _) in FUNCTIONS.iter().filter(|(name, ..)| there(name)) {
        imports += &format!("import package::model::model::{name};\n");
        calls += &format!("@compute @workgroup_size(1) fn calls_{name}() {{ let got: {gives} = {name}({values}); }}\n");
    }
    imports + &calls
}

fn validate(source: &str, composed: &str) -> Verdict {
    let module = match wgsl::Frontend::new().parse(composed) {
        Ok(module) => module,
        Err(error) => {
            // The first place that it knows: some errors begin with one that they do not.
            let at = error.labels().filter_map(|(span, _)| span.to_range()).find(|range| !range.is_empty());
            return blame(source, composed, at.map(|range| range.start), error.message().to_owned());
        }
    };
    match Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module) {
        Ok(_) => Verdict::Good,
        Err(error) => {
            // The innermost place is the last.
            let at = error.spans().last().and_then(|(span, _)| Some(span.to_range()?.start));
            blame(source, composed, at, chain(error.as_inner()))
        }
    }
}

/// An error and what caused it.
fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// The error, at the source's line from which the composed text has what is there.
fn blame(source: &str, composed: &str, at: Option<usize>, reason: String) -> Verdict {
    let line = at.and_then(|at| lines::in_source(source, composed, at));
    let caller = at.and_then(|at| composed[..at].rsplit_once("fn ")).and_then(|(_, text)| text.split('(').next());
    match caller.filter(|_| line.is_none()).and_then(|caller| of_caller(source, caller, &reason)) {
        Some(verdict) => verdict,
        None => bad(line, reason),
    }
}

#[cfg(test)]
#[path = "check_tests.rs"]
mod tests;
