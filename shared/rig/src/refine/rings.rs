//! Elevations of the LiDAR's rings, corrected by the errors that the odometry estimates.

use super::{Change, Outcome, Refined, SIGNIFICANT};
use crate::survey::Survey;
use drive::Drive;
use lidar::velodyne::{Laser, lasers_from_file};
use lidar::{Lidar, Model};
use registration::RingError;
use std::fmt::Write;

/// File name of the refined calibration.
const FILE: &str = "lidar_refined.yaml";

pub(super) fn refine(drive: &Drive, survey: &Survey, refined: &mut Refined) {
    let change = |quantity: String, error: &RingError, outcome: Outcome, text: &str| Change {
        subject: "lidar".to_owned(),
        quantity,
        // True minus stated elevation.
        difference: -error.mean.to_degrees(),
        sigma: error.variance.sqrt().to_degrees(),
        unit: "degrees",
        outcome,
        text: text.to_owned(),
    };
    let errors = &detrended(&survey.ring_errors);
    if errors.is_empty() {
        let text = "the points have no rings, or the vehicle did not move";
        refined.changes.push(change(
            "elevations of the rings".into(),
            &RingError::UNKNOWN,
            Outcome::NotObservable,
            text,
        ));
        return;
    }
    let file = velodyne_lasers(drive.lidar());
    let is_significant =
        |error: &RingError| error.is_measured() && error.mean.abs() > SIGNIFICANT * error.variance.sqrt();
    let mut n_replaced = 0;
    for (ring, error) in errors.iter().enumerate() {
        let quantity = format!("elevation of ring {ring}");
        if !error.is_measured() {
            let text = "too few surfaces that other rings also measured";
            refined.changes.push(change(quantity, error, Outcome::NotObservable, text));
        } else if !is_significant(error) {
            refined.changes.push(change(quantity, error, Outcome::Kept, ""));
        } else if file.is_some() {
            n_replaced += 1;
            refined.changes.push(change(quantity, error, Outcome::Replaced, ""));
        } else {
            let text = "no file of this model can be written: correct the calibration file of the unit";
            refined.changes.push(change(quantity, error, Outcome::ToDo, text));
        }
    }
    let common = "errors common to all rings, or linear over the rings, are not observable";
    refined.changes.push(change("elevation of all rings".into(), &RingError::UNKNOWN, Outcome::NotObservable, common));
    if let Some(VelodyneLasers { model, lasers }) = file.filter(|_| n_replaced > 0) {
        let error_of =
            |ring: u8| errors.get(usize::from(ring)).filter(|error| is_significant(error)).map_or(0.0, correction);
        let rings = drive.lidar().rings();
        let corrected = lasers
            .iter()
            .zip(rings)
            .map(|(laser, ring)| Laser { elevation_deg: laser.elevation_deg - error_of(ring).to_degrees(), ..*laser });
        refined.lidar_file = Some((FILE, yaml(model, &corrected.collect::<Vec<_>>())));
        refined.manifest.lidar.calibration = Some(FILE.to_owned());
    }
}

/// The error, reduced by its share of noise.
fn correction(error: &RingError) -> f64 {
    error.mean * (1.0 - error.variance / (error.mean * error.mean)).max(0.0)
}

/// The errors without the part that is linear over the rings: the matches do not constrain it, so it drifts.
fn detrended(errors: &[RingError]) -> Vec<RingError> {
    let known = || (0..errors.len()).filter(|ring| errors[*ring].is_measured());
    let total = |of: &dyn Fn(usize) -> f64| known().map(|ring| of(ring) / errors[ring].variance).sum::<f64>();
    let weight = total(&|_| 1.0);
    if weight == 0.0 {
        return errors.to_vec();
    }
    let middle = total(&|ring| ring as f64) / weight;
    let mean = total(&|ring| errors[ring].mean) / weight;
    let at = |ring: usize| ring as f64 - middle;
    let square = total(&|ring| at(ring).powi(2));
    let slope = if square > 0.0 { total(&|ring| at(ring) * errors[ring].mean) / square } else { 0.0 };
    let even = |ring: usize| mean + slope * at(ring);
    let without = |(ring, error): (usize, &RingError)| RingError { mean: error.mean - even(ring), ..*error };
    errors.iter().enumerate().map(without).collect()
}

/// A Velodyne.
struct VelodyneLasers {
    model: lidar::velodyne::Model,
    /// Lasers in firing order.
    lasers: Vec<Laser>,
}

/// The lasers of the LiDAR if it is a Velodyne.
fn velodyne_lasers(lidar: &Lidar) -> Option<VelodyneLasers> {
    let Model::Velodyne(model) = lidar.model() else { return None };
    let lasers = match lidar.calibration_file() {
        Some((_, text)) => lasers_from_file(text, model).ok()?,
        None => model.lasers().to_vec(),
    };
    Some(VelodyneLasers { model, lasers })
}

/// A calibration file of the unit in the format of ROS drivers, in rad and m.
fn yaml(model: lidar::velodyne::Model, lasers: &[Laser]) -> String {
    let mut text = String::from("lasers:\n");
    for (id, laser) in lasers.iter().enumerate() {
        let [elevation, azimuth] = [laser.elevation_deg, laser.azimuth_deg].map(f64::to_radians);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "- {{laser_id: {id}, rot_correction: {azimuth:.9}, vert_correction: {elevation:.9}, dist_correction: {:.6}, \
             vert_offset_correction: {:.6}, horiz_offset_correction: {:.6}}}",
            laser.range_m, laser.up_m, laser.left_m
        );
    }
    let _ = writeln!(text, "num_lasers: {}\ndistance_resolution: {}", lasers.len(), model.range_unit_m());
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_part_of_the_errors_is_removed() {
        let error = |ring: usize| RingError { mean: 2e-3 + 1e-4 * ring as f64, variance: 1e-8 };
        let mut errors: Vec<RingError> = (0..32).map(error).collect();
        let found = detrended(&errors);
        assert!(found.len() == 32 && found.iter().all(|error| error.mean.abs() < 1e-9), "{found:?}");
        errors[7].mean += 3e-3;
        let found = detrended(&errors);
        assert!((found[7].mean - 3e-3).abs() < 3e-4 && found[20].mean.abs() < 3e-4, "{found:?}");
        assert_eq!(detrended(&[RingError::UNKNOWN]), [RingError::UNKNOWN]);
    }

    #[test]
    fn written_file_is_read_back() {
        for model in [lidar::velodyne::Model::Hdl32e, lidar::velodyne::Model::Vlp32c] {
            let text = yaml(model, model.lasers());
            let found = lasers_from_file(&text, model).expect("reads");
            for (found, laser) in found.iter().zip(model.lasers()) {
                assert!((found.elevation_deg - laser.elevation_deg).abs() < 1e-6, "{found:?} {laser:?}");
                assert!((found.up_m - laser.up_m).abs() < 1e-6 && (found.azimuth_deg - laser.azimuth_deg).abs() < 1e-6);
            }
        }
    }
}
