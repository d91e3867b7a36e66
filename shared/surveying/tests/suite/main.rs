//! Deliveries of small runs, read back.

mod check_points;
mod copc;
mod others;
mod rasters;
mod support;
mod tiles;
