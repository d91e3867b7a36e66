//! Cells with classes: the training data of networks on points.

use crate::UNKNOWN;
use neighbors::{VoxelGrid, squared_distance};
use segmentation::points::CellCloud;

/// Points with the class number of each, [`UNKNOWN`] for unlabeled points.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassifiedCells {
    /// The points.
    pub cloud: CellCloud,
    /// Class number of each point.
    pub truth: Vec<u8>,
}

impl ClassifiedCells {
    /// The points within a radius of a center, with positions relative to it.
    #[must_use]
    pub fn sphere(&self, center: [f32; 3], radius_m: f32) -> Self {
        let positions = &self.cloud.positions;
        let is_inside = |point: &u32| squared_distance(positions[*point as usize], center) <= radius_m * radius_m;
        let members: Vec<u32> = (0..positions.len() as u32).filter(is_inside).collect();
        Self {
            cloud: self.cloud.around(center, &members),
            truth: members.iter().map(|point| self.truth[*point as usize]).collect(),
        }
    }
    /// The points of a class.
    pub fn points_of(&self, class: u8) -> Vec<usize> {
        (0..self.truth.len()).filter(|point| self.truth[*point] == class).collect()
    }
}

/// The most frequent known class of the points in each cell; ties go to the smallest number. [`UNKNOWN`] if the cell has
/// no known class.
pub fn classes_of_cells(grid: &VoxelGrid, classes: &[u8]) -> Vec<u8> {
    let of_cell = |cell: usize| {
        let mut counts = [0_u32; UNKNOWN as usize];
        for point in grid.points_of(cell) {
            if let Some(count) = counts.get_mut(usize::from(classes[*point as usize])) {
                *count += 1;
            }
        }
        let most = counts.iter().copied().max().filter(|most| *most > 0);
        most.and_then(|most| counts.iter().position(|n| *n == most)).map_or(UNKNOWN, |class| class as u8)
    };
    (0..grid.len()).map(of_cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_has_the_most_frequent_known_class() {
        let at = |x: f32| [x, 0.5, 0.5];
        let positions = [at(0.1), at(0.2), at(0.3), at(1.1), at(1.2), at(2.1)];
        let grid = VoxelGrid::new(&positions, 1.0).expect("a grid");
        assert_eq!(classes_of_cells(&grid, &[4, UNKNOWN, 4, 7, 3, UNKNOWN]), [4, 3, UNKNOWN]);
    }

    #[test]
    fn sphere_has_the_points_within_its_radius_and_their_classes() {
        let cloud = CellCloud {
            positions: vec![[0.0; 3], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            heights_m: vec![0.0; 3],
            ..CellCloud::default()
        };
        let cells = ClassifiedCells { cloud, truth: vec![5, 6, 5] };
        let sphere = cells.sphere([1.0, 0.0, 0.0], 2.0);
        assert_eq!((sphere.cloud.positions, sphere.truth), (vec![[-1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], vec![5, 6]));
        assert_eq!(cells.points_of(5), [0, 2]);
    }
}
