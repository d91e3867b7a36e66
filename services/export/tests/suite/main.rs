//! All tests of the stage in one program.

mod doubts;
mod placement;
mod step;
mod support;
