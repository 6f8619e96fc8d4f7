//! What the crate does, by behaviour. GPU tests run on whatever Vulkan device there is, a software one too, and fail
//! where there is none.

mod apps;
mod docs;
mod goldens;
mod light;
mod march;
mod model;
mod path_trace;
mod phase;
mod presets;
mod query;
mod resolve;
mod robustness;
mod settings;
mod support;
mod temporal;
mod textures;
mod transition;
mod view;
mod weather;
