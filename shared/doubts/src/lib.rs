//! Doubts: reasons not to rely on the results of a run as they are.
//!
//! A run with a doubt is complete, but ends with exit code 3. The library or stage that finds one constructs a variant of
//! [`Doubt`], which holds the figures and writes the text that operators read (`doubt/text.rs`). A reader of `summary.json` has only the name,
//! and finds its [`DoubtKind`]: subject, [`Severity`] and what to do.
//!
//! This crate must never judge: it has no limits and no defaults, reads no file and no clock, and depends on no topic.
//! The library or stage that states a doubt also decides when. Names, sizes and texts are an interface: programs read
//! them in `summary.json`, in `report.json` and in the metrics, so they change only with an entry in the changelog.
//!
//! | question | where |
//! |---|---|
//! | Which doubts exist, in which stage, how severe are they, and what is to be done? | the table in [`kind`](DoubtKind) |
//! | Which figures does a doubt have, and what does its text say? | [`Doubt`] |
//! | How is a doubt found by its name in a summary? | [`DoubtKind::from_name`] |
//!
//! Start with the table in `kind.rs`. To add a doubt, add a row there, a variant to [`Doubt`], and an entry in
//! `docs/reference/doubts.md`; the compiler and the test of that page find what is missing. Third-party stages state
//! their own doubts by name and text (`stage::Outputs::doubt`); those have no kind.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod doubt;
mod kind;

pub use doubt::{Doubt, ExposureUse, FixReading};
pub use kind::{DoubtKind, Severity, Stage, Subject};
