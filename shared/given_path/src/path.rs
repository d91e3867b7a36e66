//! The path of the body, with its deviations.

use crate::clock::TimeLine;
use crate::decode::{self, RawPath};
use crate::frame::WorldFrame;
use drive::Drive;
use drive::manifest::TrajectoryEntry;
use files::calendar::text_of_nanos;
use files::problems::FileProblem;
use geometry::{Geodetic, LocalFrame, Pose, Stamp, Trajectory};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Standard deviations of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Towards east, north and up, m.
    pub east_north_up_m: [f64; 3],
    /// Roll, pitch and heading, rad.
    pub roll_pitch_heading_rad: [f64; 3],
}

/// Deviations of a time.
#[derive(Clone, Copy, Debug)]
struct TimedDeviation {
    stamp: Stamp,
    deviation: Deviation,
}

/// Deviations of drive.toml; `None` where it states none.
#[derive(Clone, Copy, Debug)]
struct StatedDeviation {
    east_north_up_m: Option<[f64; 3]>,
    roll_pitch_heading_rad: Option<[f64; 3]>,
}

/// A stretch without poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Last pose before it.
    pub begin: Stamp,
    /// First pose after it.
    pub end: Stamp,
}

/// The path of the body in the world.
#[derive(Clone, Debug)]
pub struct GivenPath {
    file: PathBuf,
    world_from_body: Arc<Trajectory>,
    deviations: Vec<TimedDeviation>,
    /// Where the file states none.
    of_manifest: StatedDeviation,
    local: Option<LocalFrame>,
    max_gap_nanos: i64,
    notes: Vec<String>,
}

impl Gap {
    /// Says why the gap is not interpolated.
    pub(crate) fn refusal(&self, max_gap_s: f64) -> String {
        format!(
            "the path has no poses for {:.2} s from {}; at most {max_gap_s} s are interpolated (trajectory.max_gap_s)",
            self.end.seconds_since(self.begin),
            text_of_nanos(self.begin.0)
        )
    }
}

impl GivenPath {
    /// Reads the path that a drive names; `None` if it names none.
    pub fn from_drive(drive: &Drive) -> Option<Result<Self, FileProblem>> {
        let entry = drive.manifest().trajectory.as_ref()?;
        let origin = drive.manifest().gnss.as_ref().and_then(|gnss| {
            let [latitude, longitude, height] = gnss.origin;
            Geodetic::new(latitude, longitude, height)
        });
        Some(Self::read(drive.folder(), entry, start_of(drive), origin))
    }

    /// Reads the path of an entry. `reference` is a stamp of the drive, `origin` the origin of its world.
    pub fn read(
        folder: &Path,
        entry: &TrajectoryEntry,
        reference: Option<Stamp>,
        origin: Option<Geodetic>,
    ) -> Result<Self, FileProblem> {
        let raw = decode::read(folder, entry)?;
        let file = folder.join(&entry.file);
        let fault = |rule: String| FileProblem::for_file(&file, rule);
        let line = TimeLine::new(&raw, entry, reference).map_err(fault)?;
        let frame = WorldFrame::new(&raw, entry, origin).map_err(fault)?;
        let stamps = line.stamps(raw.poses.iter().map(|pose| pose.time));
        let reference_from_body = entry
            .body_from_reference
            .to_pose()
            .map_or_else(Pose::identity, |body_from_reference| body_from_reference.inverse());
        let mut world_from_body = Trajectory::default();
        let mut n_repeated = 0;
        for (index, (stamp, pose)) in stamps.iter().zip(&raw.poses).enumerate() {
            let at = |rule: String| fault(format!("{} {}: {rule}", raw.unit, raw.first + index));
            let pose = frame.world_from_reference(pose).map_err(at)? * reference_from_body;
            match world_from_body.poses().last() {
                Some((last, _)) if stamp < last => {
                    return Err(at(format!("time {stamp} is before the time of the previous pose, {last}")));
                }
                Some((last, before)) if stamp == last => {
                    let off_m = (before.translation.vector - pose.translation.vector).norm();
                    if off_m > MAX_REPEATED_M || before.rotation.angle_to(&pose.rotation) > MAX_REPEATED_RAD {
                        return Err(at(format!("time {stamp} stands twice with poses {off_m:.3} m apart")));
                    }
                    n_repeated += 1;
                }
                _ => {
                    world_from_body.push(*stamp, pose);
                }
            }
        }
        let mut notes = raw.notes.clone();
        if n_repeated > 0 {
            notes.push(format!("{n_repeated} repeated poses are skipped"));
        }
        let path = Self {
            world_from_body: Arc::new(world_from_body),
            deviations: deviations(&raw, &line).map_err(fault)?,
            of_manifest: StatedDeviation {
                east_north_up_m: entry.deviation_m,
                roll_pitch_heading_rad: entry.deviation_deg.map(|deg| deg.map(f64::to_radians)),
            },
            local: frame.local,
            max_gap_nanos: (entry.max_gap_s * 1e9) as i64,
            notes,
            file,
        };
        Ok(path)
    }

    /// Whether the file or the manifest states all standard deviations.
    pub fn states_deviations(&self) -> bool {
        let StatedDeviation { east_north_up_m, roll_pitch_heading_rad } = self.of_manifest;
        !self.deviations.is_empty() || (east_north_up_m.is_some() && roll_pitch_heading_rad.is_some())
    }

    /// The file of the poses.
    pub fn file(&self) -> &Path {
        &self.file
    }
    /// Poses of the body in the world, in the order of their times.
    pub fn trajectory(&self) -> &Arc<Trajectory> {
        &self.world_from_body
    }
    /// The world frame on the Earth; `None` if the path is not georeferenced.
    pub fn local_frame(&self) -> Option<&LocalFrame> {
        self.local.as_ref()
    }
    /// What was skipped while reading.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
    /// Times of the first and last pose.
    pub fn span(&self) -> [Stamp; 2] {
        let poses = self.world_from_body.poses();
        [poses[0].0, poses[poses.len() - 1].0]
    }
    /// The interpolated pose; `None` outside the path.
    pub fn at(&self, stamp: Stamp) -> Option<Pose> {
        self.world_from_body.at(stamp)
    }
    /// The first gap that is longer than allowed and overlaps a time.
    pub fn gap_in(&self, begin: Stamp, end: Stamp) -> Option<Gap> {
        let poses = self.world_from_body.poses();
        let first = poses.partition_point(|(stamp, _)| *stamp <= begin).saturating_sub(1);
        let pairs = poses[first..].windows(2).take_while(|pair| pair[0].0 < end);
        pairs
            .map(|pair| Gap { begin: pair[0].0, end: pair[1].0 })
            .find(|gap| gap.end.0 - gap.begin.0 > self.max_gap_nanos)
    }
    /// A number that changes with any pose, any standard deviation and the origin.
    pub fn fingerprint(&self) -> u64 {
        // As FNV-1a, with words of 64 bits instead of bytes.
        let mix = |hash: u64, bits: u64| (hash ^ bits).wrapping_mul(0x0000_0100_0000_01b3);
        let mix_all = |hash: u64, values: &[f64]| values.iter().fold(hash, |hash, value| mix(hash, value.to_bits()));
        let of_poses = self.world_from_body.poses().iter().fold(0xcbf2_9ce4_8422_2325, |hash, (stamp, pose)| {
            let t = pose.translation.vector;
            let q = pose.rotation.coords;
            mix_all(mix(hash, stamp.0 as u64), &[t.x, t.y, t.z, q.x, q.y, q.z, q.w])
        });
        let mix_deviation = |hash: u64, deviation: &Deviation| {
            mix_all(mix_all(hash, &deviation.east_north_up_m), &deviation.roll_pitch_heading_rad)
        };
        let of_file = self
            .deviations
            .iter()
            .fold(of_poses, |hash, timed| mix_deviation(mix(hash, timed.stamp.0 as u64), &timed.deviation));
        let hash = mix_deviation(of_file, &self.without_file());
        self.local
            .as_ref()
            .map(LocalFrame::origin)
            .map_or(hash, |origin| mix_all(hash, &[origin.latitude_deg, origin.longitude_deg, origin.altitude_m]))
    }
    /// The reason why a time is not covered.
    pub fn covers(&self, begin: Stamp, end: Stamp) -> Result<(), String> {
        let [first, last] = self.span();
        if begin < first || end > last {
            let text = |stamp: Stamp| text_of_nanos(stamp.0);
            return Err(format!(
                "the path covers {} to {} and not {} to {}; export the whole drive, or set acquire.start_s and acquire.end_s",
                text(first),
                text(last),
                text(begin),
                text(end)
            ));
        }
        self.gap_in(begin, end).map_or(Ok(()), |gap| Err(gap.refusal(self.max_gap_s())))
    }
    /// Standard deviations where the file states none: of drive.toml, otherwise [`ASSUMED_M`] and [`ASSUMED_DEG`].
    fn without_file(&self) -> Deviation {
        let StatedDeviation { east_north_up_m, roll_pitch_heading_rad } = self.of_manifest;
        Deviation {
            east_north_up_m: east_north_up_m.unwrap_or([ASSUMED_M; 3]),
            roll_pitch_heading_rad: roll_pitch_heading_rad.unwrap_or([ASSUMED_DEG.to_radians(); 3]),
        }
    }
    /// Standard deviations at a time: of the file, interpolated; otherwise of drive.toml, or assumed.
    pub fn deviation_at(&self, stamp: Stamp) -> Deviation {
        let after = self.deviations.partition_point(|timed| timed.stamp < stamp);
        let near = [after.checked_sub(1), Some(after)].map(|index| index.and_then(|index| self.deviations.get(index)));
        match near {
            [Some(a), Some(b)] => {
                let share = stamp.seconds_since(a.stamp) / b.stamp.seconds_since(a.stamp);
                let mix = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| a[axis] + (b[axis] - a[axis]) * share);
                Deviation {
                    east_north_up_m: mix(a.deviation.east_north_up_m, b.deviation.east_north_up_m),
                    roll_pitch_heading_rad: mix(a.deviation.roll_pitch_heading_rad, b.deviation.roll_pitch_heading_rad),
                }
            }
            [Some(only), None] | [None, Some(only)] => only.deviation,
            [None, None] => self.without_file(),
        }
    }
    /// The length of the longest interpolated gap, s.
    pub fn max_gap_s(&self) -> f64 {
        self.max_gap_nanos as f64 * 1e-9
    }
}

/// Standard deviations of a path that states none, m and degrees: a solution with gaps in streets. See
/// `docs/reference/drive_folder.md`.
pub const ASSUMED_M: f64 = 0.1;
/// See [`ASSUMED_M`].
pub const ASSUMED_DEG: f64 = 0.1;

/// Poses of the same time that differ by less are the same pose: the resolution of text exports.
const MAX_REPEATED_M: f64 = 0.001;
const MAX_REPEATED_RAD: f64 = 1e-4;

fn deviations(raw: &RawPath, line: &TimeLine) -> Result<Vec<TimedDeviation>, String> {
    let stamps = line.stamps(raw.deviations.iter().map(|deviation| deviation.time));
    if let Some(at) = stamps.windows(2).position(|pair| pair[1] < pair[0]) {
        return Err(format!("standard deviation {}: time {} is before the previous one", at + 1, stamps[at + 1]));
    }
    let timed = |(stamp, raw): (&Stamp, &decode::RawDeviation)| TimedDeviation {
        stamp: *stamp,
        deviation: Deviation {
            east_north_up_m: raw.east_north_up_m,
            roll_pitch_heading_rad: raw.roll_pitch_heading_rad,
        },
    };
    let mut timed: Vec<TimedDeviation> = stamps.iter().zip(&raw.deviations).map(timed).collect();
    timed.dedup_by_key(|timed| timed.stamp);
    Ok(timed)
}

/// Time of the first sweep of a drive; `None` if its recordings cannot be read, which `acquire` reports.
pub(crate) fn start_of(drive: &Drive) -> Option<Stamp> {
    let of_clouds = drive.sweep_stamps().first().copied();
    of_clouds.or_else(|| Some(drive.sweeps().ok()?.next_sweep(|_| ()).ok()??.stamp))
}
