//! Coloring against the truth of a simulated town, and of painted images.

mod occlusion;
mod sky;
