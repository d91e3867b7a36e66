//! All tests of the stage in one program.

mod extensions;
mod step;
mod support;
