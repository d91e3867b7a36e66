//! Stage `acquire`: publishes a recorded drive, or a live LiDAR, as messages (thesis 2.5.1).
//!
//! The source of the pipeline. Each tick publishes one LiDAR sweep, decoded directly into shared memory, and the measurements of
//! the other sensors up to its end: camera images, raw mosaics, position fixes, inertial samples, each kind in the order of its
//! stamps. The recording is read as needed; only lists of file names and position fixes are kept in memory.
//!
//! In live mode the packets of the LiDARs on the network, the images of a grabber and the lines of a GNSS receiver and of an IMU are first
//! recorded, then decoded from the growing recording (`docs/guide/live.md`).
//!
//! A damaged image, cloud, packet or line is counted, reported once and skipped. It does not affect other data. If too large a
//! share of a sensor's data is damaged or missing, the run ends with a doubt; without any sweep it fails.
//!
//! The stage must never contain decoding, clocks or limits of its own: those are in `acquisition`. It only binds
//! settings and topics to a recorded drive or a live vehicle, and saves the position of the source. Start with
//! `acquire.rs`, which chooses between `recorded.rs` and `live.rs`; both publish by `publish.rs`.

mod acquire;
mod live;
mod publish;
mod recorded;
mod sweep;

pub use acquire::Acquire;

use acquisition::live::EmptyOrModel;

stage::settings! {
    /// Settings of acquire.
    pub struct Settings {
        /// Start of the part to read, s after the first sweep.
        pub start_s: f64 = 0.0 => stage::at_least(0.0);
        /// End of the part to read, s after the first sweep; 0 = the end of the drive.
        pub end_s: f64 = 0.0 => stage::at_least(0.0);
        /// Largest rate of a camera, Hz; faster exposures are skipped. 0 = no limit.
        pub trigger_hz: f64 = 1.0 => stage::within(0.0, 1000.0);
        /// Least distance between exposures of a camera, m; closer exposures are skipped. 0 = no limit.
        pub trigger_m: f64 = 1.0 => stage::within(0.0, 1000.0);
        /// Least share of a revolution, 0 to 1. Smaller sweeps, e.g. at both ends of a recording, are skipped.
        pub min_turn: f64 = 0.25 => stage::within(0.0, 1.0);
        /// Largest share of damaged data, 0 to 1: undecodable blocks and late packets, bytes after the damage of a
        /// capture, images, IMU lines and NMEA lines that cannot be used. A larger share is a doubt. Healthy disks and
        /// cables damage far less than 1 %.
        pub max_damaged_share: f64 = 0.01 => stage::within(0.0, 1.0);
        /// Largest share of packets that are not the LiDAR's, 0 to 1. A larger share is a doubt: the sweeps may come
        /// from the wrong sensor. Captures of a whole network have a third to a half.
        pub max_foreign_share: f64 = 0.5 => stage::within(0.0, 1.0);
        /// Largest share of exposures before the first or after the last sweep, 0 to 1. A larger share is a doubt:
        /// cameras start and end a few exposures apart from the LiDAR, but a wrong clock places all exposures outside.
        pub max_outside_share: f64 = 0.1 => stage::within(0.0, 1.0);
        /// Largest share of packets in which the LiDAR reports that its clock follows neither the pulse of a GNSS
        /// receiver (PPS) nor PTP, 0 to 1. A larger share is a doubt if there are other sensors: their stamps may come
        /// from another clock. Under bridges the pulse is absent for a while, in which the clock drifts by less than a
        /// millisecond.
        pub max_unlocked_share: f64 = 0.5 => stage::within(0.0, 1.0);
        /// Least share of GNSS epochs with position and height, 0 to 1. A smaller share is a doubt: a log of RMC without GGA
        /// sentences has no heights, and a receiver without sky has no positions.
        pub min_fix_share: f64 = 0.5 => stage::within(0.0, 1.0);
        /// Live: IPv4 address and UDP port of the LiDAR's data packets; with several LiDARs, one address for each, in
        /// the order of the rig, separated by commas. 0.0.0.0:2368 for a Velodyne or Hesai that broadcasts. Other
        /// vendors use other ports: Ouster 7502, Robosense 6699, Livox Mid-360 56301.
        pub listen: String = "127.0.0.1:2368".to_owned() => stage::any();
        /// Live: IPv4 address and UDP port of the LiDAR's position packets.
        pub position_listen: String = "127.0.0.1:8308".to_owned() => stage::any();
        /// Live: model of the LiDAR; empty = the model of the rig or, without a rig, the model in the packets. The
        /// packets of an `ouster` need a calibration file, which the rig names; an `rs32` needs one or its device
        /// packets at `position_listen` (port 7788).
        pub model: String = String::new() => EmptyOrModel;
        /// Live: folder that a grabber fills with images, in the layout of a drive folder: `camera/<k>/<stamp in
        /// ns>.jpg`, `hs02/<stamp>.pgm`, `hs02/dark`, `hs02/white`. The folders of the rig are used, and created if
        /// absent. Empty = no cameras. A relative path is relative to the folder of launch.toml.
        pub cameras: String = String::new() => stage::any();
        /// Live: source of the GNSS receiver's NMEA sentences: `udp://0.0.0.0:10110` or `serial:///dev/ttyUSB0?baud=115200`. Empty = the
        /// sentences in the LiDAR's position packets.
        pub gnss: String = String::new() => stage::any();
        /// Live: source of IMU samples, lines as in `imu.csv`: `udp://0.0.0.0:10120` or `serial:///dev/ttyUSB1?baud=921600`. Empty = no IMU.
        pub imu: String = String::new() => stage::any();
        /// Live: largest time after the end of a sweep at which an image of its time is still published, s. `colorize` waits
        /// `colorize.max_age_s` for images. Later ones are recorded and counted; more than `max_outside_share` of them are a doubt.
        pub max_late_s: f64 = 1.0 => stage::within(0.0, 60.0);
        /// Live: largest offset between the clocks of the LiDAR and of another sensor, ms. A larger one is a doubt: in
        /// 20 ms a vehicle at 36 km/h drives 0.2 m, as much as the tolerated error of odometry and colors. Images and
        /// sentences may be later by `max_late_s`, because their transmission to the host takes time.
        pub max_clock_offset_ms: f64 = 20.0 => stage::within(0.1, 1e6);
        /// Live: folder of the raw recording inside the output folder; it must not contain an earlier recording.
        pub recording: String = "recording".to_owned() => stage::any();
        /// Live: time without packets after which the run ends, s; 0 = never, and a note says that the run waits. It fails if no
        /// packet has ever arrived.
        pub quiet_s: f64 = 0.0 => stage::within(0.0, 86_400.0);
        /// Live: time with packets and without a sweep after which the run fails, s; 0 = never. The model is detected after at most 3 s.
        pub max_undecoded_s: f64 = 5.0 => stage::within(0.0, 3600.0);
        /// Live: largest backlog of revolutions; with a larger one decoding continues at the newest complete revolution.
        pub max_behind: u32 = 5 => stage::within(2, 100_000);
    }
}
