//! Footprints of one class in the top-down view, by morphological operators.

use crate::candidates::Candidate;
use crate::settings::{FootprintSettings, Kind};
use crate::top_view::TopView;
use morphology::{Connectivity, area_closing, connected_components, dilate, h_maxima, watershed};
use ndarray::Array2;
use std::collections::BTreeMap;

/// Width of the ring around a component in which ground is expected, m: beyond the sill of a car, before the next parked car.
const RING_M: f64 = 0.5;

/// Footprints of a class.
pub(crate) struct Footprints {
    pub(crate) candidates: Vec<Candidate>,
    /// Label of the part of each cell, from 1; 0 = none.
    pub(crate) parts: Array2<u32>,
    /// Number of parts.
    pub(crate) n: usize,
    /// For each part: fraction of the observed cells around its component that have ground. `None` if no cell around it was observed, or
    /// the view has no ground.
    pub(crate) ground_around: Vec<Option<f64>>,
}

impl Footprints {
    /// Occupancy, dilation, area closing and components (thesis section 6.5.2). If the class has `peak_m`, components are split into one
    /// part for each peak of the elevation.
    pub(crate) fn from_candidates(
        view: &TopView,
        candidates: Vec<Candidate>,
        kind: &Kind,
        settings: &FootprintSettings,
    ) -> Self {
        let mut occupied = Array2::from_elem(view.seen.dim(), false);
        let mut elevation_m = Array2::from_elem(if kind.peak_m > 0.0 { view.seen.dim() } else { (0, 0) }, EMPTY_M);
        for &Candidate { cell, above_m, .. } in &candidates {
            occupied[cell] = true;
            if let Some(highest_m) = elevation_m.get_mut(cell) {
                *highest_m = above_m.max(*highest_m);
            }
        }
        let grown = dilate(&occupied, view.in_cells(settings.dilation_m));
        // Holes of eight-connected components are four-connected, so filling them never joins two components.
        let closed = area_closing(&grown, settings.hole_cells, Connectivity::Four);
        let components = connected_components(&closed, Connectivity::Eight);
        let shares = ground_shares(&components.image, components.n(), view);
        if kind.peak_m == 0.0 {
            return Self { candidates, n: components.n(), parts: components.image, ground_around: shares };
        }
        let mut parts = split_by_peaks(&elevation_m, &closed, kind.peak_m, view.in_cells(settings.dilation_m));
        undo_sparse_splits(&mut parts, &components.image, &candidates, kind.min_points);
        let mut ground_around = vec![None; parts.iter().max().map_or(0, |&n| n as usize) + 1];
        for (&part, &component) in parts.iter().zip(&components.image) {
            ground_around[part as usize] = shares[component as usize];
        }
        Self { candidates, n: ground_around.len() - 1, parts, ground_around }
    }
}

/// Elevation of cells without a point: deeper than the height of any peak.
const EMPTY_M: f32 = -1000.0;

/// Watershed of the negated elevation. Two roofs are separated along the lowest line between them, if each stands out by at least
/// `peak_m`.
fn split_by_peaks(elevation_m: &Array2<f32>, footprint: &Array2<bool>, peak_m: f64, radius: usize) -> Array2<u32> {
    // Cells between occupied cells get the height of their neighbors.
    let smooth_m = dilate(elevation_m, radius);
    let mut peaks = h_maxima(&smooth_m, peak_m as f32, Connectivity::Eight);
    peaks.zip_mut_with(footprint, |peak, &inside| *peak &= inside);
    let markers = connected_components(&peaks, Connectivity::Eight);
    // Empty cells are flooded last, so each outline is assigned to its roof before the flood crosses a gap.
    watershed(&elevation_m.mapv(|z| -z), &markers.image, footprint, Connectivity::Eight)
}

/// Gives parts with fewer candidates than `min_points` to the largest part of their component: on few points most peaks are gaps between
/// rings.
fn undo_sparse_splits(parts: &mut Array2<u32>, components: &Array2<u32>, candidates: &[Candidate], min_points: usize) {
    let mut n_of_part = vec![0_usize; parts.iter().max().map_or(0, |&n| n as usize) + 1];
    for candidate in candidates {
        n_of_part[parts[candidate.cell] as usize] += 1;
    }
    let mut largest_of_component: BTreeMap<u32, u32> = BTreeMap::new();
    for (&part, &component) in parts.iter().zip(components).filter(|(part, _)| **part != 0) {
        let largest = largest_of_component.entry(component).or_insert(part);
        let size = |part: u32| (n_of_part[part as usize], std::cmp::Reverse(part));
        if size(part) > size(*largest) {
            *largest = part;
        }
    }
    parts.zip_mut_with(components, |part, component| {
        if *part != 0 && n_of_part[*part as usize] < min_points {
            *part = largest_of_component[component];
        }
    });
}

fn ground_shares(components: &Array2<u32>, n: usize, view: &TopView) -> Vec<Option<f64>> {
    let mut n_seen = vec![0_u32; n + 1];
    let mut n_ground = n_seen.clone();
    if view.terrain_m.is_some() {
        // Where two rings overlap, the cell belongs to the later component.
        let around = dilate(components, view.in_cells(RING_M));
        for ((&label, &inside), (&seen, &ground)) in
            around.iter().zip(components).zip(view.seen.iter().zip(&view.ground))
        {
            if label != 0 && inside == 0 && seen {
                n_seen[label as usize] += 1;
                n_ground[label as usize] += u32::from(ground);
            }
        }
    }
    let share = |(&seen, &ground): (&u32, &u32)| (seen > 0).then(|| f64::from(ground) / f64::from(seen));
    n_seen.iter().zip(&n_ground).map(share).collect()
}
