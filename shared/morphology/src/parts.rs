//! Elements of any shape, decomposed into parts that are used several times: a run of `k` pixels is two runs of `k/2`, a line is two
//! lines of half its length. The extremum over each part is kept for as many rows as later parts need.

use crate::element::Run;
use crate::level::Level;
use crate::picks::{Pick, pick_all};
use crate::source::Source;
use std::collections::BTreeMap;

pub(crate) struct Parts<T> {
    pub(crate) row_reach: usize,
    /// Number of rows of the element below its origin.
    below: usize,
    rows: usize,
    n_taken: usize,
    neutral: T,
    /// Number of neutral pixels before a row.
    lead: usize,
    /// Parts. The first is a single pixel.
    parts: Vec<Part<T>>,
    /// The whole element. `right` is the column offset in padded rows.
    whole: Vec<Place>,
}

/// Longest run that is not decomposed, pixels.
const MAX_PLAIN_RUN: usize = 5;

/// A part. Its places are relative to its lowest row and leftmost column.
struct Part<T> {
    places: Vec<Place>,
    n_cols: usize,
    /// Extrema in rows padded by neutral pixels. Row `i` is stored at row `i % span`.
    kept: Vec<T>,
    span: usize,
}

/// Position of a part.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    up: usize,
    right: usize,
    part: usize,
}

impl<T: Level> Parts<T> {
    pub(crate) fn new(runs: &[Run], (rows, cols): (usize, usize), neutral: T) -> Self {
        let n_rows = rows as isize;
        let n_cols = cols as isize;
        // Runs that lie outside the image for every pixel are removed; long runs are clipped to the width of the image.
        let is_seen = |run: &&Run| run.row.abs() < n_rows && run.first < n_cols && run.last > -n_cols;
        let clipped = |run: &Run| Run { row: run.row, first: run.first.max(-n_cols), last: run.last.min(n_cols) };
        let runs: Vec<Run> = runs.iter().filter(is_seen).map(clipped).collect();
        let most = |side: fn(&Run) -> isize| runs.iter().map(side).max().unwrap_or(0).max(0) as usize;
        let above = most(|run| -run.row);
        let below = most(|run| run.row);
        let lead = most(|run| -run.first);
        let trail = most(|run| run.last);

        let mut parts = Self {
            row_reach: above.max(below),
            below,
            rows,
            n_taken: 0,
            neutral,
            lead,
            parts: Vec::new(),
            whole: Vec::new(),
        };
        parts.add(Vec::new(), 1);
        let mut of_part: BTreeMap<usize, Vec<Place>> = BTreeMap::new();
        for run in &runs {
            let up = below.wrapping_add_signed(-run.row);
            let right = lead.wrapping_add_signed(run.first);
            let part = parts.run((run.last - run.first + 1) as usize);
            of_part.entry(part).or_default().push(Place { up, right, part });
        }
        for mut places in of_part.into_values() {
            places.sort_unstable();
            let whole = parts.folded(places);
            parts.whole.extend(whole);
        }
        let padded = lead + cols + trail;
        let seen: Vec<Place> = parts.parts.iter().flat_map(|part| &part.places).chain(&parts.whole).copied().collect();
        for place in seen {
            let part = &mut parts.parts[place.part];
            part.span = part.span.max(place.up + 1);
        }
        for part in &mut parts.parts {
            part.kept = vec![neutral; part.span * padded];
        }
        parts
    }

    fn add(&mut self, places: Vec<Place>, n_cols: usize) -> usize {
        self.parts.push(Part { places, n_cols, kept: Vec::new(), span: 1 });
        self.parts.len() - 1
    }

    /// Index of the part that is a run of pixels.
    fn run(&mut self, width: usize) -> usize {
        if width == 1 {
            return 0;
        }
        let is_it = |part: &Part<T>| part.n_cols == width;
        if let Some(known) = self.parts.iter().position(is_it) {
            return known;
        }
        let place = |right, part| Place { up: 0, right, part };
        let places = if width <= MAX_PLAIN_RUN {
            (0..width).map(|right| place(right, 0)).collect()
        } else {
            let half = self.run(width.next_power_of_two() / 2);
            // The two halves may overlap, which does not change the extremum.
            vec![place(0, half), place(width - self.parts[half].n_cols, half)]
        };
        self.add(places, width)
    }

    /// Decomposes places into a set and its shifted copy, if possible. `places` are sorted and belong to one part.
    fn folded(&mut self, places: Vec<Place>) -> Vec<Place> {
        let shifted = |place: &Place, from: &Place, to: &Place| {
            let up = place.up + to.up;
            let right = place.right + to.right;
            Some(Place { up: up.checked_sub(from.up)?, right: right.checked_sub(from.right)?, part: place.part })
        };
        let holds = |place: Option<Place>| place.is_some_and(|place| places.binary_search(&place).is_ok());
        let origin = places[0];
        for by in places[..=places.len() / 2].iter().rev() {
            let twice = |place: &Place| holds(shifted(place, &origin, by));
            let once = |place: &Place| holds(shifted(place, by, &origin));
            if !places.iter().all(|place| twice(place) || once(place)) {
                continue;
            }
            let half: Vec<Place> = places.iter().filter(|place| twice(place)).copied().collect();
            if half.len() + 2 >= places.len() {
                break;
            }
            let up = half[0].up;
            let right = half.iter().map(|place| place.right).min().unwrap_or(0);
            let moved = |place: &Place| Place { up: place.up - up, right: place.right - right, ..*place };
            let places = self.folded(half.iter().map(moved).collect());
            if places.len() == 2 {
                // Reading four places takes less time than writing two and reading them twice.
                let back = |place: &Place| Place { up: place.up + up, right: place.right + right, ..*place };
                let once: Vec<Place> = places.iter().map(back).collect();
                let again = once.iter().filter_map(|place| shifted(place, &origin, by));
                return again.chain(once.iter().copied()).collect();
            }
            let ends = places.iter().map(|place| place.right + self.parts[place.part].n_cols);
            let n_cols = ends.max().unwrap_or(0);
            let place = Place { up, right, part: self.add(places, n_cols) };
            return [Some(place), shifted(&place, &origin, by)].into_iter().flatten().collect();
        }
        places
    }

    #[inline(always)]
    pub(crate) fn pair(&mut self, first: usize, source: Source<'_, T>, into: [&mut [T]; 2], pick: impl Pick<T>) {
        for (row, into) in (first..).zip(into) {
            while self.n_taken <= row + self.below {
                self.take(source, into.len(), pick);
            }
            if self.whole.is_empty() {
                into.fill(self.neutral);
            } else {
                gather(into, &self.whole, &self.parts, row + self.below, pick);
            }
        }
    }

    /// Adds a row, or a neutral row below the image, and computes it for all parts.
    #[inline(always)]
    fn take(&mut self, source: Source<'_, T>, cols: usize, pick: impl Pick<T>) {
        for idx in 0..self.parts.len() {
            let (before, part) = self.parts.split_at_mut(idx);
            let Part { places, n_cols, kept, span } = &mut part[0];
            let padded = kept.len() / *span;
            let line = &mut kept[self.n_taken % *span * padded..][..padded];
            if idx > 0 {
                gather(&mut line[..=padded - *n_cols], places, before, self.n_taken, pick);
            } else if self.n_taken < self.rows {
                line[self.lead..self.lead + cols].copy_from_slice(source.row(self.n_taken));
            } else {
                line.fill(self.neutral);
            }
        }
        self.n_taken += 1;
    }
}

/// Extremum of parts whose lowest row is `row`.
#[inline(always)]
fn gather<T: Level>(into: &mut [T], places: &[Place], parts: &[Part<T>], row: usize, pick: impl Pick<T>) {
    let source = |idx: usize| {
        let Place { up, right, part } = places[idx];
        let Part { kept, span, .. } = &parts[part];
        &kept[(row + span - up) % span * (kept.len() / span) + right..]
    };
    pick_all(into, places.len(), source, pick);
}
