//! Voxel grid: one point for each occupied voxel.

use crate::position::{Bounds, is_valid};
use rayon::prelude::*;

/// The side of a voxel is not a positive number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("voxels of {0} m: the side must be a positive, finite number")]
pub struct InvalidCell(pub f32);

/// The points of each occupied voxel. Voxels are in the order of their first points. Borders are multiples of the side, so equal
/// positions get equal voxels in every cloud.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VoxelGrid {
    /// Point numbers by voxel, ascending within a voxel.
    points: Vec<u32>,
    /// End of each voxel in `points`.
    ends: Vec<usize>,
}

/// A point and its voxel: only equality matters.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry<V> {
    voxel: V,
    point: u32,
}

/// Bits of a voxel number along an axis, if the numbers of all three fit into one integer.
const AXIS_BITS: u32 = 21;

/// The valid points with their voxels.
fn entries<V: Send>(points: &[[f32; 3]], voxel: impl Fn([f32; 3]) -> V + Sync) -> Vec<Entry<V>> {
    let valid = points.par_iter().with_min_len(1 << 14).enumerate().filter(|(_, p)| is_valid(**p));
    valid.map(|(point_idx, p)| Entry { voxel: voxel(*p), point: point_idx as u32 }).collect()
}

impl VoxelGrid {
    /// Groups the points by cubic voxels of side `cell_m`. Points with invalid coordinates have no voxel.
    pub fn new(points: &[[f32; 3]], cell_m: f32) -> Result<Self, InvalidCell> {
        if !(cell_m > 0.0 && cell_m.is_finite()) {
            return Err(InvalidCell(cell_m));
        }
        // Adding 0 makes -0 equal to 0.
        let voxel = |p: [f32; 3]| p.map(|v| (f64::from(v) / f64::from(cell_m)).floor() + 0.0);
        let bounds = Bounds::around(points.iter().copied().filter(|p| is_valid(*p)));
        let low = voxel(bounds.low);
        let high = voxel(bounds.high);
        let is_small = (0..3).all(|axis| high[axis] - low[axis] < f64::from(1 << AXIS_BITS));
        // Small integers are sorted faster.
        Ok(if is_small {
            Self::from_entries(entries(points, |p| {
                let voxel = voxel(p);
                (0..3).fold(0_u64, |bits, axis| bits << AXIS_BITS | (voxel[axis] - low[axis]) as u64)
            }))
        } else {
            // Compared as bits: no voxel number is too large.
            Self::from_entries(entries(points, |p| voxel(p).map(f64::to_bits)))
        })
    }
    fn from_entries<V: Ord + Copy + Send>(mut entries: Vec<Entry<V>>) -> Self {
        entries.par_sort_unstable();
        let mut voxels: Vec<&[Entry<V>]> = entries.chunk_by(|a, b| a.voxel == b.voxel).collect();
        voxels.sort_unstable_by_key(|entries| entries[0].point);
        let mut end = 0;
        let add = |entries: &&[Entry<V>]| {
            end += entries.len();
            end
        };
        let ends = voxels.iter().map(add).collect();
        Self { points: voxels.iter().flat_map(|entries| entries.iter().map(|entry| entry.point)).collect(), ends }
    }
    /// Number of occupied voxels.
    pub fn len(&self) -> usize {
        self.ends.len()
    }
    /// Whether no voxel is occupied.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }
    /// Numbers of the points of a voxel, ascending.
    pub fn points_of(&self, voxel_idx: usize) -> &[u32] {
        let start = if voxel_idx == 0 { 0 } else { self.ends[voxel_idx - 1] };
        &self.points[start..self.ends[voxel_idx]]
    }
    /// The first point of each voxel, ascending. This sample keeps all features of its points.
    pub fn first_points(&self) -> Vec<u32> {
        (0..self.len()).map(|voxel_idx| self.points_of(voxel_idx)[0]).collect()
    }
    /// The barycenter of each voxel of the same cloud, summed in `f64`. This sample is smoother, but no sensor measured
    /// its positions.
    pub fn barycenters(&self, points: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let barycenter = |voxel_idx| {
            let members = self.points_of(voxel_idx);
            let sum = members.iter().fold([0.0_f64; 3], |sum, point_idx| {
                let p = points[*point_idx as usize];
                std::array::from_fn(|axis| sum[axis] + f64::from(p[axis]))
            });
            sum.map(|sum| (sum / members.len() as f64) as f32)
        };
        (0..self.len()).into_par_iter().with_min_len(1 << 12).map(barycenter).collect()
    }
}
