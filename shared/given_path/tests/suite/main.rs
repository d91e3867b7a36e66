//! Paths of a known drive, as other programs write them, right and wrong.

mod drive;
mod real;
mod refused;
