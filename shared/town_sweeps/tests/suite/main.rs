//! Properties of the simulated sweeps.

mod submaps;
