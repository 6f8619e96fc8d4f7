//! What is where in the sky: shaders against their CPU twins.

mod cpu_parity;
mod custom_model;
mod density_bound;
pub mod layers;
mod seam;
mod shell_intervals;
mod zones;
