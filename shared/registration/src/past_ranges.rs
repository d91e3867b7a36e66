//! The ranges of an earlier sweep: how far each of its rays went.

use crate::{RangeImage, Sweep, SweepMotion};
use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Unit of a stored range, m; 15 bits reach 327 m.
const UNIT_M: f32 = 0.01;
/// Bit of a stored range: on a moving object.
const DYNAMIC: u16 = 1 << 15;
/// Columns that share one pose: 2.8 degrees, 0.8 ms at 10 Hz, 8 mm at 10 m/s.
const SECTOR: usize = 16;
/// Ranges on different surfaces differ by more than this, m, plus a share of the range: errors of the pose, width of the beam.
const TOLERANCE_M: f32 = 0.3;
const TOLERANCE_SHARE: f32 = 0.01;
/// Neighboring rays that are compared, too: 0.5 degrees to each side, one ring up and down. A single ray easily misses a pole or
/// the rim of an object.
const REACH_COLUMNS: usize = 3;
/// Those columns from the middle outwards, counted from the leftmost.
const BESIDE_COLUMNS: [usize; 7] = [3, 2, 4, 1, 5, 0, 6];

/// Ranges of a sweep by ray.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PastRanges {
    motion: SweepMotion,
    /// Slope of the rays of each row (z over horizontal distance), ascending.
    slopes: Vec<f32>,
    /// Time of each sector as a share of the sweep.
    shares: Vec<f32>,
    /// In units of [`UNIT_M`], 0 = no return, by row and column; with [`DYNAMIC`].
    ranges: Vec<u16>,
}

/// Of 21 rays around a position so many must pass it to call it free.
const MIN_BEYOND: u32 = 9;

/// What a sweep saw at a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Visibility {
    /// Rays passed.
    Free,
    /// A ray hit a surface there.
    Occupied,
    /// A ray hit a moving object there.
    Dynamic,
    /// No ray reached it.
    Unknown,
}

impl PastRanges {
    /// `dynamic` are the indices of the points on moving objects, ascending.
    pub fn new(sweep: &Sweep, motion: SweepMotion, dynamic: &[u32]) -> Self {
        let image = sweep.image();
        let (rows, cols) = (image.rows(), image.cols());
        let mut ranges = vec![0; rows * cols];
        let mut sums = vec![(0.0_f64, 0_u32); rows];
        let mut shares = vec![f32::NAN; cols / SECTOR];
        let duration = f64::from(sweep.duration_nanos().max(1));
        for row in 0..rows {
            for col in 0..cols {
                let position = image.position(row, col);
                let [x, y, z] = position.into();
                // NaN of an empty cell becomes 0. Too large ranges become the largest one.
                ranges[row * cols + col] = ((position.norm() * (1.0 / UNIT_M)) as u16).min(DYNAMIC - 1);
                let Some(idx) = image.point(row, col) else { continue };
                if col % SECTOR < 2 {
                    sums[row].0 += f64::from(z / (x * x + y * y).sqrt());
                    sums[row].1 += 1;
                }
                if sweep.duration_nanos() > 0 && shares[col / SECTOR].is_nan() {
                    shares[col / SECTOR] = (f64::from(sweep.points()[idx].offset_nanos) / duration - 0.5) as f32;
                }
            }
        }
        for &idx in dynamic {
            if let Some((row, col)) = image.cell(idx as usize) {
                ranges[row * cols + col] |= DYNAMIC;
            }
        }
        fill_gaps(&mut shares);
        Self { motion, slopes: slopes(&sums), shares, ranges }
    }

    /// With the poses of the sectors, for queries.
    pub fn placed(&self) -> PlacedRanges<'_> {
        // f32 holds millimetres only within some kilometres, so positions are relative to the middle of the sweep.
        let mid = Isometry3::from_parts(Vector3::zeros().into(), self.motion.mid.rotation);
        let near = SweepMotion { mid, ..self.motion };
        let sectors = self.shares.iter().map(|&share| near.at(f64::from(share)).inverse().cast::<f32>()).collect();
        PlacedRanges { ranges: self, sectors }
    }
}

/// [`PastRanges`] with the pose of each sector.
pub(crate) struct PlacedRanges<'a> {
    ranges: &'a PastRanges,
    sectors: Vec<Isometry3<f32>>,
}

impl PlacedRanges<'_> {
    /// What the sweep saw at a position in the odom frame.
    pub fn visibility(&self, position: &Vector3<f64>) -> Visibility {
        let from_mid = Point3::from((position - self.ranges.motion.mid.translation.vector).cast::<f32>());
        // The column determines the time, and the time the column: the second iteration is within 0.1 degrees.
        let cols = self.ranges.ranges.len() / self.ranges.slopes.len();
        let mut col = cols / 2;
        let mut local = Point3::origin();
        for _ in 0..2 {
            local = self.sectors[col / SECTOR] * from_mid;
            col = RangeImage::column(local.x, local.y);
        }
        let range = local.coords.norm();
        let Some(row) = self.row(local.z / (local.x * local.x + local.y * local.y).sqrt()) else {
            return Visibility::Unknown;
        };
        let tolerance = TOLERANCE_M + TOLERANCE_SHARE * range;
        let at = |row: usize, col: usize| self.ranges.ranges[row * cols + col % cols];
        // From the middle outwards: the first ray hits most static objects.
        let rows = [Some(row), row.checked_sub(1), (row + 1 < self.ranges.slopes.len()).then_some(row + 1)];
        let (mut n_beyond, mut is_blocked) = (0, false);
        for row in rows.into_iter().flatten() {
            for beside in BESIDE_COLUMNS {
                let stored = at(row, col + cols + beside - REACH_COLUMNS);
                let range_m = f32::from(stored & !DYNAMIC) * UNIT_M;
                if (range_m - range).abs() < tolerance {
                    return if stored & DYNAMIC == 0 { Visibility::Occupied } else { Visibility::Dynamic };
                }
                n_beyond += u32::from(range_m > range);
                is_blocked |= range_m > 0.0 && range_m < range;
            }
        }
        // Rays that end before and behind the position may be on one surface at a flat angle, which contains the position.
        if n_beyond >= MIN_BEYOND && !is_blocked { Visibility::Free } else { Visibility::Unknown }
    }

    /// The row whose rays have the nearest slope; `None` outside of the field of view.
    fn row(&self, slope: f32) -> Option<usize> {
        let slopes = &self.ranges.slopes;
        let above = slopes.partition_point(|s| *s < slope);
        let below = above.checked_sub(1)?;
        let is_inside = above < slopes.len();
        is_inside.then(|| if slopes[above] - slope < slope - slopes[below] { above } else { below })
    }
}

/// Mean slope of each row. An empty row takes that of the row below, so that they ascend.
fn slopes(sums: &[(f64, u32)]) -> Vec<f32> {
    let mut last = f32::MIN;
    let mean = |(sum, n): &(f64, u32)| {
        if *n > 0 {
            last = last.max((sum / f64::from(*n)) as f32);
        }
        last
    };
    sums.iter().map(mean).collect()
}

/// Fills gaps with the value before them; 0 if there is no value.
fn fill_gaps(shares: &mut [f32]) {
    let mut last = shares.iter().copied().find(|share| !share.is_nan()).unwrap_or(0.0);
    for share in shares {
        if share.is_nan() {
            *share = last;
        }
        last = *share;
    }
}
