//! Planar points of a sweep with their normals.

pub(crate) mod sampling;
pub(crate) mod sweep_features;

use crate::self_calibration::ring_errors::lever;
use crate::sweep::neighborhood::{LANES, Planes, Shapes};
use crate::voxel::{VoxelIndex, VoxelSet, thinned};
use crate::{RangeImage, Sweep};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A point on a plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Feature {
    /// x y z, m, LiDAR frame at the time of the shot.
    pub position: [f32; 3],
    /// Unit normal towards the sensor, same frame.
    pub normal: [f32; 3],
    /// Time of the shot: -0.5 first, 0.5 last of the sweep; 0 where point times are not known.
    pub share: f32,
    /// (s2 - s3) / s1 with s1 >= s2 >= s3 the deviations of the neighborhood along its principal axes: 0 line or
    /// volume, 1 plane (`a2D`, Demantké et al. 2011).
    pub planarity: f32,
    /// Standard deviation of the neighborhood perpendicular to the plane, m.
    pub roughness_m: f32,
    /// See [`FeatureSettings::max_roughness_m`].
    pub is_rough: bool,
    /// Displacement of the point along the normal per radian of elevation error, m.
    pub lever: f32,
    /// Row of the range image.
    pub row: u16,
    /// Index of the point in its sweep.
    pub point_idx: u32,
}

impl Feature {
    /// Weight of the point-to-plane residual: lower for features of low planarity or high roughness.
    #[inline]
    pub(crate) fn weight(&self) -> f64 {
        f64::from(self.planarity) * f64::from(SMOOTH_M / self.roughness_m.max(SMOOTH_M)).powi(2)
    }
}

/// Feature selection.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureSettings {
    /// Columns between evaluated neighborhoods.
    pub column_step: usize,
    /// Points nearer than this belong to the vehicle, m.
    pub min_range_m: f32,
    /// Points farther than this have neighbors too far apart for a normal, m.
    pub max_range_m: f32,
    /// Least planarity.
    pub min_planarity: f32,
    /// At most one feature per cube of this side, m.
    pub spacing_m: f64,
    /// Length of ring over which the position of a feature is smoothed: the feature moves along its normal to the mean
    /// height of the points of its ring within this distance, m. 0 keeps the measured position.
    pub smoothing_m: f32,
    /// Largest standard deviation of rough features perpendicular to the plane, m: tree crowns, hedges, fences. Rough
    /// features are matched only if the smooth ones hardly constrain the pose, see
    /// [`crate::MatchSettings::rough_below`]. 0 disables rough features.
    pub max_roughness_m: f32,
}

impl Default for FeatureSettings {
    /// Every third column is 0.5 degrees: 17 cm at 20 m, about the spacing. 100 m is the range of an HDL-32E. A
    /// planarity of 0.15 keeps road surface sampled in long strips and drops foliage. The spacing equals the map's
    /// spacing. Smoothing over 0.1 m reduces noise and keeps the shape. Smoothing over the whole neighborhood, which
    /// grows with range, distorts the road ahead: the vehicle then pitches by 0.5 degrees in 100 m. A roughness of 0.3
    /// m is a tree crown at a range of ten metres.
    fn default() -> Self {
        Self {
            column_step: 3,
            min_range_m: 1.5,
            max_range_m: 100.0,
            min_planarity: 0.15,
            spacing_m: 0.2,
            smoothing_m: 0.1,
            max_roughness_m: 0.3,
        }
    }
}

/// Largest standard deviation of smooth features perpendicular to the plane, m: range noise of 2 cm and slight
/// roughness. It excludes kerbs and gutters, whose normals depend on the viewpoint; with a limit of 6 cm they rotate
/// the vehicle by 0.2 degrees in 100 m. Rougher features must be vertical.
pub(crate) const SMOOTH_M: f32 = 0.035;
/// Largest vertical component of the normal of a rough feature. It excludes kerbs, gutters and meadows.
const MAX_UPWARDS: f32 = 0.3;
/// Least planarity of a rough feature, and the largest ratio of its third standard deviation to its second.
const MIN_ROUGH_PLANARITY: f32 = 0.05;
const MAX_ROUGH_THICKNESS: f32 = 0.7;
/// Offset added to columns before a subtraction; a multiple of the number of columns, which wrap around.
const RIM: usize = 1 << 16;
/// Largest reach of smoothing to each side, columns: 1 degree, 0.1 m at 6 m.
const SMOOTHING_COLUMNS: usize = 6;
/// Points farther from the plane than this are on another surface, m: four times the range noise.
const SMOOTHING_GATE_M: f32 = 0.08;
/// Largest ratio of the third standard deviation to the second: with 27 neighbors the normal is then accurate to about
/// 4 degrees.
const MAX_THICKNESS: f32 = 0.4;

/// Thinned planar points: the smooth ones, then the rough ones, each in the order of the range image. `up` is the
/// upward unit vector in the LiDAR frame.
pub fn planar_features(sweep: &Sweep, up: &Vector3<f32>, settings: &FeatureSettings) -> Vec<Feature> {
    let rows = 0..sweep.image().rows();
    let planes = Planes::new(sweep.image(), settings.column_step.max(1));
    let row = |row| {
        wide_loops::run(
            #[inline(always)]
            || row_features(sweep, &planes, row, up, settings),
        )
    };
    let by_row: Vec<Vec<Feature>> = rows.into_par_iter().map(row).collect();
    let smooth = by_row.iter().flatten().filter(|feature| !feature.is_rough);
    let rough = by_row.iter().flatten().filter(|feature| feature.is_rough);
    let mut taken = VoxelSet::for_at_most(by_row.iter().map(Vec::len).sum());
    let per_m = 1.0 / settings.spacing_m;
    let mut is_first = |feature: &Feature| taken.insert(VoxelIndex::containing(feature.position.map(f64::from), per_m));
    smooth.chain(rough).filter(|feature| is_first(feature)).copied().collect()
}

/// Planar points of a row, one per voxel.
#[inline(always)]
fn row_features(
    sweep: &Sweep,
    planes: &Planes,
    row: usize,
    up: &Vector3<f32>,
    settings: &FeatureSettings,
) -> Vec<Feature> {
    let per_m = 1.0 / settings.spacing_m;
    let mut taken = VoxelSet::for_at_most(planes.n());
    let mut features = Vec::new();
    for first in (0..planes.n()).step_by(LANES) {
        // Blocks without a point, such as sky, have no shapes.
        if !is_any_in_range(&planes.ranges(row, first), settings) {
            continue;
        }
        let shapes = Shapes::around(planes, row, first);
        for lane in 0..LANES.min(planes.n() - first) {
            let Some(is_smooth) = kind(&shapes, lane, up, settings) else { continue };
            let col = (first + lane) * planes.step();
            let Some(point_idx) = sweep.image().point(row, col) else { continue };
            let cube = VoxelIndex::containing(sweep.points()[point_idx].position.map(f64::from), per_m);
            if taken.insert(cube) {
                let cell = FeatureCell { row, col, point_idx, shapes: &shapes, lane, is_smooth };
                features.push(feature(sweep, &cell, settings));
            }
        }
    }
    features
}

#[inline(always)]
fn is_any_in_range(ranges: &[f32; LANES], settings: &FeatureSettings) -> bool {
    let is_in_range = |range: &f32| (*range >= settings.min_range_m) & (*range <= settings.max_range_m);
    ranges.iter().fold(false, |is_any, range| is_any | is_in_range(range))
}

/// Whether a cell is a smooth feature (`true`) or a rough one; `None` if it is not a feature.
#[inline(always)]
fn kind(shapes: &Shapes, lane: usize, up: &Vector3<f32>, settings: &FeatureSettings) -> Option<bool> {
    let Shapes { range, normal, planarity, roughness, thickness } = shapes;
    let range = range[lane];
    let planarity = planarity[lane];
    let roughness_m = roughness[lane];
    let thickness = thickness[lane];
    let upwards = normal[0][lane] * up.x + normal[1][lane] * up.y + normal[2][lane] * up.z;
    let is_smooth = planarity >= settings.min_planarity && roughness_m <= SMOOTH_M && thickness <= MAX_THICKNESS;
    let is_rough = planarity >= MIN_ROUGH_PLANARITY
        && roughness_m <= settings.max_roughness_m
        && thickness <= MAX_ROUGH_THICKNESS
        && upwards.abs() < MAX_UPWARDS;
    let is_in_range = (settings.min_range_m..=settings.max_range_m).contains(&range);
    (is_in_range && (is_smooth || is_rough)).then_some(is_smooth)
}

/// The first feature of each voxel, in order.
pub(crate) fn thinned_features(features: &[Feature], spacing_m: f64) -> Vec<Feature> {
    let kept = thinned(features.iter().map(|feature| feature.position), spacing_m);
    kept.into_iter().map(|feature_idx| features[feature_idx]).collect()
}

/// A cell of the range image that holds a feature.
struct FeatureCell<'a> {
    row: usize,
    col: usize,
    point_idx: usize,
    /// Shapes around the cells of its block.
    shapes: &'a Shapes,
    /// Its lane in the block.
    lane: usize,
    is_smooth: bool,
}

#[inline(always)]
fn feature(sweep: &Sweep, cell: &FeatureCell<'_>, settings: &FeatureSettings) -> Feature {
    let &FeatureCell { row, col, point_idx, shapes, lane, is_smooth } = cell;
    let point = &sweep.points()[point_idx];
    let center = Vector3::from(point.position);
    let normal = Vector3::from(shapes.normal.map(|axis| axis[lane]));
    let towards_sensor = if normal.dot(&center) > 0.0 { -normal } else { normal };
    let share = match sweep.duration_nanos() {
        0 => 0.0,
        duration => (f64::from(point.offset_nanos) / f64::from(duration) - 0.5) as f32,
    };
    let lift = mean_height(sweep.image(), row, col, center, normal, settings.smoothing_m);
    Feature {
        position: (center + normal * lift).into(),
        normal: towards_sensor.into(),
        share,
        planarity: shapes.planarity[lane],
        roughness_m: shapes.roughness[lane],
        is_rough: !is_smooth,
        lever: lever(&center, &towards_sensor),
        row: row as u16,
        point_idx: point_idx as u32,
    }
}

/// Mean height above the plane through `center` of the points of the same ring within `reach_m`, m.
fn mean_height(
    image: &RangeImage,
    row: usize,
    col: usize,
    center: Vector3<f32>,
    normal: Vector3<f32>,
    reach_m: f32,
) -> f32 {
    let mut sum = 0.0;
    let mut n = 0.0;
    for column in col + RIM - SMOOTHING_COLUMNS..=col + RIM + SMOOTHING_COLUMNS {
        let d = image.position(row, column) - center;
        let height = normal.dot(&d);
        if d.norm_squared() < reach_m * reach_m && height.abs() < SMOOTHING_GATE_M {
            sum += height;
            n += 1.0_f32;
        }
    }
    sum / n.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimedPoint;
    use geometry::Stamp;

    /// A floor 1.8 m below and a wall 12 m ahead, with a deterministic ripple of 1 cm as noise.
    fn corner() -> Sweep {
        let mut points = Vec::new();
        for column in 0..2170_u32 {
            for ring in 0..32_u8 {
                let azimuth = column as f32 * 0.166_f32.to_radians();
                let elevation = (-30.67 + f32::from(ring) * 1.333_f32).to_radians();
                let ray =
                    Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
                let floor = if ray.z < 0.0 { -1.8 / ray.z } else { f32::MAX };
                let wall = if ray.x > 0.0 { 12.0 / ray.x } else { f32::MAX };
                let noise = ((column * 7919 + u32::from(ring) * 104_729) % 1000) as f32 / 1000.0 - 0.5;
                let range = floor.min(wall) + 0.02 * noise;
                if range < 100.0 {
                    points.push(TimedPoint { position: (ray * range).into(), offset_nanos: column * 46_080, ring });
                }
            }
        }
        Sweep::new(Stamp(0), points, 32)
    }

    #[test]
    fn features_of_floor_and_wall_have_their_normals() {
        let features = planar_features(&corner(), &Vector3::z(), &FeatureSettings::default());
        let mut on_wall = 0;
        let mut on_floor = 0;
        let mut wrong = 0;
        for feature in &features {
            let [x, _, z] = feature.position;
            let normal = Vector3::from(feature.normal);
            if z < -1.75 && x < 11.0 {
                on_floor += 1;
                wrong += u32::from(normal.z < 0.995);
            } else if x > 11.9 && z > -1.2 {
                on_wall += 1;
                wrong += u32::from(normal.x > -0.98);
            }
        }
        assert!(on_wall > 300 && on_floor > 1000, "{on_wall} on the wall, {on_floor} on the floor");
        assert!(wrong * 50 < on_wall + on_floor, "{wrong} of {} normals are off", on_wall + on_floor);
    }

    #[test]
    fn scattered_points_give_few_features() {
        let mut random = random::Random::new(1);
        let points = (0..20_000)
            .map(|_| {
                let position = [random.range(-20.0, 20.0), random.range(-20.0, 20.0), random.range(-3.0, 5.0)];
                TimedPoint { position, offset_nanos: 0, ring: 0 }
            })
            .collect();
        let features = planar_features(&Sweep::new(Stamp(0), points, 0), &Vector3::z(), &FeatureSettings::default());
        let n_smooth = features.iter().filter(|feature| !feature.is_rough).count();
        assert!(n_smooth < 100 && features.len() < 400, "{n_smooth} smooth of {}", features.len());
    }
}
