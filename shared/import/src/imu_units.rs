//! Units of the samples of an IMU.

use drive::imu::ImuSample;
use geometry::Vector3;

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.806_65;

/// Converts accelerations in g to m/s^2, and returns a note for the report. Vehicles and people accelerate by far less
/// than gravity, so the magnitude of the accelerations shows their unit.
pub(crate) fn to_metric(samples: &mut [ImuSample]) -> Result<&'static str, String> {
    let mut norms: Vec<f64> = samples.iter().map(|sample| Vector3::from(sample.acceleration).norm()).collect();
    norms.sort_by(f64::total_cmp);
    match norms.get(norms.len() / 2) {
        None => Err("has no samples".into()),
        Some(median) if (5.0..20.0).contains(median) => Ok(""),
        Some(median) if (0.5..2.0).contains(median) => {
            for value in samples.iter_mut().flat_map(|sample| &mut sample.acceleration) {
                *value *= GRAVITY;
            }
            Ok(", with accelerations in g")
        }
        Some(median) => {
            Err(format!("accelerations have a median of {median}; with gravity it must be about 9.8 m/s^2 or 1 g"))
        }
    }
}
