//! Derivatives, losses, variables and the training loop.

mod class_rows;
mod derivatives;
mod device;
mod gradients;
mod losses;
mod nearest_examples;
mod point_trainer;
mod reference;
mod terms;
mod trainer;
mod training_spheres;
mod variables;
