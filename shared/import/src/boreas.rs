//! Boreas (Burnett et al., IJRR 2023): a sequence of a vehicle with a Velodyne Alpha Prime, an Applanix unit and a camera.
//!
//! The body frame is the frame of the Applanix unit, turned so that x is forward, y left and z up. If only the sweeps are
//! imported, it is the LiDAR frame.

mod calibration;
mod poses;
mod sweep;

use crate::cameras::{self, Camera, image_size};
use crate::error::ImportError;
use crate::files::{files, stem};
use crate::imu_table;
use crate::imu_units::to_metric;
use crate::plan::{Conversion, Plan, TextFile};
use crate::rings::model_of_beams;
use crate::stamp_text;
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use crate::{Kind, Options};
use drive::imu::{ImuSample, csv_from_samples};
use drive::manifest::{ImuEntry, LidarEntry};
use formats::cloud_fields::{Elevations, Rings};
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use lidar::{Lidar, Model};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};
use sweep::SweepFile;

/// Lasers of an Alpha Prime.
const N_LASERS: u16 = 128;
/// Sweeps from which the elevations of the lasers are determined, spread over the drive: the upper lasers may see only
/// sky for a while.
const EXAMINED: usize = 16;
/// Exposure of the camera, ns: the data set does not record it.
const EXPOSURE_NANOS: u64 = 5_000_000;
/// Cosine of the largest angle between the mean acceleration and the vertical: 30 degrees.
const MIN_UPRIGHT: f64 = 0.87;

const LIDAR_CALIBRATION: &str = "calib/T_applanix_lidar.txt";
const POSES: &str = "applanix/lidar_poses.csv";
const RAW_IMU: &str = "applanix/imu_raw.csv";

/// Whether a folder is a sequence.
pub(crate) fn is_sequence(source: &Path) -> bool {
    source.join("lidar").is_dir() && (source.join("applanix").is_dir() || source.join(LIDAR_CALIBRATION).is_file())
}

/// The drive of a sequence.
pub(crate) fn plan(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let images = if options.lidar_only { Vec::new() } else { stamped(&source.join("camera"), ".png")? };
    let has = |name: &str| !options.lidar_only && source.join(name).is_file();
    let needs_body = has(POSES) || has(RAW_IMU) || !images.is_empty() || has(LIDAR_CALIBRATION);
    let mut read = Vec::new();
    let body_from_lidar = if needs_body {
        let path = source.join(LIDAR_CALIBRATION);
        let applanix_from_lidar = calibration::transform(&path)?;
        read.push(path);
        // Applanix: x right, y forward, z up.
        let body_from_applanix = UnitQuaternion::from_euler_angles(0.0, 0.0, -FRAC_PI_2);
        body_from_applanix * applanix_from_lidar
    } else {
        Pose::identity()
    };
    let mut plan = sweeps(source, options, body_from_lidar)?;
    plan.read.extend(read);
    if has(POSES) {
        let path = source.join(POSES);
        let trajectory = poses::read(&path, &body_from_lidar.inverse())?;
        plan.report.push(format!("imported: {} true poses of {POSES}", trajectory.poses().len()));
        plan.add_truth(&trajectory, None);
        plan.read.push(path);
    }
    if has(RAW_IMU) {
        add_imu(&mut plan, &source.join(RAW_IMU))?;
    }
    if !images.is_empty() {
        let found = camera(source, images, &body_from_lidar, &mut plan.read)?;
        cameras::add(&mut plan, vec![found])?;
    }
    if needs_body {
        plan.report.push("the body frame is the frame of the Applanix unit, x forward, y left, z up".into());
    }
    Ok(plan)
}

/// A drive with only the sweeps.
fn sweeps(source: &Path, options: &Options, body_from_lidar: Pose) -> Result<Plan, ImportError> {
    let found = stamped(&source.join("lidar"), ".bin")?;
    let step = found.len().div_ceil(EXAMINED).max(1);
    let mut elevations = Elevations::default();
    let mut begins = Vec::new();
    for (index, (stamp, path)) in found.iter().enumerate() {
        let sweep = SweepFile::read(path, *stamp)?;
        if begins.last().is_some_and(|last| *last >= sweep.begin) {
            return Err(ImportError::at(
                path,
                "its first point must be later than the first point of the previous sweep",
            ));
        }
        begins.push(sweep.begin);
        if index % step == 0 {
            sweep.add_to(&mut elevations);
        }
    }
    let n_lasers = options.model.map_or(usize::from(N_LASERS), |model| Lidar::from(model).n_rings());
    let n_lasers = u16::try_from(n_lasers).ok().filter(|n| *n > 0).unwrap_or(N_LASERS);
    let rings = elevations.rings(Some(n_lasers), 1);
    let model: Model = options.model.unwrap_or_else(|| model_of_beams(rings.as_ref().map_or(0, Rings::n_rings)));
    let lidar = LidarEntry::new(model.name(), "pcd", LIDAR_FOLDER, body_from_lidar.into());
    let named = |begin: &i64| (format!("{begin:019}.pcd"), PathBuf::new());
    let named = Sweeps { files: begins.iter().map(named).collect(), times: Some(begins) };
    named.check(&source.join("lidar"))?;
    let mut plan = named.plan(Kind::Boreas, &crate::drive_name(source, Kind::Boreas), lidar);
    plan.links.clear();
    plan.report.push(match &rings {
        Some(rings) => format!("rings: {} lasers counted {}", rings.n_rings(), rings.order),
        None => "no rings: the points do not show the elevation of each laser".to_owned(),
    });
    if options.model.is_none() {
        let rule = "the Alpha Prime is not among the models";
        plan.report.push(format!("{rule}: {} is assumed, --model sets another", model.name()));
    }
    for ((name, _), (stamp, original)) in named.files.iter().zip(found) {
        let rings = rings.clone();
        plan.conversions.push(Conversion {
            place: Path::new(LIDAR_FOLDER).join(name),
            originals: vec![original.clone()],
            content: Box::new(move || Ok(SweepFile::read(&original, stamp)?.pcd(rings.as_ref())?.into())),
        });
    }
    Ok(plan)
}

/// Files named by their stamps in µs, with the stamps in ns, sorted by stamp.
fn stamped(folder: &Path, end: &str) -> Result<Vec<(i64, PathBuf)>, ImportError> {
    let mut found = Vec::new();
    for (name, path) in files(folder, end)? {
        let stamp = stamp_text::nanos(stem(&name, end).unwrap_or_default());
        let stamp = stamp.ok_or_else(|| ImportError::at(&path, "the name must be the stamp, us since 1970"))?;
        found.push((stamp, path));
    }
    found.sort();
    Ok(found)
}

/// Images are rectified. `T_camera_lidar` maps points of the LiDAR to the camera.
fn camera(
    source: &Path,
    images: Vec<(i64, PathBuf)>,
    body_from_lidar: &Pose,
    read: &mut Vec<PathBuf>,
) -> Result<Camera, ImportError> {
    let [lens, mounting] = ["calib/P_camera.txt", "calib/T_camera_lidar.txt"].map(|name| source.join(name));
    let camera_from_lidar = calibration::transform(&mounting)?;
    let projection = calibration::projection(&lens)?;
    let size = match images.first() {
        Some((_, first)) => image_size(first)?,
        None => [0; 2],
    };
    read.extend([lens, mounting]);
    Ok(Camera {
        name: "front".to_owned(),
        exposure_nanos: EXPOSURE_NANOS,
        body_from_camera: body_from_lidar * camera_from_lidar.inverse() * projection.rectified_from_camera,
        model: projection.model(size),
        images,
        n_absent: 0,
    })
}

/// The raw samples of the unit: x backward, y left, z down. The samples in `imu.csv` are processed by the unit, without
/// gravity.
fn add_imu(plan: &mut Plan, path: &Path) -> Result<(), ImportError> {
    let mut samples = imu_table::read(path)?;
    if let Err(rule) = to_metric(&mut samples).and_then(|_| upright(&samples)) {
        plan.report.push(format!("not imported: {RAW_IMU}: {rule}"));
        return Ok(());
    }
    plan.report.push(format!("imported: {} IMU samples of {RAW_IMU}", samples.len()));
    let file = "imu.csv";
    plan.texts.push(TextFile { place: file.into(), text: csv_from_samples(&samples) });
    let body_from_imu = Isometry3::from_parts([0.0; 3].into(), UnitQuaternion::from_euler_angles(0.0, PI, 0.0));
    plan.manifest.imu = Some(ImuEntry {
        delay_nanos: 0,
        file: file.to_owned(),
        position_in_body: [0.0; 3],
        body_from_imu: Some(body_from_imu.into()),
    });
    plan.read.push(path.to_owned());
    Ok(())
}

/// A vehicle is upright on average, and gravity is measured upward.
fn upright(samples: &[ImuSample]) -> Result<(), String> {
    let sum: Vector3<f64> = samples.iter().map(|sample| Vector3::from(sample.acceleration)).sum();
    let mean = sum / samples.len().max(1) as f64;
    if -mean.z > MIN_UPRIGHT * mean.norm() {
        return Ok(());
    }
    let [x, y, z] = [mean.x, mean.y, mean.z];
    Err(format!("the mean acceleration is {x:.1} {y:.1} {z:.1} m/s^2; with z down it must be about 0 0 -9.8"))
}
