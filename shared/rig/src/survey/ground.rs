//! The plane of the ground around the vehicle, from one sweep.

use geometry::Vector3;
use nalgebra::{Matrix3, SymmetricEigen};
use registration::Feature;

/// Ranges of the fitted ground, m: nearer points are on the vehicle, and farther away the road curves.
const RANGE_M: [f32; 2] = [2.0, 20.0];
/// Largest angle between the normal and the stated upward direction, rad. A LiDAR with a larger mounting error is not
/// recognized.
const MAX_TILT: f64 = 1.05;
/// Least distance of the sensor from the ground, m.
const MIN_HEIGHT_M: f64 = 0.2;
/// Number of features whose planes are tried.
const MAX_SEEDS: usize = 96;
/// A feature is on a plane if its normal (cosine of 8 degrees) and its distance, m, are within these limits. The fit
/// halves the distance.
const ALIGNED: f64 = 0.99;
const NEAR_M: f64 = 0.2;
/// Least number of features of a plane.
const MIN_FEATURES: usize = 40;
/// Number of fits, each with the features near the last plane.
const ROUNDS: usize = 4;

/// The ground in the frame of the LiDAR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlane {
    /// Unit normal towards the sensor.
    pub normal: Vector3<f64>,
    /// Distance from the sensor, m.
    pub height_m: f64,
    /// Number of features on it.
    pub n_features: usize,
}

/// The plane with the most features, of all planes with normals within 60 degrees of `up`; `None` if no plane has
/// enough features.
pub fn ground_plane(features: &[Feature], up: &Vector3<f32>) -> Option<GroundPlane> {
    let up = up.cast::<f64>();
    let candidate = |feature: &Feature| {
        let at = Vector3::from(feature.position);
        let normal = Vector3::from(feature.normal);
        let is_near = (RANGE_M[0]..RANGE_M[1]).contains(&at.norm()) && !feature.is_rough;
        let at = at.cast::<f64>();
        let normal = normal.cast::<f64>();
        (is_near && normal.dot(&up) > MAX_TILT.cos() && -normal.dot(&at) > MIN_HEIGHT_M)
            .then_some(Candidate { at, normal })
    };
    let candidates: Vec<Candidate> = features.iter().filter_map(candidate).collect();
    let every = candidates.len().div_ceil(MAX_SEEDS).max(1);
    let seeds = candidates
        .iter()
        .step_by(every)
        .map(|seed| Plane { normal: seed.normal, height_m: -seed.normal.dot(&seed.at) });
    let support = |plane: &Plane| plane.points(&candidates, NEAR_M).count();
    // The first of equally good planes.
    let mut most = 0;
    let mut best = None;
    for plane in seeds {
        let n = support(&plane);
        if n > most {
            most = n;
            best = Some(plane);
        }
    }
    let mut plane = best.filter(|_| most >= MIN_FEATURES)?;
    for _ in 0..ROUNDS {
        let points: Vec<Vector3<f64>> = plane.points(&candidates, 0.5 * NEAR_M).collect();
        if points.len() < MIN_FEATURES {
            return None;
        }
        plane = Plane::fitted(&points);
    }
    let n_features = plane.points(&candidates, 0.5 * NEAR_M).count();
    Some(GroundPlane { normal: plane.normal, height_m: plane.height_m, n_features })
}

/// A feature that may be on the ground.
struct Candidate {
    at: Vector3<f64>,
    normal: Vector3<f64>,
}

/// A plane below the sensor.
struct Plane {
    /// Unit normal towards the sensor.
    normal: Vector3<f64>,
    /// Distance from the sensor, m.
    height_m: f64,
}

impl Plane {
    /// Least squares plane of points.
    fn fitted(points: &[Vector3<f64>]) -> Self {
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let spread: Matrix3<f64> = points.iter().map(|at| (at - mean) * (at - mean).transpose()).sum();
        let eigen = SymmetricEigen::new(spread);
        let normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        let normal = if normal.dot(&mean) > 0.0 { -normal } else { normal };
        Self { normal, height_m: -normal.dot(&mean) }
    }
    /// The positions of the candidates on the plane.
    fn points(&self, candidates: &[Candidate], near_m: f64) -> impl Iterator<Item = Vector3<f64>> {
        let is_on = move |candidate: &&Candidate| {
            candidate.normal.dot(&self.normal) > ALIGNED
                && (self.normal.dot(&candidate.at) + self.height_m).abs() < near_m
        };
        candidates.iter().filter(is_on).map(|candidate| candidate.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feature(at: [f32; 3], normal: Vector3<f32>) -> Feature {
        Feature {
            position: at,
            normal: normal.into(),
            share: 0.0,
            planarity: 0.9,
            roughness_m: 0.01,
            is_rough: false,
            lever: 0.0,
            row: 0,
            point_idx: 0,
        }
    }

    #[test]
    fn tilted_ground_between_walls_is_found() {
        let normal = Vector3::new(0.1_f32, -0.05, 1.0).normalize();
        let mut features = Vec::new();
        for i in 0..400_u16 {
            let x = f32::from(i % 20) - 10.0;
            let y = f32::from(i / 20) - 10.0;
            // On the plane 1.8 m below the sensor.
            let z = (-1.8 - normal.x * x - normal.y * y) / normal.z;
            features.push(feature([x, y, z], normal));
            features.push(feature([x, 6.0, f32::from(i / 20) * 0.4], Vector3::new(0.0, -1.0, 0.0)));
        }
        let found = ground_plane(&features, &Vector3::z()).expect("is there");
        assert!(found.normal.angle(&normal.cast()) < 1e-5 && (found.height_m - 1.8).abs() < 1e-5, "{found:?}");
        assert!(ground_plane(&features[..60], &Vector3::z()).is_none());
    }
}
