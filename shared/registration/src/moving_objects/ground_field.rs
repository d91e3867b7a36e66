//! The ground as a height field, grown from the cells near the vehicle.

/// Side of a cell, m.
const CELL_M: f32 = 0.5;
/// Cells from the middle to each side: 48 m. Farther away, rings are too sparse for the field to grow.
const REACH: usize = 96;
/// Cells per row: the field and a margin that stays empty, so that each cell of the field has all its neighbors.
const SIDE: usize = 2 * (REACH + RIM);
const RIM: usize = 2;
/// Seeds of the ground lie within this distance of the vehicle, m.
const SEED_M: f32 = 6.0;
/// Largest height of a seed above the lowest one, m: a sidewalk is ground, a bonnet is not.
const SEED_STEP_M: f32 = 0.3;
/// Largest step between a cell and the second next one, m: a kerb, or a slope of 20 %.
const STEP_M: f32 = 0.2;
/// Points up to this height above the field belong to the ground, m.
const THICKNESS_M: f32 = 0.25;

/// Heights of the ground around the vehicle.
pub(crate) struct GroundField {
    /// Height per cell below which points belong to the ground; NaN without ground nearby.
    ceilings: Vec<f32>,
}

impl GroundField {
    /// Grows the field from points around the vehicle, z up, m, relative to the LiDAR. NaN points are ignored.
    pub fn grow(points: &[[f32; 3]]) -> Self {
        let mut lowest = vec![f32::NAN; SIDE * SIDE];
        for &[x, y, z] in points {
            if let Some(cell) = cell(x, y) {
                let lowest = &mut lowest[cell];
                // `f32::min` is slower because it handles NaN.
                *lowest = if *lowest <= z { *lowest } else { z };
            }
        }
        let mut ground = seeds(&lowest);
        let mut heights = vec![f32::NAN; SIDE * SIDE];
        for &seed in &ground {
            heights[seed] = lowest[seed];
        }
        let mut next = 0;
        while next < ground.len() {
            let from = ground[next];
            next += 1;
            for to in around(from, 2) {
                // A comparison with NaN is false: empty cells are never reached.
                if heights[to].is_nan() && (lowest[to] - heights[from]).abs() < STEP_M {
                    heights[to] = lowest[to];
                    ground.push(to);
                }
            }
        }
        // Cells without a height take the highest of the adjacent ones.
        let mut ceilings = vec![f32::NAN; SIDE * SIDE];
        for cell in ground {
            let ceiling = heights[cell] + THICKNESS_M;
            ceilings[cell] = ceiling;
            for near in around(cell, 1).filter(|near| heights[*near].is_nan()) {
                let other = &mut ceilings[near];
                *other = if *other >= ceiling { *other } else { ceiling };
            }
        }
        Self { ceilings }
    }
    /// Whether a point is on the ground or within its thickness.
    #[inline]
    pub fn contains(&self, [x, y, z]: [f32; 3]) -> bool {
        cell(x, y).is_some_and(|cell| z < self.ceilings[cell])
    }
}

/// Cells near the vehicle whose height is close to the lowest one.
fn seeds(lowest: &[f32]) -> Vec<usize> {
    const NEAR: usize = (SEED_M / CELL_M) as usize;
    const MIDDLE: usize = REACH + RIM;
    let along = |index: usize| (index as f32 - MIDDLE as f32 + 0.5) * CELL_M;
    let side = MIDDLE - NEAR..MIDDLE + NEAR;
    let near: Vec<usize> = side
        .clone()
        .flat_map(|row| side.clone().map(move |col| (row, col)))
        .filter(|&(row, col)| along(row).powi(2) + along(col).powi(2) < SEED_M * SEED_M)
        .map(|(row, col)| row * SIDE + col)
        .filter(|&cell| !lowest[cell].is_nan())
        .collect();
    let floor = near.iter().map(|&cell| lowest[cell]).fold(f32::MAX, f32::min);
    near.into_iter().filter(|&cell| lowest[cell] < floor + SEED_STEP_M).collect()
}

#[inline]
fn cell(x: f32, y: f32) -> Option<usize> {
    let index = |v: f32| {
        // The value is positive within the field, so truncation rounds down.
        let index = v * (1.0 / CELL_M) + REACH as f32;
        (0.0..2.0 * REACH as f32).contains(&index).then_some(index as usize + RIM)
    };
    Some(index(x)? * SIDE + index(y)?)
}

/// Cells of the field and its margin at most `reach` <= [`RIM`] rows and columns away.
#[inline(always)]
fn around(cell: usize, reach: usize) -> impl Iterator<Item = usize> {
    let first = cell - reach * SIDE - reach;
    let rows = (0..=2 * reach).map(move |row| first + row * SIDE);
    rows.flat_map(move |begin| begin..=begin + 2 * reach).filter(move |&other| other != cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn road_and_sidewalk_are_ground_and_a_car_is_not() {
        let mut points = Vec::new();
        for i in -300..300_i32 {
            for k in -100..100_i32 {
                let x = 0.1 * i as f32;
                let y = 0.1 * k as f32;
                let slope = 0.05 * x;
                let kerb = if y > 4.0 { 0.15 } else { 0.0 };
                let is_car = (8.0..12.0).contains(&x) && (-1.0..1.0).contains(&y);
                let height = if is_car { 1.4 } else { kerb };
                points.push([x, y, slope + height - 2.0]);
            }
        }
        let ground = GroundField::grow(&points);
        let found = |x: f32, y: f32, above: f32| ground.contains([x, y, 0.05 * x + above - 2.0]);
        assert!(found(-20.0, 0.3, 0.0) && found(25.0, 0.0, 0.05), "the road, up and down the slope");
        assert!(found(20.0, 6.0, 0.15), "the sidewalk");
        assert!(!found(10.0, 0.0, 1.4), "a roof");
        assert!(!found(20.0, 6.0, 0.6), "a bollard");
        assert!(!found(60.0, 0.0, 0.0), "outside of the field");
    }
}
