//! The heading of the path against its own direction of travel.

use super::median::median;
use crate::GivenPath;
use geometry::{Stamp, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Time over which the direction of travel is measured, s: at 2 m/s and 2 cm of noise, 1 degree.
const SPAN_NANOS: i64 = 500_000_000;
/// Slower vehicles have no reliable direction, m/s.
const MIN_SPEED_MPS: f64 = 2.0;
/// Directions that are compared at most.
const MAX_SAMPLES: usize = 2000;
/// Least number of directions, which are half a second apart.
const MIN_SAMPLES: usize = 10;
/// Largest median difference that is accepted, rad: lever arms and sideslip stay below 5 degrees on average.
const ACCEPTED_RAD: f64 = 0.17;
/// Largest median difference of a reading that is offered instead, rad.
const OFFERED_RAD: f64 = 0.1;

/// A direction of travel and the heading at the same time, rad, counterclockwise from the x axis.
struct Sample {
    course: f64,
    yaw: f64,
}

/// A reading of the heading that is tried.
struct Reading {
    yaw: fn(f64) -> f64,
    hint: &'static str,
}

const READINGS: [Reading; 7] = [
    Reading {
        yaw: |yaw| FRAC_PI_2 - yaw,
        hint: "a compass heading is taken for a mathematical one or the reverse: set trajectory.heading to the other sense",
    },
    Reading {
        yaw: |yaw| -yaw,
        hint: "the heading counts the other way, or an axis is mirrored: check trajectory.heading and the axes of the frame",
    },
    Reading {
        yaw: |yaw| PI - yaw,
        hint: "the heading counts the other way from the opposite axis, or x is mirrored: check trajectory.heading and the axes",
    },
    Reading {
        yaw: |yaw| yaw + PI,
        hint: "the reference frame of the export faces backwards: set trajectory.body_from_reference",
    },
    Reading {
        yaw: |yaw| yaw - FRAC_PI_2,
        hint: "the reference frame of the export has its y axis forward: set trajectory.body_from_reference",
    },
    Reading {
        yaw: |yaw| yaw + FRAC_PI_2,
        hint: "the reference frame of the export faces right, or headings start at another axis: set trajectory.body_from_reference or trajectory.heading",
    },
    Reading {
        yaw: |yaw| FRAC_PI_2 - (FRAC_PI_2 - yaw).to_degrees(),
        hint: "the headings are in radians: state the unit in the name of the column, as in heading(rad)",
    },
];

pub(super) fn agrees(path: &GivenPath) -> Result<String, String> {
    let samples = samples(path);
    if samples.len() < MIN_SAMPLES {
        return Ok("heading not compared: the path is slower than 2 m/s".into());
    }
    let found = median_difference(&samples, |yaw| yaw);
    if found <= ACCEPTED_RAD {
        return Ok(format!(
            "heading agrees with the direction of travel (median difference {:.1} deg)",
            found.to_degrees()
        ));
    }
    let fitting: Vec<&str> = READINGS
        .iter()
        .filter(|reading| median_difference(&samples, reading.yaw) <= OFFERED_RAD)
        .map(|reading| reading.hint)
        .collect();
    let hint = if fitting.is_empty() {
        "no usual convention fits: check the attitude columns and trajectory.body_from_reference".to_owned()
    } else {
        fitting.join("; or ")
    };
    Err(format!(
        "the heading differs from the direction of travel by {:.0} deg (median of {} times); {hint}",
        found.to_degrees(),
        samples.len()
    ))
}

fn samples(path: &GivenPath) -> Vec<Sample> {
    let [begin, end] = path.span();
    let n = (end.0 - begin.0) / SPAN_NANOS;
    let stride = (n / MAX_SAMPLES as i64).max(1);
    let sample = |index: i64| {
        let middle = Stamp(begin.0 + index * stride * SPAN_NANOS + SPAN_NANOS / 2);
        let before = path.at(middle.plus_nanos(-SPAN_NANOS / 2))?;
        let after = path.at(middle.plus_nanos(SPAN_NANOS / 2))?;
        let step = after.translation.vector - before.translation.vector;
        let speed = step.xy().norm() / (SPAN_NANOS as f64 * 1e-9);
        let ahead = path.at(middle)?.rotation * Vector3::x();
        (speed >= MIN_SPEED_MPS).then(|| Sample { course: step.y.atan2(step.x), yaw: ahead.y.atan2(ahead.x) })
    };
    (0..n / stride).filter_map(sample).collect()
}

fn median_difference(samples: &[Sample], reading: impl Fn(f64) -> f64) -> f64 {
    let wrapped = |angle: f64| ((angle + PI).rem_euclid(TAU) - PI).abs();
    median(samples.iter().map(|sample| wrapped(sample.course - reading(sample.yaw))).collect())
}
