//! Neighborhoods and samples compared with a search over all points.

mod clouds;
mod definitions;
mod nearest;
mod samples;
mod threads;
mod within;
