//! The stage on hand-made mosaics of known reflectance, and on a simulated drive.

mod simulated;
mod step;
