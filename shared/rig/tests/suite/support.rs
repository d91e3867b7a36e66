//! Simulated drives, and copies of them with a fault.

use drive::Drive;
use drive::manifest::{Manifest, PoseEntry};
use geometry::{Pose, UnitQuaternion, Vector3};
use rig::check::Report;
use rig::survey::{Survey, SurveySettings};
use simulation::{DriveSpec, RigSpec, write_drive};
use std::fmt::Write;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A drive that several tests read.
pub struct Recorded {
    folder: TempDir,
}

impl Recorded {
    pub fn simulate(spec: &DriveSpec) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        write_drive(spec, &folder.path().join("drive"), &mut |_| {}).expect("simulated");
        Self { folder }
    }

    pub fn path(&self) -> PathBuf {
        self.folder.path().join("drive")
    }

    pub fn manifest(&self) -> Manifest {
        Drive::open(&self.path()).expect("a drive").manifest().clone()
    }
}

/// A street with turns, with two LiDARs.
pub fn with_two_lidars() -> &'static Recorded {
    static DRIVE: OnceLock<Recorded> = OnceLock::new();
    DRIVE.get_or_init(|| {
        let rig = RigSpec::built_in("twin").expect("built in");
        Recorded::simulate(&DriveSpec { rig, ..DriveSpec::urban(TURNS_SEED, 9.0).sparse(2) })
    })
}

/// A street with three pinhole cameras and an upright LiDAR.
pub fn with_cameras() -> &'static Recorded {
    static DRIVE: OnceLock<Recorded> = OnceLock::new();
    DRIVE.get_or_init(|| {
        let mut rig = RigSpec::built_in("nuscenes").expect("built in");
        rig.cameras = [0, 2, 3].map(|index| rig.cameras[index].clone()).to_vec();
        Recorded::simulate(&DriveSpec { rig, mosaics: false, ..DriveSpec::urban(8, 6.0) })
    })
}

/// A street with turns, with only a LiDAR, a receiver and an inertial unit.
pub fn with_turns() -> &'static Recorded {
    static DRIVE: OnceLock<Recorded> = OnceLock::new();
    DRIVE.get_or_init(|| {
        let rig = RigSpec::built_in("nuscenes").expect("built in");
        Recorded::simulate(&DriveSpec { rig, ..DriveSpec::urban(TURNS_SEED, TURNS_SECONDS).sparse(2) })
    })
}

pub const TURNS_SEED: u64 = 1;
pub const TURNS_SECONDS: f64 = 14.0;

/// Stamp, force and rate of an inertial unit.
pub type Sample = (i64, [f64; 3], [f64; 3]);

/// A copy of a drive whose files are links.
pub struct Copied {
    folder: TempDir,
    pub manifest: Manifest,
}

impl Copied {
    pub fn from_recorded(recorded: &Recorded) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for entry in fs::read_dir(recorded.path()).expect("lists").flatten() {
            symlink(entry.path(), folder.path().join(entry.file_name())).expect("links");
        }
        Self { folder, manifest: recorded.manifest() }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Removes the link to a file or folder, and returns its path.
    pub fn replaced(&self, name: &str) -> PathBuf {
        let path = self.path().join(name);
        fs::remove_file(&path).expect("a link");
        path
    }

    /// Shifts the times in all image names.
    pub fn with_images_late(self, nanos: i64) -> Self {
        let originals = fs::canonicalize(self.path().join("camera")).expect("a folder");
        let cameras = self.replaced("camera");
        for camera in fs::read_dir(originals).expect("lists").flatten() {
            let folder = cameras.join(camera.file_name());
            fs::create_dir_all(&folder).expect("made");
            for image in fs::read_dir(camera.path()).expect("lists").flatten() {
                let path = image.path();
                let stamp: i64 =
                    path.file_stem().and_then(|stem| stem.to_str()).expect("text").parse().expect("a stamp");
                let extension = path.extension().expect("has one").to_string_lossy().into_owned();
                symlink(&path, folder.join(format!("{}.{extension}", stamp + nanos))).expect("links");
            }
        }
        self
    }

    /// Replaces the samples of the inertial unit: force and rate.
    pub fn with_samples(self, change: impl Fn(i64, [f64; 3], [f64; 3]) -> Sample) -> Self {
        let text = fs::read_to_string(self.path().join("imu.csv")).expect("reads");
        let mut lines = text.lines();
        let mut out = lines.next().expect("a header").to_owned();
        for line in lines {
            let (stamp, rest) = line.split_once(',').expect("columns");
            let v: Vec<f64> = rest.split(',').map(|word| word.parse().expect("a number")).collect();
            let (stamp, force, rate) = change(stamp.parse().expect("a stamp"), [v[0], v[1], v[2]], [v[3], v[4], v[5]]);
            let numbers: Vec<String> = force.iter().chain(&rate).map(f64::to_string).collect();
            write!(out, "\n{stamp},{}", numbers.join(",")).expect("a text");
        }
        fs::write(self.replaced("imu.csv"), out + "\n").expect("writes");
        self
    }

    pub fn open(&self) -> Drive {
        let _ = fs::remove_file(self.path().join("drive.toml"));
        fs::write(self.path().join("drive.toml"), toml::to_string(&self.manifest).expect("TOML")).expect("writes");
        Drive::open(self.path()).expect("a drive")
    }

    /// Check and subject of each doubt.
    pub fn doubts(&self) -> Vec<String> {
        doubts(&self.open(), &SurveySettings::default())
    }
}

pub fn doubts(drive: &Drive, settings: &SurveySettings) -> Vec<String> {
    let survey = Survey::from_drive(drive, settings).expect("surveyed");
    let report = Report::from_survey(drive, &survey, settings).expect("checked");
    report.doubts().map(|verdict| format!("{} {}", verdict.subject, verdict.check)).collect()
}

/// Rotates a sensor about body axes (`of_body`) or its own axes.
pub fn turn(entry: &mut PoseEntry, axis: Vector3<f64>, degrees: f64, of_body: bool) {
    let pose = entry.to_pose().expect("a pose");
    let rotation = UnitQuaternion::from_scaled_axis(axis * degrees.to_radians());
    let turned = if of_body { rotation * pose.rotation } else { pose.rotation * rotation };
    *entry = Pose::from_parts(pose.translation, turned).into();
}
