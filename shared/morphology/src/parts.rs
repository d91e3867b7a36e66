//! Any element, made of parts that are used more than once: a run of `k` pixels of two runs of `k/2`; a line of two lines half as
//! long. Of every part, the extremum over it is kept for as many rows as parts below ask for.

use crate::Level;
use crate::element::Run;
use crate::picks::{Pick, pick_all};
use crate::rows::Source;
use std::collections::BTreeMap;

pub(crate) struct Parts<T> {
    pub(crate) row_reach: usize,
    /// Rows of the element below its origin.
    below: usize,
    rows: usize,
    n_taken: usize,
    neutral: T,
    /// Neutral pixels before a row.
    lead: usize,
    /// The first is a pixel.
    parts: Vec<Part<T>>,
    /// The element; `right` counts in padded rows from the pixel asked for.
    whole: Vec<Place>,
}

/// Pixels of a run that are looked at one by one.
const AT_ONCE: usize = 5;

/// Places as seen from the lowest row and the leftmost column.
struct Part<T> {
    places: Vec<Place>,
    n_cols: usize,
    /// The extrema, in rows padded by neutral pixels; row `i` lies where row `i % span` does.
    kept: Vec<T>,
    span: usize,
}

/// Where a part lies.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    up: usize,
    right: usize,
    part: usize,
}

impl<T: Level> Parts<T> {
    pub(crate) fn new(runs: &[Run], (rows, cols): (usize, usize), neutral: T) -> Self {
        let (n_rows, n_cols) = (rows as isize, cols as isize);
        // A run that no pixel of the image sees is none; one that reaches past both ends sees the whole line.
        let is_seen = |run: &&Run| run.row.abs() < n_rows && run.first < n_cols && run.last > -n_cols;
        let clipped = |run: &Run| Run { row: run.row, first: run.first.max(-n_cols), last: run.last.min(n_cols) };
        let runs: Vec<Run> = runs.iter().filter(is_seen).map(clipped).collect();
        let most = |side: fn(&Run) -> isize| runs.iter().map(side).max().unwrap_or(0).max(0) as usize;
        let (above, below) = (most(|run| -run.row), most(|run| run.row));
        let (lead, trail) = (most(|run| -run.first), most(|run| run.last));

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
            let (up, right) = (below.wrapping_add_signed(-run.row), lead.wrapping_add_signed(run.first));
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

    /// The part that is a run of pixels.
    fn run(&mut self, width: usize) -> usize {
        if width == 1 {
            return 0;
        }
        let is_it = |part: &Part<T>| part.n_cols == width;
        if let Some(known) = self.parts.iter().position(is_it) {
            return known;
        }
        let place = |right, part| Place { up: 0, right, part };
        let places = if width <= AT_ONCE {
            (0..width).map(|right| place(right, 0)).collect()
        } else {
            let half = self.run(width.next_power_of_two() / 2);
            // The two may overlap; an extremum does not mind.
            vec![place(0, half), place(width - self.parts[half].n_cols, half)]
        };
        self.add(places, width)
    }

    /// The same places with fewer parts, if they are twice the same, shifted: `places` are of one part and sorted.
    fn folded(&mut self, places: Vec<Place>) -> Vec<Place> {
        let shifted = |place: &Place, from: &Place, to: &Place| {
            let (up, right) = (place.up + to.up, place.right + to.right);
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
            let (up, right) = (half[0].up, half.iter().map(|place| place.right).min().unwrap_or(0));
            let moved = |place: &Place| Place { up: place.up - up, right: place.right - right, ..*place };
            let places = self.folded(half.iter().map(moved).collect());
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

    /// Takes a row, or one below the image, and what parts make of it.
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

/// The extremum of parts, the lowest of them in this row.
#[inline(always)]
fn gather<T: Level>(into: &mut [T], places: &[Place], parts: &[Part<T>], row: usize, pick: impl Pick<T>) {
    let source = |idx: usize| {
        let Place { up, right, part } = places[idx];
        let Part { kept, span, .. } = &parts[part];
        &kept[(row + span - up) % span * (kept.len() / span) + right..]
    };
    pick_all(into, places.len(), source, pick);
}
