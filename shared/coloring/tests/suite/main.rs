//! Coloring against the truth of a simulated town.

mod occlusion;
