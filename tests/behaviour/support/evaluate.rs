//! Shader functions over many inputs, to be compared with the CPU's.
//!
//! Inputs are f32 and taken as exact, so what is compared is the arithmetic. `U` is the unit roundoff of f32: an exact
//! operation, rounded, is wrong by one U relatively; WGSL allows a division or square root about five.

use bevy::{
    app::App,
    render::render_resource::{BindGroup, BindGroupLayoutDescriptor},
};
use bevy_cumulus::reference::planet::PLANET_RADIUS;

use super::gpu::run_compute_with;

/// Unit roundoff of f32.
pub const U: f64 = 5.960_464_5e-8;
pub const COUNT: usize = 20_000;

/// Radius of the planet (m).
pub const R: f32 = PLANET_RADIUS as f32;

/// Runs `body` for each item: it reads `values[i..]` (`N` floats) and writes `results[o..]` (`M` floats).
pub fn on_gpu<const N: usize, const M: usize>(
    app: &mut App,
    imports: &str,
    body: &str,
    inputs: &[[f32; N]],
) -> Vec<[f32; M]> {
    on_gpu_with(app, None, imports, body, inputs)
}

/// The same, with a bind group 1 of the caller's.
pub fn on_gpu_with<const N: usize, const M: usize>(
    app: &mut App,
    group_1: Option<&(BindGroupLayoutDescriptor, BindGroup)>,
    imports: &str,
    body: &str,
    inputs: &[[f32; N]],
) -> Vec<[f32; M]> {
    let shader = format!(
        "{imports}
@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    let i = id.x * {N}u;
    let o = id.x * {M}u;
    if i >= arrayLength(&values) {{
        return;
    }}
    {body}
}}
"
    );
    let count = inputs.len();
    let written = run_compute_with(app, &shader, group_1, inputs.as_flattened(), count * M, count as u32);
    written.as_chunks().0.to_vec()
}

/// The largest value, with the input that gave it; a NaN counts as largest.
pub fn worst<T>(errors: impl Iterator<Item = (f64, T)>) -> (f64, T) {
    errors.reduce(|a, b| if a.0.is_nan() || a.0 >= b.0 { a } else { b }).expect("nothing was compared")
}
