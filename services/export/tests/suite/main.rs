//! All tests of the stage in one program.

mod placement;
mod step;
mod support;
