//! All tests of the crate's public interface in one program.

mod damaged_input;
mod envi;
mod jpeg;
mod ladybug;
mod ply;
mod raw_mosaic;
mod sensor_calibration;
