//! Settings and the paths that set them.

mod effects;
mod fields;
mod hogfeldt_controls;
