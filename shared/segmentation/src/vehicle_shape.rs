//! Clusters of vehicle points that no vehicle has the shape of: what drives is higher than a kerb, and a vehicle is seen more than
//! once in the sweeps of a submap.

use geometry::BevGrid;
use messages::{ClassId, ClassRow, SubmapPoint};
use morphology::{Connectivity, connected_components};
use ndarray::Array2;

/// Side of the cells in which clusters are connected, m. Neighboring rings on a car at 20 m are closer.
const CELL_M: f64 = 0.3;
/// Largest number of cells of the top view.
const MAX_CELLS: usize = 1 << 24;
/// Vehicles reach higher above the ground than this, m: the bonnet of a sports car has 0.7. On the data sets of `street_labels`, and on
/// the three `SemanticKITTI` sweeps of a motorway, clusters below are feet of fences and bushes.
const TOP_M: f32 = 0.6;
/// Vehicles have at least this many points in a submap.
const MIN_POINTS: u32 = 10;

/// A cluster of vehicle points.
#[derive(Clone, Copy)]
struct Cluster {
    n_points: u32,
    top_m: f32,
}

/// Indices of the vehicle points that belong to no vehicle. `heights_m` are the heights above the ground; where they are NaN,
/// height excludes nothing.
pub(crate) fn no_vehicles(points: &[SubmapPoint], heights_m: &[f32], classes: &[ClassRow]) -> Vec<usize> {
    let is_vehicle = |row: &ClassRow| row.class_id == ClassId::Vehicles as u8;
    let vehicles: Vec<usize> = (0..points.len()).filter(|point| is_vehicle(&classes[*point])).collect();
    let flat = |point: usize| [f64::from(points[point].x), f64::from(points[point].y)];
    let mut min = [f64::INFINITY; 2];
    let mut max = [f64::NEG_INFINITY; 2];
    for &point in &vehicles {
        for (axis, value) in flat(point).into_iter().enumerate() {
            (min[axis], max[axis]) = (min[axis].min(value), max[axis].max(value));
        }
    }
    let Some(grid) = BevGrid::covering_coarsened(min, max, CELL_M, MAX_CELLS) else { return Vec::new() };
    let cell = |point: usize| grid.cell(flat(point)[0], flat(point)[1]);
    let mut is_occupied = Array2::from_elem((grid.rows, grid.cols), false);
    vehicles.iter().filter_map(|point| cell(*point)).for_each(|cell| is_occupied[cell] = true);
    let components = connected_components(&is_occupied, Connectivity::Eight).image;
    let cluster = |point: usize| cell(point).map(|cell| components[cell] as usize).filter(|label| *label > 0);
    let n_clusters = components.iter().copied().max().unwrap_or(0) as usize;
    let mut clusters = vec![Cluster { n_points: 0, top_m: f32::NEG_INFINITY }; n_clusters + 1];
    for &point in &vehicles {
        let Some(label) = cluster(point) else { continue };
        let Cluster { n_points, top_m } = &mut clusters[label];
        *n_points += 1;
        // An unknown height is above every limit.
        *top_m = top_m.max(if heights_m[point].is_nan() { f32::INFINITY } else { heights_m[point] });
    }
    let is_none = |point: &usize| {
        cluster(*point).is_some_and(|label| clusters[label].n_points < MIN_POINTS || clusters[label].top_m < TOP_M)
    };
    vehicles.into_iter().filter(is_none).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_and_tiny_clusters_are_no_vehicles() {
        let mut points = Vec::new();
        let mut cluster = |x: f32, n: usize, top_m: f32| {
            let point =
                |i: usize| SubmapPoint { x, y: 0.1 * i as f32, z: top_m * i as f32 / n as f32, ..Default::default() };
            points.extend((1..=n).map(point));
        };
        cluster(0.0, 40, 1.5);
        cluster(10.0, 40, 0.5);
        cluster(20.0, 5, 1.5);
        let mut classes = vec![ClassRow { class_id: ClassId::Vehicles as u8, score: 200 }; points.len()];
        let heights_m: Vec<f32> = points.iter().map(|point| point.z).collect();
        assert_eq!(no_vehicles(&points, &heights_m, &classes), (40..85).collect::<Vec<_>>());
        // Without ground, only the number of points counts; points of other classes belong to no cluster.
        let unknown = vec![f32::NAN; points.len()];
        assert_eq!(no_vehicles(&points, &unknown, &classes), (80..85).collect::<Vec<_>>());
        classes[5..40].fill(ClassRow { class_id: ClassId::Building as u8, score: 200 });
        assert_eq!(no_vehicles(&points, &unknown, &classes), (0..5).chain(80..85).collect::<Vec<_>>());
        assert_eq!(no_vehicles(&[], &[], &[]), Vec::<usize>::new());
    }
}
