//! Searches loop closures among keyframes.

use super::correlation::{Located, TopView};
use super::keyframe::{Keyframe, SurfacePoint};
use super::refinement::{FitFloor, refine, surface_map};
use super::scan_context::{ContextMatch, ScanContext};
use crate::graph::RelativePose;
use geometry::{Isometry3, Pose, Vector3};

/// A keyframe that may show the same place, by scan contexts.
struct RankedTarget<'a> {
    matched: ContextMatch,
    /// The compared place near the source keyframe.
    source_from_place: Pose,
    target: &'a Keyframe,
}

/// Criteria for two keyframes of one place.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopSettings {
    /// Least path length between the two visits, m: longer than the map of the odometry.
    pub min_path_m: f64,
    /// Largest drift of the odometry as a share of that path. Keyframes farther away are not compared.
    pub max_drift: f64,
    /// Search radius in addition to the drift, m.
    pub radius_m: f64,
    /// Largest number of candidates (places and directions) that are verified, best matches first.
    pub max_candidates: usize,
    /// Largest distance of scan contexts.
    pub max_distance: f64,
    /// Least share of walls that coincide with walls.
    pub min_walls: f64,
    /// Least share of surfaces that coincide with surfaces.
    pub min_matched: f64,
    /// Largest root mean square distance of surfaces, m.
    pub max_rms_m: f64,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self {
            min_path_m: 150.0,
            max_drift: 0.02,
            radius_m: 15.0,
            max_candidates: 4,
            max_distance: 0.4,
            min_walls: 0.5,
            min_matched: 0.55,
            max_rms_m: 0.08,
        }
    }
}

/// A place that was visited again, with the measured relative pose.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopClosure {
    /// Pose of the later submap relative to the earlier one.
    pub relative: RelativePose,
    /// Distance of the scan contexts, 0 to 1.
    pub distance: f64,
    /// Share of walls that coincide with walls.
    pub walls: f64,
    /// Share of surfaces that coincide with surfaces.
    pub matched: f64,
    /// Root mean square distance of surfaces, m.
    pub rms_m: f64,
}

/// Positions of scan contexts along the later submap, m behind and ahead of its keyframe: the nearest keyframe of the
/// first visit is at most half a submap away.
const PLACES_M: [f64; 5] = [-10.0, -5.0, 0.0, 5.0, 10.0];

/// Searches loop closures.
#[derive(Clone, Debug, Default)]
pub struct LoopFinder {
    settings: LoopSettings,
}

impl LoopFinder {
    /// Creates a finder with these settings.
    pub const fn new(settings: LoopSettings) -> Self {
        Self { settings }
    }

    /// The best loop closure of `keyframe` with an earlier keyframe that passes all checks.
    pub fn find(&self, keyframe: &Keyframe, earlier: &[Keyframe]) -> Option<LoopClosure> {
        let candidates: Vec<&Keyframe> = earlier.iter().filter(|other| self.is_near(keyframe, other)).collect();
        if candidates.is_empty() {
            return None;
        }
        let source: Vec<SurfacePoint> = keyframe.surfaces().collect();
        let places = PLACES_M.map(|along| {
            let submap_from_place = keyframe.submap_from_body * Isometry3::translation(along, 0.0, 0.0);
            (submap_from_place, ScanContext::new(&source, &submap_from_place))
        });
        let mut ranked: Vec<RankedTarget<'_>> = Vec::new();
        for candidate in candidates {
            let surfaces: Vec<SurfacePoint> = candidate.surfaces().collect();
            let context = ScanContext::new(&surfaces, &candidate.submap_from_body);
            // The best place for each of the two directions.
            let by_place = places.iter().map(|(place, other)| context.matches(other).map(|matched| (matched, *place)));
            let by_place: Vec<[(ContextMatch, Pose); 2]> = by_place.collect();
            for direction in 0..2 {
                let best = by_place.iter().map(|both| both[direction]);
                let best = best.min_by(|a, b| a.0.distance.total_cmp(&b.0.distance));
                let best = best.filter(|(matched, _)| matched.distance < self.settings.max_distance);
                ranked.extend(best.map(|(matched, source_from_place)| RankedTarget {
                    matched,
                    source_from_place,
                    target: candidate,
                }));
            }
        }
        ranked.sort_by(|a, b| a.matched.distance.total_cmp(&b.matched.distance));
        let tried = ranked.iter().take(self.settings.max_candidates);
        let verified = tried.filter_map(|ranked| self.verify(keyframe, &source, ranked));
        verified.max_by(|a, b| a.matched.total_cmp(&b.matched))
    }

    fn is_near(&self, keyframe: &Keyframe, other: &Keyframe) -> bool {
        let path_m = keyframe.path_m - other.path_m;
        let radius_m = self.settings.radius_m + self.settings.max_drift * path_m;
        path_m > self.settings.min_path_m && (keyframe.p_in_odom - other.p_in_odom).norm() < radius_m
    }

    fn verify(
        &self,
        keyframe: &Keyframe,
        source: &[SurfacePoint],
        RankedTarget { matched, source_from_place, target }: &RankedTarget<'_>,
    ) -> Option<LoopClosure> {
        let surfaces: Vec<SurfacePoint> = target.surfaces().collect();
        let rotation = Isometry3::rotation(Vector3::z() * matched.rotation_rad);
        let guess = target.submap_from_body * rotation * source_from_place.inverse();
        let top_view = TopView::new(&surfaces, &target.submap_from_body);
        let Located { target_from_source: located, walls_share: walls } = top_view.locate(source, &guess)?;
        if walls < self.settings.min_walls {
            return None;
        }
        let fit = refine(&surface_map(&surfaces), source, &located, FitFloor::LOOP)?;
        if fit.matched < self.settings.min_matched || fit.rms_m > self.settings.max_rms_m {
            return None;
        }
        Some(LoopClosure {
            relative: RelativePose {
                target: target.submap,
                source: keyframe.submap,
                target_from_source: fit.target_from_source,
                information: fit.information,
            },
            distance: matched.distance,
            walls,
            matched: fit.matched,
            rms_m: fit.rms_m,
        })
    }
}
