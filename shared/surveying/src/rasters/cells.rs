//! The cells of one tile.

use super::content::{COMPLETED, MEASURED};
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
    /// Height of the ground, m: mean of the ground points, or without points of the completed ground.
    pub(super) terrain: Vec<f32>,
    /// Whether the height of the ground was measured or completed.
    pub(super) terrain_source: Vec<u8>,
    /// Points per square meter.
    pub(super) density: Vec<f32>,
    /// Largest difference between the drives of a survey in the mean of the ground points, m.
    pub(super) difference: Vec<f32>,
    /// Class of the highest point.
    pub(super) class: Vec<u8>,
    /// sRGB of the highest point with a color; the fourth channel is 255, or 0 without such a point.
    pub(super) color: Vec<[u8; 4]>,
    /// Color of the highest colored point that is on no vehicle or person; the color of the ground where nothing else has a color.
    pub(super) orthophoto: Vec<[u8; 4]>,
    /// Whether the color of the orthophoto was measured or completed.
    pub(super) orthophoto_source: Vec<u8>,
}

/// A point of a cell.
#[derive(Clone, Copy)]
pub(super) struct CellPoint {
    /// Height, mm.
    pub(super) z_mm: i32,
    /// Class id.
    pub(super) class: u8,
    /// sRGB. `None` if no camera saw the point.
    pub(super) rgb: Option<[u8; 3]>,
    /// Whether it is on something that moves or can move.
    pub(super) is_removed: bool,
}

/// The ground at a place of a cell.
#[derive(Clone, Copy)]
pub(super) struct CellGround {
    /// Height, mm.
    pub(super) z_mm: i32,
    /// sRGB, if it is known.
    pub(super) rgb: Option<[u8; 3]>,
}

/// Sums over the ground in a cell.
#[derive(Clone, Copy, Default)]
struct GroundSums {
    z_mm: i64,
    n: u32,
    rgb: [u32; 3],
    n_colored: u32,
}

impl GroundSums {
    fn height_m(&self) -> Option<f32> {
        (self.n > 0).then(|| (self.z_mm as f64 / f64::from(self.n) / 1000.0) as f32)
    }

    fn color(&self) -> Option<[u8; 4]> {
        let [r, g, b] = self.rgb.map(|sum| sum.checked_div(self.n_colored).map(|mean| mean as u8));
        Some([r?, g?, b?, 255])
    }
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
    n: Vec<u32>,
    /// Height in mm and color of the highest point that stays.
    standing: Vec<(i32, [u8; 4])>,
    /// The completed ground.
    surface: Vec<GroundSums>,
}

impl Cells {
    /// Cells without points.
    pub(super) fn builder() -> CellsBuilder {
        CellsBuilder {
            highest: vec![(i32::MIN, NO_CLASS); N_CELLS],
            colored: vec![(i32::MIN, [0; 4]); N_CELLS],
            ground: vec![(0, 0); N_CELLS],
            ground_by_source: BTreeMap::new(),
            is_ground: std::array::from_fn(|id| {
                ClassId::from_id(id as u8).is_some_and(|class| GROUND_CLASSES.contains(&class))
            }),
            n: vec![0; N_CELLS],
            standing: vec![(i32::MIN, [0; 4]); N_CELLS],
            surface: vec![GroundSums::default(); N_CELLS],
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
            terrain_source: vec![NO_CLASS; N_CELLS],
            density: vec![NO_HEIGHT; N_CELLS],
            orthophoto: vec![[0; 4]; N_CELLS],
            orthophoto_source: vec![NO_CLASS; N_CELLS],
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
                joined.terrain_source[idx] = most_frequent(four.map(|k| quarter.terrain_source[k]));
                joined.density[idx] = mean(four.map(|k| quarter.density[k]));
                joined.orthophoto[idx] = mean_color(four.map(|k| quarter.orthophoto[k]));
                joined.orthophoto_source[idx] = most_frequent(four.map(|k| quarter.orthophoto_source[k]));
            }
        }
        joined
    }
}

impl CellsBuilder {
    /// Adds a point.
    #[inline]
    pub(super) fn add(&mut self, idx: usize, point: CellPoint) {
        let CellPoint { z_mm, class, rgb, is_removed } = point;
        self.n[idx] += 1;
        if z_mm > self.highest[idx].0 || self.highest[idx].1 == NO_CLASS {
            self.highest[idx] = (z_mm, class);
        }
        if let Some([r, g, b]) = rgb {
            let color = (z_mm, [r, g, b, 255]);
            for (highest, is_seen) in [(&mut self.colored[idx], true), (&mut self.standing[idx], !is_removed)] {
                if is_seen && (z_mm > highest.0 || highest.1[3] == 0) {
                    *highest = color;
                }
            }
        }
        if self.is_ground[usize::from(class)] {
            let (sum, n) = self.ground[idx];
            self.ground[idx] = (sum + i64::from(z_mm), n + 1);
        }
    }

    /// Adds completed ground.
    #[inline]
    pub(super) fn add_surface(&mut self, idx: usize, ground: CellGround) {
        let CellGround { z_mm, rgb } = ground;
        let sums = &mut self.surface[idx];
        sums.z_mm += i64::from(z_mm);
        sums.n += 1;
        if let Some(rgb) = rgb {
            sums.n_colored += 1;
            sums.rgb.iter_mut().zip(rgb).for_each(|(sum, channel)| *sum += u32::from(channel));
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

    /// Height and source of the ground in a cell.
    fn terrain(&self, idx: usize) -> (f32, u8) {
        let (sum, n) = self.ground[idx];
        if n > 0 {
            return (metres(sum as f64 / f64::from(n)), MEASURED);
        }
        self.surface[idx].height_m().map_or((NO_HEIGHT, NO_CLASS), |height| (height, COMPLETED))
    }

    /// Color and source of the orthophoto in a cell.
    fn orthophoto(&self, idx: usize) -> ([u8; 4], u8) {
        let standing = self.standing[idx].1;
        if standing[3] != 0 {
            return (standing, MEASURED);
        }
        self.surface[idx].color().map_or(([0; 4], NO_CLASS), |color| (color, COMPLETED))
    }

    /// The values of the cells, of this area in square meters each.
    pub(super) fn finish(self, cell_m2: f64) -> Cells {
        let (terrain, terrain_source) = (0..N_CELLS).map(|idx| self.terrain(idx)).unzip();
        let (orthophoto, orthophoto_source) = (0..N_CELLS).map(|idx| self.orthophoto(idx)).unzip();
        let density = |n: &u32| if *n == 0 { NO_HEIGHT } else { (f64::from(*n) / cell_m2) as f32 };
        Cells {
            difference: self.difference(),
            height: self
                .highest
                .iter()
                .map(|(z, class)| if *class == NO_CLASS { NO_HEIGHT } else { metres(f64::from(*z)) })
                .collect(),
            terrain,
            terrain_source,
            density: self.n.iter().map(density).collect(),
            class: self.highest.into_iter().map(|(_, class)| class).collect(),
            color: self.colored.into_iter().map(|(_, color)| color).collect(),
            orthophoto,
            orthophoto_source,
        }
    }
}

fn metres(mm: f64) -> f32 {
    (mm / 1000.0) as f32
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

    fn point(z_mm: i32, class: u8, rgb: Option<[u8; 3]>) -> CellPoint {
        CellPoint { z_mm, class, rgb, is_removed: false }
    }

    #[test]
    fn orthophoto_has_no_removed_points_and_the_ground_below_them() {
        let mut cells = Cells::builder();
        let car = CellPoint { is_removed: true, ..point(1500, 10, Some([200, 0, 0])) };
        let ground = |z_mm, rgb| CellGround { z_mm, rgb };
        // A car over ground that another sweep saw, over hidden ground, over ground without color; a house.
        for idx in 0..3 {
            cells.add(idx, car);
        }
        cells.add(0, point(40, 7, Some([60, 61, 62])));
        cells.add_surface(0, ground(90, Some([99, 99, 99])));
        cells.add_surface(1, ground(70, Some([80, 81, 82])));
        cells.add_surface(1, ground(80, Some([90, 91, 92])));
        cells.add_surface(2, ground(70, None));
        cells.add(3, point(9000, 1, Some([1, 2, 3])));
        let cells = cells.finish(0.25);
        assert_eq!(cells.color[..4], [[200, 0, 0, 255], [200, 0, 0, 255], [200, 0, 0, 255], [1, 2, 3, 255]]);
        assert_eq!(cells.orthophoto[..4], [[60, 61, 62, 255], [85, 86, 87, 255], [0; 4], [1, 2, 3, 255]]);
        assert_eq!(cells.orthophoto_source[..5], [MEASURED, COMPLETED, NO_CLASS, MEASURED, NO_CLASS]);
        assert_eq!(cells.terrain[..4], [0.04, 0.075, 0.07, NO_HEIGHT]);
        assert_eq!(cells.terrain_source[..4], [MEASURED, COMPLETED, COMPLETED, NO_CLASS]);
        assert_eq!(cells.density[..5], [8.0, 4.0, 4.0, 4.0, NO_HEIGHT]);
    }

    #[test]
    fn cell_has_highest_point_and_mean_of_the_ground() {
        let mut cells = Cells::builder();
        for (z, class, rgb) in
            [(1000, 7, None), (3000, 1, Some([1, 2, 3])), (1100, 8, Some([9, 9, 9])), (5000, 9, None)]
        {
            cells.add(300, point(z, class, rgb));
        }
        let cells = cells.finish(1.0);
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
        let cells = cells.finish(1.0);
        // 1.02, 1.06 and 0.99 m; the wall does not count.
        assert!((cells.difference[300] - 0.07).abs() < 1e-6, "{}", cells.difference[300]);
        assert_eq!(cells.difference[301], NO_HEIGHT);
    }

    #[test]
    fn overview_has_means_of_cells_with_points() {
        let mut cells = Cells::builder();
        cells.add(0, point(1000, 7, Some([10, 0, 0])));
        cells.add(1, point(3000, 1, Some([20, 0, 0])));
        cells.add(TILE, point(2000, 1, None));
        let joined = Cells::joined(&[None, Some(cells.finish(1.0)), None, None]);
        let idx = TILE / 2;
        assert_eq!((joined.height[idx], joined.terrain[idx], joined.class[idx]), (2.0, 1.0, 1));
        assert_eq!(joined.color[idx], [15, 0, 0, 255]);
        assert_eq!(joined.class.iter().filter(|class| **class != NO_CLASS).count(), 1);
    }
}
