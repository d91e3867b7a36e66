//! How well the maker has measured the mountings: the true ones differ from those in `drive.toml` by a seeded error.

use super::RigSpec;
use crate::random::{gauss, hash};
use formats::manifest::{Calibration, MountingEntry};
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};

/// Standard deviations, about and along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CalibrationError {
    /// Of the directions, deg, 0 to 10.
    pub rotation_deg: f64,
    /// Of the positions, m, 0 to 1.
    pub translation_m: f64,
}

impl RigSpec {
    /// The vehicle as it really is when this one is what its maker measured.
    #[must_use]
    pub fn with_true_mountings(&self, error: CalibrationError, seed: u64) -> Self {
        let mut rig = self.clone();
        let mut off = Off { error, seed, sensor: 0 };
        off.mount(&mut rig.lidar.body_from_lidar);
        for camera in &mut rig.cameras {
            off.mount(&mut camera.body_from_camera);
        }
        for mosaic in &mut rig.mosaics {
            off.mount(&mut mosaic.body_from_camera);
        }
        if let Some(gnss) = &mut rig.gnss {
            let [_, shift] = off.draw();
            gnss.antenna_in_body = (Vector3::from(gnss.antenna_in_body) + shift).into();
        }
        rig
    }

    /// The mountings by sensor, for `truth/calibration.toml`.
    pub fn calibration(&self) -> Calibration {
        let entry = |name: &str, pose: Pose| MountingEntry { name: name.to_owned(), body_from_camera: pose.into() };
        Calibration {
            antenna_in_body: self.gnss.map(|gnss| gnss.antenna_in_body),
            body_from_lidar: self.lidar.body_from_lidar.into(),
            cameras: self.cameras.iter().map(|camera| entry(&camera.name, camera.body_from_camera)).collect(),
            mosaics: self.mosaics.iter().map(|mosaic| entry(&mosaic.name, mosaic.body_from_camera)).collect(),
        }
    }
}

/// Draws the errors sensor by sensor.
struct Off {
    error: CalibrationError,
    seed: u64,
    sensor: u64,
}

impl Off {
    /// Rotation vector (rad) and shift (m) of the next sensor.
    fn draw(&mut self) -> [Vector3<f64>; 2] {
        let of = hash(self.seed, self.sensor);
        self.sensor += 1;
        let vector =
            |first: u64, sigma: f64| Vector3::from_fn(|i, _| sigma * f64::from(gauss(hash(of, first + i as u64))));
        [vector(0, self.error.rotation_deg.to_radians()), vector(3, self.error.translation_m)]
    }
    /// Turns the sensor about its own axes and shifts it along the body's.
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
    fn errors_have_the_stated_strength_and_none_is_none() {
        let rig = RigSpec::l3d2();
        assert_eq!(rig.with_true_mountings(CalibrationError::default(), 1), rig);
        let error = CalibrationError { rotation_deg: 0.5, translation_m: 0.02 };
        let (mut turns, mut shifts, mut n) = (0.0, 0.0, 0.0_f64);
        for seed in 0..200 {
            let truth = rig.with_true_mountings(error, seed);
            for (found, nominal) in truth.cameras.iter().zip(&rig.cameras) {
                let (found, nominal) = (found.body_from_camera, nominal.body_from_camera);
                turns += nominal.rotation.angle_to(&found.rotation).to_degrees().powi(2);
                shifts += (nominal.translation.vector - found.translation.vector).norm_squared();
                n += 3.0;
            }
        }
        let (turn, shift) = ((turns / n).sqrt(), (shifts / n).sqrt());
        assert!((turn - 0.5).abs() < 0.025 && (shift - 0.02).abs() < 0.001, "{turn} {shift}");
        assert_ne!(rig.with_true_mountings(error, 1), rig.with_true_mountings(error, 2));
    }
}
