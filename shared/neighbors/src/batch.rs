//! Neighborhoods of many queries, in parallel and in Morton order: consecutive queries read the same blocks.

use crate::index::{Neighbor, SpatialIndex};
use crate::morton::Entry;
use crate::nearest::NearestSearch;
use crate::position::is_valid;
use crate::within::WithinSearch;
use rayon::prelude::*;

/// Queries of a task.
const CHUNK: usize = 1024;

/// The memory of searches of one kind, reused by each query.
pub(crate) trait Search {
    type Found: Copy + Send + Sync;

    /// Appends what a query finds.
    fn append(&mut self, query: [f32; 3], found: &mut Vec<Self::Found>);
}

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
    /// The list of a query. Empty for queries with invalid coordinates.
    pub fn get(&self, query_idx: usize) -> &[T] {
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
    /// Total length of all lists.
    pub fn n_items(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.items.len()).sum()
    }
}

/// Valid queries in Morton order.
struct Rows {
    positions: Vec<[f32; 3]>,
    /// Number of each query.
    query_of: Vec<u32>,
    n_queries: usize,
}

impl Rows {
    /// Row of each query, `u32::MAX` for an invalid query.
    fn row_of(&self) -> Vec<u32> {
        let mut row_of = vec![u32::MAX; self.n_queries];
        for (row, query) in (0..).zip(&self.query_of) {
            row_of[*query as usize] = row;
        }
        row_of
    }
}

impl SpatialIndex {
    /// The k nearest points of each query, nearest first.
    pub fn nearest_of_each(&self, queries: &[[f32; 3]], k: usize) -> Neighborhoods<Neighbor> {
        lists_of_rows(&self.rows(queries), || NearestSearch::new(self, k))
    }
    /// The k nearest points of each point of the cloud: the point itself, or a copy of it, is first.
    pub fn nearest_of_own(&self, k: usize) -> Neighborhoods<Neighbor> {
        lists_of_rows(&self.own_rows(), || NearestSearch::new(self, k))
    }
    /// Numbers of the points within a radius of each query, in Morton order.
    pub fn within_of_each(&self, queries: &[[f32; 3]], radius_m: f32) -> Neighborhoods<u32> {
        lists_of_rows(&self.rows(queries), || WithinSearch::new(self, radius_m))
    }
    /// Numbers of the points within a radius of each point of the cloud, including the point itself, in Morton order.
    pub fn within_of_own(&self, radius_m: f32) -> Neighborhoods<u32> {
        lists_of_rows(&self.own_rows(), || WithinSearch::new(self, radius_m))
    }
    /// Maps each query: `map` receives the number of the query and the numbers of the points within a radius, in Morton
    /// order. No lists are kept, so the memory does not depend on the number of neighbors. `map` runs on all threads of
    /// the current pool in any order; results are in the order of the queries. An invalid query has no points.
    ///
    /// ```
    /// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
    /// let index = neighbors::SpatialIndex::new(&points);
    /// assert_eq!(index.map_within_of_each(&points, 2.0, |_, found| found.len()), [2, 2, 1]);
    /// ```
    pub fn map_within_of_each<R: Send>(
        &self,
        queries: &[[f32; 3]],
        radius_m: f32,
        map: impl Fn(usize, &[u32]) -> R + Sync,
    ) -> Vec<R> {
        map_rows(&self.rows(queries), || WithinSearch::new(self, radius_m), map)
    }
    /// [`Self::map_within_of_each`] for each point of the cloud, which is within the radius itself.
    pub fn map_within_of_own<R: Send>(&self, radius_m: f32, map: impl Fn(usize, &[u32]) -> R + Sync) -> Vec<R> {
        map_rows(&self.own_rows(), || WithinSearch::new(self, radius_m), map)
    }
    /// Maps each query: `map` receives the number of the query and its k nearest neighbors, nearest first. The order of calls is the
    /// same as in [`Self::map_within_of_each`], and no lists are kept. An invalid query has no neighbors.
    ///
    /// ```
    /// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
    /// let index = neighbors::SpatialIndex::new(&points);
    /// assert_eq!(index.map_nearest_of_each(&points, 2, |_, found| found[1].index), [1, 0, 1]);
    /// ```
    pub fn map_nearest_of_each<R: Send>(
        &self,
        queries: &[[f32; 3]],
        k: usize,
        map: impl Fn(usize, &[Neighbor]) -> R + Sync,
    ) -> Vec<R> {
        map_rows(&self.rows(queries), || NearestSearch::new(self, k), map)
    }

    fn rows(&self, queries: &[[f32; 3]]) -> Rows {
        assert!(queries.len() < 1 << 31, "{} queries: query numbers have 31 bits", queries.len());
        let valid = queries.par_iter().with_min_len(1 << 14).enumerate().filter(|(_, p)| is_valid(**p));
        let mut entries: Vec<Entry> =
            valid.map(|(query_idx, p)| Entry { code: self.grid.code(*p), point: query_idx as u32 }).collect();
        entries.par_sort_unstable();
        Rows {
            positions: entries.iter().map(|entry| queries[entry.point as usize]).collect(),
            query_of: entries.iter().map(|entry| entry.point).collect(),
            n_queries: queries.len(),
        }
    }
    fn own_rows(&self) -> Rows {
        Rows { positions: self.positions().collect(), query_of: self.order().to_vec(), n_queries: self.n_cloud() }
    }
}

fn lists_of_rows<S: Search>(rows: &Rows, new_search: impl Fn() -> S + Sync) -> Neighborhoods<S::Found> {
    let lists_of = |queries: &[[f32; 3]]| {
        let mut search = new_search();
        let mut items = Vec::new();
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
    Neighborhoods { chunks: rows.positions.par_chunks(CHUNK).map(lists_of).collect(), row_of: rows.row_of() }
}

fn map_rows<S: Search, R: Send>(
    rows: &Rows,
    new_search: impl Fn() -> S + Sync,
    map: impl Fn(usize, &[S::Found]) -> R + Sync,
) -> Vec<R> {
    let results_of = |(queries, numbers): (&[[f32; 3]], &[u32])| {
        let mut search = new_search();
        let mut found = Vec::new();
        let mut results = Vec::with_capacity(queries.len());
        wide_loops::run(
            #[inline(always)]
            || {
                for (query, number) in queries.iter().zip(numbers) {
                    found.clear();
                    search.append(*query, &mut found);
                    results.push(map(*number as usize, &found));
                }
            },
        );
        results
    };
    let chunks = rows.positions.par_chunks(CHUNK).zip(rows.query_of.par_chunks(CHUNK));
    let in_rows: Vec<Vec<R>> = chunks.map(results_of).collect();
    let mut in_order: Vec<Option<R>> = (0..rows.n_queries).map(|_| None).collect();
    for (query, result) in rows.query_of.iter().zip(in_rows.into_iter().flatten()) {
        in_order[*query as usize] = Some(result);
    }
    let results = in_order.into_iter().enumerate();
    results.map(|(query, result)| result.unwrap_or_else(|| map(query, &[]))).collect()
}
