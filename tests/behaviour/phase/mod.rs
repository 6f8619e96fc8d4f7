//! Phase functions, and tables of them.

mod functions;
mod slots;
mod tables;
