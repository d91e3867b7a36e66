//! The commands of `replica`, run as processes.

mod commands;
mod compare;
mod cube;
mod instances;
mod spectrum;
mod support;
