//! The inertial unit compared with the motion of the LiDAR.

use super::Verdict;
use crate::survey::Survey;
use drive::Drive;
use geometry::UnitQuaternion;
use nalgebra::{Matrix3, Rotation3};
use registration::{Axes, InertialCheck};

const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Limits of the rotation of the mounting, rad, and of its significance in standard deviations.
const MAX_ROTATION: f64 = 1.5 * DEGREE;
const SIGNIFICANT: f64 = 4.0;
/// Limit of the time offset, s: a point 20 m away moves by 1 cm at 0.5 rad/s in 1 ms.
const MAX_LATE_S: f64 = 0.02;

/// Reason for unknown mounting and axes.
const NO_TURN: &str = "the vehicle turned or braked too little to compare the unit with the LiDAR";

pub(super) fn verdicts(drive: &Drive, survey: &Survey) -> Vec<Verdict> {
    let Some(check) = survey.inertial.as_ref().filter(|check| check.has_samples()) else {
        return vec![Verdict::unknown("motion", "imu", "no samples within the sweeps")];
    };
    if let Some(reason) = check.why_withheld() {
        let value = format!("does not fit the LiDAR: {reason}");
        let advice = "check the units of imu.csv (m/s^2, rad/s), its axes (imu.body_from_imu) and its clock";
        return vec![Verdict::new("motion", "imu", false, [value, String::new(), advice.to_owned()])];
    }
    let mut verdicts = units(check);
    verdicts.push(axes(drive, check));
    let Some(found) = check.mounting().filter(|_| check.is_verified()) else {
        verdicts.push(Verdict::unknown("mounting", "imu", NO_TURN));
        return verdicts;
    };
    let value = format!("stamps {:.1} +- {:.1} ms late", found.late_s * 1e3, found.late_sigma_s * 1e3);
    let is_on_time = found.late_s.abs() - 3.0 * found.late_sigma_s <= MAX_LATE_S;
    let advice = format!("add {:.0} ms to imu.delay_nanos", found.late_s * 1e3);
    verdicts.push(Verdict::new("delay", "imu", is_on_time, [value, format!("{:.0} ms", MAX_LATE_S * 1e3), advice]));
    if found.rotation_sigma.max() < 1.0 {
        let list =
            |v: &geometry::Vector3<f64>| format!("{:.2}, {:.2}, {:.2}", v.x / DEGREE, v.y / DEGREE, v.z / DEGREE);
        let value = format!(
            "turned about x, y, z of the body by {} degrees (deviations {})",
            list(&found.rotation),
            list(&found.rotation_sigma)
        );
        let is_within =
            (0..3).all(|axis| found.rotation[axis].abs() <= MAX_ROTATION.max(SIGNIFICANT * found.rotation_sigma[axis]));
        let rotation = UnitQuaternion::from_scaled_axis(found.rotation) * stated(drive);
        let advice = format!("set imu.body_from_imu.rotation = {}", quaternion(&rotation));
        let limit = format!("{:.1} degrees", MAX_ROTATION / DEGREE);
        verdicts.push(Verdict::new("mounting", "imu", is_within, [value, limit, advice]));
    }
    verdicts
}

fn units(check: &InertialCheck) -> Vec<Verdict> {
    let correction = check.correction();
    let mut wrong = Vec::new();
    if correction.force.scale != 1.0 {
        wrong.push("accelerations are in g, not m/s^2");
    }
    if correction.rate.scale != 1.0 {
        wrong.push("angular rates are in degrees per second, not rad/s");
    }
    let value = if wrong.is_empty() { "m/s^2 and rad/s".to_owned() } else { wrong.join("; ") };
    let advice = "convert imu.csv to m/s^2 and rad/s".to_owned();
    if wrong.is_empty() && !check.is_verified() {
        return Vec::new();
    }
    vec![Verdict::new("units", "imu", wrong.is_empty(), [value, String::new(), advice])]
}

fn axes(drive: &Drive, check: &InertialCheck) -> Verdict {
    let [rate, force] = [check.correction().rate.axes, check.correction().force.axes];
    if !check.is_verified() {
        return Verdict::unknown("axes", "imu", NO_TURN);
    }
    if rate == Axes::BODY && force == Axes::BODY {
        return Verdict::new("axes", "imu", true, ["body axes".to_owned(), String::new(), String::new()]);
    }
    let value = if rate == force { rate.to_string() } else { format!("angular rates: {rate}; accelerations: {force}") };
    let matrix = rate.matrix();
    let advice = if rate != force {
        "angular rates and accelerations have different axes: convert imu.csv to one frame".to_owned()
    } else if matrix.determinant() < 0.0 {
        "one axis has the wrong sense (the frame is mirrored): convert imu.csv to a right-handed frame".to_owned()
    } else {
        let rotation = rotation_of(matrix) * stated(drive);
        format!("set imu.body_from_imu.rotation = {}", quaternion(&rotation))
    };
    Verdict::new("axes", "imu", false, [value, String::new(), advice])
}

/// The stated rotation from unit axes to body axes.
fn stated(drive: &Drive) -> UnitQuaternion<f64> {
    drive.manifest().imu.as_ref().map_or_else(UnitQuaternion::identity, |entry| entry.mounting().rotation)
}

/// The rotation of right-handed axes.
pub(crate) fn rotation_of(matrix: Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

/// A rotation in the notation of `drive.toml`.
pub(crate) fn quaternion(rotation: &UnitQuaternion<f64>) -> String {
    let q = rotation.coords;
    format!("[{:.6}, {:.6}, {:.6}, {:.6}]", q.x, q.y, q.z, q.w)
}
