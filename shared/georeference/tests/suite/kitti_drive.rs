//! The recorded drive KITTI `2011_10_03_0027`, a city drive of 3.7 km: positions of its GNSS and inertial navigation system at 1 Hz,
//! inertial samples at 100 Hz, and the reference poses of the left camera at 10 Hz.
//!
//! Fixes and poses are results of the same navigation system. Aligned by a rotation, a translation and a scale, they agree within 9 mm
//! along each axis over the whole drive. So this drive has real motion, times and gaps, but its fixes lack the errors of a receiver
//! between houses.

use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Stamp, Trajectory, UnitQuaternion, Vector3};
use georeference::GeoreferenceSettings;
use messages::{GnssRow, ImuRow};
use nalgebra::Matrix3;
use std::path::Path;

/// Files of the drive, below the folder of recorded data.
pub const POSES: &str = "gnss_drives/kitti_2011_10_03_0027/poses_00.txt.gz";
pub const FIXES: &str = "gnss_drives/kitti_2011_10_03_0027/KittiGps_converted.txt";
pub const SAMPLES: &str = "gnss_drives/kitti_2011_10_03_0027/KittiEquivBiasedImu.txt.gz";

/// Second of the day of the first pose, by the clock of the fixes: with it, poses and fixes agree best (steps of 10 ms).
const FIRST_POSE_S: f64 = 46_534.94;
/// Length in the frame of the fixes of one metre of the poses: the best fit. Its cause is the projection of the fixes.
const FIX_SCALE: f64 = 0.998_08;
/// Rotation and translation from the inertial unit to the left rectified camera, from the calibration of that day.
const CAMERA_FROM_IMU: [f64; 12] = [
    -0.001_197, -0.999_977, 0.006_738, -0.325_411, //
    -0.009_241, -0.006_749, -0.999_935, 0.754_050, //
    0.999_956, -0.001_134, -0.009_249, -1.094_933,
];

/// The drive. The body is the inertial unit: x ahead, y left, z up. The world is the frame of the fixes.
pub struct KittiDrive {
    /// `world_from_body`: the reference poses, aligned with the fixes.
    pub truth: Trajectory,
    pub fixes: Vec<GnssRow>,
    pub samples: Vec<ImuRow>,
}

/// Any origin: the fixes are metres in a local frame.
pub fn origin() -> Geodetic {
    Geodetic::new(48.98, 8.39, 110.0).unwrap_or_else(|| unreachable!("is valid"))
}

/// Settings of the placing: the antenna is at the inertial unit.
pub fn settings() -> GeoreferenceSettings {
    GeoreferenceSettings {
        gnss: true,
        imu: true,
        loops: false,
        unsmooth_fixes: false,
        antenna_in_body: Point3::origin(),
        imu_in_body: Point3::origin(),
        origin: Some(origin()),
        max_keyframes: 10,
    }
}

impl KittiDrive {
    /// Reads the three files. `quality`: GGA quality that the fixes get.
    pub fn read([poses, fixes, samples]: [&Path; 3], quality: u32) -> Self {
        let stamp = |seconds: f64| (seconds * 1e9).round() as i64;
        let fixes: Vec<(i64, Vector3<f64>)> =
            numbers(&text(fixes), ',').map(|n| (stamp(n[0]), Vector3::new(n[1], n[2], n[3]) / FIX_SCALE)).collect();
        let camera_from_body = pose(&CAMERA_FROM_IMU);
        let mut from_first = Trajectory::default();
        for n in numbers(&text(poses), ' ') {
            from_first.push(Stamp(stamp(FIRST_POSE_S + n[0])), pose(&n[1..13]) * camera_from_body);
        }
        let world_from_first = alignment(&from_first, &fixes);
        let mut truth = Trajectory::default();
        for (stamp, pose) in from_first.poses() {
            truth.push(*stamp, world_from_first * pose);
        }
        let frame = LocalFrame::new(origin());
        let row = |(stamp, p): &(i64, Vector3<f64>)| {
            let place = frame.geodetic_from_world(&Point3::from(*p));
            GnssRow {
                stamp: *stamp,
                latitude_deg: place.latitude_deg,
                longitude_deg: place.longitude_deg,
                altitude_m: place.altitude_m,
                // The file has positions only.
                speed_mps: -1.0,
                course_deg: -1.0,
                hdop: 1.0,
                satellites: 8,
                quality,
                ..GnssRow::default()
            }
        };
        let sample = |n: Vec<f64>| ImuRow {
            stamp: stamp(n[0]),
            acceleration: [n[2], n[3], n[4]],
            angular_rate: [n[5], n[6], n[7]],
        };
        let fixes = fixes.iter().map(row).collect();
        Self { truth, fixes, samples: numbers(&text(samples), ' ').map(sample).collect() }
    }

    /// The stamps of the first and the last pose.
    pub fn span(&self) -> [i64; 2] {
        let poses = self.truth.poses();
        [poses.first(), poses.last()].map(|end| end.map_or(0, |(stamp, _)| stamp.0))
    }

    pub fn truth_at(&self, stamp: i64) -> Pose {
        self.truth.at(Stamp(stamp)).unwrap_or_else(|| panic!("no pose at {stamp}"))
    }
}

/// The rotation and translation that move the poses to the fixes with the least squared distance (Kabsch).
fn alignment(from_first: &Trajectory, fixes: &[(i64, Vector3<f64>)]) -> Pose {
    let pairs = fixes.iter().filter_map(|(stamp, fix)| Some((from_first.at(Stamp(*stamp))?.translation.vector, *fix)));
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = pairs.collect();
    let n = pairs.len() as f64;
    let path_center = pairs.iter().map(|pair| pair.0).sum::<Vector3<f64>>() / n;
    let fix_center = pairs.iter().map(|pair| pair.1).sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> =
        pairs.iter().map(|(path, fix)| (fix - fix_center) * (path - path_center).transpose()).sum();
    let svd = spread.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { panic!("no singular vectors") };
    let sign = (u * v).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v;
    let rotation = UnitQuaternion::from_matrix(&rotation);
    Isometry3::from_parts((fix_center - rotation * path_center).into(), rotation)
}

/// A pose from the rows of a 3 by 4 matrix.
fn pose(n: &[f64]) -> Pose {
    let rotation = Matrix3::new(n[0], n[1], n[2], n[4], n[5], n[6], n[8], n[9], n[10]);
    Isometry3::from_parts(Vector3::new(n[3], n[7], n[11]).into(), UnitQuaternion::from_matrix(&rotation))
}

/// The text of a file, decompressed if its name ends with `.gz`.
fn text(path: &Path) -> String {
    let bytes = if path.extension().is_some_and(|extension| extension == "gz") {
        let output = std::process::Command::new("gzip").arg("-dc").arg(path).output().expect("gzip starts");
        assert!(output.status.success(), "gzip -dc {}", path.display());
        output.stdout
    } else {
        std::fs::read(path).expect("reads")
    };
    String::from_utf8(bytes).expect("is text")
}

/// The numbers of the lines, without the line of names.
fn numbers(text: &str, separator: char) -> impl Iterator<Item = Vec<f64>> {
    let parsed = move |line: &str| -> Option<Vec<f64>> {
        line.split(separator).filter(|word| !word.trim().is_empty()).map(|word| word.trim().parse().ok()).collect()
    };
    text.lines().filter_map(parsed)
}
