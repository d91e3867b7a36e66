//! How the command line programs `replica` and `replica-lab` speak.
//!
//! | question | module |
//! |---|---|
//! | how an answer is printed, as text or with `--json` | [`answer`] |
//! | how a value of an argument is parsed and refused | [`argument`], [`usage_error`] |
//! | how a command ends | [`exit_code`], [`error_text`] |
//! | what Ctrl-C and a closed pipe do | [`terminal`] |
//! | how help, completions and manual pages are made | [`groups`], [`completions`], [`man`] |
//!
//! What it must never do: know a command, or what a command reads. It has no file formats, no algorithms and no pictures; those are
//! in `pictures` and in `shared/`.
//!
//! Where to begin reading: [`answer::Answer`], the option of every command that prints facts, and [`exit_code::of_result`], the end of
//! both programs.

pub mod answer;
pub mod argument;
pub mod completions;
pub mod error_text;
pub mod exit_code;
pub mod groups;
pub mod man;
pub mod terminal;
pub mod usage_error;
