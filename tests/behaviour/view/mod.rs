//! Cameras: none, one or many.

mod cameras;
mod many_cameras;
