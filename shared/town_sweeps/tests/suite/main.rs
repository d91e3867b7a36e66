//! Properties of the simulated sweeps.

mod ideal_camera;
mod submaps;
