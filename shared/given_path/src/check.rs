//! Comparison of a path with the sensors of its drive, before it is used.

mod coverage;
mod fixes;
mod gravity;
mod heading;
mod median;
mod motion;
mod turning;

use crate::path::start_of;
use crate::{GivenPath, clock};
use drive::Drive;
use drive::imu::ImuSample;
use files::problems::FileProblem;
use formats::gps_time::WEEK_NANOS;
use geometry::{Point3, Stamp};
use lidar::nmea::Fix;

/// Seconds of a week.
const WEEK_S: f64 = WEEK_NANOS as f64 * 1e-9;

/// What the drive measured.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    /// Time of the first sweep.
    pub first: Option<Stamp>,
    /// Time of the last sweep, if it is known before the recording is read.
    pub last: Option<Stamp>,
    /// Samples of the inertial unit, in body axes.
    pub imu: Vec<ImuSample>,
    /// Fixes of the GNSS receiver.
    pub fixes: Vec<Fix>,
    /// Position of the antenna, m.
    pub antenna_in_body: Point3<f64>,
}

impl Evidence {
    /// Reads the recordings of a drive. Bad lines are skipped, which `acquire` reports.
    pub fn from_drive(drive: &Drive) -> Result<Self, FileProblem> {
        let fault = |error: std::io::Error| FileProblem::for_file(drive.folder(), error.to_string());
        let imu = drive.imu().map_err(fault)?.map(|reader| reader.filter_map(Result::ok).collect()).unwrap_or_default();
        let (fixes, _) = drive.fixes().map_err(fault)?;
        let gnss = drive.manifest().gnss.as_ref();
        Ok(Self {
            first: start_of(drive),
            last: drive.sweep_stamps().last().copied(),
            imu,
            fixes,
            antenna_in_body: gnss.map_or_else(Point3::origin, |gnss| gnss.antenna_in_body.into()),
        })
    }
}

/// Results of the comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Reasons not to use the path, each with the reading that would fit.
    pub problems: Vec<String>,
    /// What agrees, with its size, and what could not be compared.
    pub notes: Vec<String>,
}

impl Findings {
    fn add(&mut self, finding: Result<String, String>) {
        match finding {
            Ok(note) => self.notes.push(note),
            Err(problem) => self.problems.push(problem),
        }
    }
}

/// Compares a path with its drive.
pub fn check(path: &GivenPath, evidence: &Evidence) -> Findings {
    let mut findings = Findings { problems: Vec::new(), notes: path.notes().to_vec() };
    let covers = coverage::covers(path, evidence);
    let is_covered = covers.is_ok();
    findings.problems.extend(covers.err());
    findings.problems.extend(motion::jump(path).err());
    findings.add(heading::agrees(path));
    // Another time explains every other difference.
    if is_covered {
        let turning = turning::agrees(path, &evidence.imu);
        let is_timed = turning.is_ok();
        findings.add(turning);
        let fixes = fixes::agrees(path, evidence);
        if is_timed || fixes.is_ok() {
            findings.add(fixes);
        }
        findings.add(gravity::agrees(path, &evidence.imu));
    }
    findings
}

/// The name of a time difference of a known cause: leap seconds, hours, days, weeks. `seconds` is within 0.3 s of it.
fn cause_of(seconds: f64, at: Stamp) -> Option<String> {
    let leaps = clock::leap_seconds(at) as f64;
    let near = |value: f64| (seconds - value).abs() < 0.3;
    if near(leaps) || near(-leaps) {
        return Some(format!(
            "{leaps} s are the leap seconds between GPS time and UTC: set trajectory.clock to the other clock"
        ));
    }
    let whole = |unit_s: f64, most: f64| {
        let n = (seconds / unit_s).round();
        (n != 0.0 && n.abs() <= most && near(n * unit_s)).then_some(n.abs())
    };
    let with_leaps = |unit_s: f64, most: f64| {
        [leaps, -leaps].into_iter().find_map(|leaps| {
            let n = ((seconds - leaps) / unit_s).round();
            (n != 0.0 && n.abs() <= most && near(n * unit_s + leaps)).then_some(n.abs())
        })
    };
    if let Some(n) = whole(WEEK_S, 2000.0) {
        return Some(format!("this is {n} weeks: set trajectory.gps_week"));
    }
    if let Some(n) = whole(WEEK_S / 7.0, 6.0) {
        return Some(format!("this is {n} days: set trajectory.gps_week, or clock to seconds of the day"));
    }
    if let Some(n) = whole(3600.0, 14.0) {
        return Some(format!(
            "this is {n} h, a time zone: export UTC, or set trajectory.delay_nanos where it is below 10 s"
        ));
    }
    with_leaps(3600.0, 14.0)
        .map(|n| format!("this is {n} h, a time zone, and the leap seconds: export UTC or GPS time"))
}
