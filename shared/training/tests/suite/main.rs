//! Derivatives, losses, variables and the training loop.

mod class_rows;
mod derivatives;
mod device;
mod gradients;
mod losses;
mod point_trainer;
mod reference;
mod terms;
mod trainer;
mod variables;
