//! The sliding map that sweeps are matched against.

use crate::voxel::{EMPTY_KEY, VoxelIndex, first_slot, table_bits};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A point of a surface, 40 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// x y z, m, odom frame. f64: the odom frame may be kilometres away from its origin.
    pub position: [f64; 3],
    /// Unit normal, odom frame.
    pub normal: [f32; 3],
    /// Number of the insertion that brought it.
    pub batch: u32,
}

/// Extent of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapSettings {
    /// One point per cube of this side, m.
    pub spacing_m: f64,
    /// Insertions after which a point leaves.
    pub batches: u32,
    /// How far a point moves along its normal towards a new point of its cube, as a share of their distance; 0 leaves it
    /// where the first measurement was.
    pub refinement: f64,
    /// Points at most; the oldest leave first.
    pub max_points: usize,
}

impl Default for MapSettings {
    /// 0.2 m is ten times the range noise, so neighbors' normals are worth having. 60 sweeps are 6 s, and 60 m at 10
    /// m/s, as far as surfaces are hit densely. A refinement of 0.1 averages over some ten sweeps. 80 000 points are 3.2 MB of state; a street fills about half.
    fn default() -> Self {
        Self { spacing_m: 0.2, batches: 60, refinement: 0.1, max_points: 80_000 }
    }
}

/// Side of a search cell, m. A search of half of it touches 2 x 2 x 2 cells; one cell of a plane holds 25 points at the
/// default spacing.
const CELL_M: f64 = 1.0;
/// Cosine of the largest angle between normals of one surface, 37 degrees.
const SAME_SURFACE: f32 = 0.8;
/// A new point farther off a map point's plane is on something else, m: five times range noise.
const REFINEMENT_GATE_M: f64 = 0.1;
/// Largest radius of [`LocalMap::surface`], m.
pub(crate) const MAX_RADIUS_M: f64 = CELL_M / 2.0;

/// Points with normals, thinned, found by place. Points stay in the order of their insertion; the index over them is
/// derived, so the list alone is the state.
#[derive(Clone, Debug, Default)]
pub struct LocalMap {
    points: Vec<MapPoint>,
    index: Index,
}

/// Open addressing over cells; each cell's points lie beside each other, in insertion order.
#[derive(Clone, Debug, Default)]
struct Index {
    bits: u32,
    keys: Vec<u64>,
    ends: Vec<u32>,
    sorted: Vec<MapPoint>,
    /// Where each of `sorted` stands in the order of insertion.
    order: Vec<u32>,
    /// Slot of each point, while the index is built.
    slots: Vec<u32>,
}

impl LocalMap {
    /// From a saved list. See [`LocalMap::points`].
    pub fn from_points(points: Vec<MapPoint>) -> Self {
        let mut index = Index::default();
        index.rebuild(&points);
        Self { points, index }
    }
    /// In the order of insertion.
    pub fn points(&self) -> &[MapPoint] {
        &self.points
    }
    /// Adds the points whose cube is still free; others move the point in their cube towards them, along its normal, by the
    /// share that the settings say. Drops what is older than they allow, and keeps within bounds. New points are expected
    /// to be thinned among themselves.
    pub fn insert(&mut self, batch: u32, new_points: &[MapPoint], settings: &MapSettings) {
        let per_m = 1.0 / settings.spacing_m;
        let mut free = Vec::new();
        for new in new_points {
            let cube = VoxelIndex::containing(new.position, per_m);
            // The first coordinate tells most cubes apart; the factor covers its rounding.
            let is_same = |old: &MapPoint| {
                (old.position[0] - new.position[0]).abs() < 1.01 * settings.spacing_m
                    && VoxelIndex::containing(old.position, per_m) == cube
            };
            let cell = self.index.cell_range(cell_of(new.position));
            match cell.into_iter().find(|&place| is_same(&self.index.sorted[place])) {
                Some(place) => {
                    let point = &mut self.points[self.index.order[place] as usize];
                    refine(point, new, settings.refinement);
                }
                None => free.push(MapPoint { batch, ..*new }),
            }
        }
        let oldest = batch.saturating_sub(settings.batches.saturating_sub(1));
        let expired = self.points.partition_point(|point| point.batch < oldest);
        self.points.drain(..expired);
        self.points.extend(free);
        let excess = self.points.len().saturating_sub(settings.max_points);
        self.points.drain(..excess);
        self.index.rebuild(&self.points);
    }
    /// The surface around a position: the implicit moving-least-squares function (Kolluri 2008) of the points within
    /// the kernel's radius (at most 0.5 m, half a search cell) whose normals are within about 37 degrees of `normal`: the other
    /// side of a wall, or the road under a bumper, does not belong to it. `None` where there is no such point.
    #[inline]
    pub fn surface(&self, position: [f64; 3], normal: &Vector3<f32>, kernel: &Kernel) -> Option<Surface> {
        let base = VoxelIndex::containing(position.map(|v| v - CELL_M / 2.0), 1.0 / CELL_M).0;
        let radius = kernel.radius_m.min(MAX_RADIUS_M);
        let limit = radius * radius;
        // How far above the face between the lower and the upper cells the position lies, by axis.
        let above: [f64; 3] = std::array::from_fn(|axis| position[axis] - f64::from(base[axis] + 1) * CELL_M);
        let (mut weights, mut distances, mut normals) = (0.0, 0.0, Vector3::<f64>::zeros());
        for corner in 0..8 {
            let is_upper = [corner & 1, corner >> 1 & 1, corner >> 2];
            let away = |axis: usize| if is_upper[axis] == 1 { -above[axis] } else { above[axis] };
            if away(0) >= radius || away(1) >= radius || away(2) >= radius {
                continue;
            }
            let cell = VoxelIndex(std::array::from_fn(|axis| base[axis] + is_upper[axis]));
            for point in self.index.cell(cell) {
                let offset = Vector3::from(position) - Vector3::from(point.position);
                let squared = offset.norm_squared();
                if squared >= limit || Vector3::from(point.normal).dot(normal) <= SAME_SURFACE {
                    continue;
                }
                let weight = match kernel.weights {
                    Weights::Compact => (1.0 - squared / limit).powi(2),
                    Weights::Gaussian { h_m } => (-squared / (h_m * h_m)).exp(),
                };
                let normal = Vector3::from(point.normal).cast::<f64>();
                weights += weight;
                distances += weight * normal.dot(&offset);
                normals += normal * weight;
            }
        }
        (weights > 1e-6).then(|| Surface { distance_m: distances / weights, normal: normals.normalize() })
    }
}

/// Moves a point along its normal by `share` of the way to the plane through another of the same surface. Sideways it
/// stays: thinning goes on as it was.
fn refine(point: &mut MapPoint, new: &MapPoint, share: f64) {
    let normal = Vector3::from(point.normal);
    let height = normal.cast::<f64>().dot(&(Vector3::from(new.position) - Vector3::from(point.position)));
    if normal.dot(&Vector3::from(new.normal)) > SAME_SURFACE && height.abs() < REFINEMENT_GATE_M {
        let step = normal.cast::<f64>() * (share * height);
        point.position = (Vector3::from(point.position) + step).into();
    }
}

/// How a point counts by its distance d, see [`LocalMap::surface`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weights {
    /// (1 - d^2/r^2)^2 within the radius r: as smooth as a Gaussian, ends at the radius, costs no exponential.
    Compact,
    /// exp(-d^2/h^2) within the radius (Kolluri 2008; IMLS-SLAM's form).
    Gaussian {
        /// h, m.
        h_m: f64,
    },
}

/// Which points make a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// Points farther away do not count, m; at most 0.5.
    pub radius_m: f64,
    /// How nearer ones count.
    pub weights: Weights,
}

/// See [`LocalMap::surface`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Of the position from the surface, positive on the side that its normal points to, m.
    pub distance_m: f64,
    /// Unit normal, odom frame.
    pub normal: Vector3<f64>,
}

fn cell_of(position: [f64; 3]) -> VoxelIndex {
    VoxelIndex::containing(position, 1.0 / CELL_M)
}

impl Index {
    /// Over these points, in the memory of the last ones.
    fn rebuild(&mut self, points: &[MapPoint]) {
        // A cell of a map as it is has some ten points; the table must stay in the second cache.
        self.bits = table_bits(points.len() / 8);
        while !self.fits(points) {
            self.bits += 1;
        }
        // Counts become starts; placing each point then moves its cell's start to its end.
        let mut start = 0;
        for end in &mut self.ends {
            let count = *end;
            *end = start;
            start += count;
        }
        self.sorted.clear();
        if let Some(&any) = points.first() {
            self.sorted.resize(points.len(), any);
        }
        self.order.resize(points.len(), 0);
        for (idx, (point, &slot)) in points.iter().zip(&self.slots).enumerate() {
            let place = &mut self.ends[slot as usize];
            self.sorted[*place as usize] = *point;
            self.order[*place as usize] = idx as u32;
            *place += 1;
        }
    }
    /// Finds each point its slot and counts the points of each. `false` if more than half of the slots are taken.
    fn fits(&mut self, points: &[MapPoint]) -> bool {
        let n_slots = 1_usize << self.bits;
        self.keys.clear();
        self.keys.resize(n_slots, EMPTY_KEY);
        self.ends.clear();
        self.ends.resize(n_slots, 0);
        self.slots.clear();
        let mut n_cells = 0;
        for point in points {
            let key = cell_of(point.position).key();
            let slot = self.slot(key);
            if self.keys[slot] == EMPTY_KEY {
                n_cells += 1;
                if 2 * n_cells > n_slots {
                    return false;
                }
                self.keys[slot] = key;
            }
            self.ends[slot] += 1;
            self.slots.push(slot as u32);
        }
        true
    }
    /// Where the key is, or where it would go.
    #[inline]
    fn slot(&self, key: u64) -> usize {
        let mut slot = first_slot(key, self.bits);
        while self.keys[slot] != key && self.keys[slot] != EMPTY_KEY {
            slot = (slot + 1) & (self.keys.len() - 1);
        }
        slot
    }
    #[inline]
    fn cell(&self, cell: VoxelIndex) -> &[MapPoint] {
        &self.sorted[self.cell_range(cell)]
    }
    /// Where the cell's points are in `sorted`.
    #[inline]
    fn cell_range(&self, cell: VoxelIndex) -> Range<usize> {
        if self.keys.is_empty() {
            return 0..0;
        }
        let slot = self.slot(cell.key());
        if self.keys[slot] == EMPTY_KEY {
            return 0..0;
        }
        let start = if slot == 0 { 0 } else { self.ends[slot - 1] };
        start as usize..self.ends[slot] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KERNEL: Kernel = Kernel { radius_m: 0.5, weights: Weights::Compact };

    fn point(x: f64, y: f64, z: f64) -> MapPoint {
        MapPoint { position: [x, y, z], normal: [0.0, 0.0, 1.0], batch: 0 }
    }

    /// Positions spread over some metres on both sides of the origin, by an irrational step.
    fn scattered(n: usize) -> Vec<MapPoint> {
        (0..n)
            .map(|i| {
                let along = |step: f64, size: f64| ((i as f64 * step).fract() - 0.5) * size;
                point(along(0.618_033_988_749, 20.0), along(0.754_877_666_246, 20.0), along(0.569_840_290_998, 6.0))
            })
            .collect()
    }

    #[test]
    fn the_surface_is_that_of_a_sum_over_every_point() {
        let map = LocalMap::from_points(scattered(5000));
        let up = Vector3::z();
        let mut found = 0;
        for query in scattered(5700).iter().skip(5000) {
            let (mut weights, mut heights) = (0.0, 0.0);
            for p in map.points() {
                let offset = Vector3::from(query.position) - Vector3::from(p.position);
                let weight = (1.0 - (offset.norm() / 0.5).powi(2)).max(0.0).powi(2);
                weights += weight;
                heights += weight * offset.z;
            }
            let surface = map.surface(query.position, &up, &KERNEL);
            assert_eq!(surface.is_some(), weights > 1e-6);
            if let Some(surface) = surface {
                assert!((surface.distance_m - heights / weights).abs() < 1e-9);
                assert_eq!(surface.normal, Vector3::z());
                found += 1;
            }
        }
        assert!(found > 400 && found < 700, "both outcomes must occur: {found} of 700");
        assert_eq!(map.surface([0.0; 3], &Vector3::x(), &KERNEL), None, "normals disagree everywhere");
        assert_eq!(LocalMap::default().surface([0.0; 3], &up, &KERNEL), None);
    }

    #[test]
    fn a_map_is_thin_ages_and_stays_bounded() {
        let settings = MapSettings { spacing_m: 0.2, batches: 3, refinement: 0.0, max_points: 1000 };
        let mut map = LocalMap::default();
        map.insert(0, &[point(0.05, 0.05, 0.05), point(0.3, 0.0, 0.0)], &settings);
        map.insert(1, &[point(0.1, 0.1, 0.1), point(-0.05, 0.0, 0.0)], &settings);
        assert_eq!(map.points().len(), 3, "the first cube was taken");
        map.insert(2, &[], &settings);
        assert_eq!(map.points().len(), 3);
        map.insert(3, &[], &settings);
        assert_eq!(map.points().len(), 1, "batch 0 is three insertions old");
        map.insert(4, &scattered(5000), &settings);
        assert_eq!(map.points().len(), 1000);
    }
}
