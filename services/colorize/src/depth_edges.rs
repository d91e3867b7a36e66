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

/// Of a jump the same way so many shots from another on the ring, nobody knows which the image shows: bars of a fence, leaves. Nearer ones are of
/// the same outline.
const REGULAR: std::ops::RangeInclusive<usize> = 3..=10;

/// Places where neighboring rings meet one outline are at most so far apart, in ranges: twice the rings of a sensor of 16 over 30 degrees.
const MAX_LINK: f32 = 0.08;

/// An outline runs across the rings by 30 degrees and more: of the square of the way between two of them, so much lies along the ring at most.
const MAX_ALONG: f32 = 0.75;

/// How far the middle may be off a straight outline, in lengths of it: two places on other things are farther.
const MAX_BEND: f32 = 0.15;

/// A place where depth jumps between two neighboring shots.
#[derive(Clone, Copy, Debug)]
pub struct DepthEdge {
    /// On the outline, which is taken to be midway between the two shots, m, submap frame.
    pub at: [f32; 3],
    /// From the near shot's direction toward the far one's, m at the range of the near side: one step of the scan.
    pub across: [f32; 3],
    /// Range of the near side from the sensor, m.
    pub range_m: f32,
    /// Along the outline, from where the ring below meets it to where the ring above does, m.
    pub outline: [f32; 3],
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
        let by_ring: Vec<Vec<Jump>> = self.by_ring().iter().map(|shots| self.jumps(shots)).collect();
        let ring = |ring: Option<usize>| ring.and_then(|ring| by_ring.get(ring)).map_or(&[][..], Vec::as_slice);
        let linked = |(i, jumps): (usize, &Vec<Jump>)| -> Vec<DepthEdge> {
            let [below, above] = [ring(i.checked_sub(1)), ring(Some(i + 1))];
            jumps.iter().filter_map(|jump| jump.linked(below, above)).collect()
        };
        by_ring.iter().enumerate().flat_map(linked).collect()
    }

    /// Those of one ring.
    fn jumps(&self, shots: &[Shot<'_>]) -> Vec<Jump> {
        let ways: Vec<Option<bool>> =
            shots.windows(2).map(|pair| near_first(pair[0].range_m, pair[1].range_m)).collect();
        let is_alone = |at: usize, jump: &Jump| {
            let is_other = |at: Option<usize>| at.and_then(|at| *ways.get(at)?) == Some(jump.near_first);
            !REGULAR.clone().any(|by| is_other(at.checked_sub(by)) || is_other(at.checked_add(by)))
        };
        let mut jumps = Vec::new();
        for (before, five) in shots.windows(5).enumerate() {
            let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|i| five[i]);
            let mut add = |jump: Option<Jump>| jumps.extend(jump.filter(|jump| is_alone(before + 1, jump)));
            add(self.jump([a, b, c, d]));
            // A beam that meets both sides is measured in between. One that is of a side is none such: the same jump, taken for half
            // a shot earlier, would draw all outlines against the scan.
            if is_between([b, c, d].map(|shot| shot.range_m)) {
                add(self.jump([a, b, d, e]));
            }
        }
        jumps
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

    /// The jump in the middle of four neighbors, if there is one between two smooth sides.
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
        let (eye, ray) = self.ray(points[near]);
        let far_at_near = self.ray(points[far]).1.map(|v| v * near_m / range_m[far]);
        let across = [0, 1, 2].map(|i| far_at_near[i] - ray[i]);
        // The near surface goes on to the outline as it came.
        let before = if near == 1 { 0 } else { 2 };
        let n_steps = 0.5 * f32::from(step(1)) / f32::from(step(before).max(1));
        let inner_m = range_m[if near == 1 { 0 } else { 3 }];
        let growth = 1.0 + n_steps * (near_m - inner_m) / near_m;
        Some(Jump {
            at: [0, 1, 2].map(|i| eye[i] + growth * (ray[i] + 0.5 * across[i])),
            across,
            range_m: near_m,
            near_first,
            time: self.time + points[near].offset_nanos as f32 * 1e-9,
        })
    }

    /// Where the sensor was, m, submap frame.
    fn eye(&self, offset_nanos: u32) -> [f32; 3] {
        let share = offset_nanos as f32 / self.sweep.duration_nanos.max(1) as f32;
        let (a, b) = (&self.sweep.submap_from_lidar_begin, &self.sweep.submap_from_lidar_end);
        [0, 1, 2].map(|i| a[i] + share * (b[i] - a[i]))
    }
}

/// A jump on its ring; see [`DepthEdge`].
struct Jump {
    at: [f32; 3],
    across: [f32; 3],
    range_m: f32,
    near_first: bool,
    time: f32,
}

impl Jump {
    /// With the direction of its outline, if the ring below or that above meets it, too, and a straight one if both do.
    fn linked(&self, below: &[Jump], above: &[Jump]) -> Option<DepthEdge> {
        let (below, above) = (self.nearest(below), self.nearest(above));
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

    /// Where another ring meets the same outline: the nearest place at the same side of something as far away.
    fn nearest(&self, ring: &[Jump]) -> Option<[f32; 3]> {
        let alike =
            ring.iter().filter(|other| other.near_first == self.near_first && is_smooth(self.range_m, other.range_m));
        let ways = alike.map(|other| (minus(other.at, self.at), other.at));
        let (way, at) = ways.min_by(|(a, _), (b, _)| dot(*a, *a).total_cmp(&dot(*b, *b)))?;
        let along_ring = dot(way, self.across).powi(2) / dot(self.across, self.across);
        let is_near = dot(way, way) < (MAX_LINK * self.range_m).powi(2);
        (is_near && along_ring < MAX_ALONG * dot(way, way)).then_some(at)
    }
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Of two neighbors between which depth jumps, whether the first is the near one.
fn near_first(a: f32, b: f32) -> Option<bool> {
    let near = a.min(b);
    ((a - b).abs() > JUMP_M + JUMP_SHARE * near).then_some(a < b)
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

    const STEP_RAD: f32 = 0.2 * std::f32::consts::PI / 180.0;

    /// Between rings, shots.
    const RING_STEPS: f32 = 5.0;

    /// The edges of rings with shots 0.2 degrees apart, given by their ranges.
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

    /// Direction of an edge along its ring, shots from the first.
    fn place(edge: &DepthEdge) -> f32 {
        edge.at[1].atan2(edge.at[0]) / STEP_RAD
    }

    /// A jump was once found twice, the second time half a shot earlier: all cameras seemed to be turned by a quarter of a shot.
    #[test]
    fn an_outline_is_midway_between_the_shots_of_its_sides() {
        for far_first in [false, true] {
            let mut range_m = vec![5.0, 5.0, 5.0, 5.0, 20.0, 20.0, 20.0, 20.0];
            let mut mixed = vec![5.0, 5.0, 5.0, 11.0, 20.0, 20.0, 20.0, 20.0];
            if far_first {
                range_m.reverse();
                mixed.reverse();
            }
            let [sharp, between] = [range_m, mixed].map(|range_m| edges_of(&[range_m.clone(), range_m]));
            assert!(sharp.len() == 2 && sharp.iter().all(|edge| (place(edge) - 3.5).abs() < 0.01), "{sharp:?}");
            let middle = if far_first { 4.0 } else { 3.0 };
            assert!(
                between.len() == 2 && between.iter().all(|edge| (place(edge) - middle).abs() < 0.01),
                "{between:?}"
            );
        }
        assert!(edges_of(&[vec![5.0; 8], vec![5.0; 8]]).is_empty());
    }

    #[test]
    fn an_outline_runs_from_ring_to_ring_and_the_near_surface_goes_on_to_it() {
        // Each ring's last near shot is two later than that of the ring below; the surface recedes by 4 cm from shot to shot.
        let ring = |n_near: usize| (0..14).map(|i| if i < n_near { 5.0 + 0.04 * i as f32 } else { 20.0 }).collect();
        let edges = edges_of(&[ring(5), ring(7), ring(9)]);
        assert_eq!(edges.len(), 3);
        for (edge, n_near) in edges.iter().zip([5, 7, 9]) {
            let [_, y, z] = edge.outline;
            assert!((y / z - 2.0 / RING_STEPS).abs() < 0.02, "{edge:?}");
            let range_m = edge.at.iter().map(|v| v * v).sum::<f32>().sqrt();
            assert!((range_m - (5.0 + 0.04 * (n_near as f32 - 0.5))).abs() < 1e-3, "{edge:?}");
        }
        // One ring alone does not tell, nor do two that meet different things.
        assert!(edges_of(&[ring(5)]).is_empty() && edges_of(&[ring(2), ring(12)]).is_empty());
    }
}
