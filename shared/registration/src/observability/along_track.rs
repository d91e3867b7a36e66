//! How well the scene constrains the along-track position.
//!
//! Objects that move along with the vehicle differ from the static scene only in the surfaces that face along the
//! track. If the match follows a queue of vehicles instead of the static scene, the street moves through the map and
//! smears it along the track: every position fits about equally well. A correct match stands out, even if sweeps are
//! not deskewed.

use crate::map::kernel::{Kernel, Weights};
use crate::map::maps::Maps;
use crate::observability::perturbation_test::DOUBTED_INFLUENCE;
use crate::{Feature, MatchScale, MatchSettings, SweepMotion};
use geometry::Pose;
use nalgebra::{Matrix6, Point3, Vector3, Vector6};

/// Below this contrast the along-track position is ambiguous. Drives in which the match follows a queue have at most
/// 0.07, averaged over a second; real drives with sweeps that are not deskewed stay above 0.12 in each sweep.
pub(crate) const MIN_CONTRAST: f64 = 0.1;
/// Least cosine between the normals of these surfaces and the direction of travel: within 60 degrees.
const MIN_FACING: f64 = 0.5;
/// With fewer features the contrast is undetermined: tunnels, open fields.
const MIN_FEATURES: usize = 40;
/// Contrast from which the along-track position is not doubted. Streets have more.
const UNDOUBTED_CONTRAST: f64 = 0.4;
/// Along-track error without any contrast, as a share of the distance traveled, and the distance over which the error
/// stays the same, m: a tunnel with a few lamps and a car ahead (contrast 0 to 0.3) was 0.6 m in 80 m too long.
const DOUBTED_SHARE: f64 = 0.01;
const COMMON_M: f64 = 50.0;
/// Shorter steps are jitter of a standing vehicle, not motion.
const MIN_STEP_M: f64 = 0.1;
/// Shifted positions along the track, m: at least twice the search radius of a match.
const BEHIND_M: [f64; 2] = [-0.6, -1.2];
const AHEAD_M: [f64; 2] = [0.6, 1.2];

/// Cost (0 good, 1 bad) of shifted positions along `forward` (LiDAR frame) minus the cost of the match, on the side
/// where it is smaller. 0.4 to 0.75 in streets, 0.15 to 0.3 with sweeps that are not deskewed, about 0 if the match
/// follows a queue. `None` if too few features face along the track.
pub(crate) fn along_track_contrast(
    forward: &Vector3<f64>,
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    settings: &MatchSettings,
) -> Option<f64> {
    let facing: Vec<&Feature> = features.iter().filter(|feature| faces(feature, forward)).collect();
    if facing.len() < MIN_FEATURES {
        return None;
    }
    let MatchScale { radius_m, scale_m } = settings.fine;
    let kernel = Kernel { radius_m, weights: Weights::Compact };
    let way = motion.mid.rotation * forward;
    let cost = |shift_m: f64| {
        let of_feature = |feature: &&Feature| {
            let pose = motion.at(f64::from(feature.share));
            let position = pose * Point3::from(feature.position).cast::<f64>() + way * shift_m;
            let normal = pose.rotation * Vector3::from(feature.normal).cast::<f64>();
            let surface = maps.map_for(feature).surface(position.coords.into(), &normal.cast(), &kernel);
            surface.map_or(1.0, |surface| (surface.distance_m / scale_m).powi(2).min(1.0))
        };
        facing.iter().map(of_feature).sum::<f64>() / facing.len() as f64
    };
    let mean = |[near, far]: [f64; 2]| cost(near).midpoint(cost(far));
    Some(mean(BEHIND_M).min(mean(AHEAD_M)) - cost(0.0))
}

/// Covariance (m, then rad) that a low contrast adds to the error of the step between two poses. If the contrast is
/// unknown, `least_influence` of the match decides. Moving objects, and the few surfaces that face along the track,
/// bias every sweep in the same direction: such errors accumulate over a distance faster than errors of independent
/// sweeps. The error shifts the pose along the track: on a bend it also rotates the pose.
pub(crate) fn along_track_error([from, to]: [&Pose; 2], contrast: Option<f64>, least_influence: f64) -> Matrix6<f64> {
    // If too few surfaces face along the track, no residual contradicts an along-track error.
    let contrast = contrast.or((least_influence < DOUBTED_INFLUENCE).then_some(0.0)).unwrap_or(UNDOUBTED_CONTRAST);
    let doubt = (1.0 - contrast / UNDOUBTED_CONTRAST).clamp(0.0, 1.0);
    let displacement = to.translation.vector - from.translation.vector;
    let rotation = (to.rotation * from.rotation.inverse()).scaled_axis();
    let mut step = Vector6::zeros();
    step.fixed_rows_mut::<3>(0).copy_from(&displacement);
    step.fixed_rows_mut::<3>(3).copy_from(&rotation);
    // Steps within a distance share one error: its square grows with the product.
    step * step.transpose() * ((doubt * DOUBTED_SHARE).powi(2) * COMMON_M / displacement.norm().max(MIN_STEP_M))
}

/// The features that do not constrain the along-track position. Traffic at the vehicle's own speed cannot affect them.
pub(crate) fn without_along_track_features(forward: &Vector3<f64>, features: &[Feature]) -> Vec<Feature> {
    features.iter().filter(|feature| !faces(feature, forward)).copied().collect()
}

fn faces(feature: &Feature, forward: &Vector3<f64>) -> bool {
    Vector3::from(feature.normal).cast::<f64>().dot(forward).abs() >= MIN_FACING
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, UnitQuaternion};

    const STRONG: f64 = 0.1;

    /// Sum of the errors of `n_steps` steps of 1 m and 0.01 rad about z with the given contrast.
    fn error_of(n_steps: u32, contrast: Option<f64>, least_influence: f64) -> Matrix6<f64> {
        let bend = UnitQuaternion::from_scaled_axis(Vector3::z() * 0.01);
        let step = [Pose::identity(), Isometry3::from_parts(Vector3::x().into(), bend)];
        along_track_error([&step[0], &step[1]], contrast, least_influence) * f64::from(n_steps)
    }

    #[test]
    fn error_of_steps_without_contrast_is_a_share_of_the_way() {
        let error = error_of(50, Some(0.0), STRONG);
        assert!((error[(0, 0)].sqrt() - 0.5).abs() < 1e-9, "1 % of 50 m, not {} m", error[(0, 0)].sqrt());
        assert!(error[(1, 1)].abs() < 1e-12);
        assert!(error_of(50, Some(0.2), STRONG)[(0, 0)] < 0.3 * error[(0, 0)]);
        assert_eq!(error_of(50, Some(0.5), STRONG), Matrix6::zeros());
    }

    #[test]
    fn error_along_a_bend_turns_the_pose() {
        let error = error_of(50, Some(0.0), STRONG);
        assert!((error[(5, 5)].sqrt() - 0.005).abs() < 1e-9, "1 % of 0.5 rad, not {} rad", error[(5, 5)].sqrt());
        assert!((error[(0, 5)] - 0.5 * 0.005).abs() < 1e-9, "the same error: {}", error[(0, 5)]);
    }

    #[test]
    fn weak_match_without_surfaces_that_face_the_way_has_no_contrast() {
        assert_eq!(error_of(1, None, 0.01), error_of(1, Some(0.0), STRONG));
        assert_eq!(error_of(1, None, STRONG), Matrix6::zeros());
    }
}
