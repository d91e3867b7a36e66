//! acquire: a recorded drive, or a live LiDAR, as messages (thesis 2.5.1).
//!
//! The source of the pipeline. A tick is one LiDAR sweep, decoded straight into the slot from which it is read, and with it
//! everything that the other sensors measured before that sweep ended: camera images, raw mosaics, position fixes, inertial
//! samples, each kind in the order of its stamps. The recording is read as it is needed; nothing but lists of file names and
//! position fixes is held.
//!
//! In live mode the packets of a LiDAR on the network are recorded first and decoded from the recording as it grows
//! (`docs/live.md`).
//!
//! What is damaged costs itself alone: a broken image, cloud, packet or line is counted, said once, and left out.

mod acquire;
mod drops;
mod events;
mod frames;
mod inertial;
mod live;
mod odometer;
mod publish;
mod receiver;
mod recorded;
mod recording;
mod sweep;
mod trigger;

pub use acquire::Acquire;

stage::settings! {
    /// Settings of acquire.
    pub struct Settings {
        /// Start of the part that is read, s after the first sweep.
        pub start_s: f64 = 0.0 => stage::at_least(0.0);
        /// End of the part that is read, s after the first sweep; 0 = the end of the drive.
        pub end_s: f64 = 0.0 => stage::at_least(0.0);
        /// Exposures of a camera that follow faster are left out, Hz; 0 = none.
        pub trigger_hz: f64 = 1.0 => stage::within(0.0, 1000.0);
        /// Exposures of a camera that has moved less since the last one are left out, m; 0 = none.
        pub trigger_m: f64 = 1.0 => stage::within(0.0, 1000.0);
        /// Sweeps that cover a smaller share of a turn, as at either end of a recording, are left out, 0 to 1.
        pub min_turn: f64 = 0.25 => stage::within(0.0, 1.0);
        /// Live: IPv4 address and UDP port for the LiDAR's data packets; a sensor that broadcasts needs 0.0.0.0:2368.
        pub listen: String = "127.0.0.1:2368".to_owned() => stage::any();
        /// Live: IPv4 address and UDP port for the LiDAR's position packets.
        pub position_listen: String = "127.0.0.1:8308".to_owned() => stage::any();
        /// Live: the LiDAR; empty = that of the rig or, without one, the one that the packets name.
        pub model: String = String::new() => stage::one_of(&["", "hdl32e", "vlp16", "hdl64e"]);
        /// Live: drive.toml whose LiDAR's mounting the recording takes over; empty = the one in the drive's folder or, without
        /// one, body and lidar frame are one.
        pub rig: String = String::new() => stage::any();
        /// Live: folder of the raw recording in the output folder; it must not hold an earlier one.
        pub recording: String = "recording".to_owned() => stage::any();
        /// Live: the run ends when no packet has come for so long after the first one, s; 0 = never.
        pub quiet_s: f64 = 0.0 => stage::within(0.0, 86_400.0);
        /// Live: when decoding is more revolutions behind, it goes on with the newest whole one.
        pub max_behind: u32 = 5 => stage::within(2, 100_000);
    }
}
