//! acquire: a recorded drive as messages (thesis 2.5.1).
//!
//! The source of the pipeline. A tick is one LiDAR sweep, decoded straight into the slot from which it is read, and with it
//! everything that the other sensors measured before that sweep ended: camera images, raw mosaics, position fixes, inertial
//! samples, each kind in the order of its stamps. The recording is read as it is needed; nothing but lists of file names and
//! position fixes is held.
//!
//! What is damaged costs itself alone: a broken image, cloud, packet or line is counted, said once, and left out.

mod acquire;
mod events;
mod frames;
mod inertial;
mod odometer;
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
    }
}
