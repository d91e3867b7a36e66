//! The texts of doubts that operators read.

use super::{Doubt, ExposureUse, FixReading};
use std::fmt::{self, Display, Formatter};

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
            Self::BadNmeaLines { share, limit, first } => {
                damaged(f, *share, "of the NMEA lines are damaged or impossible", *limit)?;
                write!(f, "; the first: {first}")
            }
            Self::BadImuLines { share, limit } => {
                damaged(f, *share, "of the IMU lines are damaged or impossible", *limit)
            }
            Self::MissingSweeps { share, limit } => {
                damaged(f, *share, "of the sweeps of the first LiDAR have no returns of this LiDAR", *limit)
            }
            Self::FewFixes { share, n_epochs, limit, reasons } => write!(
                f,
                "only {} of the {n_epochs} GNSS epochs have position and height, less than min_fix_share = {limit}{}{reasons}; \
                 the receiver must log GGA sentences with geoid separation, and RMC or ZDA",
                percent(*share),
                if reasons.is_empty() { "" } else { ": " }
            ),
            Self::RecorderClock { n_jumps, largest_s } => write!(
                f,
                "the clock of the recorder jumped {n_jumps} times, by up to {largest_s:.1} s, while the clock of the LiDAR went on: stamps \
                 before or after a jump are wrong, and other sensors may not match; set the clock before recording, or process each part as a drive"
            ),
            Self::SourceChanged { n_changes, silent_s } => write!(
                f,
                "the LiDAR was silent for {silent_s:.1} s and continued from another port ({n_changes} times): this part of the drive is \
                 missing; check power and cable of the LiDAR, or process each part as a drive"
            ),
            Self::SecondSource { n_packets } => write!(
                f,
                "{n_packets} data packets come from another port of the LiDAR's address while the first port sends: two sensors or \
                 players send at once, and only the first one is used; stop the second one, or let it send to another port"
            ),
            Self::TwoReceivers { n_epochs: 0, n_alternating, apart_m } => write!(
                f,
                "{n_alternating} GNSS fixes are to one side of the fixes before and after them, by about {apart_m:.1} m: the log mixes \
                 two receivers with different epochs, and all of their fixes are used; log the sentences of the receiver whose antenna is \
                 antenna_in_body"
            ),
            Self::TwoReceivers { n_epochs, apart_m, .. } => write!(
                f,
                "{n_epochs} GNSS epochs have two positions, up to {apart_m:.1} m apart: the log mixes two receivers, and the first \
                 position of each epoch is used; log the sentences of the receiver whose antenna is antenna_in_body"
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
            Self::MapCoordinates { origin: [x, y, z] } => write!(
                f,
                "the sweeps have map coordinates: {x} {y} {z} m is subtracted and taken as the place of the LiDAR in every sweep, so \
                 ranges, rings and the path are not right"
            ),
            Self::UnreadPointTimes { field } => write!(
                f,
                "the field {field} of the clouds is not read: in none of s, ms, us and ns does it span a sweep of 5 ms to 0.5 s; the \
                 motion during a sweep is not removed"
            ),
            Self::ClockOffset { sensor, behind_s, limit_s, delay_s } => {
                clock_offset(f, sensor, *behind_s, *limit_s, *delay_s)
            }
            Self::SilentSensors { sensors } => {
                write!(f, "drive.toml names sensors without any data within the sweeps: {}", sensors.join(", "))
            }
            Self::NoSweep { n_packets: 0 } => f.write_str(
                "no packet was received: check cable and power of the LiDAR, and whether it sends to the address of `listen`",
            ),
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
            Self::FixShape { misfit_m, reading: Some(FixReading { text, misfit_m: read_m }), .. } => write!(
                f,
                "the fixes are {misfit_m:.1} m from the path of the odometry (median), and {read_m:.1} m if their coordinates were \
                 written {text}: the position in the world is wrong; write latitude and longitude in degrees, in this order"
            ),
            Self::FixShape { misfit_m, ratio, usual: [least, largest], reading: None } => write!(
                f,
                "distances between the fixes are {ratio:.3} times the distances by odometry ({least} to {largest} are usual), {misfit_m:.1} m \
                 from its path (median): the positions or their unit are wrong, or the odometry lost its path"
            ),
            Self::FarOrigin { far_m, limit_m } => write!(
                f,
                "the fixes are {:.0} km from gnss.origin of drive.toml (limit {:.0} km): one of them is wrong; are latitude and longitude \
                 in degrees, in this order?",
                far_m / 1000.0,
                limit_m / 1000.0
            ),
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

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

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
