//! `replica`: the command line tool beside `replica-launch`. Data goes to stdout, diagnostics go to stderr.

mod answer;
mod argument;
mod byte_values;
mod class_color;
mod cli;
mod cloud_files;
mod cloud_picture;
mod control;
mod data;
mod error_text;
mod exit_code;
mod lab;
mod material_color;
mod setup;
mod terminal;
mod usage_error;

use std::process::ExitCode;

fn main() -> ExitCode {
    let command = cli::parse();
    command.run().unwrap_or_else(|error| {
        eprintln!("error: {}", error_text::error_text(&error));
        exit_code::of_error(&error)
    })
}
