//! All tests of the crate's public interface in one program.

mod damaged_input;
mod drives;
mod several_lidars;
