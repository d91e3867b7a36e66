//! Doubts with their figures.

mod text;

use crate::DoubtKind;
use std::borrow::Cow;

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

/// A way to read the coordinates of fixes in which their path fits the odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixReading {
    /// How the coordinates were written.
    pub text: &'static str,
    /// Median distance of the fixes from the odometry with this reading, m.
    pub misfit_m: f64,
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
        /// Place and reason of the first one.
        first: String,
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
        /// Numbers of the epochs without position or height, by reason.
        reasons: String,
    },
    /// [`DoubtKind::RecorderClock`].
    RecorderClock {
        /// Number of jumps.
        n_jumps: u64,
        /// The largest one.
        largest_s: f64,
    },
    /// [`DoubtKind::SourceChanged`].
    SourceChanged {
        /// Number of changes.
        n_changes: u64,
        /// Silence before them.
        silent_s: f64,
    },
    /// [`DoubtKind::SecondSource`].
    SecondSource {
        /// Packets of the second source.
        n_packets: u64,
    },
    /// [`DoubtKind::TwoReceivers`].
    TwoReceivers {
        /// Epochs with two positions.
        n_epochs: u64,
        /// Fixes to one side of the fixes before and after them.
        n_alternating: u64,
        /// Largest distance of the two.
        apart_m: f64,
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
    /// [`DoubtKind::MapCoordinates`].
    MapCoordinates {
        /// x y z that were subtracted, m.
        origin: [i64; 3],
    },
    /// [`DoubtKind::UnreadPointTimes`].
    UnreadPointTimes {
        /// Name of the field.
        field: String,
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
    /// [`DoubtKind::FixShape`].
    FixShape {
        /// Median distance of the fixes from the path of the odometry, m.
        misfit_m: f64,
        /// Quotient of distances between fixes and by odometry.
        ratio: f64,
        /// Smallest and largest usual quotient.
        usual: [f64; 2],
        /// A reading that fits.
        reading: Option<FixReading>,
    },
    /// [`DoubtKind::FarOrigin`].
    FarOrigin {
        /// Median distance of the fixes from the origin, m.
        far_m: f64,
        /// Largest distance, m.
        limit_m: f64,
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
            Self::RecorderClock { .. } => DoubtKind::RecorderClock,
            Self::SourceChanged { .. } => DoubtKind::SourceChanged,
            Self::SecondSource { .. } => DoubtKind::SecondSource,
            Self::TwoReceivers { .. } => DoubtKind::TwoReceivers,
            Self::ExposuresOutside { .. } => DoubtKind::ExposuresOutside,
            Self::LateExposures { .. } => DoubtKind::LateExposures,
            Self::PpsNotLocked { .. } => DoubtKind::PpsNotLocked,
            Self::CutCaptures { .. } => DoubtKind::CutCaptures,
            Self::ClocksSetBack { .. } => DoubtKind::ClocksSetBack,
            Self::MissingFiles { .. } => DoubtKind::MissingFiles,
            Self::MapCoordinates { .. } => DoubtKind::MapCoordinates,
            Self::UnreadPointTimes { .. } => DoubtKind::UnreadPointTimes,
            Self::ClockOffset { .. } => DoubtKind::ClockOffset,
            Self::SilentSensors { .. } => DoubtKind::SilentSensors,
            Self::NoSweep { .. } => DoubtKind::NoSweep,
            Self::NoUsableFix { .. } => DoubtKind::NoUsableFix,
            Self::FewFixesUsed { .. } => DoubtKind::FewFixesUsed,
            Self::FixShape { .. } => DoubtKind::FixShape,
            Self::FarOrigin { .. } => DoubtKind::FarOrigin,
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
            Self::TwoReceivers { apart_m, .. } => *apart_m,
            Self::SourceChanged { silent_s, .. } => *silent_s,
            Self::RecorderClock { largest_s, .. } => *largest_s,
            Self::MissingFiles { n_files, .. } => *n_files as f64,
            Self::ClockOffset { behind_s, .. } => behind_s.abs(),
            Self::SilentSensors { sensors } => sensors.len() as f64,
            Self::NoSweep { n_packets } | Self::SecondSource { n_packets } => *n_packets as f64,
            Self::FixShape { misfit_m, .. } => *misfit_m,
            Self::FarOrigin { far_m, .. } => *far_m,
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
            Self::MapCoordinates { .. }
            | Self::UnreadPointTimes { .. }
            | Self::NoUsableFix { .. }
            | Self::NoSpectra { .. }
            | Self::NoSubmaps
            | Self::NoPoints { .. } => 0.0,
        }
    }
}

/// The quotient of `part` and `whole`; 0 if `whole` is 0.
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

#[cfg(test)]
mod tests;
