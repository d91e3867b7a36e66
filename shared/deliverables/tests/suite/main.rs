//! Deliveries of small runs, read back.

mod support;
mod tiles;
