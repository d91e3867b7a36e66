//! The mounting of the LiDAR compared with the ground: level and height.

use super::Verdict;
use crate::survey::{GroundPlane, Survey};
use drive::Drive;
use geometry::{UnitQuaternion, Vector3};

/// Limit of the tilt, rad: a road slopes sideways by 1.4 degrees, and the suspension adds one.
const MAX_TILT: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Least number of sweeps with ground for a verdict.
const MIN_PLANES: usize = 3;
/// Limits of the height of the body origin above the ground, m: it may be on the road, on an axle, in the middle, or on
/// the roof.
const BODY_HEIGHT_M: [f64; 2] = [-0.5, 4.0];
/// Number of neighboring sweeps that count as one: they measure the same road.
const PER_MEASUREMENT: f64 = 2.0;

/// Mounting of the LiDAR estimated from the ground, in the body axes stated by `drive.toml`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Normal of the ground; (0, 0, 1) if the LiDAR is mounted as stated.
    pub up: Vector3<f64>,
    /// Standard deviation of its direction, rad.
    pub sigma: f64,
    /// Height of the LiDAR above the ground, m.
    pub height_m: f64,
    /// Standard deviation of the height, m.
    pub height_sigma_m: f64,
}

impl Level {
    /// The tilt of the LiDAR, rad.
    pub fn tilt(&self) -> f64 {
        self.up.angle(&Vector3::z())
    }

    /// The rotation from the stated body axes to the level ones.
    pub fn correction(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::rotation_between(&self.up, &Vector3::z()).unwrap_or_else(UnitQuaternion::identity)
    }
}

/// The level from all sweeps; `None` if too few have ground.
pub fn level(survey: &Survey, body_from_lidar: &UnitQuaternion<f64>) -> Option<Level> {
    let planes = &survey.ground;
    if planes.len() < MIN_PLANES || planes.len() * 3 < survey.n_ground_searches {
        return None;
    }
    let up_of = |plane: &GroundPlane| body_from_lidar * plane.normal;
    let median = |of: &dyn Fn(&GroundPlane) -> f64| {
        let mut values: Vec<f64> = planes.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let up = Vector3::from_fn(|axis, _| median(&|plane| up_of(plane)[axis])).normalize();
    let height_m = median(&|plane| plane.height_m);
    // The factor 1.48 converts a median deviation to a standard deviation.
    let scatter = 1.48 * median(&|plane| up_of(plane).angle(&up));
    let height_scatter_m = 1.48 * median(&|plane| (plane.height_m - height_m).abs());
    let n = (planes.len() as f64 / PER_MEASUREMENT).max(1.0).sqrt();
    Some(Level { up, sigma: scatter / n, height_m, height_sigma_m: height_scatter_m / n })
}

pub(super) fn verdicts(drive: &Drive, survey: &Survey) -> Vec<Verdict> {
    let body_from_lidar = drive.rig().body_from_lidar;
    let Some(found) = level(survey, &body_from_lidar.rotation) else {
        let reason = format!(
            "no ground within 60 degrees of the stated upward direction in {} of {} sweeps: the mounting is far off, or \
             the LiDAR sees no ground",
            survey.n_ground_searches - survey.ground.len(),
            survey.n_ground_searches
        );
        return vec![Verdict::unknown("level", "lidar", reason)];
    };
    let tilt = found.tilt();
    let up = found.up;
    // The ground falls ahead: the LiDAR is pitched up.
    let [roll, pitch] = [up.y.atan2(up.z), -up.x.atan2(up.z)].map(f64::to_degrees);
    let value = format!(
        "the ground is {:.2} +- {:.2} degrees off the x-y plane of the body ({pitch:+.2} about y, {roll:+.2} about x)",
        tilt.to_degrees(),
        found.sigma.to_degrees()
    );
    let rotation = found.correction() * body_from_lidar.rotation;
    let q = rotation.coords;
    let advice = format!(
        "set lidar.body_from_lidar.rotation = [{:.5}, {:.5}, {:.5}, {:.5}], or check the order and sense of its angles",
        q.x, q.y, q.z, q.w
    );
    let limit = format!("{:.0} degrees", MAX_TILT.to_degrees());
    let is_level = tilt - 3.0 * found.sigma <= MAX_TILT;
    let mut verdicts = vec![Verdict::new("level", "lidar", is_level, [value, limit, advice])];
    if is_level {
        verdicts.push(height(&found, body_from_lidar.translation.z));
    }
    verdicts
}

fn height(found: &Level, lidar_z: f64) -> Verdict {
    let of_body_m = found.height_m - lidar_z;
    let value = format!(
        "{:.2} +- {:.2} m above the ground, the origin of the body {of_body_m:.2} m",
        found.height_m, found.height_sigma_m
    );
    let [least, most] = BODY_HEIGHT_M;
    let advice = format!(
        "the z of lidar.body_from_lidar.translation is {lidar_z:.2} m; the LiDAR is {:.2} m above the ground",
        found.height_m
    );
    let limit = format!("origin {least} to {most} m");
    Verdict::new("height", "lidar", (least..most).contains(&of_body_m), [value, limit, advice])
}
