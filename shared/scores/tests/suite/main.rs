//! Scores of hand-made examples.

mod instances;
