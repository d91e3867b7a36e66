//! The table of all doubts.

/// The stage that states a doubt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reads the drive or the sensors.
    Acquire,
    /// Odometry, submaps and placement.
    SlamAggregate,
    /// Colors and spectra.
    Colorize,
    /// Classes.
    Infer,
    /// Clouds.
    Export,
    /// Publishes a recording.
    Replay,
}

impl Stage {
    /// All stages that state doubts, in the order of their page.
    pub const ALL: [Self; 6] =
        [Self::Acquire, Self::SlamAggregate, Self::Colorize, Self::Infer, Self::Export, Self::Replay];

    /// Its table in the launch file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Acquire => "acquire",
            Self::SlamAggregate => "slam_aggregate",
            Self::Colorize => "colorize",
            Self::Infer => "infer",
            Self::Export => "export",
            Self::Replay => "replay",
        }
    }
}

/// The part of the result that a doubt is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The run as a whole.
    Run,
    /// The data of the sensors.
    Input,
    /// Trajectory and its position on the Earth.
    Place,
    /// Colors and spectra.
    Color,
    /// Classes and instances.
    Classes,
}

impl Subject {
    /// All subjects, in the order of a report.
    pub const ALL: [Self; 5] = [Self::Run, Self::Input, Self::Place, Self::Color, Self::Classes];

    /// The subject of a doubt without a kind, by the table of its stage.
    pub fn from_stage(stage: &str) -> Self {
        match stage {
            "acquire" | "replay" => Self::Input,
            "slam_aggregate" => Self::Place,
            "calibrate" | "colorize" => Self::Color,
            "infer" | "instance" => Self::Classes,
            _ => Self::Run,
        }
    }
}

/// The consequence of a doubt for users of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The result is complete and needs a check.
    Check,
    /// The result is good in its local frame, but coordinates on the Earth would be wrong.
    Unplaced,
    /// There is no result.
    Empty,
}

/// A row of the table.
struct Row {
    name: &'static str,
    stage: Stage,
    subject: Subject,
    severity: Severity,
    advice: &'static str,
}

/// Declares [`DoubtKind`]: variant, name, stage, subject, severity, what to do.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident $name:literal $stage:ident $subject:ident $severity:ident $advice:literal)*) => {
        /// One kind of doubt. [`Doubt`](crate::Doubt) adds its figures.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum DoubtKind {
            $($(#[$doc])* $kind,)*
        }

        impl DoubtKind {
            /// All kinds.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// Its row of the table.
            const fn row(self) -> Row {
                match self {
                    $(Self::$kind => Row {
                        name: $name,
                        stage: Stage::$stage,
                        subject: Subject::$subject,
                        severity: Severity::$severity,
                        advice: $advice,
                    },)*
                }
            }
        }
    };
}

kinds! {
    /// Packets from other senders, or packets that are too short.
    ForeignPackets "foreign_packets" Acquire Input Check "Check that the sweeps are from the right sensor."
    /// LiDAR packets too late or undecodable.
    DamagedPackets "damaged_packets" Acquire Input Check "Check the recorder's network."
    /// Bytes after damage in captures.
    UnreadCaptures "unread_captures" Acquire Input Check "Copy the captures again."
    /// Sweep files that cannot be read.
    BadSweeps "bad_sweeps" Acquire Input Check "Copy them again."
    /// Images damaged, or of the wrong size.
    BadImages "bad_images" Acquire Input Check "Copy them again."
    /// Mosaics damaged, or of the wrong size.
    BadMosaics "bad_mosaics" Acquire Input Check "Copy them again."
    /// NMEA lines damaged.
    BadNmeaLines "bad_nmea_lines" Acquire Input Check "Check log and units."
    /// IMU lines damaged or impossible.
    BadImuLines "bad_imu_lines" Acquire Input Check "Check log and units."
    /// Sweeps of the first LiDAR without returns of a secondary LiDAR.
    MissingSweeps "missing_sweeps" Acquire Input Check "Check its network and clock."
    /// GNSS epochs without position and height.
    FewFixes "few_fixes" Acquire Input Check "Log GGA sentences with geoid separation, and RMC or ZDA."
    /// Jumps of the recorder's clock while the clock of the LiDAR went on.
    RecorderClock "recorder_clock" Acquire Input Check "Set the clock before recording."
    /// Silence of the LiDAR before it continued from another port.
    SourceChanged "source_changed" Acquire Input Check "Check power and cable of the LiDAR."
    /// Packets of a second sensor at the address of the LiDAR.
    SecondSource "second_source" Acquire Input Check "Stop the second sender."
    /// GNSS epochs with two positions.
    TwoReceivers "two_receivers" Acquire Input Check "Log the sentences of one receiver."
    /// Exposures before the first or after the last sweep.
    ExposuresOutside "exposures_outside" Acquire Input Check "Check the clocks."
    /// Live: exposures that arrived after the sweep of their time.
    LateExposures "late_exposures" Acquire Input Check "Check the grabber and its clock."
    /// The clock of the LiDAR follows neither PPS nor PTP.
    PpsNotLocked "pps_not_locked" Acquire Input Check
        "Check antenna, PPS cable and baud rate of the receiver, or the PTP master."
    /// Captures that end inside a packet.
    CutCaptures "cut_captures" Acquire Input Check "Copy them again."
    /// Captures in which the clocks of sensor and recorder step back.
    ClocksSetBack "clocks_set_back" Acquire Input Check
        "Process each part in a folder of its own; check the names of the captures."
    /// Files of sweeps that are missing in a counted series.
    MissingFiles "missing_files" Acquire Input Check "Copy the missing files."
    /// Sweeps have map coordinates, so the place of the LiDAR in them is unknown.
    MapCoordinates "map_coordinates" Acquire Input Check "Export the sweeps in the frame of the LiDAR."
    /// Point times of cloud files that are not read.
    UnreadPointTimes "unread_point_times" Acquire Input Check "Check the unit of the field and the times of the sweeps."
    /// Live: the clock of a sensor differs from the clock of the first LiDAR.
    ClockOffset "clock_offset" Acquire Input Check "Synchronize both by PTP, or by GNSS with PPS."
    /// Sensors of `drive.toml` without data.
    SilentSensors "silent_sensors" Acquire Input Check "Add the data, or remove the entry."
    /// Live: no packet gave a sweep.
    NoSweep "no_sweep" Acquire Input Empty "Check model and address; process the recording."

    /// No fix of the receiver has a position.
    NoUsableFix "no_usable_fix" SlamAggregate Place Check "Log GGA sentences."
    /// Too few fixes agree with the result.
    FewFixesUsed "few_fixes_used" SlamAggregate Place Check
        "Check the receiver's clock, drive farther, or remove `\"gnss\"` from `correct`."
    /// The path of the fixes has another size or shape than the path of the odometry.
    FixShape "fix_shape" SlamAggregate Place Check
        "Write latitude and longitude in degrees, in this order; check the path of the odometry."
    /// The fixes are far from the origin of the world.
    FarOrigin "far_origin" SlamAggregate Place Check "Set `gnss.origin` near the drive, and check the fixes."
    /// The stamps of the receiver are off by more than can be corrected.
    ReceiverDelay "receiver_delay" SlamAggregate Place Check "Check its clock."
    /// The scene fits other along-track positions about as well.
    MotionContested "motion_contested" SlamAggregate Place Check "Drive again in less traffic."
    /// The scene did not determine the motion.
    PathLost "path_lost" SlamAggregate Place Check "Drive with an IMU and a GNSS receiver, or along houses."
    /// Stretches of the path have no match that supports them.
    PathUnmatched "path_unmatched" SlamAggregate Place Check
        "Look at the clouds there; record with more points per sweep, or drive where walls and poles are in range."
    /// No sweep matches another: there is no path.
    NoSweepMatched "no_sweep_matched" SlamAggregate Place Empty
        "Check model, rings and point times of the LiDAR; record with more points per sweep."
    /// The IMU contradicts the LiDAR, is dead, or reports noise.
    ImuNotUsed "imu_not_used" SlamAggregate Place Check
        "Check units (m/s^2, rad/s), axes (`imu.body_from_imu`) and clock, or remove `[imu]`."

    /// Too few points have a color.
    FewPointsColored "few_points_colored" Colorize Color Check "Check images and clocks."
    /// Images of a camera without pose or unlike the rig.
    ImagesUnused "images_unused" Colorize Color Check "Check that camera."
    /// Cubes of a mosaic camera without pose or unlike the rig.
    CubesUnused "cubes_unused" Colorize Color Check "Check that camera."
    /// No point has a spectrum.
    NoSpectra "no_spectra" Colorize Color Check "Check mosaics and clocks."

    /// Points that the model cannot classify.
    PointsUnseen "points_unseen" Infer Classes Check "Use a model for this LiDAR and mounting."
    /// The ground is not where the mounting of the LiDAR puts it.
    LidarMisplaced "lidar_misplaced" Infer Classes Check
        "Check `lidar.body_from_lidar` of `drive.toml`."
    /// Intensities on another scale than in training.
    ForeignIntensities "foreign_intensities" Infer Classes Check
        "Look at the classes; `intensity = \"off\"` does without intensities."
    /// Submaps too wide for the grid of the model.
    SubmapsCoarsened "submaps_coarsened" Infer Classes Check "Use a smaller `submap_m`."

    /// Clouds may be turned about the vertical.
    HeadingUndetermined "heading_undetermined" Export Place Unplaced "Drive farther with fixes."
    /// Clouds may be shifted horizontally.
    PositionUncertain "position_uncertain" Export Place Unplaced "Drive with better reception."
    /// Clouds may be shifted in height.
    HeightUncertain "height_uncertain" Export Place Unplaced "Drive with better reception."
    /// No submap arrived.
    NoSubmaps "no_submaps" Export Run Empty "Check `min_range_m` and the LiDAR."
    /// All submaps are empty.
    NoPoints "no_points" Export Run Empty "Check `min_range_m` and the LiDAR."
    /// Live: columns dropped.
    LostColumns "lost_columns" Export Run Check "Process the raw recording."
    /// Live: clouds left in the odometry frame.
    CloudsWithoutPlace "clouds_without_place" Export Run Check "Process the raw recording."

    /// The recording is cut or was stopped early.
    RecordingIncomplete "recording_incomplete" Replay Input Check "Record the run again."
    /// Topics that stages read and the recording lacks.
    TopicsNotReplayed "topics_not_replayed" Replay Input Check "Record and replay these topics."
}

impl DoubtKind {
    /// Name in `summary.json`, in snake case. The name of a secondary LiDAR follows in its doubts.
    pub const fn name(self) -> &'static str {
        self.row().name
    }

    /// The stage that states it.
    pub const fn stage(self) -> Stage {
        self.row().stage
    }

    /// The part of the result that it is about.
    pub const fn subject(self) -> Subject {
        self.row().subject
    }

    /// The consequence for users of the result.
    pub const fn severity(self) -> Severity {
        self.row().severity
    }

    /// What to do, as in `docs/reference/doubts.md`.
    pub const fn advice(self) -> &'static str {
        self.row().advice
    }

    /// The kind of a doubt with this name in `summary.json`, which the name of a secondary LiDAR may follow. `None`: a
    /// third-party stage states the doubt.
    pub fn from_name(name: &str) -> Option<Self> {
        let exact = Self::ALL.iter().find(|kind| kind.name() == name);
        let of_secondary = || {
            let has_lidar = |kind: &&Self| {
                kind.may_name_lidar() && name.strip_prefix(kind.name()).is_some_and(|rest| rest.starts_with('_'))
            };
            Self::ALL.iter().find(has_lidar)
        };
        exact.or_else(of_secondary).copied()
    }

    /// Whether a secondary LiDAR may have this doubt.
    pub const fn may_name_lidar(self) -> bool {
        matches!(
            self,
            Self::ForeignPackets
                | Self::DamagedPackets
                | Self::UnreadCaptures
                | Self::CutCaptures
                | Self::ClocksSetBack
                | Self::MapCoordinates
                | Self::MissingFiles
                | Self::PpsNotLocked
                | Self::BadSweeps
                | Self::MissingSweeps
                | Self::UnreadPointTimes
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::path::Path;

    #[test]
    fn each_kind_is_found_by_its_name() {
        for kind in DoubtKind::ALL {
            assert_eq!(DoubtKind::from_name(kind.name()), Some(*kind));
            let of_secondary = DoubtKind::from_name(&format!("{}_rear_2", kind.name()));
            assert_eq!(of_secondary, kind.may_name_lidar().then_some(*kind), "{}", kind.name());
        }
        for name in ["", "rows_invented", "no_sweeps", "damaged_packetsrear"] {
            assert_eq!(DoubtKind::from_name(name), None, "{name}");
        }
    }

    #[test]
    fn subject_of_a_stage_is_the_usual_one_of_its_doubts() {
        for kind in DoubtKind::ALL {
            let usual = Subject::from_stage(kind.stage().name());
            assert!(kind.subject() == usual || kind.severity() == Severity::Unplaced, "{}", kind.name());
        }
    }

    /// The entries of a section of the page: the names before the colon, and the whole text in one line.
    fn entries(section: &str) -> Vec<(Vec<String>, String)> {
        let mut entries: Vec<String> = Vec::new();
        for line in section.lines() {
            if line.trim_start().starts_with("- `") {
                entries.push(line.trim().to_owned());
            } else if let Some(entry) = entries.last_mut().filter(|_| line.starts_with("  ") && !line.contains("- ")) {
                *entry += " ";
                *entry += line.trim();
            }
        }
        let names = |entry: &str| {
            let head = entry.split_once(':').expect("a colon after the name").0;
            // Settings stand in parentheses.
            let head: String =
                head.split('(').map(|part| part.split_once(')').map_or(part, |(_, rest)| rest)).collect();
            let quoted = head.split('`').skip(1).step_by(2);
            quoted.map(|name| name.trim_end_matches("_<name>").to_owned()).collect()
        };
        entries.iter().map(|entry| (names(entry), entry.clone())).collect()
    }

    #[test]
    fn page_has_each_kind_once_with_its_advice() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/doubts.md");
        let page = std::fs::read_to_string(path).expect("the page of the doubts");
        let mut found = BTreeSet::new();
        for stage in Stage::ALL {
            let heading = format!("\n## {}\n", stage.name());
            let section = page.split_once(&heading).expect("a section for each stage").1;
            let section = section.split("\n## ").next().unwrap_or_default();
            for (names, entry) in entries(section) {
                for name in names {
                    let kind = DoubtKind::from_name(&name).unwrap_or_else(|| panic!("{name} is not a doubt"));
                    assert_eq!((kind.name(), kind.stage()), (name.as_str(), stage));
                    assert!(entry.contains(kind.advice()), "{name}: {} is not in {entry}", kind.advice());
                    assert!(found.insert(name), "{} has two entries", kind.name());
                }
            }
        }
        for kind in DoubtKind::ALL {
            assert!(found.contains(kind.name()), "{} has no entry", kind.name());
        }
    }
}
