//! Detects moving objects: small objects in space that an earlier sweep observed as free.

pub(crate) mod ground_field;
pub(crate) mod past_ranges;
pub(crate) mod small_objects;

use crate::sweep::range_image::STRIDE;
use crate::{DeskewTable, Sweep, SweepMotion};
use geometry::{Isometry3, Pose, Stamp, Translation3, Vector3};
use past_ranges::{LANES, PastRanges, PlacedRanges, Positions, Visibility};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use small_objects::SmallObjects;
use std::collections::VecDeque;

/// Number of earlier sweeps that are compared. A passing vehicle stays in the field of view of a tilted LiDAR for half
/// a second; in the same time a pedestrian leaves the occupied space.
const MEMORY: usize = 8;
/// Least time between stored sweeps, s: every sweep of a LiDAR at 10 Hz.
const MIN_INTERVAL_S: f64 = 0.08;
/// Largest number of compared points of an object.
const MAX_POINTS: usize = 64;
/// Largest number of compared points in the first pass. Objects without a free vote in it are static.
const MAX_POINTS_FIRST: usize = 24;
/// An object moves if this share of its votes is free, and at least [`FREE_VOTES`] votes are. Half of a moving object
/// overlaps its previous position or space that was not visible. For a static object hardly one vote in a hundred is
/// free.
const FREE_SHARE: f64 = 0.1;
const FREE_VOTES: u32 = 4;
/// An object continues to move if this share of its votes is dynamic: the space of a lorry that passes close by was not
/// observed as free, because the lorry itself occludes it.
const DYNAMIC_SHARE: f64 = 0.5;

/// Points on moving objects: indices, ascending.
#[derive(Debug, Default)]
pub(crate) struct MovingPoints {
    /// All points on moving objects.
    pub points: Vec<u32>,
    /// Points in space that was free in an earlier sweep. Only they are evidence for later sweeps.
    proven: Vec<u32>,
}

/// Number of points of an object in space that earlier sweeps observed as free, occupied or dynamic.
#[derive(Clone, Copy, Default)]
struct Votes {
    free: u32,
    occupied: u32,
    dynamic: u32,
}

impl Votes {
    fn is_moving(&self) -> bool {
        self.free >= FREE_VOTES && f64::from(self.free) >= FREE_SHARE * f64::from(self.all())
    }
    fn continues_to_move(&self) -> bool {
        self.dynamic >= FREE_VOTES && f64::from(self.dynamic) >= DYNAMIC_SHARE * f64::from(self.all())
    }
    fn add(&mut self, other: &Self) {
        self.free += other.free;
        self.occupied += other.occupied;
        self.dynamic += other.dynamic;
    }
    fn all(&self) -> u32 {
        self.free + self.occupied + self.dynamic
    }
}

/// Detects moving objects. Its size is bounded: [`MEMORY`] range images of 2 bytes per ray, 1 MB for 32 rings.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct MovingDetector {
    memory: VecDeque<(Stamp, PastRanges)>,
}

impl MovingDetector {
    /// The points of a sweep on moving objects.
    pub fn detect(&self, sweep: &Sweep, motion: &SweepMotion) -> MovingPoints {
        if self.memory.is_empty() {
            return MovingPoints::default();
        }
        let image = sweep.image();
        let placed = points_in_odom_axes(sweep, motion);
        let objects = SmallObjects::segment(&placed, image.cols(), STRIDE);
        let past: Vec<PlacedRanges> = self.memory.iter().map(|(_, ranges)| ranges.placed()).collect();
        let votes_on = |of: &[u32], at_most: usize| {
            let members = |&object| objects.members(object as usize, at_most).map(move |cell| Member { object, cell });
            let queries = Queries::new(of.iter().flat_map(members), &placed, &motion.mid.translation.vector);
            queries.votes(&past, objects.n())
        };
        // Most objects are static, which a few of their points suffice to show.
        let all: Vec<u32> = (0..objects.n() as u32).collect();
        let mut votes = votes_on(&all, MAX_POINTS_FIRST);
        let may_move = |object: &u32| {
            let first = &votes[*object as usize];
            let has_more = objects.cells(*object as usize).len() > MAX_POINTS_FIRST;
            has_more && (first.free > 0 || first.continues_to_move())
        };
        let in_doubt: Vec<u32> = all.into_iter().filter(may_move).collect();
        let exact = votes_on(&in_doubt, MAX_POINTS);
        for object in in_doubt {
            votes[object as usize] = exact[object as usize];
        }
        let points_of = |does: fn(&Votes) -> bool| {
            let cells =
                (0..objects.n()).filter(|&object| does(&votes[object])).flat_map(|object| objects.cells(object));
            let mut points: Vec<u32> = cells.map(|&cell| image.point_of_cell(cell as usize)).collect();
            points.sort_unstable();
            points
        };
        MovingPoints {
            points: points_of(|a| a.is_moving() || a.continues_to_move()),
            proven: points_of(Votes::is_moving),
        }
    }

    /// Stores the ranges of a sweep if the last stored one is old enough.
    pub fn add_sweep(&mut self, sweep: &Sweep, motion: &SweepMotion, moving: &MovingPoints) {
        let now = sweep.mid_stamp();
        if self.memory.back().is_some_and(|(last, _)| now.seconds_since(*last) < MIN_INTERVAL_S) {
            return;
        }
        if self.memory.len() == MEMORY {
            self.memory.pop_front();
        }
        self.memory.push_back((now, PastRanges::new(sweep, *motion, &moving.proven)));
    }
}

/// A cell of the range image that belongs to an object.
struct Member {
    object: u32,
    cell: u32,
}

/// Points of objects that are compared with earlier sweeps.
struct Queries {
    /// Positions in the odom frame. Unused lanes repeat a position.
    positions: Vec<Positions>,
    /// Object index of each lane.
    objects: Vec<u32>,
}

impl Queries {
    /// `placed` are the points of all cells relative to `middle`, m.
    fn new(members: impl Iterator<Item = Member>, placed: &[[f32; 3]], middle: &Vector3<f64>) -> Self {
        let members: Vec<Member> = members.collect();
        let block = |members: &[Member]| {
            let mut block = [[0.0; LANES]; 3];
            for lane in 0..LANES {
                let position = placed[members[lane.min(members.len() - 1)].cell as usize];
                for axis in 0..3 {
                    block[axis][lane] = f64::from(position[axis]) + middle[axis];
                }
            }
            block
        };
        let positions = members.chunks(LANES).map(block).collect();
        Self { positions, objects: members.iter().map(|member| member.object).collect() }
    }
    /// The votes of all past sweeps on each of `n` objects.
    fn votes(&self, past: &[PlacedRanges], n: usize) -> Vec<Votes> {
        let with = |mut all: Vec<Votes>, others: Vec<Votes>| {
            all.iter_mut().zip(others).for_each(|(all, other)| all.add(&other));
            all
        };
        let of_one = |ranges: &PlacedRanges| {
            wide_loops::run(
                #[inline(always)]
                || self.votes_of_one(ranges, n),
            )
        };
        past.par_iter().map(of_one).reduce(|| vec![Votes::default(); n], with)
    }
    #[inline(always)]
    fn votes_of_one(&self, ranges: &PlacedRanges, n: usize) -> Vec<Votes> {
        let mut votes = vec![Votes::default(); n];
        for (positions, objects) in self.positions.iter().zip(self.objects.chunks(LANES)) {
            for (&object, seen) in objects.iter().zip(ranges.visibility(positions)) {
                let votes = &mut votes[object as usize];
                match seen {
                    Visibility::Free => votes.free += 1,
                    Visibility::Occupied => votes.occupied += 1,
                    Visibility::Dynamic => votes.dynamic += 1,
                    Visibility::Unknown => {}
                }
            }
        }
        votes
    }
}

/// The points of the range image, [`STRIDE`] cells per row, deskewed, in odom axes relative to the LiDAR in the middle
/// of the sweep, m; NaN in empty cells.
fn points_in_odom_axes(sweep: &Sweep, motion: &SweepMotion) -> Vec<[f32; 3]> {
    let from_middle = |pose: Pose| {
        let offset = pose.translation.vector - motion.mid.translation.vector;
        Isometry3::from_parts(Translation3::from(offset), pose.rotation)
    };
    let table = DeskewTable::new(&from_middle(motion.begin()), &from_middle(motion.end()), sweep.duration_nanos());
    let points = sweep.points();
    sweep.image().by_cell([f32::NAN; 3], |idx| table.deskew(points[idx].position, points[idx].offset_nanos))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimedPoint;

    /// A box on the floor, 1.5 m high.
    struct Object {
        center: [f32; 2],
        /// Half side lengths, m.
        half: [f32; 2],
    }

    /// What a ray hits.
    struct Hit {
        range: f32,
        object: Option<usize>,
    }

    /// A sweep, and the object of each point.
    struct LabeledSweep {
        sweep: Sweep,
        objects: Vec<Option<usize>>,
    }

    /// The nearest of a floor 2 m below, a wall 20 m ahead and the objects.
    fn nearest(ray: &Vector3<f32>, objects: &[Object]) -> Hit {
        let floor = if ray.z < 0.0 { -2.0 / ray.z } else { f32::MAX };
        let wall = if ray.x > 0.0 { 20.0 / ray.x } else { f32::MAX };
        let mut best = Hit { range: floor.min(wall), object: None };
        for (number, Object { center: [x, y], half: [a, b] }) in objects.iter().enumerate() {
            let low = [x - a, y - b, -1.9];
            let high = [x + a, y + b, -0.4];
            let mut enter = 0.0_f32;
            let mut leave = f32::MAX;
            for axis in 0..3 {
                let a = low[axis] / ray[axis];
                let b = high[axis] / ray[axis];
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            if enter > 0.0 && enter < leave && enter < best.range {
                best = Hit { range: enter, object: Some(number) };
            }
        }
        best
    }

    /// A sweep of a LiDAR at rest.
    fn sweep(number: u32, objects: &[Object]) -> LabeledSweep {
        let mut points = Vec::new();
        let mut hits = Vec::new();
        for column in 0..2000_u32 {
            for ring in 0..32_u8 {
                let azimuth = std::f32::consts::PI - column as f32 * std::f32::consts::TAU / 2000.0;
                let elevation = (-30.67 + f32::from(ring) * 1.333_f32).to_radians();
                let ray =
                    Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
                let hit = nearest(&ray, objects);
                if hit.range < 80.0 {
                    let position = (ray * hit.range).into();
                    points.push(TimedPoint { position, offset_nanos: column * 50_000, ring });
                    hits.push(hit.object);
                }
            }
        }
        let sweep = Sweep::new(Stamp(i64::from(number) * 100_000_000), points, 32);
        LabeledSweep { sweep, objects: hits }
    }

    #[test]
    fn crossing_object_is_detected_and_standing_one_is_not() {
        let still = SweepMotion::still(Pose::identity());
        let mut moving = MovingDetector::default();
        for number in 0..8 {
            // The first object is static, the second crosses at 3 m/s.
            let object = |center| Object { center, half: [0.75; 2] };
            let objects = [object([9.0, -4.0]), object([9.0, 1.0 + 0.3 * number as f32])];
            let LabeledSweep { sweep, objects: hits } = sweep(number, &objects);
            let moves = moving.detect(&sweep, &still);
            let found = &moves.points;
            assert!(found.is_sorted());
            let on = |object: usize| hits.iter().filter(|hit| **hit == Some(object)).count();
            let right = found.iter().filter(|&&idx| hits[idx as usize] == Some(1)).count();
            assert_eq!(found.len(), right, "sweep {number}: neither the wall nor the standing box");
            assert!(on(0) > 50 && on(1) > 50);
            if number == 0 {
                assert!(found.is_empty(), "no earlier sweep");
            } else if number >= 3 {
                assert!(right * 10 > on(1) * 7, "sweep {number}: {right} of {}", on(1));
            }
            moving.add_sweep(&sweep, &still, &moves);
        }
        assert_eq!(moving.memory.len(), MEMORY.min(8));
    }

    /// Regression: a vehicle that passed at 2.3 m was detected only until it filled the field of view; then it rotated
    /// the pose by 4 degrees.
    #[test]
    fn lorry_passing_close_is_detected_until_it_stops() {
        let still = SweepMotion::still(Pose::identity());
        let mut moving = MovingDetector::default();
        let mut found_in = |number: u32, at: f32| {
            let lorry = Object { center: [at, 3.0], half: [5.0, 1.2] };
            let LabeledSweep { sweep, objects: hits } = sweep(number, &[lorry]);
            let moves = moving.detect(&sweep, &still);
            let n_right = moves.points.iter().filter(|&&idx| hits[idx as usize] == Some(0)).count();
            assert_eq!(moves.points.len(), n_right, "sweep {number}: no other points");
            moving.add_sweep(&sweep, &still, &moves);
            n_right as f64 / hits.iter().flatten().count() as f64
        };
        // It approaches at 10 m/s and slows down to 2 m/s next to the LiDAR.
        let mut at = -14.0;
        for number in 0..20 {
            at += if number < 12 { 1.0 } else { 0.2 };
            let share = found_in(number, at);
            assert!(number < 3 || share > 0.9, "sweep {number} at {at} m: {share}");
        }
        // It has stopped.
        let shares: Vec<f64> = (20..30).map(|number| found_in(number, at)).collect();
        assert!(shares[9] == 0.0, "{shares:?}");
    }
}
