//! Rules for descriptions of sensors, shared by `drive.toml` and the rig files of simulated vehicles.

use super::PoseEntry;
use files::toml_file::TomlFile;
use geometry::CameraModel;

/// Longest side of an image, px.
const MAX_SIDE: u32 = 32_768;
/// Limit of sensor positions, m: longer than any vehicle.
const MAX_OFFSET_M: f64 = 100.0;
/// Limit of delays, ns: 10 s. A larger one is another clock, not a delay.
pub const MAX_DELAY_NANOS: u64 = 10_000_000_000;

/// Checks that a pose is a rigid transform.
pub fn pose(file: &mut TomlFile, key: &str, entry: &PoseEntry) {
    file.rule(key, entry.to_pose().is_some(), || {
        format!("{entry:?} is not a rigid transform; expected finite numbers and a unit quaternion x y z w")
    });
}

/// Checks a position on the vehicle.
pub fn position(file: &mut TomlFile, key: &str, position: &[f64; 3]) {
    let near = position.iter().all(|v| v.abs() < MAX_OFFSET_M);
    file.rule(key, near, || format!("value {position:?} must be three lengths below {MAX_OFFSET_M} m"));
}

/// Checks a delay of the stamps of a sensor.
pub fn delay(file: &mut TomlFile, key: &str, nanos: i64) {
    file.rule(key, nanos.unsigned_abs() <= MAX_DELAY_NANOS, || format!("value {nanos} must be -10 s to 10 s in ns"));
}

/// Checks an exposure time.
pub fn exposure(file: &mut TomlFile, key: &str, nanos: u64) {
    let range = 1..=10_000_000_000;
    file.rule(key, range.contains(&nanos), || format!("value {nanos} must be 1 ns to 10 s"));
}

/// Checks a lens model and its image size.
pub fn lens(file: &mut TomlFile, key: &str, model: &CameraModel) {
    let (width, height) = model.size();
    let sized = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    file.rule(key, sized, || format!("size {width} x {height} must be 1 to {MAX_SIDE} px a side"));
    let (focal, rest, angle) = match model {
        CameraModel::Pinhole(m) => ([m.fx, m.fy], [&[m.cx, m.cy][..], &m.distortion].concat(), 1.0),
        CameraModel::KannalaBrandt(m) => ([m.fx, m.fy], [&[m.cx, m.cy][..], &m.distortion].concat(), m.max_angle),
        CameraModel::SplineWarp(m) => ([m.fx, m.fy], vec![m.cx, m.cy], 1.0),
    };
    let focused = focal.iter().all(|f| *f > 0.0 && f.is_finite());
    file.rule(key, focused, || format!("focal lengths {focal:?} must be positive"));
    file.rule(key, rest.iter().all(|v| v.is_finite()), || {
        "principal point and distortion must be finite numbers".into()
    });
    let opens = angle > 0.0 && angle <= std::f64::consts::PI;
    file.rule(key, opens, || format!("max_angle {angle} must be above 0, up to pi"));
}
