//! Baked textures, images in their place, maps from files.

mod baking;
mod map_files;
mod sampling_patterns;
