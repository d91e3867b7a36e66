//! The three stages, step by step.

mod step;
