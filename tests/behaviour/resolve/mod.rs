//! Clouds among the things of a scene.

mod occlusion;
mod post_processing;
mod transparent;
