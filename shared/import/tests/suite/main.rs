//! All tests of the crate's public interface in one program.

mod folders;
mod support;
