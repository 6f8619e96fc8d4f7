//! Frames combined: at rest, in motion, over many frames.

mod accumulation_drift;
mod motion;
mod sliding_window;
