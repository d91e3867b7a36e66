//! The commands of `replica-lab`, run as processes.

mod bench;
mod color_lines;
mod commands;
mod cube;
mod evaluate_classes;
mod evaluate_instances;
mod evaluate_run;
#[path = "../../../replica/tests/suite/finished_run.rs"]
mod finished_run;
mod fuse;
mod json;
mod projections;
#[path = "../../../replica/tests/suite/returns.rs"]
mod returns;
mod spectrum;
mod support;
