//! How well the upright features of a sweep fit the map at a pose.

use super::top_view::MAX_NORMAL_Z;
use crate::map::maps::Maps;
use crate::{Feature, Kernel, MatchScale, MatchSettings, SweepMotion};
use geometry::{Point3, Vector3};

/// Mean over the upright features of min(1, (distance / scale)^2), 1 without a map point: 0 good, 1 bad.
///
/// Poses far from each other are compared by upright surfaces alone. The ground consists of the rings of the LiDAR, which fit the
/// rings of the last sweep best where the vehicle has not moved.
pub(super) fn upright_cost(features: &[Feature], maps: &Maps, motion: &SweepMotion, settings: &MatchSettings) -> f64 {
    let MatchScale { radius_m, scale_m } = settings.fine;
    let kernel = Kernel { radius_m, weights: settings.weights };
    let cost = |feature: &Feature| {
        let pose = motion.at(f64::from(feature.share));
        let normal = (pose.rotation * Vector3::from(feature.normal).cast::<f64>()).cast::<f32>();
        let position = pose * Point3::from(feature.position).cast::<f64>();
        let surface = || maps.map_for(feature).surface(position.coords.into(), &normal, &kernel);
        (normal.z.abs() < MAX_NORMAL_Z)
            .then(|| surface().map_or(1.0, |surface| (surface.distance_m / scale_m).powi(2).min(1.0)))
    };
    let costs: Vec<f64> = features.iter().filter_map(cost).collect();
    if costs.is_empty() { 1.0 } else { costs.iter().sum::<f64>() / costs.len() as f64 }
}
