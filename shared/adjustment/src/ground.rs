//! The ground of submaps in cells, for height differences between drives.

use geometry::{Point3, Pose, Vector3};
use georeference::SurfacePoint;
use std::collections::BTreeMap;

/// Ground surfaces within this horizontal distance give a height difference, m.
const CELL_M: f64 = 0.7;
/// Least upward component of the normal of the ground.
const MIN_UPWARDS: f64 = 0.9;
/// Fewer height differences are not used.
const MIN_HEIGHTS: usize = 20;
/// Height differences that are farther from their median are of two things, such as a kerb and the road below it, m.
const SAME_SURFACE_M: f64 = 0.1;

/// The lowest surface of each cell that faces upwards.
pub struct Ground {
    cells: BTreeMap<Cell, Surface>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Cell {
    x: i64,
    y: i64,
}

/// A surface in the survey frame.
#[derive(Clone, Copy)]
struct Surface {
    position: Point3<f64>,
    normal: Vector3<f64>,
}

impl Ground {
    /// The ground of a submap with this pose.
    pub fn new(surfaces: &[SurfacePoint], survey_from_submap: &Pose) -> Self {
        let mut cells: BTreeMap<Cell, Surface> = BTreeMap::new();
        for surface in surfaces {
            let normal = survey_from_submap.rotation * surface.normal;
            if normal.z <= MIN_UPWARDS {
                continue;
            }
            let position = survey_from_submap * surface.position;
            let found = Surface { position, normal };
            let lowest = cells.entry(Cell::at(&position)).or_insert(found);
            if position.z < lowest.position.z {
                *lowest = found;
            }
        }
        Self { cells }
    }

    /// Median height above another ground, m, with at least 20 cells in common.
    pub fn median_above(&self, other: &Self) -> Option<f64> {
        let above = |(cell, surface): (&Cell, &Surface)| Some(self.cells.get(cell)?.position.z - surface.position.z);
        let mut differences: Vec<f64> = other.cells.iter().filter_map(above).collect();
        if differences.len() < MIN_HEIGHTS {
            return None;
        }
        differences.sort_by(f64::total_cmp);
        Some(differences[differences.len() / 2])
    }

    /// Heights above another ground, m: the plane of this one at the surfaces of the other one, where they are the same surface.
    pub fn above(&self, other: &Self) -> Vec<f64> {
        let nearest = |p: &Point3<f64>| {
            let Cell { x, y } = Cell::at(p);
            let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| Cell { x: x + i, y: y + j }));
            let distance = |surface: &&Surface| (surface.position - p).xy().norm();
            let found = around.filter_map(|cell| self.cells.get(&cell));
            found.min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|surface| distance(surface) < CELL_M)
        };
        let above = |surface: &Surface| {
            let plane = nearest(&surface.position)?;
            Some(plane.normal.dot(&(plane.position - surface.position)) / plane.normal.z)
        };
        let mut differences: Vec<f64> = other.cells.values().filter_map(above).collect();
        differences.sort_by(f64::total_cmp);
        let Some(median) = differences.get(differences.len() / 2).copied() else { return differences };
        differences.retain(|up_m| (up_m - median).abs() < SAME_SURFACE_M);
        differences
    }
}

impl Cell {
    fn at(p: &Point3<f64>) -> Self {
        let [x, y] = [p.x, p.y].map(|value| (value / CELL_M).floor() as i64);
        Self { x, y }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Isometry3;

    /// A road with a grade of 5 % and a kerb of 12 cm on one side, seen at places that differ by `off_m`.
    fn road(off_m: f64) -> Vec<SurfacePoint> {
        let normal = Vector3::new(-0.05, 0.0, 1.0).normalize();
        let places = (0..400).map(|k| [f64::from(k % 40) * 0.5 + off_m, f64::from(k / 40) * 0.5]);
        let height = |[x, y]: [f64; 2]| 0.05 * x + if y > 3.0 { 0.12 } else { 0.0 };
        places.map(|[x, y]| SurfacePoint { position: Point3::new(x, y, height([x, y])), normal }).collect()
    }

    #[test]
    fn heights_do_not_depend_on_the_places_of_the_surfaces() {
        let target = Ground::new(&road(0.0), &Isometry3::translation(0.0, 0.0, 0.03));
        let source = Ground::new(&road(0.2), &Isometry3::identity());
        let above = target.above(&source);
        assert!(above.len() > 150, "{}", above.len());
        for up_m in &above {
            assert!((up_m - 0.03).abs() < 1e-9, "{up_m}");
        }
        // Cells of different places on a slope.
        assert!((target.median_above(&source).expect("has cells") - 0.03).abs() < 0.03);
    }
}
