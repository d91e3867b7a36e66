//! Correlative matching of the top views of two keyframes (Olson, ICRA 2009): walls onto walls, then ground onto
//! ground. The result is accurate within half a metre.

use super::keyframe::SurfacePoint;
use geometry::{Isometry3, Pose, Vector3};

const CELL_M: f64 = 0.5;
/// Half the side of the grid, m: keyframes reach 40 m and may be 10 m apart.
const HALF_M: f64 = 60.0;
const SIDE: usize = (2.0 * HALF_M / CELL_M) as usize;
/// Largest error of the initial guess, m and rad: submaps are 20 m long, a sector is 0.1 rad.
const SHIFT_M: f64 = 14.0;
const SHIFTS: usize = (SHIFT_M / CELL_M) as usize;
/// Number of shifts along one axis.
const WINDOW: usize = 2 * SHIFTS + 1;
/// Margin of cells around the grid of walls, so that the search windows of walls at its edge lie inside.
const MARGIN: usize = 2 * SHIFTS;
const WALL_SIDE: usize = SIDE + 2 * MARGIN;
const ANGLE_RAD: f64 = 0.12;
const ANGLE_STEP_RAD: f64 = 0.02;
/// Largest number of compared wall points, evenly chosen.
const MAX_WALLS: usize = 600;
/// Side of a ground cell, m.
const GROUND_CELL_M: f64 = 2.0;
const GROUND_SIDE: usize = (2.0 * HALF_M / GROUND_CELL_M) as usize;

/// Top view of a keyframe around a center.
pub struct TopView {
    frame_from_center: Pose,
    /// 2 in cells with a wall, 1 in adjacent cells.
    walls: Vec<u8>,
    /// Mean height of the ground per cell; NaN in cells without ground.
    ground: Vec<f32>,
}

fn is_wall(surface: &SurfacePoint) -> bool {
    surface.normal.z.abs() < 0.4
}

fn is_ground(surface: &SurfacePoint) -> bool {
    surface.normal.z > 0.9
}

fn cell(at: &Vector3<f64>, cell_m: f64, side: usize) -> Option<usize> {
    let index = |v: f64| {
        let index = ((v + HALF_M) / cell_m).floor();
        (index >= 1.0 && index < side as f64 - 1.0).then_some(index as usize)
    };
    Some(index(at.y)? * side + index(at.x)?)
}

/// A source located in the target.
pub struct Located {
    pub target_from_source: Pose,
    /// Share of walls that coincide with walls, 0 to 1.
    pub walls_share: f64,
}

/// Sum of the heights in a cell.
#[derive(Clone, Copy, Default)]
struct HeightSum {
    sum: f64,
    n: u32,
}

impl TopView {
    pub fn new(surfaces: &[SurfacePoint], frame_from_center: &Pose) -> Self {
        let center_from_frame = frame_from_center.inverse();
        let mut walls = vec![0; WALL_SIDE * WALL_SIDE];
        let mut sums = vec![HeightSum::default(); GROUND_SIDE * GROUND_SIDE];
        for surface in surfaces {
            let at = (center_from_frame * surface.position).coords;
            if is_wall(surface)
                && let Some(index) = cell(&at, CELL_M, SIDE)
            {
                let index = (index / SIDE + MARGIN) * WALL_SIDE + index % SIDE + MARGIN;
                walls[index] = 2;
                for neighbor in [index - 1, index + 1, index - WALL_SIDE, index + WALL_SIDE] {
                    walls[neighbor] = walls[neighbor].max(1);
                }
            }
            if is_ground(surface)
                && let Some(index) = cell(&at, GROUND_CELL_M, GROUND_SIDE)
            {
                sums[index].sum += at.z;
                sums[index].n += 1;
            }
        }
        let mean = |cell: &HeightSum| if cell.n > 0 { (cell.sum / f64::from(cell.n)) as f32 } else { f32::NAN };
        Self { frame_from_center: *frame_from_center, walls, ground: sums.iter().map(mean).collect() }
    }

    /// Locates a source near a guess of `target_from_source`. `None` if there are too few walls or too little ground.
    pub fn locate(&self, source: &[SurfacePoint], target_from_source: &Pose) -> Option<Located> {
        let walls: Vec<&SurfacePoint> = source.iter().filter(|surface| is_wall(surface)).collect();
        if walls.len() < 50 {
            return None;
        }
        let walls: Vec<&SurfacePoint> = walls.iter().step_by(walls.len().div_ceil(MAX_WALLS)).copied().collect();
        let center_from_source = self.frame_from_center.inverse() * target_from_source;
        let n_rotations = (ANGLE_RAD / ANGLE_STEP_RAD).round() as i32;
        let mut best_score = 0;
        let mut best_pose = center_from_source;
        for rotation in -n_rotations..=n_rotations {
            // Rotates about the vehicle's position in the target.
            let rotated = rotated_in_place(&center_from_source, f64::from(rotation) * ANGLE_STEP_RAD);
            let at = walls.iter().map(|wall| (rotated * wall.position).coords);
            let scores = self.scores(at);
            for east in 0..WINDOW {
                for north in 0..WINDOW {
                    let score = scores[north * WINDOW + east];
                    if score > best_score {
                        let metres = |cells: usize| (cells as f64 - SHIFTS as f64) * CELL_M;
                        best_score = score;
                        best_pose = Isometry3::translation(metres(east), metres(north), 0.0) * rotated;
                    }
                }
            }
        }
        let walls_share = f64::from(best_score) / (2.0 * walls.len() as f64);
        let rise = self.rise(source, &best_pose)?;
        let raised = Isometry3::translation(0.0, 0.0, rise) * best_pose;
        Some(Located { target_from_source: self.frame_from_center * raised, walls_share })
    }

    /// The number of coinciding walls for each shift, row by row, starting in the south-west. A shift by whole cells
    /// moves the cell of each wall, so each wall adds one window of the grid.
    fn scores(&self, walls: impl Iterator<Item = Vector3<f64>>) -> Vec<u16> {
        let mut scores = vec![0; WINDOW * WINDOW];
        for at in walls {
            let south_west = |v: f64| ((v + HALF_M) / CELL_M).floor() as i32 + MARGIN as i32 - SHIFTS as i32;
            let (Ok(x), Ok(y)) = (usize::try_from(south_west(at.x)), usize::try_from(south_west(at.y))) else {
                continue;
            };
            if x + WINDOW > WALL_SIDE || y + WINDOW > WALL_SIDE {
                continue;
            }
            for (row, scores) in scores.chunks_exact_mut(WINDOW).enumerate() {
                let begin = (y + row) * WALL_SIDE + x;
                for (score, wall) in scores.iter_mut().zip(&self.walls[begin..begin + WINDOW]) {
                    *score += u16::from(*wall);
                }
            }
        }
        scores
    }

    /// Median height of the target's ground above the source's ground.
    fn rise(&self, source: &[SurfacePoint], center_from_source: &Pose) -> Option<f64> {
        let ground = source.iter().filter(|surface| is_ground(surface));
        let mut rises: Vec<f64> = ground
            .filter_map(|surface| {
                let at = (center_from_source * surface.position).coords;
                let height = f64::from(self.ground[cell(&at, GROUND_CELL_M, GROUND_SIDE)?]);
                (!height.is_nan()).then_some(height - at.z)
            })
            .collect();
        if rises.len() < 50 {
            return None;
        }
        let middle = rises.len() / 2;
        Some(*rises.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}

/// Rotates the pose about the vertical through the origin of the source.
fn rotated_in_place(center_from_source: &Pose, angle_rad: f64) -> Pose {
    let at = center_from_source.translation;
    let rotation = Isometry3::rotation(Vector3::z() * angle_rad);
    at * rotation * at.inverse() * center_from_source
}
