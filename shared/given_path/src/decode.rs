//! Trajectory files of all formats as times, places and attitudes in their own terms.

use drive::manifest::{Clock, TrajectoryEntry, TrajectoryFormat};
use files::problems::FileProblem;
use files::regular_file;
use files::text_file::text_from_bytes;
use formats::gps_time::WEEK_NANOS;
use formats::novatel::NovatelLog;
use formats::pose_table::{Attitude, PlaceKind, PoseTable, TimeKind};
use formats::sbet::records_from_sbet;
use formats::smrmsg::records_from_smrmsg;
use formats::trajectory::TrajectoryFile;
use geometry::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;

/// A pose as the file states it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawPose {
    pub time: RawTime,
    /// Latitude and longitude (degrees) and height (m), or x y z (m), see [`RawPath::place`].
    pub place: [f64; 3],
    pub attitude: RawAttitude,
}

/// A time as the file states it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawTime {
    pub week: Option<u32>,
    /// Nanoseconds, see [`RawPath::count`].
    pub nanos: i64,
}

/// An attitude as the file states it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum RawAttitude {
    /// Roll, pitch and heading, rad.
    Angles([f64; 3]),
    /// Rotation from forward, left, up to the axes of the frame.
    Rotation(UnitQuaternion<f64>),
}

/// Standard deviations as the file states them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawDeviation {
    pub time: RawTime,
    pub east_north_up_m: [f64; 3],
    pub roll_pitch_heading_rad: [f64; 3],
}

/// Start of the count of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    /// Seconds of a week or of a day, or of a numbered week.
    Period,
    /// Seconds since the epoch of the clock.
    Epoch,
}

/// Content of the files.
#[derive(Debug)]
pub(crate) struct RawPath {
    pub poses: Vec<RawPose>,
    pub deviations: Vec<RawDeviation>,
    pub place: PlaceKind,
    pub is_above_geoid: bool,
    pub count: Count,
    /// Clock unless drive.toml names another; `None`: the file does not show it.
    pub clock: Option<Clock>,
    /// Word for the number of a pose in messages.
    pub unit: &'static str,
    /// Number of the first pose.
    pub first: usize,
    pub notes: Vec<String>,
}

/// Seconds above which times are counted since an epoch: two weeks.
const MAX_PERIOD_NANOS: i64 = 2 * WEEK_NANOS;

fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

/// Reads the files of an entry.
pub(crate) fn read(folder: &Path, entry: &TrajectoryEntry) -> Result<RawPath, FileProblem> {
    let path = folder.join(&entry.file);
    let fault = |rule: String| FileProblem::for_file(&path, rule);
    let bytes = || regular_file::read(&path).map_err(|error| fault(format!("cannot read the file: {error}")));
    let raw = match entry.format {
        TrajectoryFormat::Sbet => sbet(&bytes()?, folder, entry)?,
        TrajectoryFormat::Novatel => novatel(&NovatelLog::from_bytes(&bytes()?)),
        TrajectoryFormat::Table => {
            let text = text_from_bytes(bytes()?).map_err(|error| fault(error.to_string()))?;
            let read = PoseTable::from_text(&text)
                .map_err(|error| FileProblem { line: Some(error.line), ..fault(error.fault.to_string()) })?;
            table(&path, &read)?
        }
        TrajectoryFormat::Tum | TrajectoryFormat::Kitti => {
            let times = entry.times.as_ref().map(|name| folder.join(name));
            plain(&path, times.as_deref())?
        }
    };
    if raw.poses.len() < 2 {
        let n = raw.poses.len();
        let notes = raw.notes.join("; ");
        return Err(fault(format!("{n} poses; expected at least two {} poses. {notes}", entry_name(entry.format))));
    }
    Ok(raw)
}

const fn entry_name(format: TrajectoryFormat) -> &'static str {
    match format {
        TrajectoryFormat::Sbet => "SBET",
        TrajectoryFormat::Novatel => "INSPVA, INSPVAS or INSPVAX",
        TrajectoryFormat::Table => "table",
        TrajectoryFormat::Tum => "TUM",
        TrajectoryFormat::Kitti => "KITTI",
    }
}

fn sbet(bytes: &[u8], folder: &Path, entry: &TrajectoryEntry) -> Result<RawPath, FileProblem> {
    let records = records_from_sbet(bytes)
        .map_err(|error| FileProblem::for_file(&folder.join(&entry.file), error.to_string()))?;
    let of_week = |seconds: f64| RawTime { week: None, nanos: nanos(seconds) };
    let pose = |record: &formats::sbet::SbetRecord| RawPose {
        time: of_week(record.time_s),
        place: [record.latitude_rad.to_degrees(), turned(record.longitude_rad.to_degrees()), record.altitude_m],
        attitude: RawAttitude::Angles([record.roll_rad, record.pitch_rad, record.heading_rad()]),
    };
    let mut deviations = Vec::new();
    if let Some(name) = &entry.deviations {
        let path = folder.join(name);
        let fault = |rule: String| FileProblem::for_file(&path, rule);
        let bytes = regular_file::read(&path).map_err(|error| fault(format!("cannot read the file: {error}")))?;
        for record in records_from_smrmsg(&bytes).map_err(|error| fault(error.to_string()))? {
            let [north, east, down] = record.north_east_down_m;
            let rad = record.roll_pitch_heading_arcmin.map(|arcmin| (arcmin / 60.0).to_radians());
            deviations.push(RawDeviation {
                time: of_week(record.time_s),
                east_north_up_m: [east, north, down],
                roll_pitch_heading_rad: rad,
            });
        }
    }
    Ok(RawPath {
        poses: records.iter().map(pose).collect(),
        deviations,
        place: PlaceKind::Geodetic,
        is_above_geoid: false,
        count: Count::Period,
        clock: Some(Clock::Gps),
        unit: "record",
        first: 0,
        notes: Vec::new(),
    })
}

/// A longitude of 0 to 360 degrees as -180 to 180.
fn turned(longitude_deg: f64) -> f64 {
    if longitude_deg > 180.0 { longitude_deg - 360.0 } else { longitude_deg }
}

fn novatel(log: &NovatelLog) -> RawPath {
    let pose = |pose: &formats::novatel::NovatelPose| RawPose {
        time: RawTime { week: Some(pose.week), nanos: nanos(pose.second) },
        place: [pose.latitude_deg, pose.longitude_deg, pose.altitude_m],
        attitude: RawAttitude::Angles([pose.roll_deg, pose.pitch_deg, pose.azimuth_deg].map(f64::to_radians)),
    };
    let deviation = |deviation: &formats::novatel::NovatelDeviation| {
        let [north, east, up] = deviation.north_east_up_m;
        RawDeviation {
            time: RawTime { week: Some(deviation.week), nanos: nanos(deviation.second) },
            east_north_up_m: [east, north, up],
            roll_pitch_heading_rad: deviation.roll_pitch_azimuth_deg.map(f64::to_radians),
        }
    };
    let mut notes = Vec::new();
    if log.n_damaged > 0 {
        notes.push(format!("{} messages with a wrong checksum or length are skipped", log.n_damaged));
    }
    if log.n_not_ready > 0 {
        notes.push(format!("{} poses of a solution that is not ready are skipped", log.n_not_ready));
    }
    RawPath {
        poses: log.poses.iter().map(pose).collect(),
        deviations: log.deviations.iter().map(deviation).collect(),
        place: PlaceKind::Geodetic,
        is_above_geoid: false,
        count: Count::Period,
        clock: Some(Clock::Gps),
        unit: "message",
        first: 0,
        notes,
    }
}

fn table(path: &Path, table: &PoseTable) -> Result<RawPath, FileProblem> {
    let mut poses = Vec::with_capacity(table.rows.len());
    let mut deviations = Vec::new();
    for row in &table.rows {
        let time = RawTime { week: row.week, nanos: row.time_nanos };
        let attitude = match row.attitude {
            Attitude::Angles(angles) => {
                let [roll, pitch, heading] = angles;
                if roll.abs() > 180.0 || pitch.abs() > 90.0 || heading.abs() > 720.0 {
                    let rule = format!(
                        "roll {roll:.1}, pitch {pitch:.1}, heading {heading:.1} degrees are out of range; if the columns are in degrees, \
                         their names must not say (rad)"
                    );
                    return Err(FileProblem { line: Some(row.line), ..FileProblem::for_file(path, rule) });
                }
                RawAttitude::Angles(angles.map(f64::to_radians))
            }
            Attitude::Quaternion([x, y, z, w]) => {
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                if (norm - 1.0).abs() > 1e-3 {
                    let rule = format!("quaternion {x} {y} {z} {w} has norm {norm}, expected 1");
                    return Err(FileProblem { line: Some(row.line), ..FileProblem::for_file(path, rule) });
                }
                RawAttitude::Rotation(UnitQuaternion::from_quaternion(quaternion))
            }
        };
        poses.push(RawPose { time, place: row.place, attitude });
        if let (Some([north, east, up]), Some(angles)) = (row.north_east_up_m, row.roll_pitch_heading_deg) {
            deviations.push(RawDeviation {
                time,
                east_north_up_m: [east, north, up],
                roll_pitch_heading_rad: angles.map(f64::to_radians),
            });
        }
    }
    let has_week = table.rows.iter().all(|row| row.week.is_some());
    let is_short = table.rows.iter().all(|row| row.time_nanos < MAX_PERIOD_NANOS);
    let (count, clock) = match table.time {
        TimeKind::Seconds if has_week || is_short => (Count::Period, Some(Clock::Gps)),
        TimeKind::Seconds => (Count::Epoch, None),
        TimeKind::Nanos | TimeKind::Date => (Count::Epoch, Some(Clock::Utc)),
    };
    Ok(RawPath {
        poses,
        deviations,
        place: table.place,
        is_above_geoid: table.is_above_geoid,
        count,
        clock,
        unit: "line",
        first: table.rows.first().map_or(1, |row| row.line),
        notes: Vec::new(),
    })
}

fn plain(path: &Path, times: Option<&Path>) -> Result<RawPath, FileProblem> {
    let TrajectoryFile::Stamped(trajectory) = TrajectoryFile::load(path, times)? else {
        return Err(FileProblem::for_file(
            path,
            "poses without times; set trajectory.times to the file of their times",
        ));
    };
    let pose = |(stamp, pose): &(geometry::Stamp, geometry::Pose)| RawPose {
        time: RawTime { week: None, nanos: stamp.0 },
        place: Vector3::from(pose.translation.vector).into(),
        attitude: RawAttitude::Rotation(pose.rotation),
    };
    Ok(RawPath {
        poses: trajectory.poses().iter().map(pose).collect(),
        deviations: Vec::new(),
        place: PlaceKind::Local,
        is_above_geoid: false,
        count: Count::Epoch,
        clock: Some(Clock::Utc),
        unit: "pose",
        first: 0,
        notes: Vec::new(),
    })
}
