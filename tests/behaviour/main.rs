//! What the crate does, by behaviour. GPU tests run on whatever Vulkan device there is, a software one too, and fail
//! where there is none.

mod adding;
mod bad_input;
mod bound;
mod cameras;
mod change;
mod debug_views;
mod drift;
mod field;
mod goldens;
mod gpu;
mod halves;
mod headless;
mod hogfeldt_controls;
mod intervals;
mod large_world;
mod layers;
mod many_cameras;
mod map_files;
mod motion;
mod occlusion;
mod own_model;
mod path_tracer;
mod phase_slots;
mod phase_tables;
mod phases;
mod preset_keys;
mod sampling_patterns;
mod schedule;
mod settings;
mod shaders;
mod slab;
mod stage;
mod stall;
mod textures;
mod transparent;
mod twins;
mod view;
mod weather;
mod window;
#[cfg(target_os = "linux")]
mod window_driven;
mod zones;
