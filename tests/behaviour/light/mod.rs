//! Light that reaches the clouds and the camera.

mod low_sun;
mod marched_air;
