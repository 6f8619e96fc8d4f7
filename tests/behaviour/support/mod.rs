//! What tests share: running apps, cameras and pictures, answers in closed form.

pub mod adding_doubling;
pub mod app;
pub mod declared;
pub mod density;
pub mod evaluate;
pub mod golden;
pub mod gpu;
pub mod half;
pub mod path_trace;
pub mod program;
pub mod scene;
pub mod shared;
pub mod slab;
pub mod temporal_modes;
pub mod uniform_slab;

/// Whether tests are to be thorough however long they take (`scripts/test --full`), not only quick.
pub fn full() -> bool {
    std::env::var("CUMULUS_FULL").is_ok_and(|full| full == "1")
}
