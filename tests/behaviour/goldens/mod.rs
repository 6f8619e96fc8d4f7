//! Pictures as they were when last approved.

mod presets;
mod scenes;
