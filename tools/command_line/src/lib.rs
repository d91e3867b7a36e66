//! Conventions of the command line programs `replica` and `replica-lab`.
//!
//! | question | module |
//! |---|---|
//! | how an answer is printed, as text or with `--json` | [`answer`] |
//! | how a value of an argument is parsed and refused | [`argument`], [`usage_error`] |
//! | how a command ends | [`exit_code`], [`error_text`] |
//! | what Ctrl-C and a closed pipe do | [`terminal`] |
//! | how many threads a parallel loop has at most | [`threads`] |
//! | how help, completions and manual pages are made | [`groups`], [`completions`], [`man`] |
//!
//! It must never depend on a command or its inputs. It has no file formats, no algorithms and no pictures; they are in `pictures`
//! and in `shared/`.
//!
//! Start reading at [`answer::Answer`], the option of every command that prints facts, and [`exit_code::from_result`], the end of
//! both programs.

pub mod answer;
pub mod argument;
pub mod completions;
pub mod error_text;
pub mod exit_code;
pub mod groups;
pub mod man;
pub mod terminal;
pub mod threads;
pub mod usage_error;
