//! Surveys of simulated passes through one town, against their true positions.

mod drives;
mod points;
mod town_runs;
