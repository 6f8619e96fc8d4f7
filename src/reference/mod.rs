//! The slow truth: the renderer's maths on the CPU, in f64.
//!
//! Each public module is the twin of a shader module, and tests compare the two over many inputs. Nothing of them runs in
//! a frame, but for [`phase::HgDraine`], which turns a droplet diameter into the shader's parameters. The other truth, of
//! [`CloudMethod::PathTrace`](crate::settings::CloudMethod::PathTrace), runs on the GPU.

pub mod integrate;
pub(crate) mod path_tracer;
pub mod phase;
pub mod planet;
pub mod profile;
