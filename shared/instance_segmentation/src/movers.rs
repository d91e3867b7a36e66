//! Movers: tracks of blobs that change their position. They unite the pieces of the path of one moving object.

use crate::blobs::{Blob, Blobs};
use crate::candidates::Candidate;
use crate::object::{Motion, Object, Waypoint, united};
use crate::rays::{Rays, Sight};
use crate::sets::{SetNumbers, Sets};
use crate::settings::Kind;
use crate::top_view::TopView;
use crate::tracks::{Track, follow};
use messages::SubmapPoint;

/// A moving track has at least this many lengths of a typical object. The pieces of a shorter path overlap.
const MIN_LENGTHS: f64 = 1.0;

/// A track moves if `slam_aggregate` has marked at least this share of its points. In the narrow view of a tilted LiDAR, one
/// car after another appears at the same position; their tracks must not unite anything.
const MARKED_SHARE: f64 = 0.2;

/// Another track has at least this many blobs: its velocity is known, and blobs of different objects rarely follow one another as often.
const MIN_BLOBS: usize = 4;

/// It moves if at least this many times a sweep before or after the object sees free space at one of its places, and more often
/// than it sees something there.
const FREE_SIGHTS: u32 = 3;

/// Distance beyond its length, m, that an object must be from one of its places before the place is examined.
const CLEARANCE_M: f64 = 1.0;

/// The center of an object is behind the side that the LiDAR sees, at this share of its length.
const INSIDE_LENGTHS: f64 = 0.15;

/// Tracks of one object overlap in time or are separated by at most this time, ns.
const MAX_PAUSE_NANOS: i64 = 500_000_000;

/// A piece belongs to a mover that has at least this share of its points.
const SHARE_OF_PIECE: f64 = 0.5;

/// Another piece belongs to a mover if this share of its points is, each at its time, within this many lengths of the center of the mover.
const SHARE_ON_PATH: f64 = 0.8;
const REACH_LENGTHS: f64 = 0.6;

/// The moving objects of a class.
#[derive(Default)]
pub(crate) struct Movers {
    /// The points of movers, sorted by index.
    points: Vec<MoverPoint>,
    motions: Vec<Motion>,
    paths: Vec<Path>,
    /// Number of the mover of each path.
    mover_of_path: Vec<u32>,
    /// Largest distance of its points from its center, m.
    reach_m: f64,
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
        rays: &Rays<'_>,
        candidates: &[Candidate],
        link_m: f64,
        kind: &Kind,
    ) -> Self {
        if kind.max_speed_mps == 0.0 {
            return Self::default();
        }
        let blobs = Blobs::from_candidates(view, points, candidates, link_m);
        let mut tracks = follow(&blobs.all, kind);
        let is_mover = |track: &Track| {
            let proven = || track.blobs.len() >= MIN_BLOBS && leaves_free_space(track, &blobs, view, rays, kind);
            way_m(track, &blobs) >= MIN_LENGTHS * kind.length_m
                && (marked_share(track, &blobs) >= MARKED_SHARE || proven())
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
        let points = candidates.iter().zip(&blobs.of_candidate).filter_map(mover_point).collect();
        Self { points, motions, paths, mover_of_path: numbers, reach_m: REACH_LENGTHS * kind.length_m }
    }

    /// Unites the objects of each mover.
    pub(crate) fn unite(
        &self,
        objects: &mut Vec<Object>,
        points: &[SubmapPoint],
        time_of: impl Fn(&SubmapPoint) -> i64,
    ) {
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
            let Some((largest, &n)) = largest else { return };
            let has_blobs = n > 0 && n as f64 >= SHARE_OF_PIECE * object.points.len() as f64;
            let on_path = || self.mover_along(object, points, &time_of);
            if let Some(mover) = if has_blobs { Some(largest) } else { on_path() } {
                object.motion = Some(self.motions[mover]);
                sets.union(*first_piece[mover].get_or_insert(idx), idx);
            }
        }
        *objects = united(std::mem::take(objects), &mut sets);
    }
}

impl Movers {
    /// The mover on whose path the points of a piece are.
    fn mover_along(
        &self,
        object: &Object,
        points: &[SubmapPoint],
        time_of: impl Fn(&SubmapPoint) -> i64,
    ) -> Option<usize> {
        let is_along = |path: &Path| {
            let is_at = |&point_idx: &u32| {
                let point = &points[point_idx as usize];
                let [x, y] = path.at(time_of(point));
                (f64::from(point.x) - x).hypot(f64::from(point.y) - y) <= self.reach_m
            };
            let is_then = object.begin_nanos <= path.end_nanos().saturating_add(MAX_PAUSE_NANOS)
                && path.begin_nanos() <= object.end_nanos.saturating_add(MAX_PAUSE_NANOS);
            let n_at = || object.points.iter().filter(|idx| is_at(idx)).count();
            is_then && n_at() as f64 >= SHARE_ON_PATH * object.points.len() as f64
        };
        let path = self.paths.iter().position(is_along)?;
        Some(self.mover_of_path[path] as usize)
    }
}

/// Share of the points that are marked as moving.
fn marked_share(track: &Track, blobs: &Blobs) -> f64 {
    let sum =
        |count: fn(&Blob) -> u32| -> f64 { track.blobs.iter().map(|&idx| f64::from(count(&blobs.all[idx]))).sum() };
    sum(|blob| blob.n_marked) / sum(|blob| blob.n_points)
}

/// Whether the places of an object were free before or after it.
fn leaves_free_space(track: &Track, blobs: &Blobs, view: &TopView, rays: &Rays<'_>, kind: &Kind) -> bool {
    if view.terrain_m.is_none() {
        return false;
    }
    let path = Path::from_track(track, blobs);
    let sweeps: Vec<i64> = rays.sweep_nanos().collect();
    let mut n_free = 0;
    let mut n_occupied = 0;
    for &Waypoint { nanos, center } in &path.centers {
        let Some(cell) = view.grid.cell(center[0], center[1]) else { continue };
        let ground_m = view.terrain_m.as_ref().map_or(0.0, |terrain| f64::from(terrain[cell]));
        let Some(own) = (0..sweeps.len()).min_by_key(|&sweep| sweeps[sweep].abs_diff(nanos)) else { continue };
        let lidar = rays.lidar_at(own);
        let behind = [center[0] - lidar[0], center[1] - lidar[1]];
        let range_m = behind[0].hypot(behind[1]).max(f64::MIN_POSITIVE);
        let inside = [0, 1].map(|axis| center[axis] + INSIDE_LENGTHS * kind.length_m * behind[axis] / range_m);
        for (sweep, &then) in sweeps.iter().enumerate() {
            let elsewhere = path.at(then);
            if (elsewhere[0] - center[0]).hypot(elsewhere[1] - center[1]) >= kind.length_m + CLEARANCE_M {
                match rays.sight(sweep, inside, ground_m) {
                    Sight::Free => n_free += 1,
                    Sight::Occupied => n_occupied += 1,
                    Sight::Unknown => {}
                }
            }
        }
    }
    n_free >= FREE_SIGHTS && n_free > n_occupied
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

/// The constant velocity that fits the centers best, m/s.
fn velocity_of(centers: &[Waypoint]) -> [f64; 2] {
    let Some(first) = centers.first() else { return [0.0; 2] };
    let seconds = |c: &Waypoint| (c.nanos - first.nanos) as f64 * 1e-9;
    let mean_s = centers.iter().map(seconds).sum::<f64>() / centers.len() as f64;
    let spread: f64 = centers.iter().map(|c| (seconds(c) - mean_s).powi(2)).sum();
    [0, 1].map(|axis| {
        let sum: f64 = centers.iter().map(|c| (seconds(c) - mean_s) * c.center[axis]).sum();
        if spread > 0.0 { sum / spread } else { 0.0 }
    })
}

impl Path {
    fn from_track(track: &Track, blobs: &Blobs) -> Self {
        let waypoint = |&blob: &usize| Waypoint { nanos: blobs.all[blob].nanos, center: blobs.all[blob].center };
        let centers: Vec<Waypoint> = track.blobs.iter().map(waypoint).collect();
        let velocity = velocity_of(&centers);
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
            [after.saturating_sub(1), after].into_iter().min_by_key(|&idx| self.centers[idx].nanos.abs_diff(nanos));
        let Waypoint { nanos: at, center } = self.centers[nearest.unwrap_or(after)];
        let seconds = nanos.saturating_sub(at) as f64 * 1e-9;
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

/// Time over which the last velocity of a mover is measured, ns: vehicles accelerate.
const LATEST_NANOS: i64 = 1_000_000_000;

/// Motion of a mover with these paths: the velocity is taken from the end of the path with most blobs.
fn motion<'a>(paths: impl Iterator<Item = &'a Path> + Clone) -> Option<Motion> {
    let first = paths.clone().min_by_key(|path| path.begin_nanos())?.centers.first()?;
    let last = paths.clone().max_by_key(|path| path.end_nanos())?.centers.last()?;
    let longest = paths.max_by_key(|path| path.centers.len())?;
    let begin = longest.centers.partition_point(|center| longest.end_nanos() - center.nanos > LATEST_NANOS);
    // Two centers that are near one another give no velocity.
    let latest = &longest.centers[begin.min(longest.centers.len().saturating_sub(MIN_BLOBS))..];
    let velocity = velocity_of(latest);
    Some(Motion { first: *first, last: *last, velocity })
}
