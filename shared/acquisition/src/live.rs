//! A LiDAR on the network: its packets are first recorded, then decoded from the recording.
//!
//! The receiving thread writes a capture. The decoder reads the growing capture with the code that reads recorded drives. So the
//! recording contains all received packets even if decoding fails, and a run on the recording gives the same sweeps.

mod drops;
mod mounting;
mod other;
mod receiver;
mod recording;
mod sensor;
mod setup;

pub use mounting::Mounting;
pub use other::LiveOther;
pub use recording::captures;
pub use sensor::{Discarded, LiveLimits, LivePoll, LiveSensor};
pub use setup::LiveSetup;
