//! All tests of the crate's public interface in one program.

mod folders;
mod ros;
mod ros_damage;
mod ros_real;
mod support;
