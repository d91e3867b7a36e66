//! Movers: tracks of blobs that change their position. They unite the pieces of the path of one moving object.

use crate::blobs::{Blob, Blobs};
use crate::candidates::Candidate;
use crate::object::{Motion, Object, Waypoint, united};
use crate::sets::{SetNumbers, Sets};
use crate::settings::Kind;
use crate::top_view::TopView;
use crate::tracks::{Track, follow};
use messages::{POINT_DYNAMIC, SubmapPoint};

/// A track moves if `slam_aggregate` has marked at least this share of its points, and its length is at least this many
/// lengths of a typical object. The pieces of a shorter path overlap. In the narrow view of a tilted LiDAR, one car
/// after another appears at the same position; their tracks must not unite anything.
const MARKED_SHARE: f64 = 0.2;
const MARKED_LENGTHS: f64 = 1.0;

/// If no point of the submap is marked, a track moves if its length is at least this many object lengths, which is
/// farther than the visible part of a static object can shift.
const UNMARKED_LENGTHS: f64 = 2.0;

/// Tracks of one object overlap in time or are separated by at most this time, ns.
const MAX_PAUSE_NANOS: i64 = 500_000_000;

/// A piece belongs to a mover that has at least this share of its points.
const SHARE_OF_PIECE: f64 = 0.5;

/// The moving objects of a class.
pub(crate) struct Movers {
    /// The points of movers, sorted by index.
    points: Vec<MoverPoint>,
    motions: Vec<Motion>,
}

/// A point of a mover.
struct MoverPoint {
    point_idx: u32,
    /// Number of the mover.
    mover: u32,
}

impl Movers {
    pub(crate) fn detect(
        view: &TopView,
        points: &[SubmapPoint],
        candidates: &[Candidate],
        link_m: f64,
        kind: &Kind,
    ) -> Self {
        if kind.max_speed_mps == 0.0 {
            return Self { points: Vec::new(), motions: Vec::new() };
        }
        let blobs = Blobs::from_candidates(view, points, candidates, link_m);
        let mut tracks = follow(&blobs.all, kind.max_speed_mps);
        let is_marked = points.iter().any(|point| point.flags & POINT_DYNAMIC != 0);
        let is_mover = |track: &Track| {
            let lengths = way_m(track, &blobs) / kind.length_m;
            let is_marked_track = marked_share(track, &blobs) >= MARKED_SHARE && lengths >= MARKED_LENGTHS;
            if is_marked { is_marked_track } else { lengths >= UNMARKED_LENGTHS }
        };
        tracks.retain(is_mover);
        let paths: Vec<Path> = tracks.iter().map(|track| Path::from_track(track, &blobs)).collect();
        let mut sets = Sets::new(tracks.len());
        for (a, path) in paths.iter().enumerate() {
            for (b, other) in paths.iter().enumerate().skip(a + 1) {
                if path.belongs_to(other, kind) {
                    sets.union(a, b);
                }
            }
        }
        let SetNumbers { by_member: numbers, n } = sets.numbers();
        let motions = (0..n as u32).filter_map(|mover| {
            motion(paths.iter().zip(&numbers).filter(|(_, number)| **number == mover).map(|(path, _)| path))
        });
        let motions = motions.collect();
        let mut of_blob = vec![None; blobs.all.len()];
        for (track, &number) in tracks.iter().zip(&numbers) {
            track.blobs.iter().for_each(|&blob| of_blob[blob] = Some(number));
        }
        let mover_point = |(candidate, &blob): (&Candidate, &u32)| {
            Some(MoverPoint { point_idx: candidate.point_idx, mover: of_blob[blob as usize]? })
        };
        Self { points: candidates.iter().zip(&blobs.of_candidate).filter_map(mover_point).collect(), motions }
    }

    /// Unites the objects of each mover.
    pub(crate) fn unite(&self, objects: &mut Vec<Object>) {
        let mut sets = Sets::new(objects.len());
        let mut first_piece = vec![None; self.motions.len()];
        let mut n_of_mover = vec![0_usize; self.motions.len()];
        for (idx, object) in objects.iter_mut().enumerate() {
            n_of_mover.fill(0);
            for point in &object.points {
                if let Ok(found) = self.points.binary_search_by_key(point, |mover_point| mover_point.point_idx) {
                    n_of_mover[self.points[found].mover as usize] += 1;
                }
            }
            let largest = n_of_mover.iter().enumerate().max_by_key(|(mover, n)| (**n, std::cmp::Reverse(*mover)));
            let Some((mover, &n)) = largest else { return };
            if n > 0 && n as f64 >= SHARE_OF_PIECE * object.points.len() as f64 {
                object.motion = Some(self.motions[mover]);
                sets.union(*first_piece[mover].get_or_insert(idx), idx);
            }
        }
        *objects = united(std::mem::take(objects), &mut sets);
    }
}

/// Share of the points that are marked as moving.
fn marked_share(track: &Track, blobs: &Blobs) -> f64 {
    let sum =
        |count: fn(&Blob) -> u32| -> f64 { track.blobs.iter().map(|&idx| f64::from(count(&blobs.all[idx]))).sum() };
    sum(|blob| blob.n_marked) / sum(|blob| blob.n_points)
}

/// Distance between the first and the last center, m.
fn way_m(track: &Track, blobs: &Blobs) -> f64 {
    let center = |idx: usize| blobs.all[idx].center;
    let first = center(track.blobs[0]);
    let last = center(track.blobs[track.blobs.len() - 1]);
    (last[0] - first[0]).hypot(last[1] - first[1])
}

/// The path of a track: centers of its blobs, and the velocity that fits them best.
struct Path {
    /// Centers in time order.
    centers: Vec<Waypoint>,
    velocity: [f64; 2],
}

impl Path {
    fn from_track(track: &Track, blobs: &Blobs) -> Self {
        let waypoint = |&blob: &usize| Waypoint { nanos: blobs.all[blob].nanos, center: blobs.all[blob].center };
        let centers: Vec<Waypoint> = track.blobs.iter().map(waypoint).collect();
        let n = centers.len() as f64;
        let mean_s = centers.iter().map(|c| c.nanos as f64 * 1e-9).sum::<f64>() / n;
        let spread: f64 = centers.iter().map(|c| (c.nanos as f64 * 1e-9 - mean_s).powi(2)).sum();
        let slope = |axis: usize| {
            let sum: f64 = centers.iter().map(|c| (c.nanos as f64 * 1e-9 - mean_s) * c.center[axis]).sum();
            if spread > 0.0 { sum / spread } else { 0.0 }
        };
        let velocity = [slope(0), slope(1)];
        Self { centers, velocity }
    }

    fn begin_nanos(&self) -> i64 {
        self.centers[0].nanos
    }

    fn end_nanos(&self) -> i64 {
        self.centers[self.centers.len() - 1].nanos
    }

    /// Position at a time: from the nearest center with the mean velocity.
    fn at(&self, nanos: i64) -> [f64; 2] {
        let after = self.centers.partition_point(|center| center.nanos < nanos).min(self.centers.len() - 1);
        let nearest =
            [after.saturating_sub(1), after].into_iter().min_by_key(|&idx| (self.centers[idx].nanos - nanos).abs());
        let Waypoint { nanos: at, center } = self.centers[nearest.unwrap_or(after)];
        let seconds = (nanos - at) as f64 * 1e-9;
        [center[0] + self.velocity[0] * seconds, center[1] + self.velocity[1] * seconds]
    }

    /// Whether both are tracks of one object: they coincide within its size at one time.
    fn belongs_to(&self, other: &Self, kind: &Kind) -> bool {
        let latest_begin = self.begin_nanos().max(other.begin_nanos());
        let first_end = self.end_nanos().min(other.end_nanos());
        if latest_begin - first_end > MAX_PAUSE_NANOS {
            return false;
        }
        let middle = latest_begin + (first_end - latest_begin) / 2;
        let a = self.at(middle);
        let b = other.at(middle);
        (a[0] - b[0]).hypot(a[1] - b[1]) <= 0.5 * kind.length_m
    }
}

/// Motion of a mover with these paths: the velocity is taken from the path with most blobs.
fn motion<'a>(paths: impl Iterator<Item = &'a Path> + Clone) -> Option<Motion> {
    let first = paths.clone().min_by_key(|path| path.begin_nanos())?.centers.first()?;
    let last = paths.clone().max_by_key(|path| path.end_nanos())?.centers.last()?;
    let velocity = paths.max_by_key(|path| path.centers.len())?.velocity;
    Some(Motion { first: *first, last: *last, velocity })
}
