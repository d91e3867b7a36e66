//! Neighborhoods of many queries, in parallel and in Morton order: queries that follow each other read the same blocks.

use crate::index::{Neighbor, SpatialIndex};
use crate::morton::Entry;
use crate::nearest::NearestSearch;
use crate::position::is_valid;
use crate::within::append_within;
use rayon::prelude::*;

/// Queries of a task.
const CHUNK: usize = 1024;

/// A list for each of many queries.
#[derive(Clone, Debug)]
pub struct Neighborhoods<T> {
    /// Row of each query.
    row_of: Vec<u32>,
    chunks: Vec<Chunk<T>>,
}

/// The lists of [`CHUNK`] rows.
#[derive(Clone, Debug)]
struct Chunk<T> {
    /// End of each row in `items`.
    ends: Vec<usize>,
    items: Vec<T>,
}

impl<T> Neighborhoods<T> {
    /// Number of queries.
    pub fn len(&self) -> usize {
        self.row_of.len()
    }
    /// Whether there are no queries.
    pub fn is_empty(&self) -> bool {
        self.row_of.is_empty()
    }
    /// The list of a query. Empty for queries with coordinates that are not valid.
    pub fn of(&self, query_idx: usize) -> &[T] {
        let row = self.row_of[query_idx] as usize;
        let Some(chunk) = self.chunks.get(row / CHUNK) else { return &[] };
        let row = row % CHUNK;
        let start = if row == 0 { 0 } else { chunk.ends[row - 1] };
        &chunk.items[start..chunk.ends[row]]
    }
    /// Changes every item.
    pub(crate) fn for_each_item(&mut self, mut change: impl FnMut(&mut T)) {
        for chunk in &mut self.chunks {
            chunk.items.iter_mut().for_each(&mut change);
        }
    }
    /// Lengths of all lists together.
    pub fn n_items(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.items.len()).sum()
    }
}

/// Queries in the order of their rows.
struct Rows {
    positions: Vec<[f32; 3]>,
    row_of: Vec<u32>,
}

impl SpatialIndex {
    /// The k nearest points of each query, nearest first.
    pub fn nearest_of_each(&self, queries: &[[f32; 3]], k: usize) -> Neighborhoods<Neighbor> {
        self.nearest_of_rows(self.rows(queries), k)
    }
    /// The k nearest points of each point of the cloud: itself, or a copy of it, is first.
    pub fn nearest_of_own(&self, k: usize) -> Neighborhoods<Neighbor> {
        self.nearest_of_rows(self.own_rows(), k)
    }
    /// Numbers of the points within a radius of each query, in Morton order.
    pub fn within_of_each(&self, queries: &[[f32; 3]], radius_m: f32) -> Neighborhoods<u32> {
        self.within_of_rows(self.rows(queries), radius_m)
    }
    /// Numbers of the points within a radius of each point of the cloud, with itself, in Morton order.
    pub fn within_of_own(&self, radius_m: f32) -> Neighborhoods<u32> {
        self.within_of_rows(self.own_rows(), radius_m)
    }

    fn rows(&self, queries: &[[f32; 3]]) -> Rows {
        assert!(queries.len() < 1 << 31, "{} queries: query numbers have 31 bits", queries.len());
        let valid = queries.par_iter().with_min_len(1 << 14).enumerate().filter(|(_, p)| is_valid(**p));
        let mut entries: Vec<Entry> =
            valid.map(|(query_idx, p)| Entry { code: self.grid.code(*p), point: query_idx as u32 }).collect();
        entries.par_sort_unstable();
        let mut row_of = vec![u32::MAX; queries.len()];
        for (row, entry) in entries.iter().enumerate() {
            row_of[entry.point as usize] = row as u32;
        }
        Rows { positions: entries.iter().map(|entry| queries[entry.point as usize]).collect(), row_of }
    }
    fn own_rows(&self) -> Rows {
        let mut row_of = vec![u32::MAX; self.n_cloud()];
        for (row, point) in self.order().iter().enumerate() {
            row_of[*point as usize] = row as u32;
        }
        Rows { positions: self.positions().collect(), row_of }
    }
    fn nearest_of_rows(&self, rows: Rows, k: usize) -> Neighborhoods<Neighbor> {
        let lists_of = |queries: &[[f32; 3]]| {
            let mut search = NearestSearch::new(self, k);
            let mut items = Vec::with_capacity(queries.len() * search.k());
            let mut ends = Vec::with_capacity(queries.len());
            wide_loops::run(
                #[inline(always)]
                || {
                    for query in queries {
                        search.append(*query, &mut items);
                        ends.push(items.len());
                    }
                },
            );
            Chunk { ends, items }
        };
        Neighborhoods { chunks: rows.positions.par_chunks(CHUNK).map(lists_of).collect(), row_of: rows.row_of }
    }
    fn within_of_rows(&self, rows: Rows, radius_m: f32) -> Neighborhoods<u32> {
        let lists_of = |queries: &[[f32; 3]]| {
            let (mut items, mut ends) = (Vec::new(), Vec::with_capacity(queries.len()));
            let mut stack = Vec::with_capacity(64);
            wide_loops::run(
                #[inline(always)]
                || {
                    for query in queries {
                        append_within(self, *query, radius_m, &mut stack, &mut items);
                        ends.push(items.len());
                    }
                },
            );
            Chunk { ends, items }
        };
        Neighborhoods { chunks: rows.positions.par_chunks(CHUNK).map(lists_of).collect(), row_of: rows.row_of }
    }
}
