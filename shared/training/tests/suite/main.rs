//! Derivatives, losses, variables and the training loop.

mod derivatives;
mod gradients;
mod losses;
mod point_trainer;
mod reference;
mod trainer;
mod variables;
