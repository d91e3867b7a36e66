//! All tests of the crate's public interface in one program.

mod clock_reference;
mod damaged_input;
mod driver_clouds;
mod nmea_log;
mod other_makers;
mod packet_streams;
mod real_captures;
mod receiver_logs;
mod support;
mod veloview_reference;
