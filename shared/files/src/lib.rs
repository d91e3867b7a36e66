//! Helpers for files: atomic replacement, bounded reading of text, TOML with positions, problems of a file, the calendar.
//!
//! Settings, manifests and state files are small texts that people edit. This crate reads them so that every fault is
//! reported with file, line, key and rule, and writes files so that a crash or a full disk leaves either the old content
//! or the new one.
//!
//! - [`atomic_file`]: write to a temporary file, synchronize it, rename it.
//! - [`regular_file`]: open and read files that users name; pipes, devices and endless files are refused.
//! - [`shell`]: words of a shell, for commands in messages.
//! - [`text_file`]: read a text of at most a given size; devices, folders and larger files are refused.
//! - [`toml_file`], [`toml_nesting`]: parse TOML with the line of each key; deep nesting is refused before it is parsed.
//! - [`problems`]: all faults of one file, reported together.
//! - [`csv`]: a text of a user as a cell of a table.
//! - [`names`]: natural order of file names, numbers in names and missing numbers.
//! - [`calendar`]: dates and times of day to and from days since 1970.
//!
//! **Never**: file formats of sensors or of other programs (see the crates `formats`, `lidar`, `drive` and `recording`).
//!
//! **Start reading** at [`atomic_file::write_atomic`], then [`toml_file`].

pub mod atomic_file;
pub mod calendar;
pub mod csv;
pub mod names;
pub mod problems;
pub mod regular_file;
pub mod shell;
pub mod text_file;
pub mod toml_file;
pub mod toml_nesting;
