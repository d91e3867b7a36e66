//! Depth edges: the outlines of objects in LiDAR points, where range jumps between neighboring shots of a ring.

use coloring::{SubmapPoints, seconds};
use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use rayon::prelude::*;

/// Least range jump, m, to which [`JUMP_SHARE`] of the range of the near side is added: more than a curb, less than the
/// length of a car.
const JUMP_M: f32 = 0.5;
const JUMP_SHARE: f32 = 0.1;

/// Largest range difference of two shots on the same side of a jump, m, to which [`SMOOTH_SHARE`] of the range is
/// added. This excludes foliage.
const SMOOTH_M: f32 = 0.1;
const SMOOTH_SHARE: f32 = 0.05;

/// Largest azimuth difference of neighbors on a ring, 0.01 degree: three shots of an HDL-32E at 20 Hz.
const MAX_AZIMUTH_STEP: u16 = 100;

/// Range of distances between jumps in the same direction on a ring, shots, that make them ambiguous in the image: bars
/// of a fence, foliage. Nearer jumps belong to the same outline.
const AMBIGUOUS: std::ops::RangeInclusive<usize> = 3..=10;

/// Largest distance of an outline's jumps on neighboring rings, in ranges: twice the ring spacing of a LiDAR with 16 rings
/// over 30 degrees.
const MAX_LINK: f32 = 0.08;

/// Largest share of the squared distance between two jumps that lies along the ring: an outline crosses the rings at 30
/// degrees or more.
const MAX_ALONG: f32 = 0.75;

/// Largest deviation of the middle jump from a straight outline, in lengths of the outline. Jumps of different objects
/// deviate more.
const MAX_BEND: f32 = 0.15;

/// A jump of range between two neighboring shots of a ring.
#[derive(Clone, Copy, Debug)]
pub struct DepthEdge {
    /// Position on the outline, assumed midway between the two shots, m, submap frame.
    pub at: [f32; 3],
    /// Vector from the direction of the near shot to the direction of the far one, m at the range of the near side: one
    /// step of the scan.
    pub across: [f32; 3],
    /// Range of the near side from the LiDAR, m.
    pub range_m: f32,
    /// Vector along the outline, from its jump on the ring below to its jump on the ring above, m.
    pub outline: [f32; 3],
    /// Time of the shot, s after the submap's first.
    pub time: f32,
}

/// The depth edges of all sweeps that overlap one of the time spans (s after the submap's first shot), without edges of
/// moving objects.
pub fn depth_edges(points: &SubmapPoints<'_>, spans: &[[f32; 2]]) -> Vec<DepthEdge> {
    let of_sweep = |sweep: &SubmapSweep| {
        let begin = seconds(sweep.stamp, points.origin);
        let end = begin + sweep.duration_nanos as f32 * 1e-9;
        if !spans.iter().any(|[from, until]| begin <= *until && end >= *from) {
            return Vec::new();
        }
        let first = sweep.first_point as usize;
        let rows = points.rows.get(first..first + sweep.n_points as usize).unwrap_or_default();
        Shots { points: rows, sweep, time: begin, n_rings: points.rings.get(sweep.lidar) as usize }.edges()
    };
    points.sweeps.par_iter().flat_map_iter(of_sweep).collect()
}

/// The points of a sweep.
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
    /// Distance from the LiDAR, m.
    range_m: f32,
}

impl<'a> Shots<'a> {
    fn edges(&self) -> Vec<DepthEdge> {
        let by_ring: Vec<Vec<Jump>> = self.by_ring().iter().map(|shots| self.jumps(shots)).collect();
        let ring = |ring: Option<usize>| ring.and_then(|ring| by_ring.get(ring)).map_or(&[][..], Vec::as_slice);
        let linked = |(i, jumps): (usize, &Vec<Jump>)| -> Vec<DepthEdge> {
            let [below, above] = [ring(i.checked_sub(1)), ring(Some(i + 1))];
            jumps.iter().filter_map(|jump| jump.linked(below, above)).collect()
        };
        by_ring.iter().enumerate().flat_map(linked).collect()
    }

    /// The jumps of one ring, from its shots in firing order.
    fn jumps(&self, shots: &[Shot<'_>]) -> Vec<Jump> {
        let directions: Vec<Option<bool>> =
            shots.windows(2).map(|pair| near_first(pair[0].range_m, pair[1].range_m)).collect();
        let is_alone = |at: usize, jump: &Jump| {
            let is_other = |at: Option<usize>| at.and_then(|at| *directions.get(at)?) == Some(jump.near_first);
            !AMBIGUOUS.clone().any(|by| is_other(at.checked_sub(by)) || is_other(at.checked_add(by)))
        };
        let mut jumps = Vec::new();
        for (before, five) in shots.windows(5).enumerate() {
            let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|i| five[i]);
            let mut add = |jump: Option<Jump>| jumps.extend(jump.filter(|jump| is_alone(before + 1, jump)));
            add(self.jump([a, b, c, d]));
            // A beam that hits both sides measures a range in between. A shot on one side is not such a mixed shot: the
            // same jump, found half a shot earlier, would shift all outlines against the scan direction.
            if is_between([b, c, d].map(|shot| shot.range_m)) {
                add(self.jump([a, b, d, e]));
            }
        }
        jumps
    }

    /// The shots of each ring in firing order.
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

    /// Origin and vector of a shot, m, submap frame.
    fn ray(&self, point: &SubmapPoint) -> ([f32; 3], [f32; 3]) {
        let origin = self.lidar_position(point.offset_nanos);
        (origin, [point.x - origin[0], point.y - origin[1], point.z - origin[2]])
    }

    /// The jump in the middle of four neighbors, if it is between two smooth sides.
    fn jump(&self, shots: [Shot<'_>; 4]) -> Option<Jump> {
        let range_m = shots.map(|shot| shot.range_m);
        let near_first = near_first(range_m[1], range_m[2])?;
        let (near, far) = if near_first { (1, 2) } else { (2, 1) };
        if !is_smooth(range_m[0], range_m[1]) || !is_smooth(range_m[2], range_m[3]) {
            return None;
        }
        let points = shots.map(|shot| shot.point);
        let step = |i: usize| between(points[i].azimuth, points[i + 1].azimuth);
        if (0..3).any(|i| step(i) > MAX_AZIMUTH_STEP) || points.iter().any(|p| p.flags & POINT_DYNAMIC != 0) {
            return None;
        }
        let near_m = range_m[near];
        let (origin, ray) = self.ray(points[near]);
        let far_at_near = self.ray(points[far]).1.map(|v| v * near_m / range_m[far]);
        let across = [0, 1, 2].map(|i| far_at_near[i] - ray[i]);
        // The near surface is extrapolated to the outline.
        let before = if near == 1 { 0 } else { 2 };
        let n_steps = 0.5 * f32::from(step(1)) / f32::from(step(before).max(1));
        let inner_m = range_m[if near == 1 { 0 } else { 3 }];
        let growth = 1.0 + n_steps * (near_m - inner_m) / near_m;
        Some(Jump {
            at: [0, 1, 2].map(|i| origin[i] + growth * (ray[i] + 0.5 * across[i])),
            across,
            range_m: near_m,
            near_first,
            time: self.time + points[near].offset_nanos as f32 * 1e-9,
        })
    }

    /// Position of the LiDAR at a shot, m, submap frame.
    fn lidar_position(&self, offset_nanos: u32) -> [f32; 3] {
        let share = offset_nanos as f32 / self.sweep.duration_nanos.max(1) as f32;
        let a = &self.sweep.submap_from_lidar_begin;
        let b = &self.sweep.submap_from_lidar_end;
        [0, 1, 2].map(|i| a[i] + share * (b[i] - a[i]))
    }
}

/// A jump on its ring, without the direction of its outline; see [`DepthEdge`].
struct Jump {
    at: [f32; 3],
    across: [f32; 3],
    range_m: f32,
    near_first: bool,
    time: f32,
}

impl Jump {
    /// Adds the direction of the outline, if the ring below or above also has a jump on it. If both rings have one, the
    /// outline must be straight.
    fn linked(&self, below: &[Jump], above: &[Jump]) -> Option<DepthEdge> {
        let below = self.nearest(below);
        let above = self.nearest(above);
        let outline = minus(above.or(below.map(|_| self.at))?, below.unwrap_or(self.at));
        if let (Some(below), Some(above)) = (below, above) {
            let bend = [0, 1, 2].map(|i| 0.5 * (above[i] + below[i]) - self.at[i]);
            if dot(bend, bend) > MAX_BEND * MAX_BEND * dot(outline, outline) {
                return None;
            }
        }
        let &Self { at, across, range_m, time, .. } = self;
        Some(DepthEdge { at, across, range_m, outline, time })
    }

    /// The jump of another ring on the same outline: the nearest one in the same direction at a similar range.
    fn nearest(&self, ring: &[Jump]) -> Option<[f32; 3]> {
        let alike =
            ring.iter().filter(|other| other.near_first == self.near_first && is_smooth(self.range_m, other.range_m));
        let offsets = alike.map(|other| (minus(other.at, self.at), other.at));
        let (offset, at) = offsets.min_by(|(a, _), (b, _)| dot(*a, *a).total_cmp(&dot(*b, *b)))?;
        let along_ring = dot(offset, self.across).powi(2) / dot(self.across, self.across);
        let is_near = dot(offset, offset) < (MAX_LINK * self.range_m).powi(2);
        (is_near && along_ring < MAX_ALONG * dot(offset, offset)).then_some(at)
    }
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// For a range jump between two neighbors: whether the first is the near one.
fn near_first(a: f32, b: f32) -> Option<bool> {
    let near = a.min(b);
    ((a - b).abs() > JUMP_M + JUMP_SHARE * near).then_some(a < b)
}

/// Whether two shots are on one surface.
fn is_smooth(a: f32, b: f32) -> bool {
    (a - b).abs() < SMOOTH_M + SMOOTH_SHARE * a.min(b)
}

/// Whether the second of three neighbors lies between the two sides of a jump, on neither of them.
fn is_between([a, b, c]: [f32; 3]) -> bool {
    !is_smooth(a, b) && !is_smooth(b, c) && (b > a) == (c > b)
}

/// Angle between two azimuths, 0.01 degree.
fn between(a: u16, b: u16) -> u16 {
    let apart = a.abs_diff(b);
    apart.min(36_000_u16.saturating_sub(apart))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_RAD: f32 = 0.2 * std::f32::consts::PI / 180.0;

    /// Distance between rings, in shots.
    const RING_STEPS: f32 = 5.0;

    /// The edges of rings whose shots are 0.2 degrees apart, given by their ranges.
    fn edges_of(rings: &[Vec<f32>]) -> Vec<DepthEdge> {
        let mut points = Vec::new();
        for (ring, range_m) in rings.iter().enumerate() {
            let shot = |(i, range_m): (usize, &f32)| {
                let (y, x) = (i as f32 * STEP_RAD).sin_cos();
                let (z, level) = (ring as f32 * RING_STEPS * STEP_RAD).sin_cos();
                let [x, y, z] = [x * level, y * level, z].map(|v| v * range_m);
                SubmapPoint { x, y, z, azimuth: i as u16 * 20, ring: ring as _, ..SubmapPoint::default() }
            };
            points.extend(range_m.iter().enumerate().map(shot));
        }
        let sweep = SubmapSweep { n_points: points.len() as u32, ..SubmapSweep::default() };
        Shots { points: &points, sweep: &sweep, time: 0.0, n_rings: rings.len() }.edges()
    }

    /// Position of an edge along its ring, shots from the first.
    fn shot_position(edge: &DepthEdge) -> f32 {
        edge.at[1].atan2(edge.at[0]) / STEP_RAD
    }

    /// Regression: a jump was found twice, the second time half a shot earlier: all cameras appeared to be rotated by a
    /// quarter of a shot.
    #[test]
    fn edge_is_midway_between_shots_of_both_sides() {
        for far_first in [false, true] {
            let mut range_m = vec![5.0, 5.0, 5.0, 5.0, 20.0, 20.0, 20.0, 20.0];
            let mut mixed = vec![5.0, 5.0, 5.0, 11.0, 20.0, 20.0, 20.0, 20.0];
            if far_first {
                range_m.reverse();
                mixed.reverse();
            }
            let [sharp, between] = [range_m, mixed].map(|range_m| edges_of(&[range_m.clone(), range_m]));
            assert!(sharp.len() == 2 && sharp.iter().all(|edge| (shot_position(edge) - 3.5).abs() < 0.01), "{sharp:?}");
            let middle = if far_first { 4.0 } else { 3.0 };
            assert!(
                between.len() == 2 && between.iter().all(|edge| (shot_position(edge) - middle).abs() < 0.01),
                "{between:?}"
            );
        }
        assert!(edges_of(&[vec![5.0; 8], vec![5.0; 8]]).is_empty());
    }

    #[test]
    fn outline_follows_rings_and_near_surface_is_extrapolated() {
        // The last near shot of each ring is two shots later than on the ring below. The surface recedes by 4 cm per
        // shot.
        let ring = |n_near: usize| (0..14).map(|i| if i < n_near { 5.0 + 0.04 * i as f32 } else { 20.0 }).collect();
        let edges = edges_of(&[ring(5), ring(7), ring(9)]);
        assert_eq!(edges.len(), 3);
        for (edge, n_near) in edges.iter().zip([5, 7, 9]) {
            let [_, y, z] = edge.outline;
            assert!((y / z - 2.0 / RING_STEPS).abs() < 0.02, "{edge:?}");
            let range_m = edge.at.iter().map(|v| v * v).sum::<f32>().sqrt();
            assert!((range_m - (5.0 + 0.04 * (n_near as f32 - 0.5))).abs() < 1e-3, "{edge:?}");
        }
        // A single ring gives no direction, and neither do two rings that hit different objects.
        assert!(edges_of(&[ring(5)]).is_empty() && edges_of(&[ring(2), ring(12)]).is_empty());
    }
}
