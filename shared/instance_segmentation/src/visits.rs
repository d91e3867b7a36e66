//! Separates objects that occupied the same cells at different times: a passing car covers the same cells as a parked car, but not
//! all at the same time.
//!
//! A *visit* is an interval in which a cell has points without a gap of `apart_s`. Visits of neighboring cells are
//! connected if no such gap lies between them. A *group* is a connected set of visits. A parked object that was
//! occluded for a while has several groups at one position, which are joined. A lane with several passing objects also
//! has several groups, which are not joined because they are *moving*: the first and the last footprint of a moving
//! group are at different positions.

use crate::candidates::Candidate;
use crate::footprint::{Footprint, overlap};
use crate::footprints::Footprints;
use crate::sets::{SetNumbers, Sets};
use crate::top_view::Cell;
use ndarray::Array2;
use std::collections::BTreeMap;

/// Duration of the first and of the last footprint of a group, ns: five sweeps, so that missing rings have no effect.
pub(crate) const END_WINDOW_NANOS: i64 = 500_000_000;

/// A group moves if its first and its last footprint overlap by less than this fraction of the smaller one.
const SAME_PLACE: f64 = 0.2;

/// Groups of a static object overlap by at least this fraction of the smaller one.
const SAME_OBJECT: f64 = 0.5;

const NONE: u32 = u32::MAX;

/// An interval in which a cell has points.
pub(crate) struct Visit {
    pub(crate) cell: Cell,
    pub(crate) begin: i64,
    pub(crate) end: i64,
    /// Previous visit of the same cell.
    before: u32,
}

/// All visits of a class.
pub(crate) struct Visits {
    pub(crate) all: Vec<Visit>,
    /// Visit of each candidate.
    pub(crate) of_candidate: Vec<u32>,
    /// Latest visit of each cell.
    latest: Array2<u32>,
}

impl Visits {
    /// Candidates are sorted by time except within a sweep.
    pub(crate) fn from_footprints(footprints: &Footprints, apart_nanos: i64) -> Self {
        let mut latest = Array2::from_elem(footprints.parts.dim(), NONE);
        let mut all: Vec<Visit> = Vec::new();
        let mut of_candidate: Vec<u32> = Vec::with_capacity(footprints.candidates.len());
        for &Candidate { cell, time, .. } in &footprints.candidates {
            let latest = &mut latest[cell];
            match all.get_mut(*latest as usize) {
                Some(visit) if time.saturating_sub(visit.end) <= apart_nanos => {
                    visit.begin = visit.begin.min(time);
                    visit.end = visit.end.max(time);
                }
                _ => {
                    let before = std::mem::replace(latest, all.len() as u32);
                    all.push(Visit { cell, begin: time, end: time, before });
                }
            }
            of_candidate.push(*latest);
        }
        Self { all, of_candidate, latest }
    }

    /// Groups of the visits. Cells up to `reach` cells apart are neighbors.
    pub(crate) fn groups(&self, footprints: &Footprints, apart_nanos: i64, reach: usize) -> SetNumbers {
        let mut sets = Sets::new(self.all.len());
        link_neighbors(&self.all, &self.latest, &footprints.parts, apart_nanos, reach, &mut sets);
        let mut groups = sets.numbers();
        groups.n = join_standing(&self.all, &mut groups.by_member, groups.n, footprints);
        groups
    }
}

fn link_neighbors(
    visits: &[Visit],
    latest: &Array2<u32>,
    parts: &Array2<u32>,
    apart_nanos: i64,
    reach: usize,
    sets: &mut Sets,
) {
    for (idx, visit) in visits.iter().enumerate() {
        let (row, col) = visit.cell;
        let part = parts[visit.cell];
        let mut first = sets.find(idx);
        // Only half of the neighbors: the other half is visited from their side.
        for other_row in row..=(row + reach).min(latest.nrows() - 1) {
            let begin = if other_row == row { col + 1 } else { col.saturating_sub(reach) };
            for other_col in begin..=(col + reach).min(latest.ncols() - 1) {
                let mut other = latest[(other_row, other_col)];
                if other == NONE || parts[(other_row, other_col)] != part {
                    continue;
                }
                while other != NONE {
                    let visit_there = &visits[other as usize];
                    let pause = (visit_there.begin - visit.end).max(visit.begin - visit_there.end);
                    // Most neighbors are in the set already.
                    if pause <= apart_nanos && sets.parents[other as usize] as usize != first {
                        first = sets.union_firsts(first, other as usize);
                    }
                    other = visit_there.before;
                }
            }
        }
    }
}

/// Joins static groups of one part that are at the same position. Returns the number of remaining groups.
fn join_standing(visits: &[Visit], group_of_visit: &mut [u32], n: usize, footprints: &Footprints) -> usize {
    let mut begins = vec![i64::MAX; n];
    let mut ends = vec![i64::MIN; n];
    for (visit, &group) in visits.iter().zip(&*group_of_visit) {
        let begin = &mut begins[group as usize];
        *begin = visit.begin.min(*begin);
        let end = &mut ends[group as usize];
        *end = visit.end.max(*end);
    }
    let mut cells: Vec<Footprint<Cell>> = vec![Footprint::default(); n];
    for (visit, &group) in visits.iter().zip(&*group_of_visit) {
        let of_group = &mut cells[group as usize];
        of_group.all.push(visit.cell);
        if visit.begin <= begins[group as usize] + END_WINDOW_NANOS {
            of_group.at_first.push(visit.cell);
        }
        if visit.end >= ends[group as usize] - END_WINDOW_NANOS {
            of_group.at_last.push(visit.cell);
        }
    }
    cells.iter_mut().for_each(Footprint::sort);
    let is_moving: Vec<bool> = cells.iter().map(|of_group| of_group.overlap_of_ends() < SAME_PLACE).collect();

    let mut by_part: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (group, of_group) in cells.iter().enumerate().filter(|(group, _)| !is_moving[*group]) {
        by_part.entry(footprints.parts[of_group.all[0]]).or_default().push(group);
    }
    let mut sets = Sets::new(n);
    for groups in by_part.values() {
        for (i, &a) in groups.iter().enumerate() {
            for &b in &groups[i + 1..] {
                if overlap(&cells[a].all, &cells[b].all) >= SAME_OBJECT {
                    sets.union(a, b);
                }
            }
        }
    }
    let SetNumbers { by_member: numbers, n } = sets.numbers();
    for group in group_of_visit {
        *group = numbers[*group as usize];
    }
    n
}
