//! The stage on hand-made mosaics of known reflectance, and on a simulated drive.

mod mosaics;
mod regions;
mod simulated;
mod step;
