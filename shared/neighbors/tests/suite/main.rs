//! Neighborhoods and samples equal those of a search over all points.

mod clouds;
mod definitions;
mod nearest;
mod samples;
mod threads;
mod within;
