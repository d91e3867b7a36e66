//! Sampling of the features of a sweep for matching.

use crate::Feature;
use crate::features::thinned_features;
use geometry::{UnitQuaternion, Vector3};

/// Feature sampling for matching.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Evenly in space, so that the road near the vehicle does not outweigh the facades.
    Even {
        /// One feature per cube of this side, m.
        spacing_m: f64,
        /// Largest number of features; the excess is removed evenly.
        max_features: usize,
    },
    /// The nine observability lists of IMLS-SLAM (Deschaud, ICRA 2018, III-C): for each vehicle axis the features that
    /// best constrain the rotation about it, in either sense, and those that best constrain the translation along it.
    NineLists {
        /// Features of each list (the paper's s).
        per_list: usize,
    },
}

/// Samples from all features. `axes_from_lidar` rotates LiDAR axes to vehicle axes. `is_near_model` is the gate of the
/// paper: features far from the model are not sampled. A feature in several lists counts several times.
pub(crate) fn sampled(
    features: &[Feature],
    sampling: Sampling,
    axes_from_lidar: &UnitQuaternion<f64>,
    is_near_model: impl Fn(&Feature) -> bool,
) -> Vec<Feature> {
    match sampling {
        Sampling::Even { spacing_m, max_features } => {
            let thinned = thinned_features(features, spacing_m);
            let step = thinned.len().div_ceil(max_features.max(1)).max(1);
            thinned.into_iter().step_by(step).collect()
        }
        Sampling::NineLists { per_list } => nine_lists(features, per_list, axes_from_lidar, is_near_model),
    }
}

fn nine_lists(
    features: &[Feature],
    per_list: usize,
    axes_from_lidar: &UnitQuaternion<f64>,
    is_near_model: impl Fn(&Feature) -> bool,
) -> Vec<Feature> {
    let axes = axes_from_lidar.to_rotation_matrix().matrix().cast::<f32>();
    let influences: Vec<[f32; 9]> = features.iter().map(|feature| influences(feature, &axes)).collect();
    let influence = |idx: u32, list: usize| influences[idx as usize][list];
    // Evaluated once per feature.
    let mut near: Vec<Option<bool>> = vec![None; features.len()];
    let mut samples = Vec::with_capacity(9 * per_list);
    let mut order: Vec<u32> = (0..features.len() as u32).collect();
    for list in 0..9 {
        let strongest_first = |a: &u32, b: &u32| influence(*b, list).total_cmp(&influence(*a, list)).then(a.cmp(b));
        let mut n_taken = 0;
        let mut begin = 0;
        // The head of the list usually suffices because few features are far from the model.
        while n_taken < per_list && begin < order.len() {
            let end = (begin + 2 * per_list).min(order.len());
            if end < order.len() {
                order[begin..].select_nth_unstable_by(end - begin, strongest_first);
            }
            order[begin..end].sort_unstable_by(strongest_first);
            for &idx in &order[begin..end] {
                let idx = idx as usize;
                if n_taken < per_list && *near[idx].get_or_insert_with(|| is_near_model(&features[idx])) {
                    samples.push(features[idx]);
                    n_taken += 1;
                }
            }
            begin = end;
        }
    }
    samples
}

/// a2D^2 (x times n) . axis and its negative for the three axes, then a2D^2 |n . axis|.
fn influences(feature: &Feature, axes: &nalgebra::Matrix3<f32>) -> [f32; 9] {
    let normal = axes * Vector3::from(feature.normal);
    let torque = (axes * Vector3::from(feature.position)).cross(&normal);
    let weight = feature.planarity * feature.planarity;
    let [a, b, c] = [0, 1, 2].map(|axis| weight * torque[axis]);
    let [x, y, z] = [0, 1, 2].map(|axis| weight * normal[axis].abs());
    [a, -a, b, -b, c, -c, x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feature(position: [f32; 3], normal: [f32; 3], planarity: f32) -> Feature {
        Feature {
            position,
            normal,
            share: 0.0,
            planarity,
            roughness_m: 0.02,
            is_rough: false,
            lever: 0.0,
            row: 0,
            point_idx: 0,
        }
    }

    /// A floor, two walls along the street, and one wall across it, each of 400 features.
    fn street() -> Vec<Feature> {
        let mut features = Vec::new();
        for i in 0..20_u8 {
            for k in 0..20_u8 {
                let u = f32::from(i) - 9.5;
                let v = 0.1 * f32::from(k);
                features.push(feature([u, f32::from(k) * 0.4 - 4.0, -2.0], [0.0, 0.0, 1.0], 0.9));
                features.push(feature([u, 5.0, v], [0.0, -1.0, 0.0], 0.9));
                features.push(feature([u, -5.0, v], [0.0, 1.0, 0.0], 0.9));
                features.push(feature([15.0, 0.4 * u, v], [-1.0, 0.0, 0.0], 0.5));
            }
        }
        features
    }

    fn lists(features: &[Feature], is_near_model: impl Fn(&Feature) -> bool) -> Vec<Feature> {
        sampled(features, Sampling::NineLists { per_list: 50 }, &UnitQuaternion::identity(), is_near_model)
    }

    #[test]
    fn each_list_has_the_features_that_determine_its_direction() {
        let samples = lists(&street(), |_| true);
        assert_eq!(samples.len(), 9 * 50);
        let along = samples[6 * 50..7 * 50].iter().filter(|sample| sample.normal[0] < -0.99).count();
        assert_eq!(along, 50, "only the wall across determines x, though its planarity is low");
        let across = samples[7 * 50..8 * 50].iter().filter(|sample| sample.normal[1].abs() > 0.99).count();
        assert_eq!(across, 50);
        let upright = samples[8 * 50..].iter().filter(|sample| sample.normal[2] > 0.99).count();
        assert_eq!(upright, 50);
        // (x times n) . z is largest far ahead on one side and far behind on the other.
        let turning = &samples[4 * 50..5 * 50];
        assert!(
            turning.iter().all(|sample| sample.position[0] * sample.normal[1] > 0.0),
            "all have the same sense of rotation"
        );
    }

    #[test]
    fn features_far_from_the_model_are_not_sampled() {
        let samples = lists(&street(), |feature| feature.position[1] < 4.0);
        assert!(!samples.is_empty());
        assert!(samples.iter().all(|sample| sample.position[1] < 4.0));
        assert_eq!(samples.len(), 9 * 50, "other features replace them");
        assert!(lists(&street(), |_| false).is_empty());
    }
}
