//! The ray march against closed forms, and what its steps cost.

mod counts;
mod debug_views;
mod empty_space;
mod slab;
mod slab_settings;
mod step_budget;
