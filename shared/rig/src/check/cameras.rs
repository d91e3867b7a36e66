//! Cameras compared with the outlines of objects in the points.

use super::Verdict;
use super::hypotheses::{Hypothesis, lenses, mountings};
use crate::survey::{PixelBuffer, Survey, decoded};
use camera_alignment::{AlignmentExposure, ExposureProfiles, Offset, OffsetMonitor, Profile, fit_rotation};
use coloring::{PointBuffers, ProjectionCamera, SubmapPoints, VisibilityMap};
use drive::manifest::rules::MAX_DELAY_NANOS;
use drive::{Drive, Frame};
use geometry::Stamp;
use rayon::prelude::*;

/// Largest number of compared exposures of a camera, spread over the drive.
const MAX_EXPOSURES: usize = 24;
/// Limits of offset and delay, as in `colorize` (`max_offset_mrad`, `max_delay_ms`): 10 cm at 20 m.
const MAX_OFFSET_RAD: f32 = 5e-3;
const MAX_DELAY_S: f32 = 5e-3;
/// Time before and after an exposure at which its pose is evaluated to determine how a delay moves edges, ns.
const SHIFT_NANOS: i64 = 20_000_000;
/// Least height of the peak of another hypothesis, in standard deviations of the score of random positions. The highest
/// peak of many wrong hypotheses is higher than the peak of a single one.
const MIN_PEAK: f32 = 14.0;
/// Least margin over the peak of the stated camera.
const MIN_GAIN: f32 = 4.0;
/// Tested common delays of all cameras if nothing fits, ns: to both sides, in steps that the search bridges.
const DELAY_STEP_NANOS: i64 = 100_000_000;
const MAX_DELAY_STEPS: i64 = 20;
/// Offsets between time scales, s.
const SCALES_S: [i64; 4] = [-37, -18, 18, 37];
/// Offsets of all cameras as stated, and the compared exposures.
pub struct CameraScores<'a> {
    drive: &'a Drive,
    survey: &'a Survey,
    /// Exposures per camera.
    frames: Vec<Vec<&'a Frame>>,
    /// Common offset from all profiles.
    pub offset: Offset,
    /// Peaks of the stated cameras without delay, comparable to the peaks of the hypotheses.
    peaks: Vec<f32>,
}

impl<'a> CameraScores<'a> {
    /// Compares the images of the cameras that are on time.
    pub fn from_survey(drive: &'a Drive, survey: &'a Survey, on_time: &[bool]) -> Self {
        let frames: Vec<Vec<&Frame>> = (0..drive.rig().cameras.len())
            .map(|camera| if on_time[camera] { exposures(drive, survey, camera) } else { Vec::new() })
            .collect();
        let mut monitor = OffsetMonitor::default();
        let mut peaks = Vec::new();
        for (camera, frames) in frames.iter().enumerate() {
            let stated = ProjectionCamera::from(&drive.rig().cameras[camera]);
            let profiles = frame_profiles(frames, &drive.manifest().cameras[camera], |frame, pixels| {
                profiles(survey, &stated, frame.stamp, pixels)
            });
            peaks.push(peak(&profiles));
            monitor.add(vec![ExposureProfiles { camera, profiles }]);
        }
        Self { drive, survey, frames, offset: monitor.offset(), peaks }
    }

    /// The hypothesis with the highest peak, if it fits far better than the stated camera.
    fn better(&self, camera: usize, hypotheses: &[Hypothesis]) -> Option<BetterHypothesis> {
        let prepared: Vec<ProjectionCamera> =
            hypotheses.iter().map(|hypothesis| ProjectionCamera::from(&hypothesis.camera)).collect();
        let mut by_hypothesis: Vec<Vec<Profile>> = vec![Vec::new(); hypotheses.len()];
        for frame in &self.frames[camera] {
            let Some(pixels) = decoded(frame, &self.drive.manifest().cameras[camera]) else { continue };
            let mirrored = pixels.mirrored();
            let found: Vec<Vec<Profile>> = (hypotheses.par_iter().zip(&prepared))
                .map(|(hypothesis, camera)| {
                    let pixels = if hypothesis.is_mirrored { &mirrored } else { &pixels };
                    profiles(self.survey, camera, frame.stamp, pixels)
                })
                .collect();
            by_hypothesis.iter_mut().zip(found).for_each(|(all, found)| all.extend(found));
        }
        let peaks: Vec<f32> = by_hypothesis.par_iter().map(|profiles| peak(profiles)).collect();
        // The first of equal peaks.
        let best = (0..peaks.len()).reduce(|best, i| if peaks[i] > peaks[best] { i } else { best })?;
        let is_better = peaks[best] >= MIN_PEAK && peaks[best] > self.peaks[camera] + MIN_GAIN;
        is_better.then(|| BetterHypothesis { hypothesis: hypotheses[best].clone(), peak: peaks[best] })
    }

    /// Common delay of the stamps of all cameras in `cameras` at which their outlines fit far better.
    fn common_delay(&self, cameras: &[usize]) -> Option<CommonDelay> {
        let fine = (-MAX_DELAY_STEPS..=MAX_DELAY_STEPS).map(|step| step * DELAY_STEP_NANOS);
        let delays: Vec<i64> =
            fine.chain(SCALES_S.map(|seconds| seconds * 1_000_000_000)).filter(|d| *d != 0).collect();
        let mut squares = vec![0.0_f32; delays.len()];
        let mut stated = 0.0;
        for camera in cameras {
            let prepared = ProjectionCamera::from(&self.drive.rig().cameras[*camera]);
            let mut by_delay: Vec<Vec<Profile>> = vec![Vec::new(); delays.len()];
            for frame in &self.frames[*camera] {
                let Some(pixels) = decoded(frame, &self.drive.manifest().cameras[*camera]) else { continue };
                let found: Vec<Vec<Profile>> = (delays.par_iter())
                    .map(|delay| profiles(self.survey, &prepared, frame.stamp.plus_nanos(-delay), &pixels))
                    .collect();
                by_delay.iter_mut().zip(found).for_each(|(all, found)| all.extend(found));
            }
            squares.iter_mut().zip(&by_delay).for_each(|(sum, profiles)| *sum += peak(profiles).max(0.0).powi(2));
            stated += self.peaks[*camera].max(0.0).powi(2);
        }
        let best = (0..delays.len()).reduce(|best, i| if squares[i] > squares[best] { i } else { best })?;
        let found = squares[best].sqrt();
        let stated = stated.sqrt();
        let is_better = found >= MIN_PEAK && found > stated + MIN_GAIN;
        is_better.then(|| CommonDelay { late_s: delays[best] as f64 * 1e-9, peak: found })
    }
}

/// A hypothesis that fits better than the stated camera.
struct BetterHypothesis {
    hypothesis: Hypothesis,
    peak: f32,
}

/// A delay of all cameras.
struct CommonDelay {
    /// The delay, s.
    late_s: f64,
    peak: f32,
}

/// The exposures of a camera within the survey.
fn exposures<'a>(drive: &'a Drive, survey: &Survey, camera: usize) -> Vec<&'a Frame> {
    let [begin, end] = survey.span;
    let of_camera = |frame: &&Frame| frame.camera == camera && (begin..end).contains(&frame.stamp);
    let all: Vec<&Frame> = drive.camera_frames().iter().filter(of_camera).collect();
    let every = all.len().div_ceil(MAX_EXPOSURES).max(1);
    all.into_iter().step_by(every).collect()
}

fn frame_profiles(
    frames: &[&Frame],
    entry: &drive::manifest::CameraEntry,
    of: impl Fn(&Frame, &PixelBuffer) -> Vec<Profile> + Sync,
) -> Vec<Profile> {
    let by_frame: Vec<Vec<Profile>> = (frames.par_iter())
        .map(|frame| decoded(frame, entry).map(|pixels| of(frame, &pixels)).unwrap_or_default())
        .collect();
    by_frame.into_iter().flatten().collect()
}

/// The profiles of an image that was taken at `stamp`, from the edges of the sweeps around this time.
fn profiles(survey: &Survey, camera: &ProjectionCamera, stamp: Stamp, pixels: &PixelBuffer) -> Vec<Profile> {
    let Some(image) = pixels.view() else { return Vec::new() };
    let at = |nanos: i64| survey.trajectory.at(stamp.plus_nanos(nanos));
    let Some(pose) = at(0) else { return Vec::new() };
    let Some(before) = at(-SHIFT_NANOS) else { return Vec::new() };
    let Some(after) = at(SHIFT_NANOS) else { return Vec::new() };
    let reach = (camera_alignment::MAX_AGE_S * 1e9) as i64;
    let visibility = VisibilityMap::unobstructed();
    let mut found = Vec::new();
    let first = survey.edges.partition_point(|sweep| sweep.end < stamp.plus_nanos(-reach));
    for sweep in survey.edges[first..].iter().take_while(|sweep| sweep.begin < stamp.plus_nanos(reach)) {
        let posed = |pose| camera.exposure(stamp.0, pose, &sweep.odom_from_edges);
        let exposure = AlignmentExposure {
            exposure: posed(&pose),
            shifted: [posed(&before), posed(&after)],
            shift_s: 2e-9 * SHIFT_NANOS as f32,
            visibility: &visibility,
            image,
        };
        let mut buffers = PointBuffers::default();
        let points = SubmapPoints::new(&[], &[], sweep.begin.0, sweep.n_rings, &mut buffers);
        found.extend(exposure.profiles(&points, &sweep.edges));
    }
    found
}

/// Height of the highest peak around the given mounting.
fn peak(profiles: &[Profile]) -> f32 {
    if profiles.is_empty() { 0.0 } else { fit_rotation(profiles).peak }
}

pub(super) fn verdicts(drive: &Drive, survey: &Survey, on_time: &[bool]) -> Vec<Verdict> {
    let names: Vec<String> = drive.manifest().cameras.iter().map(|entry| entry.name.clone()).collect();
    if names.is_empty() {
        return Vec::new();
    }
    let scores = CameraScores::from_survey(drive, survey, on_time);
    let lost: Vec<usize> = (0..names.len())
        .filter(|camera| !scores.offset.cameras[*camera].is_observable() && !scores.frames[*camera].is_empty())
        .collect();
    if lost.len() == scores.frames.iter().filter(|frames| !frames.is_empty()).count()
        && let Some(found) = scores.common_delay(&lost)
    {
        return vec![delay(&found)];
    }
    let mut verdicts = vec![common_delay(&scores.offset)];
    for (camera, name) in names.iter().enumerate().filter(|(camera, _)| on_time[*camera]) {
        verdicts.push(camera_verdict(&scores, camera, name, &names));
    }
    verdicts
}

fn delay(CommonDelay { late_s, peak }: &CommonDelay) -> Verdict {
    let value = format!("exposures {:+.1} s after their stamps (peak {peak:.0})", -late_s);
    let advice = if late_s.abs() * 1e9 <= MAX_DELAY_NANOS as f64 {
        format!("add {late_s:+.1} s to delay_nanos of all cameras")
    } else {
        format!("add {:+.1} s to the names of all images", -late_s)
    };
    Verdict::new("delay", "cameras", false, [value, format!("{:.0} ms", MAX_DELAY_S * 1e3), advice])
}

fn common_delay(offset: &Offset) -> Verdict {
    let limit = format!("{:.0} ms", MAX_DELAY_S * 1e3);
    match offset.delay_s.map(|values| values.map(f64::from)) {
        Some([delay_s, sigma_s]) => {
            let value = format!("exposures {:.1} +- {:.1} ms after their stamps", delay_s * 1e3, sigma_s * 1e3);
            let advice = format!("add {:+.0} ms to delay_nanos of all cameras", -delay_s * 1e3);
            let is_within = delay_s.abs() - 3.0 * sigma_s <= f64::from(MAX_DELAY_S);
            Verdict::new("delay", "cameras", is_within, [value, limit, advice])
        }
        None if offset.is_delay_observable => {
            Verdict::new("delay", "cameras", true, ["none found".to_owned(), limit, String::new()])
        }
        None => Verdict::unknown("delay", "cameras", "not observable: outlines move too little across the images"),
    }
}

fn camera_verdict(scores: &CameraScores<'_>, camera: usize, name: &str, names: &[String]) -> Verdict {
    let rig = scores.drive.rig();
    let stated = &rig.cameras[camera];
    let found = &scores.offset.cameras[camera];
    let of_hypothesis = |BetterHypothesis { hypothesis, peak }: BetterHypothesis| {
        let value = format!("{} (peak {peak:.0}, as stated {:.0})", hypothesis.text, scores.peaks[camera]);
        let limit = format!("peak {MIN_GAIN:.0} above the stated one");
        Verdict::new(hypothesis.check, name, false, [value, limit, hypothesis.advice])
    };
    let mut hypotheses = lenses(stated);
    if !found.is_observable() {
        hypotheses.extend(mountings(rig, camera, names));
    }
    if let Some(better) = scores.better(camera, &hypotheses) {
        return of_hypothesis(better);
    }
    if !found.is_observable() {
        let text = format!("not observable: {} outlines, peak {:.1}", found.n_edges, found.peak);
        return Verdict::unknown("mounting", name, text);
    }
    let [x, y, z] = found.rotation.map(|rad| rad * 1e3);
    let value = format!(
        "{:.2} +- {:.2} mrad off the outlines (about its x {x:.2}, y {y:.2}, z {z:.2})",
        found.angle() * 1e3,
        found.sigma() * 1e3
    );
    let advice = "`replica rig calibrate` refines the rotation".to_owned();
    let limit = format!("{:.0} mrad", MAX_OFFSET_RAD * 1e3);
    Verdict::new("mounting", name, !found.exceeds(MAX_OFFSET_RAD), [value, limit, advice])
}
