//! What an earlier sweep saw: how far each of its rays went before it met something.

use crate::{RangeImage, Sweep, SweepMotion};
use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Unit of a stored range, m; 15 bits reach 327 m.
const UNIT_M: f32 = 0.01;
/// The bit of a stored range that says: on a thing that moved.
const MOVED: u16 = 1 << 15;
/// Columns that share one pose: 2.8 degrees, 0.8 ms at 10 Hz, 8 mm at 10 m/s.
const SECTOR: usize = 16;
/// Ranges differ by more than this on different surfaces, m, plus a share of the range: the vehicle's pose and the beam's
/// width.
const TOLERANCE_M: f32 = 0.3;
const TOLERANCE_SHARE: f32 = 0.01;
/// Rays beside the one through a point whose surface may be the point's: 0.5 degrees to each side, one ring up and down. A
/// pole, or the rim of a thing, is easily missed by one ray.
const REACH_COLUMNS: usize = 3;
/// Those columns from the middle outwards, counted from the leftmost.
const BESIDE_COLUMNS: [usize; 7] = [3, 2, 4, 1, 5, 0, 6];

/// Ranges of a sweep, by ray.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Seen {
    motion: SweepMotion,
    /// Slope of each row's rays (z over horizontal distance), rising.
    slopes: Vec<f32>,
    /// Share of the sweep at which each sector was seen.
    shares: Vec<f32>,
    /// In units of [`UNIT_M`], 0 = no return, by row and column; with [`MOVED`].
    ranges: Vec<u16>,
}

/// Rays around a place that must go on behind it to call it free, of 21.
const MIN_BEYOND: u32 = 9;

/// What a sweep says about a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    /// A ray went through.
    Free,
    /// A ray met something there.
    Filled,
    /// A ray met something there that moved.
    Moved,
    /// No ray came as far, or there was none.
    Hidden,
}

impl Seen {
    /// `moved` are the indices of the points on things that moved, rising.
    pub fn new(sweep: &Sweep, motion: SweepMotion, moved: &[u32]) -> Self {
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
                // NaN, of an empty cell, becomes 0, and what is too far the farthest.
                ranges[row * cols + col] = ((position.norm() * (1.0 / UNIT_M)) as u16).min(MOVED - 1);
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
        for &idx in moved {
            if let Some((row, col)) = image.place(idx as usize) {
                ranges[row * cols + col] |= MOVED;
            }
        }
        fill(&mut shares);
        Self { motion, slopes: slopes(&sums), shares, ranges }
    }

    /// With the poses of its sectors, to be asked.
    pub fn placed(&self) -> PlacedSeen<'_> {
        // f32 holds millimetres within some kilometres only; so places are given from the middle of the sweep.
        let mid = Isometry3::from_parts(Vector3::zeros().into(), self.motion.mid.rotation);
        let near = SweepMotion { mid, ..self.motion };
        let sectors = self.shares.iter().map(|&share| near.at(f64::from(share)).inverse().cast::<f32>()).collect();
        PlacedSeen { seen: self, sectors }
    }
}

/// [`Seen`], with the pose of each sector.
pub(crate) struct PlacedSeen<'a> {
    seen: &'a Seen,
    sectors: Vec<Isometry3<f32>>,
}

impl PlacedSeen<'_> {
    /// What the sweep says about a place in the odom frame.
    pub fn sight(&self, place: &Vector3<f64>) -> Sight {
        let from_mid = Point3::from((place - self.seen.motion.mid.translation.vector).cast::<f32>());
        // The column tells the time, and the time tells the column: the second guess is within 0.1 degrees.
        let cols = self.seen.ranges.len() / self.seen.slopes.len();
        let mut col = cols / 2;
        let mut local = Point3::origin();
        for _ in 0..2 {
            local = self.sectors[col / SECTOR] * from_mid;
            col = RangeImage::column(local.x, local.y);
        }
        let range = local.coords.norm();
        let Some(row) = self.row(local.z / (local.x * local.x + local.y * local.y).sqrt()) else {
            return Sight::Hidden;
        };
        let tolerance = TOLERANCE_M + TOLERANCE_SHARE * range;
        let at = |row: usize, col: usize| self.seen.ranges[row * cols + col % cols];
        // From the middle outwards: what stands is mostly met by the first ray.
        let rows = [Some(row), row.checked_sub(1), (row + 1 < self.seen.slopes.len()).then_some(row + 1)];
        let (mut n_beyond, mut is_blocked) = (0, false);
        for row in rows.into_iter().flatten() {
            for beside in BESIDE_COLUMNS {
                let met = at(row, col + cols + beside - REACH_COLUMNS);
                let reached = f32::from(met & !MOVED) * UNIT_M;
                if (reached - range).abs() < tolerance {
                    return if met & MOVED == 0 { Sight::Filled } else { Sight::Moved };
                }
                n_beyond += u32::from(reached > range);
                is_blocked |= reached > 0.0 && reached < range;
            }
        }
        // Rays that end before and behind the place may be on a surface seen at a flat angle, which the place is on, too.
        if n_beyond >= MIN_BEYOND && !is_blocked { Sight::Free } else { Sight::Hidden }
    }

    /// The row whose rays rise most nearly like this; `None` outside the field of view.
    fn row(&self, slope: f32) -> Option<usize> {
        let slopes = &self.seen.slopes;
        let above = slopes.partition_point(|s| *s < slope);
        let below = above.checked_sub(1)?;
        let is_inside = above < slopes.len();
        is_inside.then(|| if slopes[above] - slope < slope - slopes[below] { above } else { below })
    }
}

/// Mean slope of each row; an empty row takes that of the row below, so that they rise.
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

/// Gaps take the value before them; all of them 0 where there is none.
fn fill(shares: &mut [f32]) {
    let mut last = shares.iter().copied().find(|share| !share.is_nan()).unwrap_or(0.0);
    for share in shares {
        if share.is_nan() {
            *share = last;
        }
        last = *share;
    }
}
