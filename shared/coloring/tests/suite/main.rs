//! Coloring compared with the ground truth of a simulated town and of painted images.

mod occlusion;
mod sky;
