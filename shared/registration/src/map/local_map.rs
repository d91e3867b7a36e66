//! The sliding local map to which sweeps are matched.

use crate::Kernel;
use crate::map::cell::{Cell, CellPoint, SAME_SURFACE, SurfaceSums};
use crate::voxel::{SpreadKeys, VoxelIndex};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, VecDeque};

/// A point of a surface, 48 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// x y z, m, odom frame. f64: the vehicle may be kilometres from the origin of the odom frame.
    pub position: [f64; 3],
    /// Unit normal, odom frame.
    pub normal: [f32; 3],
    /// See [`crate::Feature::lever`].
    pub lever: f32,
    /// Displacement of the point along the normal by the motion during a revolution, m, for a sensor that spins
    /// clockwise; 0 with point times.
    pub turn_lever: f32,
    /// Number of the insertion that added the point.
    pub batch: u32,
}

/// Extent and density of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapSettings {
    /// One point per cube of this side, m; rounded so that whole cubes fill a metre.
    pub spacing_m: f64,
    /// Number of insertions after which a point is dropped.
    pub batches: u32,
    /// Step of a point along its normal towards a new point in its cube, as a share of their distance; 0 keeps the
    /// first measurement.
    pub refinement: f64,
    /// Largest number of points; the oldest are dropped first.
    pub max_points: usize,
}

impl Default for MapSettings {
    /// 0.2 m is ten times the range noise, so normals from neighbors are accurate. 60 sweeps are 6 s, and 60 m at 10
    /// m/s: the range of dense returns. A refinement of 0.1 averages about ten sweeps. 80 000 points are 3.8 MB of
    /// state; a street uses about half.
    fn default() -> Self {
        Self { spacing_m: 0.2, batches: 60, refinement: 0.1, max_points: 80_000 }
    }
}

/// Side of a cell, m. A search with half this radius visits 2 x 2 x 2 cells; one cell of a plane holds 25 points at the
/// default spacing.
const CELL_M: f64 = 1.0;
/// Larger distances of a new point from a map point's plane mean another surface, m: five times the range noise.
const REFINEMENT_GATE_M: f32 = 0.1;
/// Largest radius of [`LocalMap::surface`], m.
pub(crate) const MAX_RADIUS_M: f64 = CELL_M / 2.0;
/// Positions are multiples of this, m: 1 um. f32 therefore holds them exactly within a cell, and f64 in the odom frame.
const UNIT_M: f64 = 1.0 / (1 << 20) as f64;

/// Thinned points with normals, searchable by position. The list of points is the whole state: a map rebuilt from it
/// continues with the same bits.
#[derive(Clone, Debug, Default)]
pub struct LocalMap {
    cells: HashMap<u64, Cell, SpreadKeys>,
    /// Cell and batch of each point, in insertion order. Cells hold their points in the same order.
    order: VecDeque<(u64, u32)>,
}

impl LocalMap {
    /// Builds the map from a list of points, for example a saved one, see [`LocalMap::points`].
    pub fn from_points(points: &[MapPoint]) -> Self {
        let mut map = Self::default();
        for point in points {
            let placed = PlacedPoint::new(point);
            map.push(placed.key, placed.point, point.batch);
        }
        map
    }
    /// All points in insertion order.
    pub fn points(&self) -> Vec<MapPoint> {
        let mut met: HashMap<u64, usize, SpreadKeys> = HashMap::default();
        let point = |&(key, batch): &(u64, u32)| {
            let at = met.entry(key).or_default();
            let CellPoint { position, normal, levers: [lever, turn_lever] } = self.cells[&key].get(*at);
            *at += 1;
            let corner = VoxelIndex::from_key(key).0;
            let position = std::array::from_fn(|axis| f64::from(corner[axis]) * CELL_M + f64::from(position[axis]));
            MapPoint { position, normal, lever, turn_lever, batch }
        };
        self.order.iter().map(point).collect()
    }
    /// Number of points.
    pub fn len(&self) -> usize {
        self.order.len()
    }
    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }
    /// Adds the points whose cubes are empty. Each of the others moves the point in its cube along the normal by
    /// [`MapSettings::refinement`]. Drops points that are too old or too many. New points must already be thinned: they
    /// do not refine each other.
    pub fn insert(&mut self, batch: u32, new_points: &[MapPoint], settings: &MapSettings) {
        let n_before = self.order.len();
        let added = wide_loops::run(
            #[inline(always)]
            || self.refine(new_points, settings),
        );
        for PlacedPoint { key, point } in added {
            self.push(key, point, batch);
        }
        let oldest = batch.saturating_sub(settings.batches.saturating_sub(1));
        let n_expired = self.order.iter().take(n_before).take_while(|(_, batch)| *batch < oldest).count();
        let n_excess = self.order.len().saturating_sub(settings.max_points);
        for _ in 0..n_expired.max(n_excess) {
            self.drop_oldest();
        }
    }
    /// Refines the map with the points whose cubes are occupied, and returns the others with their cells.
    #[inline(always)]
    fn refine(&mut self, new_points: &[MapPoint], settings: &MapSettings) -> Vec<PlacedPoint> {
        let per_side = (CELL_M / settings.spacing_m).round().max(1.0) as f32;
        let cube_of = |position: [f32; 3]| position.map(|v| (v * per_side).floor());
        let mut added = Vec::new();
        for new in new_points {
            let new = PlacedPoint::new(new);
            let cube = cube_of(new.point.position);
            let taken = self.cells.get_mut(&new.key).and_then(|cell| Some((cell.in_cube(cube, per_side)?, cell)));
            let Some((at, cell)) = taken else {
                added.push(new);
                continue;
            };
            let refined = refined(cell.get(at), &new.point, settings.refinement as f32);
            // A point must stay in its cube, otherwise thinning would find the cube empty.
            if cube_of(refined.position) == cube {
                cell.set(at, refined);
            }
        }
        added
    }
    fn push(&mut self, key: u64, point: CellPoint, batch: u32) {
        self.cells.entry(key).or_default().push(point);
        self.order.push_back((key, batch));
    }
    fn drop_oldest(&mut self) {
        let Some((key, _)) = self.order.pop_front() else { return };
        if let Entry::Occupied(mut cell) = self.cells.entry(key) {
            cell.get_mut().drop_first();
            if cell.get().n() == 0 {
                cell.remove();
            }
        }
    }
    /// The surface around a position: the implicit moving-least-squares function (Kolluri 2008) of the points within
    /// the kernel's radius (at most 0.5 m, half a cell) whose normals are within about 37 degrees of `normal`. The
    /// angle limit excludes the other side of a wall and the road under a bumper. `None` if there is no such point.
    #[inline(always)]
    pub fn surface(&self, position: [f64; 3], normal: &Vector3<f32>, kernel: &Kernel) -> Option<Surface> {
        let base = VoxelIndex::containing(position.map(|v| v - CELL_M / 2.0), 1.0 / CELL_M).0;
        let kernel = Kernel { radius_m: kernel.radius_m.min(MAX_RADIUS_M), ..*kernel };
        // Offset from the corner of the lowest cell, and from the face to the upper cells.
        let offset: [f32; 3] = std::array::from_fn(|axis| (position[axis] - f64::from(base[axis]) * CELL_M) as f32);
        let above = offset.map(|v| f64::from(v) - CELL_M);
        let mut sums = SurfaceSums::zero();
        for corner in 0..8 {
            let is_upper = [corner & 1, corner >> 1 & 1, corner >> 2];
            let away = |axis: usize| if is_upper[axis] == 1 { -above[axis] } else { above[axis] };
            if away(0) >= kernel.radius_m || away(1) >= kernel.radius_m || away(2) >= kernel.radius_m {
                continue;
            }
            let key = VoxelIndex(std::array::from_fn(|axis| base[axis].wrapping_add(is_upper[axis]))).key();
            if let Some(cell) = self.cells.get(&key) {
                let offset = std::array::from_fn(|axis| offset[axis] - is_upper[axis] as f32 * CELL_M as f32);
                cell.add_surface(offset, (*normal).into(), &kernel, &mut sums);
            }
        }
        let [weight, distance, x, y, z, lever, turn_lever] = sums.totals();
        (weight > 1e-6).then(|| Surface {
            distance_m: distance / weight,
            normal: Vector3::new(x, y, z).normalize(),
            lever: lever / weight,
            turn_lever: turn_lever / weight,
        })
    }
}

/// A point with the key of its cell.
struct PlacedPoint {
    key: u64,
    point: CellPoint,
}

impl PlacedPoint {
    #[inline(always)]
    fn new(point: &MapPoint) -> Self {
        let position = point.position.map(|v| (v / UNIT_M).round() * UNIT_M);
        let cell = VoxelIndex::containing(position, 1.0 / CELL_M);
        let in_cell = std::array::from_fn(|axis| (position[axis] - f64::from(cell.0[axis]) * CELL_M) as f32);
        let levers = [point.lever, point.turn_lever];
        Self { key: cell.key(), point: CellPoint { position: in_cell, normal: point.normal, levers } }
    }
}

/// A point, moved along its normal by `share` of its distance to the plane through a new point of the same surface. It
/// does not move tangentially, so thinning is not affected.
#[inline(always)]
fn refined(old: CellPoint, new: &CellPoint, share: f32) -> CellPoint {
    let CellPoint { position, normal, levers } = old;
    let axis = Vector3::from(normal);
    let height = axis.dot(&(Vector3::from(new.position) - Vector3::from(position)));
    if axis.dot(&Vector3::from(new.normal)) <= SAME_SURFACE || height.abs() >= REFINEMENT_GATE_M {
        return old;
    }
    let unit = UNIT_M as f32;
    let moved = (Vector3::from(position) + axis * (share * height)).map(|v| (v / unit).round() * unit);
    let levers = std::array::from_fn(|at| levers[at] + share * (new.levers[at] - levers[at]));
    CellPoint { position: moved.into(), normal, levers }
}

/// Result of [`LocalMap::surface`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Signed distance of the position, positive on the side of the normal, m.
    pub distance_m: f64,
    /// Unit normal, odom frame.
    pub normal: Vector3<f64>,
    /// Mean lever, m, see [`crate::Feature::lever`].
    pub lever: f64,
    /// Mean of [`MapPoint::turn_lever`], m.
    pub turn_lever: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Weights;

    const KERNEL: Kernel = Kernel { radius_m: 0.5, weights: Weights::Compact };

    fn point(x: f64, y: f64, z: f64) -> MapPoint {
        MapPoint { position: [x, y, z], normal: [0.0, 0.0, 1.0], lever: 0.0, turn_lever: 0.0, batch: 0 }
    }

    /// Quasi-random positions some metres around the origin.
    fn scattered(n: usize) -> Vec<MapPoint> {
        (0..n)
            .map(|i| {
                let along = |step: f64, size: f64| ((i as f64 * step).fract() - 0.5) * size;
                point(along(0.618_033_988_749, 20.0), along(0.754_877_666_246, 20.0), along(0.569_840_290_998, 6.0))
            })
            .collect()
    }

    #[test]
    fn surface_equals_the_sum_over_all_points() {
        let map = LocalMap::from_points(&scattered(5000));
        let up = Vector3::z();
        let mut found = 0;
        for query in scattered(5700).iter().skip(5000) {
            let mut weights = 0.0;
            let mut heights = 0.0;
            for p in map.points() {
                let offset = Vector3::from(query.position) - Vector3::from(p.position);
                let weight = (1.0 - (offset.norm() / 0.5).powi(2)).max(0.0).powi(2);
                weights += weight;
                heights += weight * offset.z;
            }
            let surface = map.surface(query.position, &up, &KERNEL);
            assert_eq!(surface.is_some(), weights > 1e-6);
            if let Some(surface) = surface {
                assert!((surface.distance_m - heights / weights).abs() < 1e-6);
                assert_eq!(surface.normal, Vector3::z());
                found += 1;
            }
        }
        assert!(found > 400 && found < 700, "both outcomes must occur: {found} of 700");
        assert_eq!(map.surface([0.0; 3], &Vector3::x(), &KERNEL), None, "normals disagree everywhere");
        assert_eq!(LocalMap::default().surface([0.0; 3], &up, &KERNEL), None);
    }

    #[test]
    fn map_is_thinned_ages_and_stays_bounded() {
        let settings = MapSettings { spacing_m: 0.2, batches: 3, refinement: 0.0, max_points: 1000 };
        let mut map = LocalMap::default();
        map.insert(0, &[point(0.05, 0.05, 0.05), point(0.3, 0.0, 0.0)], &settings);
        map.insert(1, &[point(0.1, 0.1, 0.1), point(-0.05, 0.0, 0.0)], &settings);
        assert_eq!(map.len(), 3, "the first cube was occupied");
        map.insert(2, &[], &settings);
        assert_eq!(map.len(), 3);
        map.insert(3, &[], &settings);
        assert_eq!(map.len(), 1, "batch 0 is three insertions old");
        map.insert(4, &scattered(5000), &settings);
        assert_eq!(map.len(), 1000);
    }
}
