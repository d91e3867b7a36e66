//! From keyframes to closed loops.

use super::correlation::PlaceFromAbove;
use super::fit::{fit, map_of};
use super::keyframe::{Keyframe, SurfacePoint};
use super::scan_context::{Likeness, ScanContext};
use crate::graph::Relative;
use geometry::{Isometry3, Pose, Vector3};

/// When a place is called the same.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopSettings {
    /// Way between the two visits at least, m: longer than what the odometry still has in its map.
    pub min_way_m: f64,
    /// Odometry drifts by at most this share of the way between them; only places that near are looked at.
    pub max_drift: f64,
    /// And this far at any rate, m.
    pub reach_m: f64,
    /// Places and directions that are tried, the likest first.
    pub max_tried: usize,
    /// Largest distance of scan contexts.
    pub max_distance: f64,
    /// Least share of walls on walls.
    pub min_walls: f64,
    /// Least share of surfaces on surfaces.
    pub min_matched: f64,
    /// Largest distance of surfaces, root mean square, m.
    pub max_rms_m: f64,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self {
            min_way_m: 150.0,
            max_drift: 0.02,
            reach_m: 15.0,
            max_tried: 4,
            max_distance: 0.4,
            min_walls: 0.5,
            min_matched: 0.55,
            max_rms_m: 0.08,
        }
    }
}

/// A place that was seen again.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedLoop {
    /// The later submap in the earlier one.
    pub relative: Relative,
    /// Distance of the scan contexts, 0 to 1.
    pub distance: f64,
    /// Share of walls on walls.
    pub walls: f64,
    /// Share of surfaces on surfaces.
    pub matched: f64,
    /// m.
    pub rms_m: f64,
}

/// Where along the later submap a scan context is taken, m behind and before its keyframe's place: visits lie half a submap
/// apart at most.
const PLACES_M: [f64; 5] = [-10.0, -5.0, 0.0, 5.0, 10.0];

/// Looks for places.
#[derive(Clone, Debug, Default)]
pub struct LoopFinder {
    settings: LoopSettings,
}

impl LoopFinder {
    /// With these settings.
    pub const fn new(settings: LoopSettings) -> Self {
        Self { settings }
    }

    /// Where `keyframe` was before: the best of the earlier keyframes that passes all tests.
    pub fn find(&self, keyframe: &Keyframe, earlier: &[Keyframe]) -> Option<ClosedLoop> {
        let candidates: Vec<&Keyframe> = earlier.iter().filter(|other| self.is_in_reach(keyframe, other)).collect();
        if candidates.is_empty() {
            return None;
        }
        let source: Vec<SurfacePoint> = keyframe.surfaces().collect();
        let places = PLACES_M.map(|along| {
            let submap_from_place = keyframe.submap_from_body * Isometry3::translation(along, 0.0, 0.0);
            (submap_from_place, ScanContext::new(&source, &submap_from_place))
        });
        let mut ranked: Vec<(Likeness, Pose, &Keyframe)> = Vec::new();
        for candidate in candidates {
            let surfaces: Vec<SurfacePoint> = candidate.surfaces().collect();
            let context = ScanContext::new(&surfaces, &candidate.submap_from_body);
            // The best place of each of both directions.
            let by_place =
                places.iter().map(|(place, other)| context.likeness(other).map(|likeness| (likeness, *place)));
            let by_place: Vec<[(Likeness, Pose); 2]> = by_place.collect();
            for direction in 0..2 {
                let likest = by_place.iter().map(|both| both[direction]);
                let likest = likest.min_by(|a, b| a.0.distance.total_cmp(&b.0.distance));
                let likest = likest.filter(|(likeness, _)| likeness.distance < self.settings.max_distance);
                ranked.extend(likest.map(|(likeness, place)| (likeness, place, candidate)));
            }
        }
        ranked.sort_by(|a, b| a.0.distance.total_cmp(&b.0.distance));
        let tried = ranked.iter().take(self.settings.max_tried);
        let closed =
            tried.filter_map(|(likeness, place, target)| self.verified(keyframe, &source, target, place, likeness));
        closed.max_by(|a, b| a.matched.total_cmp(&b.matched))
    }

    fn is_in_reach(&self, keyframe: &Keyframe, other: &Keyframe) -> bool {
        let way_m = keyframe.way_m - other.way_m;
        let reach_m = self.settings.reach_m + self.settings.max_drift * way_m;
        way_m > self.settings.min_way_m && (keyframe.p_in_odom - other.p_in_odom).norm() < reach_m
    }

    fn verified(
        &self,
        keyframe: &Keyframe,
        source: &[SurfacePoint],
        target: &Keyframe,
        source_from_place: &Pose,
        likeness: &Likeness,
    ) -> Option<ClosedLoop> {
        let surfaces: Vec<SurfacePoint> = target.surfaces().collect();
        let turn = Isometry3::rotation(Vector3::z() * likeness.turn_rad);
        let guess = target.submap_from_body * turn * source_from_place.inverse();
        let above = PlaceFromAbove::new(&surfaces, &target.submap_from_body);
        let (located, walls) = above.locate(source, &guess)?;
        if walls < self.settings.min_walls {
            return None;
        }
        let fit = fit(&map_of(&surfaces), source, &located)?;
        if fit.matched < self.settings.min_matched || fit.rms_m > self.settings.max_rms_m {
            return None;
        }
        Some(ClosedLoop {
            relative: Relative {
                target: target.submap,
                source: keyframe.submap,
                target_from_source: fit.target_from_source,
                information: fit.information,
            },
            distance: likeness.distance,
            walls,
            matched: fit.matched,
            rms_m: fit.rms_m,
        })
    }
}
