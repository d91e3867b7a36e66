//! Things of one class: cells joined by dilation, closed by area, sorted out by points and surroundings.

use crate::settings::{Settings, Thing};
use crate::top_view::{TopView, cell_of};
use messages::{ClassRow, SubmapPoint};
use morphology::{Connectivity, Labels, area_closing, connected_components, dilate};
use ndarray::Array2;

/// Width of the ring around a thing in which ground is looked for, m: past the sill of a car, before the next parked one.
const RING_M: f64 = 0.5;

/// Points of the things that were found.
pub(crate) struct Objects {
    /// Index of each point that belongs to a thing, and the thing's number from 0 in raster order.
    pub(crate) members: Vec<(usize, u32)>,
    /// How many things.
    pub(crate) n: u32,
    /// Components that had points enough but no ground around them.
    pub(crate) n_afloat: u32,
}

/// All things of one class in the view.
pub(crate) fn find(
    view: &TopView,
    points: &[SubmapPoint],
    classes: &[ClassRow],
    thing: Thing,
    settings: &Settings,
) -> Objects {
    let mut occupied = Array2::from_elem(view.seen.dim(), false);
    let mut candidates: Vec<(usize, (usize, usize))> = Vec::new();
    for (point_idx, (point, row)) in points.iter().zip(classes).enumerate() {
        if row.class_id != thing.class as u8 {
            continue;
        }
        let cell = cell_of(&view.grid, point).filter(|&cell| view.is_below(point, cell, thing.max_height_m));
        if let Some(cell) = cell {
            occupied[cell] = true;
            candidates.push((point_idx, cell));
        }
    }
    let components = footprints(&occupied, view, settings);

    let mut n_points = vec![0_usize; components.n() + 1];
    for &(_, cell) in &candidates {
        n_points[components.image[cell] as usize] += 1;
    }
    let shares = ground_shares(&components, view);
    let mut objects = Objects { members: Vec::new(), n: 0, n_afloat: 0 };
    let mut numbers: Vec<Option<u32>> = vec![None; components.n() + 1];
    for label in 1..=components.n() {
        if n_points[label] < thing.min_points {
            continue;
        }
        if shares[label].is_some_and(|share| share < settings.min_ground_around) {
            objects.n_afloat += 1;
            continue;
        }
        numbers[label] = Some(objects.n);
        objects.n += 1;
    }
    let number = |cell: (usize, usize)| numbers[components.image[cell] as usize];
    objects.members.extend(candidates.iter().filter_map(|&(point_idx, cell)| Some((point_idx, number(cell)?))));
    objects
}

/// Components of the occupied cells after dilation, their small holes filled.
fn footprints(occupied: &Array2<bool>, view: &TopView, settings: &Settings) -> Labels {
    let grown = dilate(occupied, in_cells(settings.dilation_m, view));
    // A hole between eight-connected cells is four-connected, so it never joins two components.
    let closed = area_closing(&grown, settings.hole_cells as usize, Connectivity::Four);
    connected_components(&closed, Connectivity::Eight)
}

/// By label: share of the cells with points around the component that have ground. `None` where nothing was seen around
/// it, or the view has no ground at all.
fn ground_shares(components: &Labels, view: &TopView) -> Vec<Option<f64>> {
    let mut n_seen = vec![0_u32; components.n() + 1];
    let mut n_ground = n_seen.clone();
    if view.terrain_m.is_some() {
        // Where two rings cross, the later component has the cell.
        let around = dilate(&components.image, in_cells(RING_M, view));
        for ((cell, &label), &inside) in around.indexed_iter().zip(&components.image) {
            if label != 0 && inside == 0 && view.seen[cell] {
                n_seen[label as usize] += 1;
                n_ground[label as usize] += u32::from(view.ground[cell]);
            }
        }
    }
    let share = |(&seen, &ground): (&u32, &u32)| (seen > 0).then(|| f64::from(ground) / f64::from(seen));
    n_seen.iter().zip(&n_ground).map(share).collect()
}

fn in_cells(length_m: f64, view: &TopView) -> usize {
    (length_m / view.grid.cell_m).round() as usize
}
