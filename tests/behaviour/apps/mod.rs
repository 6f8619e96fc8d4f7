//! The examples, run as a user runs them.

mod headless;
#[cfg(target_os = "linux")]
mod windows;
