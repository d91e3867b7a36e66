//! A live vehicle: the data of its sensors is first recorded, then decoded from the recording.
//!
//! | sensor | module |
//! |---|---|
//! | LiDAR: UDP packets | `sensor`, `receiver` |
//! | secondary LiDARs | `secondary_lidar` |
//! | cameras: folders that fill | `images` |
//! | GNSS receiver and IMU: lines by UDP or a serial port | `lines` |
//! | auxiliary sensors: assignment of their data to sweeps | `auxiliary` |
//! | offset of their clocks | `clocks` |
//!
//! The receiving thread writes a capture. The decoder reads the growing capture with the code that reads recorded drives. So the
//! recording contains all received packets even if decoding fails, and a run on the recording gives the same sweeps.

mod auxiliary;
mod clocks;
mod drops;
mod images;
mod line_address;
mod lines;
mod mounting;
mod receiver;
mod record_file;
mod recorded_entries;
mod recording;
mod secondary_lidar;
mod sensor;
mod vehicle;

pub use auxiliary::{AuxiliaryLimits, AuxiliaryNews, AuxiliarySensors, AuxiliarySources, DueFrame, DueRows};
pub use clocks::{ClockEstimate, Clocks};
pub use images::CameraKind;
pub use line_address::{LineAddress, LineAddressError};
pub use mounting::{EmptyOrModel, Mounting};
pub use recorded_entries::RecordedEntries;
pub use recording::captures;
pub use secondary_lidar::SecondaryLidar;
pub use sensor::{Discarded, LiveLimits, LivePoll, LiveSensor, SensorStats};
pub use vehicle::{LivePlan, LiveVehicle};

use geometry::Stamp;
use std::time::SystemTime;

/// The wall clock: the stamps of captures contain the date and hour, which the packets of some sensors lack.
fn now() -> Stamp {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Stamp(since.as_nanos() as i64)
}
