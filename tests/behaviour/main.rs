//! What the crate does, by behaviour. GPU tests run on whatever Vulkan device there is, a software one too, and fail
//! where there is none.

mod bound;
mod gpu;
mod headless;
mod intervals;
mod phases;
mod sampling_patterns;
mod schedule;
mod shaders;
mod slab;
mod textures;
mod twins;
mod view;
mod window;
