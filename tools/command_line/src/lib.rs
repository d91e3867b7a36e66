//! How the command line programs `replica` and `replica-lab` speak.

pub mod answer;
pub mod argument;
pub mod completions;
pub mod error_text;
pub mod exit_code;
pub mod groups;
pub mod man;
pub mod terminal;
pub mod usage_error;
