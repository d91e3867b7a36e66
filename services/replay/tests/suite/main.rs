//! The stage, step by step.

mod step;
