//! Simulated drives through the stage, with the samples of the inertial unit or the fixes changed by a fault of wiring,
//! mounting, units or clocks.

use acquisition::rows::{gnss_row, sweep_header};
use drive::Drive;
use geometry::{Pose, Stamp, Trajectory, Vector3};
use messages::{
    GnssRow, GnssTopic, ImuRow, ImuTopic, NoHeader, PlacementTopic, SweepHeader, SweepPoint, SweepTopic,
    TrajectoryTopic,
};
use simulation::{DriveSettings, DriveSpec, write_drive};
use slam_aggregate::{Settings, SlamAggregate};
use stage::Received;
use stage::testing::{Bench, context};

/// A fault of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// No fault.
    None,
    /// The drive has no inertial unit.
    NoUnit,
    /// Angular rates in degrees per second.
    Degrees,
    /// A left-handed unit: its y axis points to the right.
    Mirrored,
    /// Degrees per second of a left-handed unit.
    MirroredDegrees,
    /// Stamps of the samples are late, s.
    Late(f64),
    /// Bias of the accelerometers along x and y, m/s^2.
    ForceBias([f64; 2]),
    /// Stamps of the fixes are late, s.
    LateFixes(f64),
}

impl Fault {
    fn row(self, row: &ImuRow) -> ImuRow {
        let mut row = *row;
        let [fx, fy, fz] = row.acceleration;
        let [wx, wy, wz] = row.angular_rate;
        if matches!(self, Self::Mirrored | Self::MirroredDegrees) {
            row.acceleration = [fx, -fy, fz];
            row.angular_rate = [-wx, wy, -wz];
        }
        if matches!(self, Self::Degrees | Self::MirroredDegrees) {
            row.angular_rate = row.angular_rate.map(f64::to_degrees);
        }
        match self {
            Self::Late(seconds) => row.stamp += nanos(seconds),
            Self::ForceBias([x, y]) => row.acceleration = [fx + x, fy + y, fz],
            _ => {}
        }
        row
    }
}

fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

struct StoredSweep {
    stamp: i64,
    header: SweepHeader,
    rows: Vec<SweepPoint>,
}

/// A drive in memory.
pub struct SensorDrive {
    folder: tempfile::TempDir,
    sweeps: Vec<StoredSweep>,
    imu: Vec<ImuRow>,
    fixes: Vec<GnssRow>,
    truth: Trajectory,
}

/// The result of a drive.
pub struct Outcome {
    /// Length of the true path, m.
    pub path_m: f64,
    /// Distance of the last pose of the odometry from the truth, m.
    pub end_m: f64,
    /// Largest error of the odometry's motion over a second, m.
    pub second_m: f64,
    /// Largest angle between the vertical of a placed submap and the truth, degrees.
    pub tilt_deg: f64,
    pub notes: Vec<String>,
    /// Names of doubts.
    pub doubts: Vec<&'static str>,
}

impl Outcome {
    pub fn says(&self, words: &str) -> bool {
        self.notes.iter().any(|note| note.contains(words))
    }
}

/// Doubts about the motion.
const DOUBTS: [&str; 4] = ["imu_not_used", "path_lost", "motion_contested", "path_unmatched"];

impl SensorDrive {
    /// Simulates the LiDAR, the inertial unit and the receiver of a drive.
    pub fn simulated(settings: &DriveSettings) -> Self {
        let spec = DriveSpec { cameras: false, mosaics: false, ..settings.spec().expect("a rig") };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("drive");
        write_drive(&spec, &path, &mut |_| {}).expect("writes");
        let drive = Drive::open(&path).expect("opens");
        let n_rings = drive.lidar().n_rings();
        let mut source = drive.sweeps().expect("opens");
        let mut sweeps = Vec::new();
        let mut rows = Vec::new();
        while let Some(sweep) = source.next_sweep(|piece| rows.extend_from_slice(piece)).expect("reads") {
            let header = sweep_header(&sweep, n_rings);
            sweeps.push(StoredSweep { stamp: sweep.stamp.0, header, rows: std::mem::take(&mut rows) });
        }
        let samples = drive.imu().expect("opens").into_iter().flatten().map(|sample| sample.expect("reads"));
        let imu = samples.map(|sample| ImuRow {
            stamp: sample.stamp.0,
            acceleration: sample.acceleration,
            angular_rate: sample.angular_rate,
        });
        let imu = imu.collect();
        let fixes = drive.fixes().expect("reads").0.iter().filter_map(gnss_row).collect();
        let truth = drive.true_trajectory().expect("simulated").expect("reads");
        Self { folder, sweeps, imu, fixes, truth }
    }

    /// Runs the stage on the drive with a fault.
    pub fn run(&self, settings: &Settings, fault: Fault) -> Outcome {
        let context = context(&self.folder.path().join("drive"));
        let mut bench = Bench::<SlamAggregate>::new(settings, &context).expect("starts");
        let mut imu = self.imu.iter().filter(|_| fault != Fault::NoUnit).map(|row| fault.row(row)).peekable();
        let delay = if let Fault::LateFixes(seconds) = fault { nanos(seconds) } else { 0 };
        let mut fixes = self.fixes.iter().map(|fix| GnssRow { stamp: fix.stamp + delay, ..*fix }).peekable();
        for StoredSweep { stamp, header, rows } in &self.sweeps {
            let end = stamp + i64::from(header.duration_nanos);
            let samples: Vec<ImuRow> = std::iter::from_fn(|| imu.next_if(|row| row.stamp < end)).collect();
            bench.send::<ImuTopic>(*stamp, NoHeader::default(), samples);
            let found: Vec<GnssRow> = std::iter::from_fn(|| fixes.next_if(|fix| fix.stamp < end)).collect();
            bench.send::<GnssTopic>(*stamp, NoHeader::default(), found);
            bench.send::<SweepTopic>(*stamp, *header, rows.clone());
            bench.tick().expect("steps");
        }
        bench.finish().expect("ends");
        self.outcome(&mut bench)
    }

    fn truth(&self, stamp: i64) -> Pose {
        let known = self.truth.poses();
        let at = stamp.clamp(known[0].0.0, known[known.len() - 1].0.0);
        self.truth.at(Stamp(at)).expect("within the truth")
    }

    fn outcome(&self, bench: &mut Bench<SlamAggregate>) -> Outcome {
        let messages = bench.take::<TrajectoryTopic>();
        let rows: Vec<_> = messages.iter().flat_map(|message| message.rows().to_vec()).collect();
        let found: Vec<Pose> = rows.iter().map(|row| row.odom_from_body.to_pose().expect("a pose")).collect();
        let truth: Vec<Pose> = rows.iter().map(|row| self.truth(row.stamp)).collect();
        let error_m = |from: usize, to: usize| {
            let moved = |poses: &[Pose]| poses[from].inverse() * poses[to];
            (moved(&found).translation.vector - moved(&truth).translation.vector).norm()
        };
        let path_m = truth.windows(2).map(|pair| (pair[1].translation.vector - pair[0].translation.vector).norm());
        // Two poses a sweep.
        let per_second = 20.min(found.len() - 1);
        let placements = bench.take::<PlacementTopic>();
        let tilts = placements.iter().flat_map(Received::rows).map(|row| {
            let up = |pose: &Pose| pose.rotation.inverse() * Vector3::z();
            let placed = row.world_from_submap.to_pose().expect("a pose");
            up(&placed).angle(&up(&self.truth(row.stamp))).to_degrees()
        });
        Outcome {
            path_m: path_m.sum(),
            end_m: error_m(0, found.len() - 1),
            second_m: (per_second..found.len()).map(|to| error_m(to - per_second, to)).fold(0.0, f64::max),
            tilt_deg: tilts.fold(0.0, f64::max),
            notes: bench.notes().to_vec(),
            doubts: DOUBTS.into_iter().filter(|name| bench.doubt(name).is_some()).collect(),
        }
    }
}
