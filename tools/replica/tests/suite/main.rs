//! The commands of `replica`, run as processes.

mod commands;
mod compare;
mod deliver;
#[allow(dead_code, reason = "the tests of replica-lab read more of it")]
mod finished_run;
mod inspect_drive;
mod instances;
mod json;
mod returns;
mod scene;
mod setup;
mod support;
mod survey;
mod view;
