//! Bad input, bad devices, odd worlds and odd moments.

pub mod bad_input;
mod large_world;
mod pipeline_stalls;
mod schedule;
mod shader_variants;
