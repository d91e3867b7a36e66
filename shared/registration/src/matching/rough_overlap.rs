//! Along-track position of a sweep by the overlap of its rough surfaces with the map.
//!
//! Crowns, hedges and tufts hardly take part in a match, but near the correct position of a sweep its rough surfaces lie on rough
//! surfaces of the map. The share that does is compared at positions along the track. Vehicles that move along, and errors of
//! normals, which mislead the match on a motorway, are smooth.

use crate::map::maps::Maps;
use crate::matching::{MatchScale, MatchSettings};
use crate::{Feature, Kernel, SweepMotion};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Distance between the compared positions, m: a fifth of the search radius.
const STEP_M: f64 = 0.1;
/// Fewer rough features do not determine a position.
const MIN_FEATURES: usize = 40;
/// Part of the error of the result that does not depend on the scatter, m. Chosen on motorways 101 to 108.
const COMMON_M: f64 = 0.03;
/// Features of one parallel task; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 64;

/// A measured along-track position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overlap {
    /// Shift of the sweep along the track that overlaps most, m.
    pub shift_m: f64,
    /// Standard deviation of the shift, m.
    pub sigma_m: f64,
}

/// The positions to compare.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AlongTrackSearch {
    /// Unit vector, odom axes.
    pub forward: Vector3<f64>,
    /// Largest shift to either side, m.
    pub reach_m: f64,
}

/// A rough feature at the predicted pose, odom frame.
struct PlacedFeature<'a> {
    feature: &'a Feature,
    position: Vector3<f64>,
    normal: Vector3<f32>,
}

/// Finds the shift at which the rough features of a sweep overlap most with the map. `None` if fewer than 40 features are
/// rough, or if the overlap has no maximum within the search.
pub(crate) fn rough_overlap(
    search: &AlongTrackSearch,
    features: &[Feature],
    maps: &Maps,
    motion: &SweepMotion,
    settings: &MatchSettings,
) -> Option<Overlap> {
    let placed = placed(features, motion);
    if placed.len() < MIN_FEATURES {
        return None;
    }
    let n_side = (search.reach_m / STEP_M).round().max(1.0) as usize;
    let n_shifts = 2 * n_side + 1;
    let step = search.forward * STEP_M;
    let MatchScale { radius_m, scale_m } = settings.coarse;
    let kernel = Kernel { radius_m, weights: settings.weights };
    // 1 on a surface of the map, 0 beyond the robust scale or without a surface.
    let nearness = |PlacedFeature { feature, position, normal }: &PlacedFeature<'_>| -> Vec<f64> {
        let at_shift = |number: usize| {
            let position = position + step * (number as f64 - n_side as f64);
            let surface = maps.map_for(feature).surface(position.into(), normal, &kernel);
            surface.map_or(0.0, |surface| (1.0 - (surface.distance_m / scale_m).powi(2)).max(0.0))
        };
        (0..n_shifts).map(at_shift).collect()
    };
    let rows: Vec<Vec<f64>> = placed.par_iter().with_min_len(CHUNK).map(nearness).collect();
    let sums: Vec<f64> = (0..n_shifts).map(|number| rows.iter().map(|row| row[number]).sum()).collect();
    let best = (1..n_shifts - 1).max_by(|a, b| sums[*a].total_cmp(&sums[*b]))?;
    let [before, here, after] = [sums[best - 1], sums[best], sums[best + 1]];
    let bend = before - 2.0 * here + after;
    if here < before || here < after || bend >= 0.0 {
        return None;
    }
    // Sandwich variance of a maximum: the slopes of the single features scatter about their mean, and the curvature converts
    // their sum to a shift.
    let slope = |row: &Vec<f64>| (row[best + 1] - row[best - 1]) / (2.0 * STEP_M);
    let mean = rows.iter().map(slope).sum::<f64>() / rows.len() as f64;
    let scatter = rows.iter().map(|row| (slope(row) - mean).powi(2)).sum::<f64>().sqrt();
    let curvature = -bend / (STEP_M * STEP_M);
    Some(Overlap {
        shift_m: (best as f64 - n_side as f64 + 0.5 * (before - after) / bend) * STEP_M,
        sigma_m: scatter / curvature + COMMON_M,
    })
}

/// The rough features at the predicted pose.
fn placed<'a>(features: &'a [Feature], motion: &SweepMotion) -> Vec<PlacedFeature<'a>> {
    let mid = *motion.mid.rotation.to_rotation_matrix().matrix();
    let place = |feature: &'a Feature| {
        let share = f64::from(feature.share);
        let arm = motion.rotated(&mid, &feature.position, share);
        let normal = (mid * Vector3::from(feature.normal).cast::<f64>()).cast();
        let position = arm + motion.mid.translation.vector + motion.translation * share;
        PlacedFeature { feature, position, normal }
    };
    features.iter().filter(|feature| feature.is_rough).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Pose;
    use random::Random;

    /// Points on both sides of a road: on round bushes, 0.8 m wide and every 4 m, or on hedges without gaps.
    fn roadside(n: usize, has_gaps: bool, seed: u64) -> Vec<Feature> {
        let mut random = Random::for_hashed_stream(seed, 0);
        let mut point = |number: usize| {
            let side = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
            // Direction from the axis of a bush, 0 towards the road.
            let angle: f32 = if has_gaps { random.range(-1.4, 1.4) } else { 0.0 };
            let along = if has_gaps { 4.0 * random.range(-6.0, 6.0_f32).floor() } else { random.range(-24.0, 24.0) };
            let radius = 0.4 + random.range(-0.1, 0.1);
            Feature {
                position: [along + radius * angle.sin(), side * (6.4 - radius * angle.cos()), random.range(-1.5, 0.5)],
                normal: [angle.sin(), -side * angle.cos(), 0.0],
                share: 0.0,
                planarity: 0.3,
                roughness_m: 0.1,
                is_rough: true,
                lever: 0.0,
                row: 0,
                point_idx: 0,
            }
        };
        (0..n).map(&mut point).collect()
    }

    /// Overlap of a sweep that is predicted 0.37 m behind its position.
    fn overlap(n: usize, has_gaps: bool) -> Option<Overlap> {
        let maps = Maps::from_sweep(&roadside(4000, has_gaps, 1), &SweepMotion::still(Pose::identity()));
        let search = AlongTrackSearch { forward: Vector3::x(), reach_m: 0.8 };
        let predicted = SweepMotion::still(Pose::translation(-0.37, 0.0, 0.0));
        rough_overlap(&search, &roadside(n, has_gaps, 2), &maps, &predicted, &MatchSettings::default())
    }

    #[test]
    fn bushes_determine_the_along_track_position() {
        let found = overlap(300, true).expect("bushes overlap");
        assert!((found.shift_m - 0.37).abs() < 3.0 * found.sigma_m, "{found:?}");
        assert!(found.sigma_m < 0.1, "{found:?}");
    }

    #[test]
    fn hedge_without_gaps_determines_less_than_bushes() {
        let [hedge, bushes] = [false, true].map(|has_gaps| overlap(300, has_gaps));
        let bushes_m = bushes.expect("bushes overlap").sigma_m;
        assert!(hedge.is_none_or(|hedge| hedge.sigma_m > 3.0 * bushes_m), "{hedge:?}, {bushes_m} m");
    }

    #[test]
    fn few_rough_features_measure_nothing() {
        assert_eq!(overlap(MIN_FEATURES - 1, true), None);
    }
}
