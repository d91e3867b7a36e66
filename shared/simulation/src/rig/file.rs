//! Reads rig files.

mod lidars;

use super::spec::{CameraSpec, MosaicSpec, RigSpec};
use crate::sensors::gnss::{GnssSpec, Receiver};
use crate::sensors::imu::{Grade, ImuSpec};
use crate::sensors::mosaic::{MosaicModel, SIZE};
use crate::sensors::trigger::TriggerSpec;
use drive::manifest::rules;
use files::problems::FileError;
use files::toml_file::TomlFile;
use geometry::{CameraModel, Isometry3, Pose, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Rotation3};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

const KEYS: [&str; 8] = ["name", "body_height_m", "lidar", "trigger", "camera", "mosaic", "gnss", "imu"];

/// Mounting of a sensor. Angles rotate the sensor from the body axes: first roll about x, then pitch about y (positive is
/// down), then yaw about z (positive is left). A camera without angles faces forward.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMounting {
    position: [f64; 3],
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default)]
    pitch_deg: f64,
    #[serde(default)]
    roll_deg: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLidar {
    /// Required if there are several LiDARs.
    #[serde(default)]
    name: Option<String>,
    model: String,
    mounting: RawMounting,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTrigger {
    rate_hz: f64,
    way_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    name: String,
    exposure_nanos: u64,
    mounting: RawMounting,
    lens: CameraModel,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMosaic {
    name: String,
    sensor: String,
    mounting: RawMounting,
    lens: CameraModel,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGnss {
    receiver: String,
    antenna_in_body: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawImu {
    grade: String,
    rate_hz: f64,
    #[serde(default)]
    position_in_body: [f64; 3],
}

impl RigSpec {
    /// Reads the text of a rig file. `path` is for error messages. The error lists all problems at once.
    pub fn from_toml(path: &Path, text: &str) -> Result<Self, FileError> {
        read(path, text)
    }
}

fn read(path: &Path, text: &str) -> Result<RigSpec, FileError> {
    let mut file = TomlFile::new(path, text, &KEYS);
    let name: Option<String> = file.required("name", &[]);
    let body_height_m =
        file.required("body_height_m", &[]).inspect(|h| within(&mut file, "body_height_m", *h, 0.0, 3.0));
    let lidars: Vec<Option<RawLidar>> = file.one_or_more("lidar", &[]);
    let lidars = lidars::lidars(&mut file, lidars);
    // Cameras that cannot be read are reported as problems.
    let cameras: Vec<RawCamera> = file.list("camera", &[]).into_iter().flatten().collect();
    let mosaics: Vec<RawMosaic> = file.list("mosaic", &[]).into_iter().flatten().collect();
    let trigger: Option<RawTrigger> = file.optional("trigger", &[]);
    file.rule("trigger", trigger.is_some() || (cameras.is_empty() && mosaics.is_empty()), || {
        "is missing: cameras need a trigger with rate_hz and way_m".into()
    });
    let trigger = trigger.unwrap_or(RawTrigger { rate_hz: 1.0, way_m: 1.0 });
    within(&mut file, "trigger.rate_hz", trigger.rate_hz, 0.1, 30.0);
    within(&mut file, "trigger.way_m", trigger.way_m, 0.0, 100.0);
    let cameras = cameras.into_iter().enumerate().map(|(index, raw)| camera(&mut file, index, raw)).collect();
    let mut names = BTreeSet::new();
    let mosaics: Vec<_> =
        mosaics.into_iter().enumerate().map(|(index, raw)| mosaic(&mut file, index, raw, &mut names)).collect();
    let gnss: Option<RawGnss> = file.optional("gnss", &[]);
    let gnss = gnss.and_then(|raw| gnss_spec(&mut file, &raw));
    let imu: Option<RawImu> = file.optional("imu", &[]);
    let imu = imu.and_then(|raw| imu_spec(&mut file, &raw));
    match (name, body_height_m, lidars, mosaics.into_iter().collect()) {
        (Some(name), Some(body_height_m), Some(lidars), Some(mosaics)) if file.is_sound() => Ok(RigSpec {
            name,
            body_height_m,
            lidar: lidars.first,
            lidar_name: lidars.first_name,
            other_lidars: lidars.others,
            trigger: TriggerSpec { rate_hz: trigger.rate_hz, way_m: trigger.way_m },
            cameras,
            mosaics,
            gnss,
            imu,
        }),
        _ => Err(file.into_error()),
    }
}

fn camera(file: &mut TomlFile, index: usize, raw: RawCamera) -> CameraSpec {
    let key = |name: &str| format!("camera[{index}].{name}");
    rules::exposure(file, &key("exposure_nanos"), raw.exposure_nanos);
    rules::lens(file, &key("lens"), &raw.lens);
    let body_from_camera = camera_pose(file, &key("mounting"), &raw.mounting);
    CameraSpec { name: raw.name, exposure_nanos: raw.exposure_nanos, body_from_camera, lens: raw.lens }
}

fn mosaic(file: &mut TomlFile, index: usize, raw: RawMosaic, names: &mut BTreeSet<String>) -> Option<MosaicSpec> {
    let key = |name: &str| format!("mosaic[{index}].{name}");
    rules::lens(file, &key("lens"), &raw.lens);
    let (width, height) = raw.lens.size();
    file.rule(&key("lens"), [width, height] == SIZE.map(|side| side as u32), || {
        format!("size {width} x {height} must be the sensor's, {} x {}", SIZE[0], SIZE[1])
    });
    // The name is used as a folder of the drive.
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let taken = ["camera", "lidar", "truth"].contains(&raw.name.as_str()) || !names.insert(raw.name.clone());
    file.rule(&key("name"), !taken && !raw.name.is_empty() && raw.name.chars().all(plain), || {
        format!("value {:?} must be a folder of its own: a to z, 0 to 9, _", raw.name)
    });
    let body_from_camera = camera_pose(file, &key("mounting"), &raw.mounting);
    let models = [MosaicModel::hs02(), MosaicModel::hs03()];
    let sensor = one_of(file, &key("sensor"), &raw.sensor, &models, |model| model.name)?;
    Some(MosaicSpec { name: raw.name, sensor, body_from_camera, lens: raw.lens })
}

fn gnss_spec(file: &mut TomlFile, raw: &RawGnss) -> Option<GnssSpec> {
    rules::position(file, "gnss.antenna_in_body", &raw.antenna_in_body);
    let receiver = one_of(file, "gnss.receiver", &raw.receiver, &Receiver::ALL, |receiver| receiver.name())?;
    Some(GnssSpec { receiver, antenna_in_body: raw.antenna_in_body })
}

fn imu_spec(file: &mut TomlFile, raw: &RawImu) -> Option<ImuSpec> {
    within(file, "imu.rate_hz", raw.rate_hz, 10.0, 1000.0);
    rules::position(file, "imu.position_in_body", &raw.position_in_body);
    let grade = one_of(file, "imu.grade", &raw.grade, &Grade::ALL, |grade| grade.name())?;
    Some(ImuSpec { grade, rate_hz: raw.rate_hz, position_in_body: raw.position_in_body })
}

fn within(file: &mut TomlFile, key: &str, value: f64, low: f64, high: f64) {
    file.rule(key, (low..=high).contains(&value), || format!("value {value} must be {low} to {high}"));
}

fn one_of<T: Clone>(
    file: &mut TomlFile,
    key: &str,
    name: &str,
    known: &[T],
    name_of: impl Fn(&T) -> &'static str,
) -> Option<T> {
    let found = known.iter().find(|known| name_of(known) == name).cloned();
    file.rule(key, found.is_some(), || {
        let names: Vec<&str> = known.iter().map(&name_of).collect();
        format!("value {name:?} must be one of {}", names.join(", "))
    });
    found
}

fn pose(file: &mut TomlFile, key: &str, raw: &RawMounting) -> Pose {
    rules::position(file, &format!("{key}.position"), &raw.position);
    let angles = [raw.roll_deg, raw.pitch_deg, raw.yaw_deg];
    file.rule(key, angles.iter().all(|angle| angle.abs() <= 360.0), || {
        format!("roll, pitch and yaw {angles:?} must be -360 to 360 degrees")
    });
    let [roll, pitch, yaw] = angles.map(f64::to_radians);
    Isometry3::from_parts(Vector3::from(raw.position).into(), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

/// Converts a mounting from body axes to camera axes: x right, y down, z forward.
fn camera_pose(file: &mut TomlFile, key: &str, raw: &RawMounting) -> Pose {
    let axes = Matrix3::from_columns(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
    pose(file, key, raw) * UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lidar::velodyne::Model;

    #[test]
    fn rig_file_error_lists_every_problem_with_its_line() {
        let text = include_str!("../../rigs/l3d2.toml");
        let broken = text
            .replace("body_height_m = 1.0", "body_height_m = 9.0")
            .replace("model = \"hdl32e\"", "model = \"hdl33\"")
            .replace("rate_hz = 1.0\n", "rate_hz = 1.0\nrate = 2\n")
            .replace("name = \"hs03\"\nsensor = \"hs03\"", "name = \"hs02\"\nsensor = \"hs04\"")
            .replace("grade = \"tactical\"", "grade = \"naval\"")
            .replace("fx = 353.0, fy = 353.0, cx = 307.5", "fx = 0.0, fy = 353.0, cx = 307.5");
        let error = RigSpec::from_toml(Path::new("my.toml"), &broken).expect_err("faults");
        let line_of = |part: &str| broken.lines().position(|line| line.contains(part)).expect("there") + 1;
        let texts: Vec<String> = error.problems.iter().map(ToString::to_string).collect();
        for (line, expected) in [
            (line_of("body_height_m"), "body_height_m: value 9 must be 0 to 3"),
            (line_of("hdl33"), "lidar.model: value \"hdl33\" must be one of hdl32e, vlp16, vlp32c, hdl64e"),
            (line_of("rate = 2"), "trigger: unknown field `rate`"),
            (line_of("hs04"), "mosaic[1].sensor: value \"hs04\" must be one of hs02, hs03"),
            (line_of("hs04") - 1, "mosaic[1].name: value \"hs02\" must be a folder of its own"),
            (line_of("naval"), "imu.grade: value \"naval\" must be one of tactical, mems"),
            (line_of("fx = 0.0"), "camera[0].lens: focal lengths [0.0, 353.0] must be positive"),
        ] {
            let begin = format!("my.toml:{line}: {expected}");
            assert!(texts.iter().any(|text| text.starts_with(&begin)), "{begin}\nis not in\n{error}");
        }
    }

    #[test]
    fn rig_with_only_a_lidar_is_accepted() {
        let text = "name = \"bare\"\nbody_height_m = 0.0\n[lidar]\nmodel = \"vlp16\"\nmounting = { position = [0.0, 0.0, 2.0] }\n";
        let rig = RigSpec::from_toml(Path::new("bare.toml"), text).expect("sound");
        assert_eq!((rig.lidar.model, rig.cameras.len(), rig.gnss, rig.imu), (Model::Vlp16, 0, None, None));
        assert_eq!(RigSpec::from_toml(Path::new("x"), "").expect_err("empty").problems.len(), 3);
        let error = RigSpec::from_toml(Path::new("x"), "name = [").expect_err("no TOML");
        assert_eq!((error.problems.len(), error.problems[0].line), (1, Some(1)));
    }
}
