//! What the crate does, by behaviour. GPU tests run on whatever Vulkan device there is, a software one too, and fail
//! where there is none.

mod gpu;
mod phases;
//mod sampling_patterns;
mod twins;
