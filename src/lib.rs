//! Volumetric clouds for Bevy.
#![forbid(unsafe_code)]
#![warn(missing_docs)]
pub mod settings;
