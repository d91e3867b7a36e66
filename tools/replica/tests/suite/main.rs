//! The commands of `replica`, run as processes.

mod color_lines;
mod commands;
mod compare;
mod cube;
mod deliver;
mod evaluate_classes;
mod evaluate_run;
mod finished_run;
mod fuse;
mod inspect_drive;
mod instances;
mod json;
mod setup;
mod spectrum;
mod support;
mod view;
