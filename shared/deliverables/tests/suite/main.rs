//! Deliveries of small runs, read back.

mod copc;
mod support;
mod tiles;
