//! Blobs: nearby points of a class within one time slice. A moving object is not smeared within a slice.

use crate::candidates::Candidate;
use crate::sets::{SetNumbers, Sets};
use crate::top_view::TopView;
use messages::{POINT_DYNAMIC, SubmapPoint};

/// Duration of a slice, ns: one revolution of a LiDAR at 10 Hz.
pub(crate) const SLICE_NANOS: i64 = 100_000_000;

/// Slice (16 bits), row and column (24 bits each) of a cell of the size of the links: one number sorts faster than three. A view has
/// less than 2^24 rows and columns.
type CoarseCell = u64;
const ROW: CoarseCell = 1 << 24;
const SLICE: CoarseCell = 1 << 48;
const MAX_SLICE: i64 = 0xffff;

/// Nearby points of one slice.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blob {
    pub(crate) slice: u32,
    /// Mean time of its points, ns since the Unix epoch.
    pub(crate) nanos: i64,
    /// Mean position of its points, m.
    pub(crate) center: [f64; 2],
    pub(crate) n_points: u32,
    /// Number of points that `slam_aggregate` has marked as moving.
    pub(crate) n_marked: u32,
}

/// Blobs in the order of slices.
pub(crate) struct Blobs {
    pub(crate) all: Vec<Blob>,
    /// Blob of each candidate.
    pub(crate) of_candidate: Vec<u32>,
}

impl Blobs {
    /// Points up to about `link_m` apart are one blob.
    pub(crate) fn from_candidates(
        view: &TopView,
        points: &[SubmapPoint],
        candidates: &[Candidate],
        link_m: f64,
    ) -> Self {
        let begin = candidates.iter().map(|candidate| candidate.time).min().unwrap_or_default();
        let width = view.in_cells(link_m).max(1);
        let key = |(idx, candidate): (usize, &Candidate)| {
            let slice = (candidate.time.saturating_sub(begin) / SLICE_NANOS).min(MAX_SLICE) as CoarseCell;
            let [row, col] = [candidate.cell.0, candidate.cell.1].map(|at| (at / width) as CoarseCell);
            CandidateCell { cell: slice * SLICE + row * ROW + col, candidate_idx: idx as u32 }
        };
        let mut keys: Vec<CandidateCell> = candidates.iter().enumerate().map(key).collect();
        keys.sort_unstable();
        let members_by_cell: Vec<&[CandidateCell]> = keys.chunk_by(|a, b| a.cell == b.cell).collect();
        let cells: Vec<CoarseCell> = members_by_cell.iter().map(|members| members[0].cell).collect();
        let SetNumbers { by_member: blob_of_cell, n } = connected(&cells);

        let mut all = vec![Blob::default(); n];
        let mut of_candidate = vec![0; candidates.len()];
        for ((&cell, &members), &number) in cells.iter().zip(&members_by_cell).zip(&blob_of_cell) {
            let blob = &mut all[number as usize];
            blob.slice = (cell / SLICE) as u32;
            for &CandidateCell { candidate_idx: idx, .. } in members {
                let candidate = &candidates[idx as usize];
                let point = &points[candidate.point_idx as usize];
                blob.center[0] += f64::from(point.x);
                blob.center[1] += f64::from(point.y);
                blob.nanos += candidate.time.saturating_sub(begin);
                blob.n_points += 1;
                blob.n_marked += u32::from(point.flags & POINT_DYNAMIC != 0);
                of_candidate[idx as usize] = number;
            }
        }
        for blob in &mut all {
            blob.center = blob.center.map(|sum| sum / f64::from(blob.n_points));
            blob.nanos = begin + blob.nanos / i64::from(blob.n_points);
        }
        Self { all, of_candidate }
    }
}

/// A candidate in its cell; ordered by cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct CandidateCell {
    cell: CoarseCell,
    candidate_idx: u32,
}

/// Number of the blob of each coarse cell: eight-connected cells of one slice. `cells` are sorted.
fn connected(cells: &[CoarseCell]) -> SetNumbers {
    let mut sets = Sets::new(cells.len());
    for (idx, &cell) in cells.iter().enumerate() {
        // The other neighbors are visited from their side.
        for neighbor in [cell + 1, cell + ROW - 1, cell + ROW, cell + ROW + 1] {
            if let Ok(other) = cells.binary_search(&neighbor) {
                sets.union(idx, other);
            }
        }
    }
    sets.numbers()
}
