//! All tests of the crate's public interface in one program.

mod clock_reference;
mod damaged_input;
mod driver_clouds;
mod drives;
mod envi;
mod jpeg;
mod ladybug;
mod nmea_log;
mod other_makers;
mod packet_streams;
mod ply;
mod raw_mosaic;
mod real_captures;
mod recording;
mod rewritten_recording;
mod sensor_calibration;
mod several_lidars;
mod support;
mod veloview_reference;
