//! Perturbation test of a match: determines how much of its information the scene supports.
//!
//! Errors of normals resemble surfaces with another orientation. Along a tunnel or a bare road the normal equations
//! then have an influence of 0.004 although every position fits about equally well, and the covariance would stay small
//! while the pose drifts. Shifting the sweep separates the two: near real surfaces the cost grows as the residuals
//! predict.

use crate::map::kernel::Kernel;
use crate::map::maps::Maps;
use crate::matching::{LEVER_M, MatchScale, MatchSettings, Matched};
use crate::{Feature, SweepMotion};
use nalgebra::{Matrix6, Vector3, Vector6};

/// Directions with a larger influence are not tested: see [`MatchSettings::min_influence`]. Streets have more.
pub(crate) const DOUBTED_INFLUENCE: f64 = 0.02;
/// Shift along the direction, m, which is the search radius; rotations are converted at [`LEVER_M`].
const SHIFT_M: f64 = 0.3;
/// One in this many features is shifted: a quarter of the features gives the same result.
const EVERY: usize = 4;
/// Growth of the cost as a share of the predicted growth: at the first value the information is rejected, at the second
/// fully confirmed.
const NOTHING: f64 = 0.25;
const EVERYTHING: f64 = 0.6;

/// [`Matched::step_information`] without the part that the perturbation test does not support.
pub(crate) fn supported_information(
    matched: &Matched,
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    settings: &MatchSettings,
) -> Matrix6<f64> {
    // The normals are unit vectors.
    let weight = matched.information.fixed_view::<3, 3>(0, 0).trace() * matched.rms_m.powi(2).max(1e-6)
        / settings.drift_residual_m.powi(2);
    let inverse_lever = Vector6::new(1.0, 1.0, 1.0, 1.0 / LEVER_M, 1.0 / LEVER_M, 1.0 / LEVER_M);
    let scale = Matrix6::from_diagonal(&inverse_lever);
    let eigen = (scale * matched.step_information * scale / weight).symmetric_eigen();
    let mut found = Matrix6::zeros();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        let direction = vector.component_div(&inverse_lever);
        let mut share = 1.0;
        if *value > 0.5 * settings.min_influence && *value < DOUBTED_INFLUENCE {
            let step = vector.component_mul(&inverse_lever) * SHIFT_M;
            let growth = growth(&step, features, maps, motion, settings);
            let share_of_growth = ((growth - NOTHING) / (EVERYTHING - NOTHING)).clamp(0.0, 1.0);
            // The weaker the influence, the larger the part caused by errors of normals.
            share = share_of_growth * value / DOUBTED_INFLUENCE;
        }
        found += direction * direction.transpose() * (weight * value * share);
    }
    found
}

/// Growth of the cost under a step to both sides, as a share of the growth that the residuals predict.
fn growth(
    step: &Vector6<f64>,
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    settings: &MatchSettings,
) -> f64 {
    let MatchScale { radius_m, scale_m } = settings.fine;
    let kernel = Kernel { radius_m, weights: settings.weights };
    let mid = *motion.mid.rotation.to_rotation_matrix().matrix();
    let [translation, rotation] = [0, 3].map(|at| step.fixed_rows::<3>(at).into_owned());
    let cost = |r: f64| (r / scale_m).powi(2).min(1.0);
    let mut found = 0.0;
    let mut predicted = 0.0;
    for feature in features.iter().step_by(EVERY) {
        let share = f64::from(feature.share);
        let arm = motion.rotated(&mid, &feature.position, share);
        let position = arm + motion.mid.translation.vector + motion.translation * share;
        let normal = mid * Vector3::from(feature.normal).cast::<f64>();
        let map = maps.map_for(feature);
        let surface = |position: Vector3<f64>| map.surface(position.into(), &normal.cast(), &kernel);
        let shift = translation + rotation.cross(&arm);
        let weight = feature.weight();
        let here = surface(position);
        let cost_here = here.map_or(1.0, |surface| cost(surface.distance_m));
        for sign in [-1.0, 1.0] {
            let there = surface(position + shift * sign).map_or(1.0, |surface| cost(surface.distance_m));
            found += weight * (there - cost_here);
            if let Some(here) = here {
                predicted += weight * (cost(here.distance_m + sign * here.normal.dot(&shift)) - cost_here);
            }
        }
    }
    if predicted > 0.0 { found / predicted } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    /// Ground and two walls along x, whose normals err by 3 degrees, and the given share of posts that face along the
    /// track.
    fn features(posts: f64, n: usize, seed: u64) -> Vec<Feature> {
        let mut random = Random::for_hashed_stream(seed, 0);
        let mut found = Vec::new();
        let mut add = |position: [f32; 3], normal: [f32; 3], random: &mut Random| {
            let noise: [f32; 3] = std::array::from_fn(|_| 0.05 * random.range(-1.0, 1.0) * 1.73);
            let normal = (Vector3::from(normal) + Vector3::from(noise)).normalize().into();
            found.push(Feature {
                position,
                normal,
                share: 0.0,
                planarity: 1.0,
                roughness_m: 0.0,
                is_rough: false,
                lever: 0.0,
                row: 0,
                point_idx: 0,
            });
        };
        for number in 0..n {
            let along = random.range(-20.0, 20.0);
            let across = random.range(-4.0, 4.0);
            let up = random.range(-1.5, 3.0);
            match number % 3 {
                0 => add([along, across, -1.5], [0.0, 0.0, 1.0], &mut random),
                1 => add([along, -4.0, up], [0.0, 1.0, 0.0], &mut random),
                _ => add([along, 4.0, up], [0.0, -1.0, 0.0], &mut random),
            }
        }
        for number in 0..(n as f64 * posts) as usize {
            let x = -20.0 + (number % 20) as f32 * 2.0;
            let up = random.range(-1.5, 1.0);
            add([x, 3.5, up], [-1.0, 0.0, 0.0], &mut random);
        }
        found
    }

    /// Information along x and along y, before and after the test, of a sweep that is matched to a map of the same
    /// surfaces.
    fn along_and_across(posts: f64) -> [[f64; 2]; 2] {
        let motion = SweepMotion::still(geometry::Pose::identity());
        // One point every 10 cm.
        let maps = Maps::from_sweep(&features(posts, 80_000, 1), &motion);
        let features = features(posts, 1200, 2);
        let settings = MatchSettings::default();
        let mut claimed = Matrix6::zeros();
        for feature in &features {
            let normal = Vector3::from(feature.normal).cast::<f64>();
            let torque = Vector3::from(feature.position).cast::<f64>().cross(&normal);
            let j = Vector6::new(normal.x, normal.y, normal.z, torque.x, torque.y, torque.z);
            claimed += j * j.transpose() * feature.weight();
        }
        let rms_m: f64 = 0.01;
        let matched = Matched {
            motion,
            n_features: features.len(),
            n_matches: features.len(),
            rms_m,
            cost: 0.0,
            least_influence: 0.0,
            n_degenerate_directions: 0,
            information: claimed / rms_m.powi(2),
            step_information: claimed / settings.drift_residual_m.powi(2),
            converged: true,
        };
        let found = supported_information(&matched, &features, &maps, &motion, &settings);
        [0, 1].map(|axis| [matched.step_information[(axis, axis)], found[(axis, axis)]])
    }

    #[test]
    fn errors_of_normals_are_no_information_along_a_tunnel() {
        let [[claimed, found], [claimed_across, found_across]] = along_and_across(0.0);
        assert!(claimed * settings_square() > 2.0, "errors of normals claim something: {claimed}");
        assert!(found < 0.1 * claimed, "{found} of {claimed}");
        assert!((found_across / claimed_across - 1.0).abs() < 0.05, "{found_across} of {claimed_across}");
    }

    #[test]
    fn posts_that_face_the_way_confirm_the_information() {
        let [[claimed, found], _] = along_and_across(0.1);
        assert!(found > 0.9 * claimed, "{found} of {claimed}");
    }

    #[test]
    fn few_posts_confirm_a_part_of_the_information() {
        let [[claimed, found], _] = along_and_across(0.01);
        assert!((0.3..0.8).contains(&(found / claimed)), "{found} of {claimed}");
    }

    fn settings_square() -> f64 {
        MatchSettings::default().drift_residual_m.powi(2)
    }
}
