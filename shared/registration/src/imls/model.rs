//! The model: all points of the last sweeps, and the implicit moving-least-squares surface through them (Kolluri 2008).

use super::ImlsSettings;
use super::saved_bytes::SavedBytes;
use crate::map::local_map::Surface;
use crate::voxel::{SpreadKeys, VoxelIndex};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, VecDeque};

/// Side of a cell, m: the paper's radius. A search then visits at most 27 cells.
const CELL_M: f64 = 0.2;
/// Steps of a coordinate within a cell: 3 um each.
const STEPS: f64 = 65536.0;
/// Steps of a component of a normal.
const NORMAL_STEPS: f32 = 32767.0;

/// Packed point of 12 bytes: position in its cell and unit normal. Six million points, 100 sweeps, are 72 MB.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Packed {
    position: [u16; 3],
    normal: [i16; 3],
}

#[derive(Clone, Debug, Default)]
struct Cell {
    points: Vec<Packed>,
    /// The sweeps of the points, in the order of `points`.
    sweeps: VecDeque<SweepCount>,
}

/// Number of points of a sweep in a cell.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct SweepCount {
    sweep: u32,
    n_points: u32,
}

/// Cells that hold points of a sweep.
#[derive(Clone, Debug)]
struct SweepCells {
    sweep: u32,
    keys: Vec<u64>,
}

/// A point with the normal of its surface, odom frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrientedPoint {
    /// m.
    pub position: Vector3<f64>,
    /// Unit vector.
    pub normal: Vector3<f32>,
}

/// All points of the last sweeps.
#[derive(Clone, Debug, Default)]
pub(super) struct Model {
    cells: HashMap<u64, Cell, SpreadKeys>,
    /// The cells of each sweep.
    by_sweep: VecDeque<SweepCells>,
}

/// The points of a [`Model`], by cell.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct SavedModel {
    cells: Vec<SavedCell>,
    points: SavedBytes,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct SavedCell {
    key: u64,
    sweeps: VecDeque<SweepCount>,
}

impl Packed {
    const BYTES: usize = 12;

    fn new(point: &OrientedPoint, cell: &VoxelIndex) -> Self {
        let in_cell = |axis: usize| (point.position[axis] / CELL_M - f64::from(cell.0[axis])) * STEPS;
        Self {
            // Casts saturate.
            position: std::array::from_fn(|axis| in_cell(axis) as u16),
            normal: std::array::from_fn(|axis| (point.normal[axis] * NORMAL_STEPS).round() as i16),
        }
    }
    /// Position relative to the corner of its cell, m.
    #[inline]
    fn position(&self) -> Vector3<f32> {
        const STEP_M: f32 = (CELL_M / STEPS) as f32;
        Vector3::from(self.position.map(|v| (f32::from(v) + 0.5) * STEP_M))
    }
    #[inline]
    fn normal(&self) -> Vector3<f32> {
        Vector3::from(self.normal.map(|v| f32::from(v) / NORMAL_STEPS))
    }
    fn to_bytes(self) -> impl Iterator<Item = u8> {
        let normal = self.normal.map(i16::to_le_bytes);
        self.position.map(u16::to_le_bytes).into_iter().chain(normal).flatten()
    }
    fn from_bytes(bytes: &[u8]) -> Self {
        let pair = |at: usize| [bytes[2 * at], bytes[2 * at + 1]];
        Self {
            position: std::array::from_fn(|axis| u16::from_le_bytes(pair(axis))),
            normal: std::array::from_fn(|axis| i16::from_le_bytes(pair(3 + axis))),
        }
    }
}

impl Model {
    /// Adds the points of sweep `number` and drops sweeps that are too old.
    pub fn insert(&mut self, number: u32, points: &[OrientedPoint], n_sweeps: u32) {
        let mut keys = Vec::new();
        for point in points {
            let index = VoxelIndex::containing(point.position.into(), 1.0 / CELL_M);
            let key = index.key();
            let cell = self.cells.entry(key).or_default();
            cell.points.push(Packed::new(point, &index));
            match cell.sweeps.back_mut() {
                Some(last) if last.sweep == number => last.n_points += 1,
                _ => {
                    cell.sweeps.push_back(SweepCount { sweep: number, n_points: 1 });
                    keys.push(key);
                }
            }
        }
        self.by_sweep.push_back(SweepCells { sweep: number, keys });
        let oldest = (number + 1).saturating_sub(n_sweeps);
        let n_old = self.by_sweep.partition_point(|cells| cells.sweep < oldest);
        let old: Vec<SweepCells> = self.by_sweep.drain(..n_old).collect();
        for SweepCells { sweep, keys } in old {
            for key in keys {
                self.drop_sweep(key, sweep);
            }
        }
    }

    fn drop_sweep(&mut self, key: u64, sweep: u32) {
        let Some(cell) = self.cells.get_mut(&key) else { return };
        if let Some(first) = cell.sweeps.front().copied().filter(|first| first.sweep == sweep) {
            cell.sweeps.pop_front();
            cell.points.drain(..first.n_points as usize);
        }
        if cell.points.is_empty() {
            self.cells.remove(&key);
        } else if cell.points.len() * 4 < cell.points.capacity() {
            cell.points.shrink_to_fit();
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.cells.values().map(|cell| cell.points.len()).sum()
    }

    /// The surface at a position: I(x), the mean distance from the planes of the points within the radius, weighted by
    /// exp(-d^2 / h^2), and the normal of the nearest point. `None` if no point is within the radius.
    pub fn surface(&self, position: &Vector3<f64>, settings: &ImlsSettings) -> Option<Surface> {
        let limit = (settings.radius_m * settings.radius_m) as f32;
        let per_h2 = (1.0 / (settings.h_m * settings.h_m)) as f32;
        let mut weights = 0.0_f64;
        let mut heights = 0.0_f64;
        let mut nearest = f32::INFINITY;
        let mut normal = Vector3::zeros();
        self.visit(position, settings.radius_m, |cell, offset| {
            for point in &cell.points {
                let away = offset - point.position();
                let square = away.norm_squared();
                if square > limit {
                    continue;
                }
                let its_normal = point.normal();
                let weight = (-square * per_h2).exp();
                weights += f64::from(weight);
                heights += f64::from(weight * its_normal.dot(&away));
                if square < nearest {
                    nearest = square;
                    normal = its_normal;
                }
            }
        });
        // All weights may underflow if h is a small fraction of the radius.
        (weights > 0.0).then(|| Surface {
            distance_m: heights / weights,
            normal: normal.cast::<f64>().normalize(),
            lever: 0.0,
            turn_lever: 0.0,
        })
    }

    /// Whether a point is within the radius.
    pub fn is_near(&self, position: &Vector3<f64>, radius_m: f64) -> bool {
        let limit = (radius_m * radius_m) as f32;
        let mut is_near = false;
        self.visit(position, radius_m, |cell, offset| {
            is_near = is_near || cell.points.iter().any(|point| (offset - point.position()).norm_squared() <= limit);
        });
        is_near
    }

    /// Visits the cells around a position with the position relative to their corners, m.
    fn visit(&self, position: &Vector3<f64>, radius_m: f64, mut visit: impl FnMut(&Cell, Vector3<f32>)) {
        let corner = |sign: f64| VoxelIndex::containing(position.map(|v| v + sign * radius_m).into(), 1.0 / CELL_M).0;
        let low = corner(-1.0);
        let high = corner(1.0);
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let index = [x, y, z];
                    let offset = Vector3::from_fn(|axis, _| position[axis] - f64::from(index[axis]) * CELL_M);
                    let outside = offset.map(|v| (-v).max(v - CELL_M).max(0.0));
                    if outside.norm_squared() > radius_m * radius_m {
                        continue;
                    }
                    if let Some(cell) = self.cells.get(&VoxelIndex(index).key()) {
                        visit(cell, offset.cast());
                    }
                }
            }
        }
    }

    pub fn save(&self) -> SavedModel {
        let mut keys: Vec<u64> = self.cells.keys().copied().collect();
        keys.sort_unstable();
        let mut bytes = Vec::with_capacity(self.len() * Packed::BYTES);
        for key in &keys {
            bytes.extend(self.cells[key].points.iter().flat_map(|point| point.to_bytes()));
        }
        let cell = |key: u64| SavedCell { key, sweeps: self.cells[&key].sweeps.clone() };
        let cells = keys.into_iter().map(cell).collect();
        SavedModel { cells, points: SavedBytes(bytes) }
    }

    pub fn load(saved: SavedModel) -> Self {
        let mut model = Self::default();
        let mut points = saved.points.0.chunks_exact(Packed::BYTES).map(Packed::from_bytes);
        let mut by_sweep: std::collections::BTreeMap<u32, Vec<u64>> = std::collections::BTreeMap::new();
        for SavedCell { key, sweeps } in saved.cells {
            let n: u32 = sweeps.iter().map(|count| count.n_points).sum();
            for count in &sweeps {
                by_sweep.entry(count.sweep).or_default().push(key);
            }
            model.cells.insert(key, Cell { points: points.by_ref().take(n as usize).collect(), sweeps });
        }
        model.by_sweep = by_sweep.into_iter().map(|(sweep, keys)| SweepCells { sweep, keys }).collect();
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> ImlsSettings {
        ImlsSettings::default()
    }

    /// A grid of 2 cm on the plane z = `height`.
    fn floor(height: f64) -> Vec<OrientedPoint> {
        let at = |i: i32| f64::from(i) * 0.02;
        let point =
            |i: i32, k: i32| OrientedPoint { position: Vector3::new(at(i), at(k), height), normal: Vector3::z() };
        (-50..50).flat_map(|i| (-50..50).map(move |k| point(i, k))).collect()
    }

    #[test]
    fn surface_equals_the_weighted_mean_of_all_points_within_the_radius() {
        let mut random = random::Random::new(3);
        let mut points = Vec::new();
        for _ in 0..4000 {
            let mut number = |size: f32| random.range(-size, size);
            let position = Vector3::new(number(1.0), number(1.0), number(0.1)).cast::<f64>();
            let normal = Vector3::new(number(0.2), number(0.2), 1.0).normalize();
            points.push(OrientedPoint { position, normal });
        }
        let mut model = Model::default();
        model.insert(0, &points, 100);
        assert_eq!(model.len(), points.len(), "nothing is thinned");
        for i in 0..200 {
            let x = Vector3::new(f64::from(i) * 0.007 - 0.7, 0.3, 0.15);
            let mut weights = 0.0;
            let mut heights = 0.0;
            let mut nearest_m = f64::MAX;
            let mut nearest_normal = Vector3::zeros();
            for point in &points {
                let away = x - point.position;
                let normal = point.normal.cast::<f64>();
                if away.norm() <= 0.2 {
                    let weight = (-away.norm_squared() / 0.0036).exp();
                    weights += weight;
                    heights += weight * away.dot(&normal);
                    if away.norm() < nearest_m {
                        nearest_m = away.norm();
                        nearest_normal = normal;
                    }
                }
            }
            let found = model.surface(&x, &settings());
            assert_eq!(found.is_some(), weights > 0.0);
            assert_eq!(model.is_near(&x, 0.2), weights > 0.0);
            if let Some(found) = found {
                assert!(
                    (found.distance_m - heights / weights).abs() < 2e-5,
                    "{} {}",
                    found.distance_m,
                    heights / weights
                );
                assert!((found.normal - nearest_normal).norm() < 1e-3);
            }
        }
    }

    #[test]
    fn model_keeps_all_points_of_the_last_sweeps() {
        let mut model = Model::default();
        for number in 0..5_u32 {
            model.insert(number, &floor(f64::from(number)), 3);
        }
        assert_eq!(model.len(), 30_000, "three sweeps of 10 000 points");
        let at = |z: f64| model.surface(&Vector3::new(0.01, 0.01, z), &settings()).map(|surface| surface.distance_m);
        assert_eq!((at(0.05), at(1.05)), (None, None), "sweeps 0 and 1 are dropped");
        for z in [2.05, 4.05] {
            assert!(at(z).is_some_and(|distance_m| (distance_m - 0.05).abs() < 1e-5), "{z}: {:?}", at(z));
        }
    }

    #[test]
    fn loaded_model_has_the_same_bits_and_drops_the_same_sweeps() {
        let bytes = |model: &Model| postcard::to_stdvec(&model.save()).expect("saves");
        let mut model = Model::default();
        (0..3).for_each(|number| model.insert(number, &floor(0.003 * f64::from(number)), 3));
        let saved = bytes(&model);
        assert!(saved.len() < 13 * model.len(), "{} bytes for {} points", saved.len(), model.len());
        let mut loaded = Model::load(postcard::from_bytes(&saved).expect("loads"));
        for model in [&mut model, &mut loaded] {
            model.insert(3, &floor(0.01), 3);
        }
        assert_eq!(model.len(), 30_000);
        assert_eq!(bytes(&loaded), bytes(&model));
        let x = Vector3::new(0.1, 0.2, 0.05);
        assert_eq!(model.surface(&x, &settings()), loaded.surface(&x, &settings()));
    }
}
