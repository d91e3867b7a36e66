//! The rig of the L3D2 vehicle (thesis 2.5.1, figures 2.18 and 2.19): where its sensors sit and how they look.
//!
//! The body frame is the IMU's, 1 m above the road in the middle of the vehicle, x forward, y left, z up.

use geometry::{CameraModel, Isometry3, KannalaBrandt, Pinhole, Pose, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Rotation3};

/// Angle between the lidar's axis of rotation and the horizontal (thesis 2.5.1: "an angle of 30 degrees between the axis of
/// rotation and the horizontal"), rad. The axis rises to the back: the fan of beams, 10.67 degrees to one side of the plane
/// across the axis and 30.67 to the other, stands almost upright. Its lowest beams fall straight down behind the vehicle and
/// sweep the road; its sideward beams look up to 54 degrees ahead along the facades.
pub const LIDAR_AXIS_ELEVATION: f64 = std::f64::consts::PI / 6.0;

/// Number of color cameras: five around, one up.
pub const N_CAMERAS: usize = 6;

/// Exposure of the color cameras, ns.
pub const CAMERA_EXPOSURE_NANOS: u64 = 2_000_000;

/// Where the GNSS antenna is in the body frame, m.
pub const ANTENNA_IN_BODY: [f64; 3] = [-1.2, 0.3, 1.75];

/// `body_from_lidar`: at the back edge of the roof, 2.95 m above the road.
///
/// Lidar frame: z along the axis, y left; x, where the encoder reads 0, forward and steeply up: revolutions are split in
/// the sky.
pub fn body_from_lidar() -> Pose {
    let tilt = -(std::f64::consts::FRAC_PI_2 - LIDAR_AXIS_ELEVATION);
    Isometry3::from_parts(
        Vector3::new(-2.3, 0.0, 1.95).into(),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt),
    )
}

/// Name and mounting of each color camera: `0` looks ahead, `1` to `4` follow clockwise seen from above, `5` looks up.
pub fn color_cameras() -> Vec<(String, Pose)> {
    let head = Vector3::new(-0.4, 0.0, 2.2);
    let around = (0..5).map(|k| {
        let yaw = -f64::from(k) * std::f64::consts::TAU / 5.0;
        let forward = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
        (format!("ladybug_{k}"), looking(head + forward * 0.042, forward, Vector3::z()))
    });
    let up = looking(head + Vector3::z() * 0.06, Vector3::z(), -Vector3::x());
    around.chain([("ladybug_5".to_owned(), up)]).collect()
}

/// Lens of the color cameras: 100 degrees wide and 83 high, so that neighbors overlap by 28 degrees.
pub fn color_lens() -> CameraModel {
    CameraModel::KannalaBrandt(KannalaBrandt {
        width: 616,
        height: 512,
        fx: 353.0,
        fy: 353.0,
        cx: 307.5,
        cy: 255.5,
        distortion: [-0.02, 0.001, 0.0, 0.0],
        max_angle: 1.2,
    })
}

/// `body_from_camera` of HS02 and HS03, side by side on the left, looking left.
pub fn mosaic_mountings() -> [Pose; 2] {
    [-0.15, 0.15].map(|x| looking(Vector3::new(-0.9 + x, 0.75, 1.9), Vector3::y(), Vector3::z()))
}

/// Lens of the mosaic cameras: 45 degrees wide.
pub fn mosaic_lens() -> CameraModel {
    let focal = 1024.0 / (22.5_f64).to_radians().tan();
    CameraModel::Pinhole(Pinhole {
        width: 2048,
        height: 1088,
        fx: focal,
        fy: focal,
        cx: 1023.5,
        cy: 543.5,
        distortion: [0.0; 5],
    })
}

/// A camera at `position` that looks along `forward` with `up` towards the top of the image; both unit, at right angles.
fn looking(position: Vector3<f64>, forward: Vector3<f64>, up: Vector3<f64>) -> Pose {
    let axes = Matrix3::from_columns(&[forward.cross(&up), -up, forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(position.into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lidar_axis_rises_30_degrees_to_the_back() {
        let axis = body_from_lidar() * Vector3::z();
        let expected = Vector3::new(-30.0_f64.to_radians().cos(), 0.0, 0.5);
        assert!((axis - expected).norm() < 1e-12, "{axis}");
        assert!((body_from_lidar() * Vector3::y() - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn cameras_look_where_they_should() {
        let cameras = color_cameras();
        assert_eq!(cameras.len(), N_CAMERAS);
        for (k, (_, pose)) in cameras.iter().take(5).enumerate() {
            let yaw = -72.0_f64.to_radians() * k as f64;
            let forward = pose * Vector3::z();
            assert!((forward - Vector3::new(yaw.cos(), yaw.sin(), 0.0)).norm() < 1e-9);
            assert!((pose * Vector3::y() + Vector3::z()).norm() < 1e-9, "image rows run down");
        }
        assert!((cameras[5].1 * Vector3::z() - Vector3::z()).norm() < 1e-9);
        for pose in mosaic_mountings() {
            assert!((pose * Vector3::z() - Vector3::y()).norm() < 1e-9);
            assert!(
                (pose * Vector3::x() - Vector3::x()).norm() < 1e-9,
                "forward is to the right of a look to the left"
            );
        }
    }
}
