//! nuScenes with tables: sweeps, cameras and poses of a scene. The body frame is the ego frame of the data set: at the rear axle, on
//! the ground. The world frame is the map frame.

use super::labels::{self, KeyFrame};
use super::scene_choice::SceneChoice;
use super::{lidar, table};
use crate::cameras::{self, Camera};
use crate::error::ImportError;
use crate::plan::Plan;
use crate::rows::{self, Rows};
use crate::sweeps::Sweeps;
use crate::{Kind, Options};
use geometry::{CameraModel, Pinhole, Pose, Stamp, Trajectory};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The LiDAR of the data set.
const LIDAR: &str = "LIDAR_TOP";
/// The cameras, clockwise from the front.
const CAMERAS: [&str; 6] =
    ["CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_RIGHT", "CAM_BACK", "CAM_BACK_LEFT", "CAM_FRONT_LEFT"];
/// Exposure of the cameras, ns: the data set does not record it. 5 ms are common in daylight.
const EXPOSURE_NANOS: u64 = 5_000_000;

#[derive(Deserialize)]
struct Sensor {
    token: String,
    channel: String,
}

#[derive(Deserialize)]
struct CalibratedSensor {
    token: String,
    sensor_token: String,
    translation: [f64; 3],
    rotation: [f64; 4],
    camera_intrinsic: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Sample {
    token: String,
    scene_token: String,
}

#[derive(Deserialize)]
struct SampleData {
    token: String,
    sample_token: String,
    ego_pose_token: String,
    calibrated_sensor_token: String,
    /// µs since the Unix epoch.
    timestamp: i64,
    is_key_frame: bool,
    #[serde(default)]
    width: u32,
    #[serde(default)]
    height: u32,
    filename: String,
}

#[derive(Deserialize)]
struct EgoPose {
    token: String,
    translation: [f64; 3],
    rotation: [f64; 4],
}

/// A file of a sensor.
struct Frame {
    data: SampleData,
    stamp: Stamp,
    path: PathBuf,
}

/// The drive of the chosen scenes.
pub(super) fn plan(source: &Path, versions: &[PathBuf], options: &Options) -> Result<Plan, ImportError> {
    let choice = SceneChoice::new(source, versions, options)?;
    let tables = choice.tables.as_path();
    let calibrated = calibrated_sensors(tables)?;
    let mut frames = frames(source, tables, &choice.scenes, &calibrated)?;
    let poses = ego_poses(tables, &frames)?;
    let sweep_frames = frames.remove(LIDAR).unwrap_or_default();
    let body_from_lidar = calibration(&sweep_frames, &calibrated, tables)?.body_from_sensor;

    let file = |(number, frame): (usize, &Frame)| {
        let name = frame.path.file_name().unwrap_or_default().to_string_lossy();
        (format!("{number:06}_{name}"), frame.path.clone())
    };
    let sweeps = Sweeps {
        files: sweep_frames.iter().enumerate().map(file).collect(),
        times: Some(sweep_frames.iter().map(|frame| frame.stamp.0).collect()),
    };
    sweeps.check(source)?;
    rows::check(&sweeps.files, Rows::NUSCENES)?;
    let name = format!("{} ({})", choice.name, Kind::Nuscenes.title());
    let mut plan = sweeps.plan(Kind::Nuscenes, &name, lidar(options, body_from_lidar.into()));
    plan.report.push("the body frame is the ego frame: at the rear axle, on the ground".into());

    let mut found = Vec::new();
    for channel in CAMERAS {
        if let Some(images) = frames.get(channel) {
            found.push(camera(channel, images, &calibrated, tables)?);
        }
    }
    cameras::add(&mut plan, found)?;

    let mut stamped: Vec<(Stamp, &str)> = frames
        .values()
        .chain([&sweep_frames])
        .flatten()
        .map(|frame| (frame.stamp, frame.data.ego_pose_token.as_str()))
        .collect();
    stamped.sort_unstable();
    stamped.dedup_by_key(|(stamp, _)| *stamp);
    let mut trajectory = Trajectory::default();
    for (stamp, token) in stamped {
        trajectory.push(stamp, poses[token]);
    }
    plan.add_truth(&trajectory, None);
    plan.report.push(format!("imported: {} true poses of ego_pose.json", trajectory.poses().len()));

    let key_frames = sweep_frames.iter().enumerate().filter(|(_, frame)| frame.data.is_key_frame);
    let key_frame = |(seq, frame): (usize, &Frame)| KeyFrame {
        seq,
        sweep: frame.path.clone(),
        data_token: frame.data.token.clone(),
        sample_token: frame.data.sample_token.clone(),
        world_from_lidar: poses[frame.data.ego_pose_token.as_str()] * body_from_lidar,
    };
    labels::add(&mut plan, source, tables, key_frames.map(key_frame).collect())?;
    for name in ["scene", "log", "sensor", "calibrated_sensor", "sample", "sample_data", "ego_pose"] {
        plan.read.push(tables.join(format!("{name}.json")));
    }
    Ok(plan)
}

/// A calibrated sensor with its channel.
struct ChannelSensor {
    channel: String,
    sensor: CalibratedSensor,
}

/// A calibrated sensor with its mounting.
struct MountedSensor<'a> {
    body_from_sensor: Pose,
    sensor: &'a CalibratedSensor,
}

/// All calibrated sensors by token.
fn calibrated_sensors(tables: &Path) -> Result<BTreeMap<String, ChannelSensor>, ImportError> {
    let sensors: Vec<Sensor> = table::rows(&tables.join("sensor.json"))?;
    let channels: BTreeMap<String, String> = sensors.into_iter().map(|sensor| (sensor.token, sensor.channel)).collect();
    let mut found = BTreeMap::new();
    table::each_row(&tables.join("calibrated_sensor.json"), |row: CalibratedSensor| {
        let channel = channels.get(&row.sensor_token);
        let channel = channel.ok_or_else(|| format!("sensor {} is not in sensor.json", row.sensor_token))?;
        found.insert(row.token.clone(), ChannelSensor { channel: channel.clone(), sensor: row });
        Ok(())
    })?;
    Ok(found)
}

/// Files of the LiDAR and of the cameras by channel, sorted by time.
fn frames(
    source: &Path,
    tables: &Path,
    scenes: &BTreeSet<String>,
    calibrated: &BTreeMap<String, ChannelSensor>,
) -> Result<BTreeMap<String, Vec<Frame>>, ImportError> {
    let mut samples = BTreeSet::new();
    table::each_row(&tables.join("sample.json"), |row: Sample| {
        if scenes.contains(&row.scene_token) {
            samples.insert(row.token);
        }
        Ok(())
    })?;
    let mut frames: BTreeMap<String, Vec<Frame>> = BTreeMap::new();
    let mut n_files = 0;
    let mut absent = Vec::new();
    let path = tables.join("sample_data.json");
    table::each_row(&path, |data: SampleData| {
        if !samples.contains(&data.sample_token) {
            return Ok(());
        }
        let known = calibrated.get(&data.calibrated_sensor_token);
        let ChannelSensor { channel, .. } = known.ok_or_else(|| {
            format!("calibrated sensor {} is not in calibrated_sensor.json", data.calibrated_sensor_token)
        })?;
        if channel != LIDAR && !CAMERAS.contains(&channel.as_str()) {
            return Ok(());
        }
        let nanos = data.timestamp.checked_mul(1000);
        let stamp = Stamp(nanos.ok_or_else(|| format!("timestamp {} must be in microseconds", data.timestamp))?);
        n_files += 1;
        match table::file_inside(source, &data.filename)?.canonicalize() {
            Ok(path) => frames.entry(channel.clone()).or_default().push(Frame { data, stamp, path }),
            Err(_) => absent.push(data.filename),
        }
        Ok(())
    })?;
    if let Some(first) = absent.first() {
        let rule = format!(
            "{} of {n_files} files of the scene are absent, first {first}: download all its blobs",
            absent.len()
        );
        return Err(ImportError::at(source, rule));
    }
    if !frames.contains_key(LIDAR) {
        return Err(ImportError::at(&path, format!("the scene has no {LIDAR}")));
    }
    for frames in frames.values_mut() {
        frames.sort_by(|a, b| (a.stamp, &a.data.token).cmp(&(b.stamp, &b.data.token)));
    }
    Ok(frames)
}

/// Poses of the files by the tokens of the poses.
fn ego_poses(tables: &Path, frames: &BTreeMap<String, Vec<Frame>>) -> Result<BTreeMap<String, Pose>, ImportError> {
    let path = tables.join("ego_pose.json");
    let wanted: BTreeSet<&str> = frames.values().flatten().map(|frame| frame.data.ego_pose_token.as_str()).collect();
    let mut poses = BTreeMap::new();
    table::each_row(&path, |row: EgoPose| {
        if wanted.contains(row.token.as_str()) {
            poses.insert(row.token, table::pose(row.translation, row.rotation)?);
        }
        Ok(())
    })?;
    match wanted.iter().find(|token| !poses.contains_key(**token)) {
        None => Ok(poses),
        Some(token) => Err(ImportError::at(&path, format!("has no pose {token}, which sample_data.json names"))),
    }
}

/// Mounting and calibration of a sensor, which must be the same for all its files.
fn calibration<'a>(
    frames: &[Frame],
    calibrated: &'a BTreeMap<String, ChannelSensor>,
    tables: &Path,
) -> Result<MountedSensor<'a>, ImportError> {
    let path = tables.join("calibrated_sensor.json");
    let tokens: BTreeSet<&str> = frames.iter().map(|frame| frame.data.calibrated_sensor_token.as_str()).collect();
    let mut sensors = tokens.iter().filter_map(|token| calibrated.get(*token)).map(|found| &found.sensor);
    let Some(sensor) = sensors.next() else { return Err(ImportError::at(&path, "has no calibration of the scene")) };
    let is_same = |other: &CalibratedSensor| {
        (other.translation, other.rotation, &other.camera_intrinsic)
            == (sensor.translation, sensor.rotation, &sensor.camera_intrinsic)
    };
    if !sensors.all(is_same) {
        let rule = "a sensor has several calibrations in the chosen scenes; choose one scene with --scene";
        return Err(ImportError::at(&path, rule));
    }
    let pose = table::pose(sensor.translation, sensor.rotation);
    let pose = pose.map_err(|rule| ImportError::at(&path, format!("sensor {}: {rule}", sensor.token)))?;
    Ok(MountedSensor { body_from_sensor: pose, sensor })
}

fn camera(
    channel: &str,
    frames: &[Frame],
    calibrated: &BTreeMap<String, ChannelSensor>,
    tables: &Path,
) -> Result<Camera, ImportError> {
    let MountedSensor { body_from_sensor: body_from_camera, sensor } = calibration(frames, calibrated, tables)?;
    let fault = |rule: String| ImportError::at(&tables.join("calibrated_sensor.json"), format!("{channel}: {rule}"));
    let [[fx, skew, cx], [_, fy, cy], _] = sensor.camera_intrinsic[..] else {
        return Err(fault("camera_intrinsic must be 3 rows of 3 numbers".into()));
    };
    if skew != 0.0 {
        return Err(fault(format!("skew {skew} of camera_intrinsic must be 0")));
    }
    let size = |frame: &Frame| [frame.data.width, frame.data.height];
    let first = frames.first().map(size).unwrap_or_default();
    if let Some(other) = frames.iter().find(|frame| size(frame) != first) {
        let [w, h] = size(other);
        let [width, height] = first;
        return Err(ImportError::at(&other.path, format!("{w} x {h} px; the previous images have {width} x {height}")));
    }
    let [width, height] = first;
    Ok(Camera {
        name: channel.to_owned(),
        exposure_nanos: EXPOSURE_NANOS,
        body_from_camera,
        model: CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] }),
        images: frames.iter().map(|frame| (frame.stamp.0, frame.path.clone())).collect(),
        n_absent: 0,
    })
}
