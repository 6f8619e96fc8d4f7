//! Preset files: loading, following, keys.

mod files;
mod keys;
