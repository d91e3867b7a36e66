//! The GNSS receiver: position of its fixes, position of its antenna, and agreement of its motion with the LiDAR's.

use super::Verdict;
use crate::survey::Survey;
use drive::Drive;
use geometry::{Geodetic, LocalFrame, Stamp};
use lidar::nmea::Fix;

/// Largest distance of the fixes from the origin of the world frame, m. Coordinates in meters lose precision beyond.
const MAX_ORIGIN_M: f64 = 50_000.0;
/// Limits of the antenna position: m ahead or behind, to the side, and above the ground.
const MAX_ALONG_M: f64 = 15.0;
const MAX_ACROSS_M: f64 = 3.0;
const MAX_ABOVE_M: f64 = 6.0;
/// Least speed with a reliable course, m/s.
const MIN_SPEED_MPS: f64 = 2.0;
/// Least turning for a verdict, rad: root of the sum of squares.
const MIN_TURNED: f64 = 0.35;
/// Longest time between two fixes whose courses are compared, s.
const MAX_STEP_S: f64 = 2.5;
/// Accepted range of the ratio of the receiver's speed to the LiDAR's speed.
const SPEED_SHARE: [f64; 2] = [0.9, 1.1];
/// Least number of fixes for a comparison of speeds.
const MIN_FIXES: usize = 4;

/// Turning of the LiDAR compared with turning of the receiver's course.
pub(super) struct Turning {
    /// Ratio of the LiDAR's turning to the course's turning: 1 if both are correct, -1 if one of them is mirrored.
    pub share: f64,
    /// Turning of the course, rad: root of the sum of squares.
    pub turned: f64,
}

impl Turning {
    /// Compares the two; `None` if the vehicle hardly turned, or without a receiver.
    pub fn from_survey(survey: &Survey) -> Option<Self> {
        let mut squares = 0.0;
        let mut products = 0.0;
        for pair in survey.fixes.windows(2) {
            let [Some(a), Some(b)] = [&pair[0], &pair[1]].map(heading_of) else { continue };
            let [Some(from), Some(to)] = [&pair[0], &pair[1]].map(|fix| survey.trajectory.at(fix.stamp)) else {
                continue;
            };
            if pair[1].stamp.seconds_since(pair[0].stamp) > MAX_STEP_S {
                continue;
            }
            let by_course = wrapped(b - a);
            let by_lidar = geometry::heading(&(from.rotation.inverse() * to.rotation)).scaled_axis().z;
            squares += by_course * by_course;
            products += by_course * by_lidar;
        }
        let turned = squares.sqrt();
        (turned > MIN_TURNED).then(|| Self { share: products / squares, turned })
    }
}

/// Direction of travel, rad counterclockwise from east.
fn heading_of(fix: &Fix) -> Option<f64> {
    let is_moving = fix.speed_mps.is_some_and(|speed| speed > MIN_SPEED_MPS);
    fix.course_deg.filter(|_| is_moving).map(|course| (90.0 - course).to_radians())
}

/// An angle, wrapped to -pi to pi.
fn wrapped(angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    sin.atan2(cos)
}

/// Verdicts about the origin of the world frame, and about the position of the antenna if the height of the LiDAR is
/// correct.
pub(super) fn place(drive: &Drive, survey: &Survey, is_height_right: bool) -> Vec<Verdict> {
    let Some(entry) = &drive.manifest().gnss else { return Vec::new() };
    let mut verdicts = Vec::new();
    verdicts.extend(origin(entry.origin, &survey.fixes));
    if !is_height_right {
        return verdicts;
    }
    let [x, y, z] = entry.antenna_in_body;
    let ground_m = super::level(survey, &drive.rig().body_from_lidar.rotation)
        .map_or(0.0, |level| drive.rig().body_from_lidar.translation.z - level.height_m);
    let above_m = z - ground_m;
    let is_possible = x.abs() <= MAX_ALONG_M && y.abs() <= MAX_ACROSS_M && (0.0..=MAX_ABOVE_M).contains(&above_m);
    let value = format!("{x:.2} m ahead, {y:.2} m to the left, {above_m:.2} m above the ground");
    let limit = format!("{MAX_ALONG_M} m ahead or behind, {MAX_ACROSS_M} m to the side, 0 to {MAX_ABOVE_M} m above");
    let advice =
        "measure gnss.antenna_in_body again: m along x (forward), y (left), z (up) from the origin of the body";
    verdicts.push(Verdict::new("antenna", "gnss", is_possible, [value, limit, advice.to_owned()]));
    verdicts
}

fn origin([latitude, longitude, height]: [f64; 3], fixes: &[Fix]) -> Option<Verdict> {
    let fix = fixes.get(fixes.len() / 2)?;
    let distance = |latitude: f64, longitude: f64| -> Option<f64> {
        let frame = LocalFrame::new(Geodetic::new(latitude, longitude, height)?);
        let at = Geodetic::new(fix.position_deg[0], fix.position_deg[1], fix.altitude_m.unwrap_or(height))?;
        Some(frame.world_from_geodetic(&at).coords.norm())
    };
    let distance_m = distance(latitude, longitude)?;
    let is_near = |latitude: f64, longitude: f64| distance(latitude, longitude).is_some_and(|m| m < MAX_ORIGIN_M);
    let place = format!("the fixes are at {:.5}, {:.5}", fix.position_deg[0], fix.position_deg[1]);
    let advice = if is_near(longitude, latitude) {
        format!("gnss.origin has longitude and latitude exchanged: {place}")
    } else if is_near(latitude, -longitude) || is_near(-latitude, longitude) {
        format!("gnss.origin has the wrong sign of a coordinate: {place}")
    } else {
        format!("set gnss.origin near the drive: {place}")
    };
    let value = format!("the fixes are {:.1} km from gnss.origin", distance_m * 1e-3);
    let limit = format!("{:.0} km", MAX_ORIGIN_M * 1e-3);
    Some(Verdict::new("origin", "gnss", distance_m < MAX_ORIGIN_M, [value, limit, advice]))
}

/// Verdict about the speeds of receiver and LiDAR.
pub(super) fn motion(survey: &Survey) -> Vec<Verdict> {
    let speed_at = |stamp: Stamp| -> Option<f64> {
        let [before, after] = [-250_000_000, 250_000_000].map(|nanos| survey.trajectory.at(stamp.plus_nanos(nanos)));
        Some((after?.translation.vector - before?.translation.vector).norm() / 0.5)
    };
    let pairs = survey.fixes.iter().filter_map(|fix| Some((fix.speed_mps?, speed_at(fix.stamp)?)));
    let pairs: Vec<(f64, f64)> = pairs.filter(|(_, speed)| *speed > MIN_SPEED_MPS).collect();
    if pairs.len() < MIN_FIXES {
        return vec![Verdict::unknown("speed", "gnss", "fewer than 4 fixes with speed while the vehicle moved")];
    }
    let square: f64 = pairs.iter().map(|(_, by_lidar)| by_lidar * by_lidar).sum();
    let share = pairs.iter().map(|(by_receiver, by_lidar)| by_receiver * by_lidar).sum::<f64>() / square;
    let value = format!("{share:.3} times the speed of the LiDAR at {} fixes", pairs.len());
    let [least, most] = SPEED_SHARE;
    let advice = if share < 0.6 && share > 0.45 || share > 1.8 && share < 2.05 {
        "the speeds of the log are in knots or km/h where m/s or knots are expected; check the converter of the log"
    } else {
        "speeds of receiver and LiDAR differ: check the clock of the receiver and the unit of the ranges"
    };
    vec![Verdict::new(
        "speed",
        "gnss",
        (least..most).contains(&share),
        [value, format!("{least} to {most}"), advice.to_owned()],
    )]
}
