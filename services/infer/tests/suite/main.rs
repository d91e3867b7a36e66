//! The stage infer, run without processes.

mod mounting;
mod step;
