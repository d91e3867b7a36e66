//! Settings, declared once: key, type, default, rule and meaning of each in one line.
//!
//! One declaration by [`settings!`] generates the struct that a program uses, the check of a table of launch.toml, and
//! the description that `--describe`, `--help` and the reference page of settings show. Therefore the three cannot
//! differ.
//!
//! A setting with a fixed set of words is an enum, declared by [`words!`]: one list gives the words in launch.toml, the rule
//! ("must be one of ...") and the variants of a `match`. A word that a program does not handle does not compile.
//!
//! | module | content |
//! |---|---|
//! | `declare` | [`settings!`] |
//! | `word` | [`words!`], [`Word`] |
//! | `rule` | [`Rule`] and the rules: [`within`], [`one_word`] ... |
//! | `field` | [`Field`] and [`Settings`]: the results of a declaration |
//! | `table` | [`parse_table`]: a table with all its [`Problem`]s |
//!
//! The supervisor, the stages, the simulator and the tools that query them use it. The crate must never read a file,
//! refer to a table by its name, or depend on another crate of the project: positions in launch.toml and changes of the
//! command line belong to `run::launch_file`.
//!
//! Start with the example of [`settings!`], then read `rule`. To add a setting, add a line to the `settings!` of its
//! stage; to add a word, add a line to its `words!`, and the compiler shows where it must be handled.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod declare;
mod field;
mod rule;
mod table;
mod word;

pub use field::{Field, SettingError, Settings};
pub use rule::{Rule, any, at_least, list_of_words, one_word, within, zero_or_within};
pub use table::{Problem, nearest_key, parse_table};
pub use word::{UnknownWord, Word, words_of};

/// Rules for words that are known only at run time, such as the words of a stage in Python. In Rust, declare
/// [`words!`].
pub mod run_time_words {
    pub use crate::rule::{each_one_of, one_of};
}

#[doc(hidden)]
pub use field::default_text;
#[doc(hidden)]
pub use word::{deserialize_word, parse_word};
#[doc(hidden)]
pub use {serde, toml};
