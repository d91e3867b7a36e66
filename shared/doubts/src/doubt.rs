//! Doubts with their figures, and the texts that operators read.

use crate::DoubtKind;
use std::borrow::Cow;
use std::fmt::{self, Display, Formatter};

/// Exposures of one or more cameras.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExposureUse {
    /// Exposures that arrived.
    pub received: u64,
    /// Exposures that do not match the rig.
    pub unusable: u64,
    /// Exposures at a time without a pose.
    pub without_pose: u64,
}

/// A reason not to rely on a result. Shares are parts of 1; a limit is the value of the setting that the text names.
#[derive(Clone, Debug, PartialEq)]
pub enum Doubt {
    /// A doubt about the packets, sweeps or clock of a secondary LiDAR.
    SecondaryLidar {
        /// Name of the LiDAR.
        lidar: String,
        /// The doubt.
        doubt: Box<Self>,
    },
    /// [`DoubtKind::ForeignPackets`].
    ForeignPackets {
        /// Share of all packets.
        share: f64,
        /// All packets.
        n_packets: u64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::DamagedPackets`].
    DamagedPackets {
        /// Share of the packets of the LiDAR.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::UnreadCaptures`].
    UnreadCaptures {
        /// Share of the bytes.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::BadSweeps`].
    BadSweeps {
        /// Share of the files.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::BadImages`].
    BadImages {
        /// Share of the files.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::BadMosaics`].
    BadMosaics {
        /// Share of the files.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::BadNmeaLines`].
    BadNmeaLines {
        /// Share of the lines.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::BadImuLines`].
    BadImuLines {
        /// Share of the lines.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::MissingSweeps`].
    MissingSweeps {
        /// Share of the sweeps of the first LiDAR.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::FewFixes`].
    FewFixes {
        /// Share of the epochs with position and height.
        share: f64,
        /// All epochs.
        n_epochs: u64,
        /// Least share.
        limit: f64,
    },
    /// [`DoubtKind::ExposuresOutside`].
    ExposuresOutside {
        /// Share of all exposures.
        share: f64,
        /// All exposures.
        n_frames: u64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::LateExposures`].
    LateExposures {
        /// Share of all exposures.
        share: f64,
        /// All exposures.
        n_frames: u64,
        /// Latest arrival after the sweep of their time, s.
        max_late_s: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::PpsNotLocked`].
    PpsNotLocked {
        /// Share of the packets that report the state of the clock.
        share: f64,
        /// These packets.
        n_states: u64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::CutCaptures`].
    CutCaptures {
        /// Captures that end inside a packet.
        n_captures: u64,
    },
    /// [`DoubtKind::ClocksSetBack`].
    ClocksSetBack {
        /// Number of steps back.
        n_steps: u64,
        /// Sum of the steps, s.
        back_s: f64,
    },
    /// [`DoubtKind::MissingFiles`].
    MissingFiles {
        /// Number of missing files.
        n_files: u64,
        /// The first gap: files around it and missing numbers.
        first: String,
    },
    /// [`DoubtKind::ClockOffset`].
    ClockOffset {
        /// The sensor.
        sensor: String,
        /// Delay of its stamps relative to the stamps of the LiDAR, s; negative: ahead.
        behind_s: f64,
        /// Largest offset, s.
        limit_s: f64,
        /// Longest delay of the data in transit to the host, s.
        delay_s: f64,
    },
    /// [`DoubtKind::SilentSensors`].
    SilentSensors {
        /// Their names.
        sensors: Vec<String>,
    },
    /// [`DoubtKind::NoSweep`].
    NoSweep {
        /// Packets received.
        n_packets: u64,
    },
    /// [`DoubtKind::NoUsableFix`].
    NoUsableFix {
        /// Fixes without a position.
        n_invalid: u64,
    },
    /// [`DoubtKind::FewFixesUsed`].
    FewFixesUsed {
        /// Fixes that were used.
        n_used: usize,
        /// All fixes.
        n: usize,
        /// Their quotient.
        share: f64,
        /// Least share.
        limit: f64,
        /// Why they were not used.
        reason: String,
    },
    /// [`DoubtKind::ReceiverDelay`].
    ReceiverDelay {
        /// Delay of the stamps, s; negative: early.
        late_s: f64,
    },
    /// [`DoubtKind::MotionContested`].
    MotionContested {
        /// Time of all stretches, s.
        seconds: f64,
        /// Longest time, s.
        limit_s: f64,
        /// The stretches.
        stretches: String,
    },
    /// [`DoubtKind::PathLost`].
    PathLost {
        /// Growth of the deviation of position and heading, m.
        growth_m: f64,
        /// Largest growth, m.
        limit_m: f64,
        /// Distance at which a heading error is converted to metres, m.
        lever_m: f64,
        /// Time of all stretches, s.
        seconds: f64,
        /// The stretches.
        stretches: String,
    },
    /// [`DoubtKind::PathUnmatched`].
    PathUnmatched {
        /// Sweeps without a match in the stretches.
        n_unmatched: u64,
        /// All sweeps.
        n_sweeps: u64,
        /// Time of these sweeps, s.
        seconds: f64,
        /// Path of these sweeps, m.
        path_m: f64,
        /// Longest time, s.
        limit_s: f64,
        /// The stretches.
        stretches: String,
    },
    /// [`DoubtKind::NoSweepMatched`].
    NoSweepMatched {
        /// All sweeps.
        n_sweeps: u64,
        /// Time of the drive, s.
        seconds: f64,
    },
    /// [`DoubtKind::ImuNotUsed`].
    ImuNotUsed {
        /// Contradiction to the LiDAR, as a text.
        reason: String,
    },
    /// [`DoubtKind::FewPointsColored`].
    FewPointsColored {
        /// Share of the points with a color.
        share: f64,
        /// Least share.
        limit: f64,
        /// All images.
        exposures: ExposureUse,
    },
    /// [`DoubtKind::NoSpectra`].
    NoSpectra {
        /// All cubes.
        exposures: ExposureUse,
    },
    /// [`DoubtKind::ImagesUnused`].
    ImagesUnused {
        /// The largest share of a camera.
        share: f64,
        /// Largest allowed share.
        limit: f64,
        /// The cameras beyond the limit, with their exposures.
        cameras: Vec<String>,
    },
    /// [`DoubtKind::CubesUnused`].
    CubesUnused {
        /// The largest share of a camera.
        share: f64,
        /// Largest allowed share.
        limit: f64,
        /// The cameras beyond the limit, with their exposures.
        cameras: Vec<String>,
    },
    /// [`DoubtKind::PointsUnseen`].
    PointsUnseen {
        /// Share of the points.
        share: f64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::LidarMisplaced`].
    LidarMisplaced {
        /// Submaps in which the ground is not where the mounting puts it.
        n_misplaced: u64,
        /// All submaps.
        n_submaps: u64,
        /// Largest share.
        limit: f64,
        /// What was found, as a text.
        found: String,
    },
    /// [`DoubtKind::ForeignIntensities`].
    ForeignIntensities {
        /// Submaps on another scale.
        n_foreign: u64,
        /// All submaps.
        n_submaps: u64,
        /// Largest share.
        limit: f64,
        /// Use of these intensities, as a text.
        treatment: String,
    },
    /// [`DoubtKind::SubmapsCoarsened`].
    SubmapsCoarsened {
        /// Submaps whose cells were enlarged.
        n_coarsened: u64,
        /// All submaps.
        n_submaps: u64,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::HeadingUndetermined`].
    HeadingUndetermined {
        /// Largest standard deviation of a submap, degrees.
        largest_deg: f64,
        /// Deviation, limit and median as a text.
        reason: String,
    },
    /// [`DoubtKind::PositionUncertain`].
    PositionUncertain {
        /// Largest standard deviation of a submap, m.
        largest_m: f64,
        /// Median of all submaps, m.
        median_m: f64,
        /// Limit, m.
        limit_m: f64,
    },
    /// [`DoubtKind::HeightUncertain`].
    HeightUncertain {
        /// Largest standard deviation of a submap, m.
        largest_m: f64,
        /// Median of all submaps, m.
        median_m: f64,
        /// Limit, m.
        limit_m: f64,
    },
    /// [`DoubtKind::NoSubmaps`].
    NoSubmaps,
    /// [`DoubtKind::NoPoints`].
    NoPoints {
        /// Submaps, all of them empty.
        n_clouds: usize,
    },
    /// [`DoubtKind::LostColumns`].
    LostColumns {
        /// Columns that were dropped.
        n_lost: u64,
        /// All columns.
        n_columns: usize,
        /// Largest share.
        limit: f64,
    },
    /// [`DoubtKind::CloudsWithoutPlace`].
    CloudsWithoutPlace {
        /// Clouds in the odometry frame.
        n_without: u64,
        /// All clouds.
        n_clouds: usize,
    },
    /// [`DoubtKind::RecordingIncomplete`].
    RecordingIncomplete {
        /// Where the recording ends.
        fault: String,
        /// Share of the drive that was replayed.
        progress: f64,
    },
    /// [`DoubtKind::TopicsNotReplayed`].
    TopicsNotReplayed {
        /// The topics.
        topics: Vec<String>,
    },
}

impl Doubt {
    /// Kind of the doubt.
    pub fn kind(&self) -> DoubtKind {
        match self {
            Self::SecondaryLidar { doubt, .. } => doubt.kind(),
            Self::ForeignPackets { .. } => DoubtKind::ForeignPackets,
            Self::DamagedPackets { .. } => DoubtKind::DamagedPackets,
            Self::UnreadCaptures { .. } => DoubtKind::UnreadCaptures,
            Self::BadSweeps { .. } => DoubtKind::BadSweeps,
            Self::BadImages { .. } => DoubtKind::BadImages,
            Self::BadMosaics { .. } => DoubtKind::BadMosaics,
            Self::BadNmeaLines { .. } => DoubtKind::BadNmeaLines,
            Self::BadImuLines { .. } => DoubtKind::BadImuLines,
            Self::MissingSweeps { .. } => DoubtKind::MissingSweeps,
            Self::FewFixes { .. } => DoubtKind::FewFixes,
            Self::ExposuresOutside { .. } => DoubtKind::ExposuresOutside,
            Self::LateExposures { .. } => DoubtKind::LateExposures,
            Self::PpsNotLocked { .. } => DoubtKind::PpsNotLocked,
            Self::CutCaptures { .. } => DoubtKind::CutCaptures,
            Self::ClocksSetBack { .. } => DoubtKind::ClocksSetBack,
            Self::MissingFiles { .. } => DoubtKind::MissingFiles,
            Self::ClockOffset { .. } => DoubtKind::ClockOffset,
            Self::SilentSensors { .. } => DoubtKind::SilentSensors,
            Self::NoSweep { .. } => DoubtKind::NoSweep,
            Self::NoUsableFix { .. } => DoubtKind::NoUsableFix,
            Self::FewFixesUsed { .. } => DoubtKind::FewFixesUsed,
            Self::ReceiverDelay { .. } => DoubtKind::ReceiverDelay,
            Self::MotionContested { .. } => DoubtKind::MotionContested,
            Self::PathLost { .. } => DoubtKind::PathLost,
            Self::PathUnmatched { .. } => DoubtKind::PathUnmatched,
            Self::NoSweepMatched { .. } => DoubtKind::NoSweepMatched,
            Self::ImuNotUsed { .. } => DoubtKind::ImuNotUsed,
            Self::FewPointsColored { .. } => DoubtKind::FewPointsColored,
            Self::NoSpectra { .. } => DoubtKind::NoSpectra,
            Self::ImagesUnused { .. } => DoubtKind::ImagesUnused,
            Self::CubesUnused { .. } => DoubtKind::CubesUnused,
            Self::PointsUnseen { .. } => DoubtKind::PointsUnseen,
            Self::LidarMisplaced { .. } => DoubtKind::LidarMisplaced,
            Self::ForeignIntensities { .. } => DoubtKind::ForeignIntensities,
            Self::SubmapsCoarsened { .. } => DoubtKind::SubmapsCoarsened,
            Self::HeadingUndetermined { .. } => DoubtKind::HeadingUndetermined,
            Self::PositionUncertain { .. } => DoubtKind::PositionUncertain,
            Self::HeightUncertain { .. } => DoubtKind::HeightUncertain,
            Self::NoSubmaps => DoubtKind::NoSubmaps,
            Self::NoPoints { .. } => DoubtKind::NoPoints,
            Self::LostColumns { .. } => DoubtKind::LostColumns,
            Self::CloudsWithoutPlace { .. } => DoubtKind::CloudsWithoutPlace,
            Self::RecordingIncomplete { .. } => DoubtKind::RecordingIncomplete,
            Self::TopicsNotReplayed { .. } => DoubtKind::TopicsNotReplayed,
        }
    }

    /// Name in `summary.json`, unique in the stage.
    pub fn name(&self) -> Cow<'static, str> {
        match self {
            Self::SecondaryLidar { lidar, doubt } => format!("{}_{lidar}", doubt.name()).into(),
            _ => self.kind().name().into(),
        }
    }

    /// The value that exceeds its limit, in the unit that the text states; 0 if there is no value.
    pub fn size(&self) -> f64 {
        match self {
            Self::SecondaryLidar { doubt, .. } => doubt.size(),
            Self::ForeignPackets { share, .. }
            | Self::DamagedPackets { share, .. }
            | Self::UnreadCaptures { share, .. }
            | Self::BadSweeps { share, .. }
            | Self::BadImages { share, .. }
            | Self::BadMosaics { share, .. }
            | Self::BadNmeaLines { share, .. }
            | Self::BadImuLines { share, .. }
            | Self::MissingSweeps { share, .. }
            | Self::FewFixes { share, .. }
            | Self::ExposuresOutside { share, .. }
            | Self::LateExposures { share, .. }
            | Self::PpsNotLocked { share, .. }
            | Self::FewFixesUsed { share, .. }
            | Self::FewPointsColored { share, .. }
            | Self::ImagesUnused { share, .. }
            | Self::CubesUnused { share, .. }
            | Self::PointsUnseen { share, .. } => *share,
            Self::CutCaptures { n_captures } => *n_captures as f64,
            Self::ClocksSetBack { back_s, .. } => *back_s,
            Self::MissingFiles { n_files, .. } => *n_files as f64,
            Self::ClockOffset { behind_s, .. } => behind_s.abs(),
            Self::SilentSensors { sensors } => sensors.len() as f64,
            Self::NoSweep { n_packets } => *n_packets as f64,
            Self::ReceiverDelay { late_s } => late_s.abs(),
            Self::MotionContested { seconds, .. } | Self::PathUnmatched { seconds, .. } => *seconds,
            Self::NoSweepMatched { n_sweeps, .. } => *n_sweeps as f64,
            Self::PathLost { growth_m, .. } => *growth_m,
            Self::ImuNotUsed { .. } => 1.0,
            Self::LidarMisplaced { n_misplaced, n_submaps, .. } => share(*n_misplaced, *n_submaps),
            Self::ForeignIntensities { n_foreign, n_submaps, .. } => share(*n_foreign, *n_submaps),
            Self::SubmapsCoarsened { n_coarsened, n_submaps, .. } => share(*n_coarsened, *n_submaps),
            Self::HeadingUndetermined { largest_deg, .. } => *largest_deg,
            Self::PositionUncertain { largest_m, .. } | Self::HeightUncertain { largest_m, .. } => *largest_m,
            Self::LostColumns { n_lost, n_columns, .. } => share(*n_lost, *n_columns as u64),
            Self::CloudsWithoutPlace { n_without, n_clouds } => share(*n_without, *n_clouds as u64),
            Self::RecordingIncomplete { progress, .. } => *progress,
            Self::TopicsNotReplayed { topics } => topics.len() as f64,
            Self::NoUsableFix { .. } | Self::NoSpectra { .. } | Self::NoSubmaps | Self::NoPoints { .. } => 0.0,
        }
    }
}

/// States what is doubtful, its size, the limit that it exceeds and what to do.
impl Display for Doubt {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::SecondaryLidar { lidar, doubt } => write!(f, "LiDAR {lidar}: {doubt}"),
            Self::ForeignPackets { share, n_packets, limit } => write!(
                f,
                "{} of the {n_packets} packets are foreign or too short, more than max_foreign_share = {limit}; check that \
                 the sweeps are from the right sensor",
                percent(*share)
            ),
            Self::DamagedPackets { share, limit } => {
                damaged(f, *share, "of the LiDAR's packets arrived too late or have undecodable blocks", *limit)
            }
            Self::UnreadCaptures { share, limit } => {
                damaged(f, *share, "of the bytes of the captures follow a damaged part and are not read", *limit)
            }
            Self::BadSweeps { share, limit } => damaged(f, *share, "of the sweep files cannot be read", *limit),
            Self::BadImages { share, limit } => {
                damaged(f, *share, "of the images are damaged or have the wrong size", *limit)
            }
            Self::BadMosaics { share, limit } => {
                damaged(f, *share, "of the mosaics are damaged or have the wrong size", *limit)
            }
            Self::BadNmeaLines { share, limit } => damaged(f, *share, "of the NMEA lines are damaged", *limit),
            Self::BadImuLines { share, limit } => {
                damaged(f, *share, "of the IMU lines are damaged or impossible", *limit)
            }
            Self::MissingSweeps { share, limit } => {
                damaged(f, *share, "of the sweeps of the first LiDAR have no returns of this LiDAR", *limit)
            }
            Self::FewFixes { share, n_epochs, limit } => write!(
                f,
                "only {} of the {n_epochs} GNSS epochs have position and height, less than min_fix_share = {limit}; the \
                 receiver must log GGA and RMC sentences",
                percent(*share)
            ),
            Self::ExposuresOutside { share, n_frames, limit } => write!(
                f,
                "{} of the {n_frames} exposures lie before the first or after the last sweep, more than max_outside_share = \
                 {limit}; check the clocks of cameras and LiDAR",
                percent(*share)
            ),
            Self::LateExposures { share, n_frames, max_late_s, limit } => write!(
                f,
                "{} of the {n_frames} exposures arrived more than max_late_s = {max_late_s} after the sweep of their time and colored \
                 nothing, more than max_outside_share = {limit}; they are recorded; check the grabber and its clock",
                percent(*share)
            ),
            Self::PpsNotLocked { share, n_states, limit } => write!(
                f,
                "in {} of the {n_states} packets that report it, the clock of the LiDAR follows neither PPS nor PTP, more than \
                 max_unlocked_share = {limit}; stamps of the other sensors may come from another clock",
                percent(*share)
            ),
            Self::CutCaptures { n_captures } => write!(
                f,
                "{n_captures} capture(s) end inside a packet: the recorder did not finish them, and an unknown part of the drive is \
                 missing"
            ),
            Self::ClocksSetBack { n_steps, back_s } => write!(
                f,
                "the clocks of LiDAR and recorder step back together {n_steps} time(s), by {back_s:.1} s in all; the stamps after a \
                 step continue without a gap and are late by the step, so other sensors do not match"
            ),
            Self::MissingFiles { n_files, first } => write!(f, "{n_files} file(s) of sweeps are missing: {first}"),
            Self::ClockOffset { sensor, behind_s, limit_s, delay_s } => {
                clock_offset(f, sensor, *behind_s, *limit_s, *delay_s)
            }
            Self::SilentSensors { sensors } => {
                write!(f, "drive.toml names sensors without any data within the sweeps: {}", sensors.join(", "))
            }
            Self::NoSweep { n_packets } => {
                write!(f, "{n_packets} packets were received and recorded, but none gave a sweep")
            }
            Self::NoUsableFix { n_invalid } => write!(
                f,
                "the drive has a GNSS receiver, but no usable fix ({n_invalid} arrived without a position): the result is not \
                 georeferenced; does the receiver send positions with heights (NMEA GGA)?"
            ),
            Self::FewFixesUsed { n_used, n, share, limit, reason } => {
                write!(f, "{n_used} of {n} fixes used ({:.0} %, limit {:.0} %): {reason}", 100.0 * share, 100.0 * limit)
            }
            Self::ReceiverDelay { late_s } => write!(
                f,
                "the stamps of the GNSS receiver are at least {:.1} s {} by its velocities, which is not corrected; \
                 check its clock against the clock of the LiDAR",
                late_s.abs(),
                if *late_s > 0.0 { "late" } else { "early" }
            ),
            Self::MotionContested { seconds, limit_s, stretches } => write!(
                f,
                "the ego-motion is ambiguous for {seconds:.1} s of the drive, more than {limit_s} s: the scene fits other along-track \
                 positions about as well, as in moving traffic ({stretches}); the vehicle may have driven farther than the result \
                 says"
            ),
            Self::PathLost { growth_m, limit_m, lever_m, seconds, stretches } => write!(
                f,
                "the scene did not constrain the motion for {seconds:.1} s of the drive ({stretches}): there the deviation of position and \
                 heading grew by {growth_m:.1} m within {lever_m} m, more than {limit_m} m; the path may be shorter, longer or bent"
            ),
            Self::PathUnmatched { n_unmatched, n_sweeps, seconds, path_m, limit_s, stretches } => write!(
                f,
                "{n_unmatched} of {n_sweeps} sweeps have no match that supports the path, for {seconds:.1} s and {path_m:.1} m \
                 of it, more than max_unmatched_s = {limit_s} ({stretches}): there the path is a prediction, or rest, whatever \
                 its stated deviation; look at the clouds there"
            ),
            Self::NoSweepMatched { n_sweeps, seconds } => write!(
                f,
                "none of the {n_sweeps} sweeps of {seconds:.1} s matches another: the result has no path, and all clouds lie at \
                 the start; check model, rings and point times of the LiDAR, and record with more points per sweep"
            ),
            Self::ImuNotUsed { reason } => write!(
                f,
                "the inertial unit is not used: {reason}; check the units (m/s^2, rad/s) and axes of its file, imu.body_from_imu and \
                 the clock of the unit, or remove [imu] from drive.toml"
            ),
            Self::FewPointsColored { share, limit, exposures } => {
                let colored = 100.0 * share;
                let limit = 100.0 * limit;
                write!(f, "{colored:.1} % of the points have a color (limit {limit:.1} %): ")?;
                arrived(f, "images", *exposures)
            }
            Self::NoSpectra { exposures } => {
                f.write_str("no point has a spectrum: ")?;
                arrived(f, "cubes", *exposures)
            }
            Self::ImagesUnused { limit, cameras, .. } => unused(f, "images", *limit, cameras),
            Self::CubesUnused { limit, cameras, .. } => unused(f, "cubes", *limit, cameras),
            Self::PointsUnseen { share, limit } => write!(
                f,
                "the model could not classify {:.1} % of the points (limit {:.1} %): they are unlabeled; does it suit this LiDAR?",
                100.0 * share,
                100.0 * limit
            ),
            Self::LidarMisplaced { n_misplaced, n_submaps, limit, found } => write!(
                f,
                "in {n_misplaced} of {n_submaps} submaps the LiDAR is not above the ground as on a vehicle (limit {:.0} %): {found}; \
                 the classes are not reliable; check lidar.body_from_lidar in drive.toml",
                100.0 * limit
            ),
            Self::ForeignIntensities { n_foreign, n_submaps, limit, treatment } => write!(
                f,
                "the intensities of {n_foreign} of {n_submaps} submaps are on another scale than in training (limit {:.0} %): \
                 {treatment}; train with this sensor",
                100.0 * limit
            ),
            Self::SubmapsCoarsened { n_coarsened, n_submaps, limit } => write!(
                f,
                "{n_coarsened} of {n_submaps} submaps are too wide for the grid of the model (limit {:.0} %): its cells were \
                 enlarged, so small objects may be missed; use shorter submaps",
                100.0 * limit
            ),
            Self::HeadingUndetermined { reason, .. } => {
                write!(f, "{reason}; results may be turned about the vertical; a longer drive with fixes is needed")
            }
            Self::PositionUncertain { largest_m, median_m, limit_m } => {
                uncertain(f, "horizontal position", *largest_m, *median_m, *limit_m)
            }
            Self::HeightUncertain { largest_m, median_m, limit_m } => {
                uncertain(f, "height", *largest_m, *median_m, *limit_m)
            }
            Self::NoSubmaps => f.write_str("the result has no cloud: no submap arrived; did acquire decode any sweep?"),
            Self::NoPoints { n_clouds } => {
                write!(f, "the result has no point: all {n_clouds} submaps are empty; check min_range_m and the LiDAR")
            }
            Self::LostColumns { n_lost, n_columns, limit } => write!(
                f,
                "{n_lost} of {n_columns} columns of the clouds were lost ({:.1} %, limit {:.1} %); index.json lists them",
                100.0 * self.size(),
                100.0 * limit
            ),
            Self::CloudsWithoutPlace { n_without, n_clouds } => {
                write!(f, "{n_without} of {n_clouds} clouds have no placement: they stay in the frame of the odometry")
            }
            Self::RecordingIncomplete { fault, progress } => {
                write!(f, "{fault}; {:.0} % of the drive was replayed", 100.0 * progress)
            }
            Self::TopicsNotReplayed { topics } => write!(
                f,
                "the replay does not reproduce the results of its run: stages read {}, which no stage publishes here; record and \
                 replay these topics too",
                topics.join(", ")
            ),
        }
    }
}

fn damaged(f: &mut Formatter<'_>, share: f64, what: &str, limit: f64) -> fmt::Result {
    write!(f, "{} {what}, more than max_damaged_share = {limit}", percent(share))
}

fn clock_offset(f: &mut Formatter<'_>, sensor: &str, behind_s: f64, limit_s: f64, delay_s: f64) -> fmt::Result {
    let offset_ms = behind_s.abs() * 1e3;
    let limit_ms = limit_s * 1e3;
    let side = if behind_s < 0.0 { "ahead of" } else { "behind" };
    write!(f, "stamps of {sensor} are {offset_ms:.1} ms {side} the LiDAR, more than max_clock_offset_ms = {limit_ms}")?;
    // Data that is ahead cannot be late.
    if behind_s >= 0.0 && delay_s > 0.0 {
        write!(f, " and more than max_late_s = {delay_s}")?;
    }
    f.write_str("; synchronize the clocks by PTP or by GNSS with PPS")
}

fn arrived(f: &mut Formatter<'_>, exposures: &str, counted: ExposureUse) -> fmt::Result {
    let ExposureUse { received, unusable, without_pose } = counted;
    if received == 0 {
        return write!(f, "no {exposures} arrived");
    }
    write!(f, "{received} {exposures} arrived, {unusable} do not match the rig, {without_pose} have no pose")
}

fn unused(f: &mut Formatter<'_>, exposures: &str, limit: f64, cameras: &[String]) -> fmt::Result {
    let limit = 100.0 * limit;
    let cameras = cameras.join(", ");
    write!(
        f,
        "more than {limit:.0} % of the {exposures} of a camera are not used; check its rig and its clock: {cameras}"
    )
}

fn uncertain(f: &mut Formatter<'_>, what: &str, largest_m: f64, median_m: f64, limit_m: f64) -> fmt::Result {
    write!(
        f,
        "{what} of the submaps uncertain: standard deviation {largest_m:.1} m (limit {limit_m}), median {median_m:.1} m"
    )
}

/// The quotient of `part` and `whole`; 0 if `whole` is 0.
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubt_about_a_secondary_lidar_has_its_name_in_name_and_text() {
        let doubt = Doubt::DamagedPackets { share: 0.25, limit: 0.01 };
        let of_rear = Doubt::SecondaryLidar { lidar: "rear".to_owned(), doubt: Box::new(doubt.clone()) };
        assert_eq!((of_rear.kind(), of_rear.size()), (doubt.kind(), 0.25));
        assert_eq!((doubt.name(), of_rear.name()), ("damaged_packets".into(), "damaged_packets_rear".into()));
        assert_eq!(of_rear.to_string(), format!("LiDAR rear: {doubt}"));
    }

    #[test]
    fn sensor_that_is_ahead_is_not_excused_by_the_delay_of_its_data() {
        let offset = |behind_s| {
            Doubt::ClockOffset { sensor: "imu".to_owned(), behind_s, limit_s: 0.005, delay_s: 0.5 }.to_string()
        };
        assert_eq!(
            offset(-0.0321),
            "stamps of imu are 32.1 ms ahead of the LiDAR, more than max_clock_offset_ms = 5; synchronize the clocks by \
             PTP or by GNSS with PPS"
        );
        assert!(
            offset(0.0321).contains(
                "32.1 ms behind the LiDAR, more than max_clock_offset_ms = 5 and more than max_late_s = 0.5;"
            )
        );
    }
}
