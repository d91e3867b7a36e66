//! The ranges of an earlier sweep: the distance that each of its rays traveled.

mod visibility;

pub(crate) use visibility::{LANES, PlacedRanges, Positions, Visibility};

use crate::{Sweep, SweepMotion};
use serde::{Deserialize, Serialize};

/// Unit of a stored range, m; 15 bits reach 327 m.
const UNIT_M: f32 = 0.01;
/// Flag bit of a stored range: the point is on a moving object.
const DYNAMIC: u16 = 1 << 15;
/// Columns that share one pose: 2.8 degrees, 0.8 ms at 10 Hz, 8 mm at 10 m/s.
const SECTOR: usize = 16;

/// Ranges of a sweep per ray.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PastRanges {
    motion: SweepMotion,
    /// Slope of the rays of each row (z over horizontal distance), ascending.
    slopes: Vec<f32>,
    /// Time of each sector as a share of the sweep.
    shares: Vec<f32>,
    /// Ranges per row and column, in units of [`UNIT_M`], 0 = no return; flagged with [`DYNAMIC`].
    ranges: Vec<u16>,
}

impl PastRanges {
    /// `dynamic` are the indices of the points on moving objects, ascending.
    pub fn new(sweep: &Sweep, motion: SweepMotion, dynamic: &[u32]) -> Self {
        let image = sweep.image();
        let rows = image.rows();
        let cols = image.cols();
        let mut ranges = vec![0; rows * cols];
        let mut slope_sums = vec![SlopeSum::default(); rows];
        wide_loops::run(
            #[inline(always)]
            || {
                for (row, ranges) in ranges.chunks_exact_mut(cols).enumerate() {
                    for (stored, [x, y, z]) in ranges.iter_mut().zip(image.positions_of_row(row)) {
                        // The NaN of an empty cell becomes 0. Ranges that are too large become the largest one.
                        let units = (x * x + y * y + z * z).sqrt() * (1.0 / UNIT_M);
                        *stored = (units as u16).min(DYNAMIC - 1);
                    }
                }
            },
        );
        for (row, sum) in slope_sums.iter_mut().enumerate() {
            for col in (0..cols).step_by(SECTOR).flat_map(|col| [col, col + 1]) {
                let [x, y, z] = image.position(row, col).into();
                if !x.is_nan() {
                    sum.sum += f64::from(z / (x * x + y * y).sqrt());
                    sum.n += 1;
                }
            }
        }
        let duration = f64::from(sweep.duration_nanos().max(1));
        let first_in = |sector: usize| {
            let cols = sector * SECTOR..(sector + 1) * SECTOR;
            (0..rows).find_map(|row| cols.clone().find_map(|col| image.point(row, col)))
        };
        let share_of = |idx: usize| (f64::from(sweep.points()[idx].offset_nanos) / duration - 0.5) as f32;
        let has_times = sweep.duration_nanos() > 0;
        let share_in = |sector| first_in(sector).filter(|_| has_times).map_or(f32::NAN, share_of);
        let mut shares: Vec<f32> = (0..cols / SECTOR).map(share_in).collect();
        for &idx in dynamic {
            if let Some((row, col)) = image.cell(idx as usize) {
                ranges[row * cols + col] |= DYNAMIC;
            }
        }
        fill_gaps(&mut shares);
        Self { motion, slopes: slopes(&slope_sums), shares, ranges }
    }
}

/// Sum of the slopes of the rays of a row.
#[derive(Clone, Copy, Default)]
struct SlopeSum {
    sum: f64,
    n: u32,
}

/// Mean slope of each row. An empty row takes the slope of the row below, so that slopes ascend.
fn slopes(sums: &[SlopeSum]) -> Vec<f32> {
    let mut last = f32::MIN;
    let mean = |row: &SlopeSum| {
        if row.n > 0 {
            last = last.max((row.sum / f64::from(row.n)) as f32);
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
