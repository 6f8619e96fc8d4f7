//! Settings and the paths that set them.

mod fields;
mod hogfeldt_controls;
