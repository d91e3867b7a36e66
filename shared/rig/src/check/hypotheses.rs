//! Alternative hypotheses about a camera: mountings, lenses, times and images that are tried if the stated ones do not
//! fit.

use geometry::{CameraModel, Isometry3, KannalaBrandt, Pinhole, Pose, Rig, RigCamera, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Rotation3};

/// Typical wrong scales of focal lengths: calibration at another resolution, or another lens.
const SCALES: [f64; 6] = [0.5, 2.0 / 3.0, 0.8, 1.25, 1.5, 2.0];
/// Tested rotations about y and x, degrees: the search around each covers half the step.
const TURNS_DEG: f64 = 4.0;
const MAX_YAW_STEPS: i32 = 7;
const MAX_PITCH_STEPS: i32 = 3;
/// Largest angle of a fisheye model that replaces a pinhole model, rad.
const FISHEYE_ANGLE: f64 = 1.5;

/// A hypothetical camera.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    /// Name of the check.
    pub check: &'static str,
    /// Finding for the verdict.
    pub text: String,
    /// Advice for the verdict.
    pub advice: String,
    /// The hypothetical camera.
    pub camera: RigCamera,
    /// Whether left and right of its images are exchanged.
    pub is_mirrored: bool,
}

impl Hypothesis {
    fn new(check: &'static str, text: impl Into<String>, advice: impl Into<String>, camera: RigCamera) -> Self {
        Self { check, text: text.into(), advice: advice.into(), camera, is_mirrored: false }
    }
}

/// Hypotheses about lenses and focal lengths.
pub(super) fn lenses(camera: &RigCamera) -> Vec<Hypothesis> {
    let with = |model| RigCamera { model, ..camera.clone() };
    let mut found = Vec::new();
    match &camera.model {
        CameraModel::Pinhole(m) => {
            let Pinhole { width, height, fx, fy, cx, cy, .. } = *m;
            let fisheye =
                KannalaBrandt { width, height, fx, fy, cx, cy, distortion: [0.0; 4], max_angle: FISHEYE_ANGLE };
            let text = "the images are from a fisheye lens";
            let advice = "set model.kind = \"kannala_brandt\" with the calibration of the fisheye";
            found.push(Hypothesis::new("lens", text, advice, with(CameraModel::KannalaBrandt(fisheye))));
            if m.distortion != [0.0; 5] {
                let plain = Pinhole { distortion: [0.0; 5], ..m.clone() };
                let text = "the images are rectified already";
                let advice = "remove the distortion of the model";
                found.push(Hypothesis::new("lens", text, advice, with(CameraModel::Pinhole(plain))));
            }
        }
        CameraModel::KannalaBrandt(m) => {
            let KannalaBrandt { width, height, fx, fy, cx, cy, .. } = *m;
            let pinhole = Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] };
            let text = "the images are from a pinhole lens";
            let advice = "set model.kind = \"pinhole\"";
            found.push(Hypothesis::new("lens", text, advice, with(CameraModel::Pinhole(pinhole))));
        }
        CameraModel::SplineWarp(_) => {}
    }
    found.extend(SCALES.iter().filter_map(|scale| {
        let text = format!("the focal length fits {scale:.2} times as large");
        let advice = "use a calibration of this lens at the resolution of the images";
        Some(Hypothesis::new("lens", text, advice, with(scaled(&camera.model, *scale)?)))
    }));
    found
}

fn scaled(model: &CameraModel, scale: f64) -> Option<CameraModel> {
    match model {
        CameraModel::Pinhole(m) => {
            Some(CameraModel::Pinhole(Pinhole { fx: m.fx * scale, fy: m.fy * scale, ..m.clone() }))
        }
        CameraModel::KannalaBrandt(m) => {
            Some(CameraModel::KannalaBrandt(KannalaBrandt { fx: m.fx * scale, fy: m.fy * scale, ..m.clone() }))
        }
        CameraModel::SplineWarp(_) => None,
    }
}

/// Hypotheses about mountings and images of camera `index`.
pub(super) fn mountings(rig: &Rig, index: usize, names: &[String]) -> Vec<Hypothesis> {
    let camera = &rig.cameras[index];
    let at = |body_from_camera| RigCamera { body_from_camera, ..camera.clone() };
    let mut found = Vec::new();
    for (other, name) in names.iter().enumerate().filter(|(other, _)| *other != index) {
        if rig.cameras[other].model.size() == camera.model.size() {
            let text = format!("its images fit the mounting of {name}");
            let advice = format!("exchange the folders of {} and {name}", names[index]);
            found.push(Hypothesis::new("mounting", text, advice, rig.cameras[other].clone()));
        }
    }
    let inverse = camera.body_from_camera.inverse();
    let text = "the inverse of body_from_camera fits";
    found.push(Hypothesis::new(
        "mounting",
        text,
        "invert body_from_camera: the file has camera_from_body",
        at(inverse),
    ));
    for AxisOrder { rotation, name } in axes() {
        let text = format!("it fits with other axes: x, y, z of the camera are {name} of the stated one");
        let advice = "camera axes are x right, y down, z forward; multiply body_from_camera by this exchange of axes";
        found.push(Hypothesis::new("mounting", text, advice, at(turned(&camera.body_from_camera, &rotation))));
    }
    let mirrored =
        Hypothesis::new("image", "its images are mirrored", "mirror the images left to right", camera.clone());
    found.push(Hypothesis { is_mirrored: true, ..mirrored });
    for yaw in -MAX_YAW_STEPS..=MAX_YAW_STEPS {
        for pitch in -MAX_PITCH_STEPS..=MAX_PITCH_STEPS {
            let [yaw_deg, pitch_deg] = [yaw, pitch].map(|steps| f64::from(steps) * TURNS_DEG);
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::y() * yaw_deg.to_radians())
                * UnitQuaternion::from_scaled_axis(Vector3::x() * pitch_deg.to_radians());
            let text = format!(
                "it fits turned by about {yaw_deg} degrees about its y and {pitch_deg} degrees about its x axis"
            );
            let advice = "measure the rotation of body_from_camera again, then use `replica rig calibrate`";
            found.push(Hypothesis::new("mounting", text, advice, at(turned(&camera.body_from_camera, &rotation))));
        }
    }
    found
}

/// The mounting with the camera rotated in its own frame.
pub(crate) fn turned(body_from_camera: &Pose, rotation: &UnitQuaternion<f64>) -> Pose {
    Isometry3::from_parts(body_from_camera.translation, body_from_camera.rotation * rotation)
}

/// An order of three axes and their senses.
struct AxisOrder {
    rotation: UnitQuaternion<f64>,
    name: String,
}

/// The 23 other right-handed orders and senses.
fn axes() -> Vec<AxisOrder> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];
    let mut found = Vec::new();
    for order in ORDERS {
        for bits in 0..8_u32 {
            let sign = |axis: usize| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 };
            let matrix = Matrix3::from_fn(|row, column| if order[column] == row { sign(column) } else { 0.0 });
            if matrix.determinant() > 0.0 && matrix != Matrix3::identity() {
                let name = |axis: usize| {
                    format!("{}{}", if sign(axis) < 0.0 { "-" } else { "" }, ["x", "y", "z"][order[axis]])
                };
                let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
                found.push(AxisOrder { rotation, name: format!("{}, {}, {}", name(0), name(1), name(2)) });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_all_other_rotations_of_a_cube() {
        let axes = axes();
        assert_eq!(axes.len(), 23);
        assert!(axes.iter().all(|axes| axes.rotation.angle() > 1.0));
        let names: std::collections::BTreeSet<&String> = axes.iter().map(|axes| &axes.name).collect();
        assert_eq!(names.len(), 23);
    }
}
