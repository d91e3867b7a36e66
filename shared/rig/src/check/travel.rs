//! The mounting of the LiDAR compared with the direction of travel.

use super::Verdict;
use crate::survey::Survey;
use geometry::Vector3;
use nalgebra::{Matrix2, Vector2};

/// Limit of the angle between the x axis of the body and the direction of travel, rad.
const MAX_ANGLE: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Least speed with a reliable direction, m/s.
const MIN_SPEED_MPS: f64 = 1.5;
/// Least number of pairs of sweeps for a verdict.
const MIN_PAIRS: usize = 10;
/// Number of neighboring pairs that count as one: their errors are correlated.
const PER_MEASUREMENT: f64 = 4.0;

/// Direction of travel in the body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Angle to the left of the x axis of the body, rad. It is the heading error of the mounting: 0 if the mounting is
    /// correct.
    pub yaw: f64,
    /// Standard deviation of the angle, rad.
    pub sigma: f64,
}

/// The direction of travel: a wheeled vehicle moves along its own axis, apart from the lateral motion of the body
/// origin in turns.
pub fn travel(survey: &Survey) -> Option<Travel> {
    let mut motions: Vec<(Vector3<f64>, f64)> = Vec::new();
    for pair in survey.poses.windows(2).filter(|pair| pair[0].is_measured && pair[1].is_measured) {
        let [a, b] = [&pair[0].odom_from_body, &pair[1].odom_from_body];
        let seconds = pair[1].middle.seconds_since(pair[0].middle);
        let velocity = registration::Velocity::between(a, b, seconds.max(1e-3));
        if velocity.linear.norm() > MIN_SPEED_MPS {
            motions.push((velocity.linear, velocity.angular.z));
        }
    }
    if motions.len() < MIN_PAIRS {
        return None;
    }
    // Backwards is the opposite sense of the same axis; most drives go forwards.
    let mean: Vector3<f64> = motions.iter().map(|(linear, _)| linear).sum();
    let rough = mean.y.atan2(mean.x);
    let (sin, cos) = rough.sin_cos();
    // Along and across the approximate direction: across = yaw * along + lever arm * yaw rate.
    let turned = motions.iter().map(|(v, w)| ([cos * v.x + sin * v.y, *w], cos * v.y - sin * v.x));
    let rows: Vec<(Vector2<f64>, f64)> = turned.map(|(row, across)| (row.into(), across)).collect();
    let normal: Matrix2<f64> = rows.iter().map(|(row, _)| row * row.transpose()).sum();
    let right: Vector2<f64> = rows.iter().map(|(row, across)| row * *across).sum();
    // Prior: the lever arm is some metres; without turns it would be unconstrained.
    let prior = Matrix2::new(0.0, 0.0, 0.0, 1e-3);
    let inverse = (normal + prior).try_inverse()?;
    let solution = inverse * right;
    let square: f64 = rows.iter().map(|(row, across)| (across - row.dot(&solution)).powi(2)).sum();
    let variance = square / rows.len() as f64 * PER_MEASUREMENT;
    Some(Travel { yaw: rough + solution.x.atan(), sigma: (variance * inverse[(0, 0)]).sqrt() })
}

pub(super) fn verdict(survey: &Survey) -> Verdict {
    let Some(found) = travel(survey) else {
        return Verdict::unknown("heading", "lidar", "the vehicle hardly moved, or its motion was not measured");
    };
    let degrees = found.yaw.to_degrees();
    let value = format!(
        "the vehicle drives {degrees:+.2} +- {:.2} degrees to the left of the x axis of the body",
        found.sigma.to_degrees()
    );
    let advice = format!(
        "turn lidar.body_from_lidar by {:.1} degrees about the z axis of the body (yaw is positive to the left)",
        -degrees
    );
    let limit = format!("{:.0} degrees", MAX_ANGLE.to_degrees());
    let is_within = found.yaw.abs() - 3.0 * found.sigma <= MAX_ANGLE;
    Verdict::new("heading", "lidar", is_within, [value, limit, advice])
}
