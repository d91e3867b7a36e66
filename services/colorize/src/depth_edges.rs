//! Where the depth of a submap jumps: the outlines of things, as the LiDAR saw them.

use crate::chunk::seconds;
use crate::cloud::Cloud;
use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use rayon::prelude::*;

/// The far side is farther by so much, m, and by [`JUMP_SHARE`] of the near side's range: more than a curb, less than a car's length.
const JUMP_M: f32 = 0.5;
const JUMP_SHARE: f32 = 0.1;

/// Two shots on one side of a jump differ by less than this, m, and by [`SMOOTH_SHARE`] of the range. Leaves do not.
const SMOOTH_M: f32 = 0.1;
const SMOOTH_SHARE: f32 = 0.05;

/// Neighbors on a ring are at most so far apart, 0.01 degree: three shots of an HDL-32E at 20 Hz.
const MAX_AZIMUTH_STEP: u16 = 100;

/// A place where depth jumps between two neighboring shots.
#[derive(Clone, Copy, Debug)]
pub struct DepthEdge {
    /// On the outline, which is taken to be midway between the two shots, m, submap frame.
    pub at: [f32; 3],
    /// From the near shot's direction toward the far one's, m at the range of the near side: one step of the scan.
    pub across: [f32; 3],
    /// Range of the near side from the sensor, m.
    pub range_m: f32,
    /// When it was shot, s after the submap's first.
    pub time: f32,
}

/// The jumps of a submap along its rings, without those of moving things: of the sweeps that reach into one of the
/// spans of time, s after the submap's first shot.
pub fn depth_edges(cloud: &Cloud<'_>, spans: &[[f32; 2]]) -> Vec<DepthEdge> {
    let of_sweep = |sweep: &SubmapSweep| {
        let begin = seconds(sweep.stamp, cloud.origin);
        let end = begin + sweep.duration_nanos as f32 * 1e-9;
        if !spans.iter().any(|[from, until]| begin <= *until && end >= *from) {
            return Vec::new();
        }
        let first = sweep.first_point as usize;
        let points = cloud.points.get(first..first + sweep.n_points as usize).unwrap_or_default();
        let shots = Shots { points, sweep, time: seconds(sweep.stamp, cloud.origin), n_rings: cloud.n_rings as usize };
        shots.edges()
    };
    cloud.sweeps.par_iter().flat_map_iter(of_sweep).collect()
}

/// A sweep's points.
struct Shots<'a> {
    points: &'a [SubmapPoint],
    sweep: &'a SubmapSweep,
    time: f32,
    n_rings: usize,
}

/// A point on its ring.
#[derive(Clone, Copy)]
struct Shot<'a> {
    point: &'a SubmapPoint,
    /// From the sensor, m.
    range_m: f32,
}

impl<'a> Shots<'a> {
    fn edges(&self) -> Vec<DepthEdge> {
        let mut edges = Vec::new();
        for shots in self.by_ring() {
            for five in shots.windows(5) {
                let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|i| five[i]);
                self.add([a, b, c, d], &mut edges);
                // A beam that meets both sides is measured in between. One that is of a side is none such: the same jump, taken for half
                // a shot earlier, would draw all outlines against the scan.
                if is_between([b, c, d].map(|shot| shot.range_m)) {
                    self.add([a, b, d, e], &mut edges);
                }
            }
        }
        edges
    }

    /// The points of each ring in the order of their shots.
    fn by_ring(&self) -> Vec<Vec<Shot<'a>>> {
        let mut rings = vec![Vec::with_capacity(self.points.len() / self.n_rings.max(1)); self.n_rings];
        for point in self.points {
            if let Some(ring) = rings.get_mut(usize::from(point.ring)) {
                let range_m = self.ray(point).1.iter().map(|v| v * v).sum::<f32>().sqrt();
                ring.push(Shot { point, range_m });
            }
        }
        rings
    }

    /// From where and in which direction the shot was, m, submap frame.
    fn ray(&self, point: &SubmapPoint) -> ([f32; 3], [f32; 3]) {
        let eye = self.eye(point.offset_nanos);
        (eye, [point.x - eye[0], point.y - eye[1], point.z - eye[2]])
    }

    /// Adds the jump in the middle of four neighbors, if there is one between two smooth sides.
    fn add(&self, shots: [Shot<'_>; 4], edges: &mut Vec<DepthEdge>) {
        let range_m = shots.map(|shot| shot.range_m);
        let (near, far) = if range_m[1] < range_m[2] { (1, 2) } else { (2, 1) };
        let jumps = range_m[far] - range_m[near] > JUMP_M + JUMP_SHARE * range_m[near];
        if !jumps || !is_smooth(range_m[0], range_m[1]) || !is_smooth(range_m[2], range_m[3]) {
            return;
        }
        let points = shots.map(|shot| shot.point);
        let step = |i: usize| between(points[i].azimuth, points[i + 1].azimuth);
        if (0..3).any(|i| step(i) > MAX_AZIMUTH_STEP) || points.iter().any(|p| p.flags & POINT_DYNAMIC != 0) {
            return;
        }
        let near_m = range_m[near];
        let (eye, ray) = self.ray(points[near]);
        let far_at_near = self.ray(points[far]).1.map(|v| v * near_m / range_m[far]);
        let across = [0, 1, 2].map(|i| far_at_near[i] - ray[i]);
        edges.push(DepthEdge {
            at: [0, 1, 2].map(|i| eye[i] + ray[i] + 0.5 * across[i]),
            across,
            range_m: near_m,
            time: self.time + points[near].offset_nanos as f32 * 1e-9,
        });
    }

    /// Where the sensor was, m, submap frame.
    fn eye(&self, offset_nanos: u32) -> [f32; 3] {
        let share = offset_nanos as f32 / self.sweep.duration_nanos.max(1) as f32;
        let (a, b) = (&self.sweep.submap_from_lidar_begin, &self.sweep.submap_from_lidar_end);
        [0, 1, 2].map(|i| a[i] + share * (b[i] - a[i]))
    }
}

/// Whether two shots are of one surface.
fn is_smooth(a: f32, b: f32) -> bool {
    (a - b).abs() < SMOOTH_M + SMOOTH_SHARE * a.min(b)
}

/// Whether the second of three neighbors is on no side of a jump between the others.
fn is_between([a, b, c]: [f32; 3]) -> bool {
    !is_smooth(a, b) && !is_smooth(b, c) && (b > a) == (c > b)
}

/// The smaller of the two angles, 0.01 degree.
fn between(a: u16, b: u16) -> u16 {
    let apart = a.abs_diff(b);
    apart.min(36_000_u16.saturating_sub(apart))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions of the edges of a ring with shots 0.2 degrees apart, steps of the scan from its first shot.
    fn edges_of(range_m: &[f32]) -> Vec<f32> {
        const STEP_RAD: f32 = 0.2 * std::f32::consts::PI / 180.0;
        let shot = |(i, range_m): (usize, &f32)| {
            let (y, x) = (i as f32 * STEP_RAD).sin_cos();
            SubmapPoint { x: x * range_m, y: y * range_m, azimuth: i as u16 * 20, ..SubmapPoint::default() }
        };
        let points: Vec<SubmapPoint> = range_m.iter().enumerate().map(shot).collect();
        let sweep = SubmapSweep { n_points: points.len() as u32, ..SubmapSweep::default() };
        let shots = Shots { points: &points, sweep: &sweep, time: 0.0, n_rings: 1 };
        shots.edges().iter().map(|edge| edge.at[1].atan2(edge.at[0]) / STEP_RAD).collect()
    }

    /// A jump was once found twice, the second time half a shot earlier: all cameras seemed to be turned by a quarter of a shot.
    #[test]
    fn an_outline_is_midway_between_the_shots_of_its_sides() {
        for far_first in [false, true] {
            let mut range_m = [5.0, 5.0, 5.0, 5.0, 20.0, 20.0, 20.0, 20.0];
            let mut mixed = [5.0, 5.0, 5.0, 11.0, 20.0, 20.0, 20.0, 20.0];
            if far_first {
                range_m.reverse();
                mixed.reverse();
            }
            let [sharp, between] = [range_m, mixed].map(|range_m| edges_of(&range_m));
            assert!(sharp.len() == 1 && (sharp[0] - 3.5).abs() < 0.01, "{sharp:?}");
            let middle = if far_first { 4.0 } else { 3.0 };
            assert!(between.len() == 1 && (between[0] - middle).abs() < 0.01, "{between:?}");
        }
        assert!(edges_of(&[5.0; 8]).is_empty());
    }
}
