//! Which small objects of a sweep stand where an earlier sweep saw through.

use crate::seen::{PlacedSeen, Seen, Sight};
use crate::small_objects::SmallObjects;
use crate::{DeskewTable, Sweep, SweepMotion};
use geometry::{Isometry3, Pose, Stamp, Translation3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Earlier sweeps that are asked, at most. A thing that drives by stays in the view of a tilted lidar for half a second; who
/// walks has left the place where he was after as long.
const MEMORY: usize = 8;
/// Seconds between them at least: every sweep of a lidar at 10 Hz.
const APART_S: f64 = 0.08;
/// Points of an object whose places are asked for, at most.
const ASKED: u32 = 64;
/// The same at first: an object none of whose places seems free is asked no more.
const ASKED_FIRST: u32 = 24;
/// An object moves if this share of the answers is that a ray went through, and at least so many are. Half of a moving
/// thing stands where it has been before or where nothing was in view; of a standing one hardly a hundredth seems free.
const FREE_SHARE: f64 = 0.1;
const FREE_ANSWERS: u32 = 4;

/// What stands where an earlier sweep met a moving thing, by this share of the answers, still moves: a lorry that passes close
/// by hides all that its own place was free of.
const MOVED_SHARE: f64 = 0.5;

/// What moves in a sweep: indices of points, rising.
#[derive(Debug, Default)]
pub(crate) struct Moving {
    /// All of them.
    pub points: Vec<u32>,
    /// Those that an earlier sweep saw through. What only goes on moving is no proof for a later sweep.
    proven: Vec<u32>,
}

/// How often earlier sweeps saw what at the places of an object.
#[derive(Clone, Copy, Default)]
struct Answers {
    free: u32,
    filled: u32,
    moved: u32,
}

impl Answers {
    fn is_proof(&self) -> bool {
        self.free >= FREE_ANSWERS && f64::from(self.free) >= FREE_SHARE * f64::from(self.all())
    }
    fn goes_on(&self) -> bool {
        self.moved >= FREE_ANSWERS && f64::from(self.moved) >= MOVED_SHARE * f64::from(self.all())
    }
    fn add(&mut self, other: &Self) {
        self.free += other.free;
        self.filled += other.filled;
        self.moved += other.moved;
    }
    fn all(&self) -> u32 {
        self.free + self.filled + self.moved
    }
}

/// Tells what moves. Bounded: [`MEMORY`] images of 2 bytes a ray, 1 MB for 32 rings.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct MovingObjects {
    memory: VecDeque<(Stamp, Seen)>,
}

impl MovingObjects {
    /// The sweep's points on moving objects.
    pub fn found(&self, sweep: &Sweep, motion: &SweepMotion) -> Moving {
        if self.memory.is_empty() {
            return Moving::default();
        }
        let image = sweep.image();
        let placed = upright(sweep, motion);
        let objects = SmallObjects::found(&placed, image.cols());
        // Most things stand, and a few of their points tell.
        let seen: Vec<PlacedSeen> = self.memory.iter().map(|(_, seen)| seen.placed()).collect();
        let ask = |asked: &[u32]| answers(&seen, &placed, &objects, asked, &motion.mid.translation.vector);
        let first = ask(&objects.members(ASKED_FIRST));
        let is_suspect = |cell: &u32| {
            let first = &first[objects.of_cell[*cell as usize] as usize];
            first.free > 0 || first.goes_on()
        };
        let asked: Vec<u32> = objects.members(ASKED).into_iter().filter(is_suspect).collect();
        let answers = ask(&asked);
        let points_of = |does: fn(&Answers) -> bool| {
            let is_of = |object: u32| object != SmallObjects::NONE && does(&answers[object as usize]);
            let cells = (0..placed.len()).filter(|&cell| is_of(objects.of_cell[cell]));
            let mut points: Vec<u32> = cells
                .filter_map(|cell| image.point(cell / image.cols(), cell % image.cols()))
                .map(|point_idx| point_idx as u32)
                .collect();
            points.sort_unstable();
            points
        };
        Moving { points: points_of(|a| a.is_proof() || a.goes_on()), proven: points_of(Answers::is_proof) }
    }

    /// Keeps the sweep in mind, if the last one kept is old enough.
    pub fn remember(&mut self, sweep: &Sweep, motion: &SweepMotion, moving: &Moving) {
        let now = sweep.mid_stamp();
        if self.memory.back().is_some_and(|(last, _)| now.seconds_since(*last) < APART_S) {
            return;
        }
        if self.memory.len() == MEMORY {
            self.memory.pop_front();
        }
        self.memory.push_back((now, Seen::new(sweep, *motion, &moving.proven)));
    }
}

/// For each object what all that was `seen` says of its cells `asked`. `placed` are the cells' points, m, seen from `middle`.
fn answers(
    seen: &[PlacedSeen],
    placed: &[[f32; 3]],
    objects: &SmallObjects,
    asked: &[u32],
    middle: &Vector3<f64>,
) -> Vec<Answers> {
    let of_one = |seen: &PlacedSeen| {
        let mut answers = vec![Answers::default(); objects.n];
        for &cell in asked {
            let answers = &mut answers[objects.of_cell[cell as usize] as usize];
            match seen.sight(&(Vector3::from(placed[cell as usize]).cast::<f64>() + middle)) {
                Sight::Free => answers.free += 1,
                Sight::Filled => answers.filled += 1,
                Sight::Moved => answers.moved += 1,
                Sight::Hidden => {}
            }
        }
        answers
    };
    let with = |mut all: Vec<Answers>, others: Vec<Answers>| {
        all.iter_mut().zip(others).for_each(|(all, other)| all.add(&other));
        all
    };
    seen.par_iter().map(of_one).reduce(|| vec![Answers::default(); objects.n], with)
}

/// The points of the range image, row by row, deskewed in odom axes, seen from the lidar at the middle of the sweep, m; NaN
/// in empty cells.
fn upright(sweep: &Sweep, motion: &SweepMotion) -> Vec<[f32; 3]> {
    let from_middle = |pose: Pose| {
        let offset = pose.translation.vector - motion.mid.translation.vector;
        Isometry3::from_parts(Translation3::from(offset), pose.rotation)
    };
    let table = DeskewTable::new(&from_middle(motion.begin()), &from_middle(motion.end()), sweep.duration_nanos());
    let (image, points) = (sweep.image(), sweep.points());
    let mut placed = vec![[f32::NAN; 3]; image.rows() * image.cols()];
    placed.par_chunks_exact_mut(image.cols()).enumerate().for_each(|(row, cells)| {
        for (col, cell) in cells.iter_mut().enumerate() {
            if let Some(idx) = image.point(row, col) {
                *cell = table.deskew(points[idx].position, points[idx].offset_nanos);
            }
        }
    });
    placed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimedPoint;

    /// A box that stands on the floor: middle and half of its sides, m.
    struct Thing([f32; 2], [f32; 2]);

    /// Range to the nearest of a floor 2 m below, a wall 20 m ahead and the things, 1.5 m high; and which of them was hit.
    fn nearest(ray: &Vector3<f32>, things: &[Thing]) -> (f32, Option<usize>) {
        let floor = if ray.z < 0.0 { -2.0 / ray.z } else { f32::MAX };
        let wall = if ray.x > 0.0 { 20.0 / ray.x } else { f32::MAX };
        let mut best = (floor.min(wall), None);
        for (number, Thing([x, y], [a, b])) in things.iter().enumerate() {
            let (low, high) = ([x - a, y - b, -1.9], [x + a, y + b, -0.4]);
            let (mut enter, mut leave) = (0.0_f32, f32::MAX);
            for axis in 0..3 {
                let (a, b) = (low[axis] / ray[axis], high[axis] / ray[axis]);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            if enter > 0.0 && enter < leave && enter < best.0 {
                best = (enter, Some(number));
            }
        }
        best
    }

    /// A sweep of a lidar that stands, and which of the things each point is on.
    fn sweep(number: u32, things: &[Thing]) -> (Sweep, Vec<Option<usize>>) {
        let (mut points, mut hits) = (Vec::new(), Vec::new());
        for column in 0..2000_u32 {
            for ring in 0..32_u8 {
                let azimuth = std::f32::consts::PI - column as f32 * std::f32::consts::TAU / 2000.0;
                let elevation = (-30.67 + f32::from(ring) * 1.333_f32).to_radians();
                let ray =
                    Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
                let (range, hit) = nearest(&ray, things);
                if range < 80.0 {
                    points.push(TimedPoint { position: (ray * range).into(), offset_nanos: column * 50_000, ring });
                    hits.push(hit);
                }
            }
        }
        (Sweep::new(Stamp(i64::from(number) * 100_000_000), points, 32), hits)
    }

    #[test]
    fn what_crosses_moves_and_what_stands_does_not() {
        let still = SweepMotion::still(Pose::identity());
        let mut moving = MovingObjects::default();
        for number in 0..8 {
            // One stands, one crosses at 3 m/s.
            let side = [0.75; 2];
            let things = [Thing([9.0, -4.0], side), Thing([9.0, 1.0 + 0.3 * number as f32], side)];
            let (sweep, hits) = sweep(number, &things);
            let moves = moving.found(&sweep, &still);
            let found = &moves.points;
            assert!(found.is_sorted());
            let on = |object: usize| hits.iter().filter(|hit| **hit == Some(object)).count();
            let right = found.iter().filter(|&&idx| hits[idx as usize] == Some(1)).count();
            assert_eq!(found.len(), right, "sweep {number}: neither the wall nor the box that stands");
            assert!(on(0) > 50 && on(1) > 50);
            if number == 0 {
                assert!(found.is_empty(), "nothing is known yet");
            } else if number >= 3 {
                assert!(right * 10 > on(1) * 7, "sweep {number}: {right} of {}", on(1));
            }
            moving.remember(&sweep, &still, &moves);
        }
        assert_eq!(moving.memory.len(), MEMORY.min(8));
    }

    /// A vehicle that passed at 2.3 m was known to move until it filled the view; then it pulled the map along, by 4 degrees.
    #[test]
    fn a_lorry_that_passes_close_moves_as_long_as_it_is_there_and_not_for_long_after() {
        let still = SweepMotion::still(Pose::identity());
        let mut moving = MovingObjects::default();
        let mut found_in = |number: u32, at: f32| {
            let (sweep, hits) = sweep(number, &[Thing([at, 3.0], [5.0, 1.2])]);
            let moves = moving.found(&sweep, &still);
            let n_right = moves.points.iter().filter(|&&idx| hits[idx as usize] == Some(0)).count();
            assert_eq!(moves.points.len(), n_right, "sweep {number}: nothing else");
            moving.remember(&sweep, &still, &moves);
            n_right as f64 / hits.iter().flatten().count() as f64
        };
        // It comes at 10 m/s and slows down to 2 m/s beside the lidar.
        let mut at = -14.0;
        for number in 0..20 {
            at += if number < 12 { 1.0 } else { 0.2 };
            let share = found_in(number, at);
            assert!(number < 3 || share > 0.9, "sweep {number} at {at} m: {share}");
        }
        // It stands.
        let shares: Vec<f64> = (20..30).map(|number| found_in(number, at)).collect();
        assert!(shares[9] == 0.0, "{shares:?}");
    }
}
