//! The stage infer, run without processes.

mod step;
