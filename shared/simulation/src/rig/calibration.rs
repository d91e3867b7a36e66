//! Calibration errors: the true mountings differ from the nominal ones in `drive.toml` by a seeded error.

use super::spec::{OtherLidarSpec, RigSpec};
use drive::manifest::{Calibration, LidarMountingEntry, MountingEntry};
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use random::{gauss, hash};

/// Standard deviations of the mounting errors, about and along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CalibrationError {
    /// Rotation, deg, 0 to 10.
    pub rotation_deg: f64,
    /// Translation, m, 0 to 1.
    pub translation_m: f64,
}

impl RigSpec {
    /// The rig with true mountings; `self` has the nominal mountings.
    #[must_use]
    pub fn with_true_mountings(&self, error: CalibrationError, seed: u64) -> Self {
        let mut rig = self.clone();
        let mut errors = MountingErrors { error, seed, sensor: 0 };
        errors.mount(&mut rig.lidar.body_from_lidar);
        for camera in &mut rig.cameras {
            errors.mount(&mut camera.body_from_camera);
        }
        for mosaic in &mut rig.mosaics {
            errors.mount(&mut mosaic.body_from_camera);
        }
        if let Some(gnss) = &mut rig.gnss {
            let [_, shift] = errors.draw();
            gnss.antenna_in_body = (Vector3::from(gnss.antenna_in_body) + shift).into();
        }
        for other in &mut rig.other_lidars {
            errors.mount(&mut other.lidar.body_from_lidar);
        }
        rig
    }

    /// The mountings by sensor, for `truth/calibration.toml`.
    pub fn calibration(&self) -> Calibration {
        let entry = |name: &str, pose: Pose| MountingEntry { name: name.to_owned(), body_from_camera: pose.into() };
        let other = |OtherLidarSpec { name, lidar }: &OtherLidarSpec| LidarMountingEntry {
            name: name.clone(),
            body_from_lidar: lidar.body_from_lidar.into(),
        };
        Calibration {
            antenna_in_body: self.gnss.map(|gnss| gnss.antenna_in_body),
            body_from_lidar: self.lidar.body_from_lidar.into(),
            other_lidars: self.other_lidars.iter().map(other).collect(),
            cameras: self.cameras.iter().map(|camera| entry(&camera.name, camera.body_from_camera)).collect(),
            mosaics: self.mosaics.iter().map(|mosaic| entry(&mosaic.name, mosaic.body_from_camera)).collect(),
        }
    }
}

/// Draws the mounting errors of one sensor after the other.
struct MountingErrors {
    error: CalibrationError,
    seed: u64,
    sensor: u64,
}

impl MountingErrors {
    /// Rotation vector (rad) and shift (m) of the next sensor.
    fn draw(&mut self) -> [Vector3<f64>; 2] {
        let of = hash(self.seed, self.sensor);
        self.sensor += 1;
        let vector =
            |first: u64, sigma: f64| Vector3::from_fn(|i, _| sigma * f64::from(gauss(hash(of, first + i as u64))));
        [vector(0, self.error.rotation_deg.to_radians()), vector(3, self.error.translation_m)]
    }
    /// Rotates the sensor about its own axes and shifts it along the axes of the body.
    fn mount(&mut self, body_from_sensor: &mut Pose) {
        let [turn, shift] = self.draw();
        let translation = body_from_sensor.translation.vector + shift;
        let rotation = body_from_sensor.rotation * UnitQuaternion::from_scaled_axis(turn);
        *body_from_sensor = Isometry3::from_parts(translation.into(), rotation);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mounting_errors_have_the_configured_standard_deviation() {
        let rig = RigSpec::l3d2();
        assert_eq!(rig.with_true_mountings(CalibrationError::default(), 1), rig);
        let error = CalibrationError { rotation_deg: 0.5, translation_m: 0.02 };
        let mut turns = 0.0;
        let mut shifts = 0.0;
        let mut n = 0.0_f64;
        for seed in 0..200 {
            let truth = rig.with_true_mountings(error, seed);
            for (found, nominal) in truth.cameras.iter().zip(&rig.cameras) {
                let found = found.body_from_camera;
                let nominal = nominal.body_from_camera;
                turns += nominal.rotation.angle_to(&found.rotation).to_degrees().powi(2);
                shifts += (nominal.translation.vector - found.translation.vector).norm_squared();
                n += 3.0;
            }
        }
        let turn = (turns / n).sqrt();
        let shift = (shifts / n).sqrt();
        assert!((turn - 0.5).abs() < 0.025 && (shift - 0.02).abs() < 0.001, "{turn} {shift}");
        assert_ne!(rig.with_true_mountings(error, 1), rig.with_true_mountings(error, 2));
    }
}
