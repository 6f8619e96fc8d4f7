//! Light that reaches the clouds and the camera.

mod marched_air;
