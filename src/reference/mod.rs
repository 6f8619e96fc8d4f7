//! The slow truth: the renderer's maths on the CPU, in f64.
//!
//! Each public module is the twin of a shader module, and tests compare the two over many inputs. The renderer uses none
//! of them, but for [`phase::HgDraine`], which turns a droplet diameter into the shader's parameters, and the tables that
//! it reads. The other truth, of
//! [`CloudMethod::PathTrace`](crate::settings::CloudMethod::PathTrace), runs on the GPU.
//!
//! | module | what it says |
//! |---|---|
//! | [`planet`], [`profile`], [`phase`], [`mod@integrate`] | formulas |
//! | [`phase_table`], [`mie`], [`mod@ice`] | phase functions as tables |
//! | [`sampler`] | what a texture holds at a point |
//! | [`field`] | the model: what is at a point |
//! | [`query`] | what a game may ask: how much light passes, is the sun hidden? |

pub mod field;
pub mod ice;
pub mod integrate;
pub(crate) mod keeper;
mod layer;
pub mod mie;
pub(crate) mod path_tracer;
pub mod phase;
pub mod phase_table;
mod places;
pub mod planet;
pub mod profile;
pub mod quadrature;
pub mod query;
#[cfg(test)]
mod repetition;
pub mod sampler;
pub(crate) mod texture_set;
mod zones;
