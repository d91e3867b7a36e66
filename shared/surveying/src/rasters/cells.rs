//! The cells of one tile.

use messages::{ClassId, GROUND_CLASSES};
use std::collections::BTreeMap;

/// Cells along one side of a tile.
pub(super) const TILE: usize = 256;
const N_CELLS: usize = TILE * TILE;

/// Value of a height without points, m.
pub(super) const NO_HEIGHT: f32 = -9999.0;
/// Value of a class without points.
pub(super) const NO_CLASS: u8 = 255;

/// Values of the cells, rows from north to south.
pub(super) struct Cells {
    /// Highest point, m.
    pub(super) height: Vec<f32>,
    /// Mean of the ground points, m.
    pub(super) terrain: Vec<f32>,
    /// Largest difference between the drives of a survey in the mean of the ground points, m.
    pub(super) difference: Vec<f32>,
    /// Class of the highest point.
    pub(super) class: Vec<u8>,
    /// sRGB of the highest point with a color; the fourth channel is 255, or 0 without such a point.
    pub(super) color: Vec<[u8; 4]>,
}

/// Collects the points of a tile at full resolution.
pub(super) struct CellsBuilder {
    /// Height in mm and class of the highest point.
    highest: Vec<(i32, u8)>,
    colored: Vec<(i32, [u8; 4])>,
    /// Sum of heights, mm, and number of ground points.
    ground: Vec<(i64, u32)>,
    /// Sum of heights, mm, and number of ground points by cell and source, for surveys.
    ground_by_source: BTreeMap<(usize, u16), (i64, u32)>,
    is_ground: [bool; 256],
}

impl Cells {
    pub(super) fn builder() -> CellsBuilder {
        CellsBuilder {
            highest: vec![(i32::MIN, NO_CLASS); N_CELLS],
            colored: vec![(i32::MIN, [0; 4]); N_CELLS],
            ground: vec![(0, 0); N_CELLS],
            ground_by_source: BTreeMap::new(),
            is_ground: std::array::from_fn(|id| {
                ClassId::from_id(id as u8).is_some_and(|class| GROUND_CLASSES.contains(&class))
            }),
        }
    }

    /// Cells of twice the side, from the tiles at the upper left, upper right, lower left and lower right.
    pub(super) fn joined(quarters: &[Option<Cells>]) -> Self {
        let mut joined = Self {
            height: vec![NO_HEIGHT; N_CELLS],
            terrain: vec![NO_HEIGHT; N_CELLS],
            difference: vec![NO_HEIGHT; N_CELLS],
            class: vec![NO_CLASS; N_CELLS],
            color: vec![[0; 4]; N_CELLS],
        };
        let half = TILE / 2;
        for (number, quarter) in quarters.iter().enumerate() {
            let Some(quarter) = quarter else { continue };
            let left = number % 2 * half;
            let top = number / 2 * half;
            for (row, column) in (0..half).flat_map(|row| (0..half).map(move |column| (row, column))) {
                let first = 2 * row * TILE + 2 * column;
                let four = [first, first + 1, first + TILE, first + TILE + 1];
                let idx = (top + row) * TILE + left + column;
                joined.height[idx] = mean(four.map(|k| quarter.height[k]));
                joined.terrain[idx] = mean(four.map(|k| quarter.terrain[k]));
                joined.difference[idx] = mean(four.map(|k| quarter.difference[k]));
                joined.class[idx] = most_frequent(four.map(|k| quarter.class[k]));
                joined.color[idx] = mean_color(four.map(|k| quarter.color[k]));
            }
        }
        joined
    }
}

impl CellsBuilder {
    /// Adds a point at height `z_mm`.
    #[inline]
    pub(super) fn add(&mut self, idx: usize, z_mm: i32, class: u8, rgb: Option<[u8; 3]>) {
        if z_mm > self.highest[idx].0 || self.highest[idx].1 == NO_CLASS {
            self.highest[idx] = (z_mm, class);
        }
        if let Some([r, g, b]) = rgb
            && (z_mm > self.colored[idx].0 || self.colored[idx].1[3] == 0)
        {
            self.colored[idx] = (z_mm, [r, g, b, 255]);
        }
        if self.is_ground[usize::from(class)] {
            let (sum, n) = self.ground[idx];
            self.ground[idx] = (sum + i64::from(z_mm), n + 1);
        }
    }

    /// Adds a ground point of a drive of a survey to the differences between drives.
    pub(super) fn add_to_difference(&mut self, idx: usize, z_mm: i32, class: u8, source: u16) {
        if self.is_ground[usize::from(class)] {
            let (sum, n) = self.ground_by_source.entry((idx, source)).or_default();
            *sum += i64::from(z_mm);
            *n += 1;
        }
    }

    /// Differences between the drives.
    fn difference(&self) -> Vec<f32> {
        let mut difference = vec![NO_HEIGHT; N_CELLS];
        let cells: Vec<(usize, f64)> =
            self.ground_by_source.iter().map(|((idx, _), (sum, n))| (*idx, *sum as f64 / f64::from(*n))).collect();
        for cell in cells.chunk_by(|a, b| a.0 == b.0).filter(|cell| cell.len() > 1) {
            let heights = || cell.iter().map(|(_, height)| *height);
            let range = heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min);
            difference[cell[0].0] = (range / 1000.0) as f32;
        }
        difference
    }

    pub(super) fn finish(self) -> Cells {
        let metres = |mm: f64| (mm / 1000.0) as f32;
        Cells {
            difference: self.difference(),
            height: self
                .highest
                .iter()
                .map(|(z, class)| if *class == NO_CLASS { NO_HEIGHT } else { metres(f64::from(*z)) })
                .collect(),
            terrain: self
                .ground
                .iter()
                .map(|(sum, n)| if *n == 0 { NO_HEIGHT } else { metres(*sum as f64 / f64::from(*n)) })
                .collect(),
            class: self.highest.into_iter().map(|(_, class)| class).collect(),
            color: self.colored.into_iter().map(|(_, color)| color).collect(),
        }
    }
}

fn mean(values: [f32; 4]) -> f32 {
    let known = values.into_iter().filter(|value| *value != NO_HEIGHT);
    let (sum, n) = known.fold((0.0_f64, 0), |(sum, n), value| (sum + f64::from(value), n + 1));
    if n == 0 { NO_HEIGHT } else { (sum / f64::from(n)) as f32 }
}

/// The most frequent class; ties go to the lowest id.
fn most_frequent(classes: [u8; 4]) -> u8 {
    let count = |class: u8| classes.iter().map(|other| u32::from(*other == class)).sum::<u32>();
    let known = classes.into_iter().filter(|class| *class != NO_CLASS);
    known.max_by_key(|class| (count(*class), u8::MAX - class)).unwrap_or(NO_CLASS)
}

fn mean_color(colors: [[u8; 4]; 4]) -> [u8; 4] {
    let known = || colors.iter().filter(|color| color[3] != 0);
    let n = known().count() as u32;
    if n == 0 {
        return [0; 4];
    }
    std::array::from_fn(|channel| ((known().map(|color| u32::from(color[channel])).sum::<u32>() + n / 2) / n) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_has_highest_point_and_mean_of_the_ground() {
        let mut cells = Cells::builder();
        for (z, class, rgb) in
            [(1000, 7, None), (3000, 1, Some([1, 2, 3])), (1100, 8, Some([9, 9, 9])), (5000, 9, None)]
        {
            cells.add(300, z, class, rgb);
        }
        let cells = cells.finish();
        assert_eq!((cells.height[300], cells.terrain[300], cells.class[300]), (5.0, 1.05, 9));
        assert_eq!(cells.color[300], [1, 2, 3, 255]);
        assert_eq!(
            (cells.height[0], cells.terrain[0], cells.class[0], cells.color[0]),
            (-9999.0, -9999.0, 255, [0; 4])
        );
    }

    #[test]
    fn difference_is_the_range_of_the_ground_of_the_drives() {
        let mut cells = Cells::builder();
        for (z, class, source) in [(1000, 7, 1), (1040, 7, 1), (1060, 8, 2), (990, 8, 3), (5000, 1, 3)] {
            cells.add_to_difference(300, z, class, source);
        }
        cells.add_to_difference(301, 1000, 7, 1);
        let cells = cells.finish();
        // 1.02, 1.06 and 0.99 m; the wall does not count.
        assert!((cells.difference[300] - 0.07).abs() < 1e-6, "{}", cells.difference[300]);
        assert_eq!(cells.difference[301], NO_HEIGHT);
    }

    #[test]
    fn overview_has_means_of_cells_with_points() {
        let mut cells = Cells::builder();
        cells.add(0, 1000, 7, Some([10, 0, 0]));
        cells.add(1, 3000, 1, Some([20, 0, 0]));
        cells.add(TILE, 2000, 1, None);
        let joined = Cells::joined(&[None, Some(cells.finish()), None, None]);
        let idx = TILE / 2;
        assert_eq!((joined.height[idx], joined.terrain[idx], joined.class[idx]), (2.0, 1.0, 1));
        assert_eq!(joined.color[idx], [15, 0, 0, 255]);
        assert_eq!(joined.class.iter().filter(|class| **class != NO_CLASS).count(), 1);
    }
}
