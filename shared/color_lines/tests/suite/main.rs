//! Models of synthetic and real images.

mod lines;
mod regions;
mod scikit_learn;
mod support;
