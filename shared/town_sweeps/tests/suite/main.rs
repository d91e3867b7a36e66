//! Properties of the simulated sweeps.

mod ideal_camera;
mod mounts;
mod submaps;
