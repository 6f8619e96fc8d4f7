//! The slow truth: the renderer's maths on the CPU, in f64.
//!
//! Each file here is the twin of a shader module, and tests compare the two over many inputs. Nothing of this runs in
//! a frame, but for [`phase::HgDraine`], which turns a droplet diameter into the shader's parameters.

pub mod integrate;
pub mod phase;
pub mod planet;
pub mod profile;
