//! All tests of the crate's public interface in one program.

mod damaged_input;
mod recording;
mod rewritten_recording;
