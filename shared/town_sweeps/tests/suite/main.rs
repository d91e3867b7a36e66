//! Properties of the simulated sweeps.

mod mounts;
mod submaps;
