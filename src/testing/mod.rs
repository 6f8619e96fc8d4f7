//! The crate's insides as its own tests and tools see them: bindings of the model, contents of textures, layouts and
//! uniforms of a stage. Not part of the public interface: it changes with what is inside.

mod accumulation;
mod model;
pub mod textures;

pub use accumulation::Accumulation;
pub use model::model_bindings;
