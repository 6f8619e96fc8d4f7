//! The path tracer against answers from outside.

mod closed_forms;
