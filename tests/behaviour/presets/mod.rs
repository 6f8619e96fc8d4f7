//! Preset files: loading, following, keys.

mod files;
mod frozen;
mod keys;
