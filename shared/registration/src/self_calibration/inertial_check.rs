//! Compares an inertial unit with the motion of the LiDAR: units, axes, mounting, time offset. A wrong unit is not
//! used.
//!
//! The rates of a unit that passes the first plausibility test are compared with the rotation, and its forces with the
//! acceleration, of the matched sweeps. Until both agree, the unit is on probation: it has no weight in matches. If other
//! axes or units fit far better, the samples are corrected from then on; if no combination fits, they are withheld. The
//! sums use the uncorrected samples, so that a correction does not change the evidence, and the poses of the matches
//! without the weight of the samples, so that a unit is not compared with itself.

mod axes;
mod comparison;
mod force_bias;
mod history;
mod judgment;

pub use axes::Axes;
pub use comparison::Fit;
pub use force_bias::ForceBias;

use crate::{InertialSample, Registered};
use comparison::Sums;
use doubts::Doubt;
use force_bias::BiasSums;
use geometry::{Point3, Pose, Stamp, UnitQuaternion, Vector3};
use history::History;
use judgment::{MIN_FORCES, MIN_RATES};
use serde::{Deserialize, Serialize};

/// One g, m/s^2, and one degree, rad.
const GRAVITY_MPS2: f64 = 9.806_65;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Tested time offsets between unit and LiDAR: number of steps to either side, and the step, s.
const LAG_STEPS: usize = 10;
const LAG_STEP_S: f64 = 0.02;
/// Range of the mean specific force of a tenth of a second on a vehicle, m/s^2; a unit that reports g has a tenth of
/// it.
const FORCE_MPS2: [f64; 2] = [6.0, 14.0];
/// Largest initial angle between the mean specific force and the z axis of the body, rad: hard braking on a steep road.
const MAX_TILT: f64 = 0.6;
/// Largest change of the rotation rate from sweep to sweep before the unit is verified, rad/s. A verified unit may
/// measure any change.
const MAX_RATE_JUMP: f64 = 0.4;
/// A unit that is not verified is harmless while the vehicle neither turns nor accelerates: limits for its mean rate (rad/s) and its
/// horizontal force (m/s^2) over a sweep, and for the root mean square of its differences to the LiDAR so far. Two good matches differ
/// by 0.01 rad/s, and an inclined start by 0.5 m/s^2.
const HARMLESS_RATE: f64 = 0.03;
const HARMLESS_FORCE: f64 = 1.0;
const HARMLESS_RATE_RMS: f64 = 0.02;
const HARMLESS_FORCE_RMS: f64 = 0.7;
/// Consecutive implausible batches after which a verified unit is withheld: a second.
const MAX_IMPLAUSIBLE: u32 = 10;

/// Correction of the samples of the unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InertialCorrection {
    /// Correction of the angular rates.
    pub rate: Fit,
    /// Correction of the specific forces.
    pub force: Fit,
    /// Rotation from the axes of the fits to body axes.
    pub rotation: UnitQuaternion<f64>,
    /// Bias of the specific forces, body axes, m/s^2.
    pub force_bias: Vector3<f64>,
    /// Delay of the stamps, s; positive if they are late.
    pub late_s: f64,
}

impl InertialCorrection {
    const NONE: Self = Self {
        rate: Fit::NOMINAL,
        force: Fit::NOMINAL,
        rotation: UnitQuaternion::new_unchecked(geometry::Quaternion::new(1.0, 0.0, 0.0, 0.0)),
        force_bias: Vector3::new(0.0, 0.0, 0.0),
        late_s: 0.0,
    };

    /// The force along the axes of the body, with its bias.
    fn biased_force(&self, force: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * self.force.axes.in_body(force) * self.force.scale
    }

    fn apply(&self, sample: &InertialSample) -> InertialSample {
        if *self == Self::NONE {
            return *sample;
        }
        InertialSample {
            stamp: sample.stamp.plus_nanos(-(self.late_s * 1e9).round() as i64),
            force: self.biased_force(&sample.force) - self.force_bias,
            rate: self.rotation * self.rate.axes.in_body(&sample.rate) * self.rate.scale,
        }
    }
}

/// Whether the samples are used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Trust {
    /// The samples are plausible.
    Assumed,
    /// They agree with the LiDAR.
    Verified,
    /// The samples disagree with the LiDAR, for this reason.
    Withheld(String),
}

/// Rotation and time offset that fit the unit to the LiDAR, with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InertialMounting {
    /// Remaining rotation about body axes between the unit as described in `drive.toml` (axes and units corrected) and
    /// the LiDAR, rad.
    pub rotation: Vector3<f64>,
    /// Standard deviation of the rotation, rad.
    pub rotation_sigma: Vector3<f64>,
    /// Delay of the stamps, s; positive if they are late.
    pub late_s: f64,
    /// Standard deviation of the delay, s.
    pub late_sigma_s: f64,
}

/// Compares the samples of an inertial unit with the poses of the LiDAR.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InertialCheck {
    /// Position of the unit, m.
    imu_in_body: Point3<f64>,
    history: History,
    /// Sums of the rates per time offset, the earliest stamps first.
    rates: Vec<Sums>,
    forces: Sums,
    biases: BiasSums,
    trust: Trust,
    /// Whether the unit must be verified before it has weight in matches.
    on_probation: bool,
    /// Whether the last samples do no harm, even if the unit is wrong.
    is_harmless: bool,
    correction: InertialCorrection,
    mounting: Option<InertialMounting>,
    /// Angular rate of the body from the last two poses, rad/s.
    last_rate: Option<Vector3<f64>>,
    n_samples: u64,
    n_implausible: u32,
    has_changed: bool,
}

impl InertialCheck {
    /// Creates the check for a unit at `imu_in_body`. `on_probation`: its samples have no weight in matches until they
    /// agree with the LiDAR, see [`Self::is_on_probation`]; otherwise a plausible unit is used immediately, and influences
    /// the poses that it is compared with.
    pub fn new(imu_in_body: Point3<f64>, on_probation: bool) -> Self {
        Self {
            imu_in_body,
            history: History::default(),
            rates: vec![Sums::default(); 2 * LAG_STEPS + 1],
            forces: Sums::default(),
            biases: BiasSums::default(),
            trust: Trust::Assumed,
            on_probation,
            is_harmless: false,
            correction: InertialCorrection::NONE,
            mounting: None,
            last_rate: None,
            n_samples: 0,
            n_implausible: 0,
            has_changed: false,
        }
    }

    /// Adds the samples of about one sweep in time order; returns the samples to use, corrected.
    pub fn add_samples(&mut self, samples: &[InertialSample]) -> Vec<InertialSample> {
        let finite = |sample: &&InertialSample| sample.force.iter().chain(&sample.rate).all(|v| v.is_finite());
        let samples: Vec<InertialSample> = samples.iter().filter(finite).copied().collect();
        if samples.is_empty() {
            return samples;
        }
        for sample in &samples {
            self.history.push_sample(sample);
        }
        let mean = |of: fn(&InertialSample) -> Vector3<f64>| {
            samples.iter().map(of).sum::<Vector3<f64>>() / samples.len() as f64
        };
        let force = mean(|sample| sample.force);
        let rate = mean(|sample| sample.rate);
        let is_first = self.n_samples == 0;
        self.n_samples += samples.len() as u64;
        let in_g = FORCE_MPS2.map(|force| force / GRAVITY_MPS2);
        if is_first && (in_g[0]..in_g[1]).contains(&force.norm()) {
            self.correction.force.scale = GRAVITY_MPS2;
        }
        if matches!(self.trust, Trust::Withheld(_)) {
            return Vec::new();
        }
        if let Some(fault) = self.fault(&force, &rate, is_first) {
            self.n_implausible += 1;
            if self.trust == Trust::Assumed || self.n_implausible >= MAX_IMPLAUSIBLE {
                self.withhold(fault);
            }
            return Vec::new();
        }
        self.n_implausible = 0;
        self.is_harmless = self.agrees_without_motion(&force, &rate);
        samples.iter().map(|sample| self.correction.apply(sample)).collect()
    }

    /// Reason why means over the time of a sweep are implausible for a vehicle.
    fn fault(&self, force: &Vector3<f64>, rate: &Vector3<f64>, is_first: bool) -> Option<String> {
        let size = force.norm() * self.correction.force.scale;
        if !(FORCE_MPS2[0]..FORCE_MPS2[1]).contains(&size) {
            return Some(format!("the specific force is {size:.2} m/s^2, not about 9.8"));
        }
        let up = self.correction.rotation * self.correction.force.axes.in_body(force);
        if is_first && up.angle(&Vector3::z()) > MAX_TILT {
            let degrees = up.angle(&Vector3::z()) / DEGREE;
            return Some(format!("the specific force is {degrees:.0} degrees off the z axis of the body"));
        }
        let rate = self.correction.rotation * self.correction.rate.axes.in_body(rate) * self.correction.rate.scale;
        let change = (rate - self.last_rate.unwrap_or_else(Vector3::zeros)).norm();
        if self.trust == Trust::Assumed && change > MAX_RATE_JUMP {
            let rate = rate.norm();
            return Some(format!("the angular rate is {rate:.2} rad/s, {change:.2} off the rate of the LiDAR"));
        }
        None
    }

    /// Adds the pose of the body (in odometry axes) in the middle of the next sweep; `None` if it was not measured.
    pub fn add_pose(&mut self, stamp: Stamp, odom_from_body: Option<&Pose>) {
        self.last_rate = self.history.push_pose(stamp, odom_from_body);
        let Self { history, rates, forces, biases, correction, imu_in_body, .. } = self;
        let mut is_new = false;
        history.take_rotations(LAG_STEPS as f64 * LAG_STEP_S, |body, unit_at| {
            for (step, sums) in rates.iter_mut().enumerate() {
                sums.add(body, &unit_at(lag_s(step)));
            }
            is_new = true;
        });
        history.take_accelerations(imu_in_body, GRAVITY_MPS2, |body, unit, odom_from_body| {
            forces.add(body, unit);
            biases.add(&(correction.biased_force(unit) - body), odom_from_body);
        });
        if is_new {
            self.judge();
        }
    }

    /// Adds the next sweep. `body_from_lidar` is the mounting of the LiDAR.
    pub fn add_registered(&mut self, registered: &Registered, body_from_lidar: &Pose) {
        let middle = registered.stamp.plus_nanos(i64::from(registered.duration_nanos) / 2);
        let is_measured = registered.matched.as_ref().is_some_and(|matched| matched.n_degenerate_directions == 0);
        let odom_from_body = registered.by_lidar * body_from_lidar.inverse();
        self.add_pose(middle, is_measured.then_some(&odom_from_body));
    }

    /// Whether the samples so far were wrong: a filter that used them must discard them. `true` once for each change.
    pub const fn take_change(&mut self) -> bool {
        std::mem::replace(&mut self.has_changed, false)
    }

    /// Reason why the unit is not used; `None` if it is used, or if the drive has no unit.
    pub fn why_withheld(&self) -> Option<&str> {
        match &self.trust {
            Trust::Withheld(reason) => Some(reason),
            Trust::Assumed | Trust::Verified => None,
        }
    }

    /// The doubt if the unit is not used.
    pub fn doubt(&self) -> Option<Doubt> {
        self.why_withheld().map(|reason| Doubt::ImuNotUsed { reason: reason.to_owned() })
    }

    /// Correction of the samples.
    pub const fn correction(&self) -> &InertialCorrection {
        &self.correction
    }

    /// Estimated mounting and time offset; `None` until the vehicle has turned.
    pub const fn mounting(&self) -> Option<&InertialMounting> {
        self.mounting.as_ref()
    }

    /// Whether the corrected samples agree with the LiDAR. `false` until the vehicle has turned and braked.
    pub fn is_verified(&self) -> bool {
        self.trust == Trust::Verified
    }

    /// Whether the odometry must not use the last samples where the LiDAR measures its motion without them.
    pub fn is_on_probation(&self) -> bool {
        self.on_probation && self.trust == Trust::Assumed && !self.is_harmless
    }

    /// Whether the vehicle neither turns nor accelerates by these means over a sweep, and the unit has agreed with the LiDAR so far.
    fn agrees_without_motion(&self, force: &Vector3<f64>, rate: &Vector3<f64>) -> bool {
        let InertialCorrection { rate: rate_fit, force: force_fit, .. } = &self.correction;
        let rms = |sums: &Sums, fit: &Fit| (sums.residual(fit) / sums.n().max(1.0)).sqrt();
        let rates = &self.rates[self.current_step()];
        let has_enough = rates.n() >= MIN_RATES && self.forces.n() >= MIN_FORCES;
        has_enough
            && rate.norm() * rate_fit.scale < HARMLESS_RATE
            && self.correction.biased_force(force).xy().norm() < HARMLESS_FORCE
            && rms(rates, rate_fit) < HARMLESS_RATE_RMS
            && rms(&self.forces, force_fit) < HARMLESS_FORCE_RMS
    }

    /// Whether there were any samples.
    pub const fn has_samples(&self) -> bool {
        self.n_samples > 0
    }

    /// Report lines for the operator; empty without samples.
    pub fn summary(&self) -> Vec<String> {
        if !self.has_samples() {
            return Vec::new();
        }
        let mut lines = self.corrections();
        lines.push(match &self.trust {
            Trust::Assumed => "not compared with the LiDAR: the vehicle turned too little".to_owned(),
            Trust::Verified => "agrees with the LiDAR".to_owned(),
            Trust::Withheld(reason) => format!("not used: {reason}"),
        });
        if let Some(InertialMounting { rotation, rotation_sigma, late_s, late_sigma_s }) = &self.mounting {
            lines.push(format!("stamps {:.0} ms late (deviation {:.1})", late_s * 1e3, late_sigma_s * 1e3));
            // Unknown until the vehicle has turned.
            if rotation_sigma.max() < 1.0 {
                let angles = list(&(rotation / DEGREE));
                let deviations = list(&(rotation_sigma / DEGREE));
                lines.push(format!("rotated about x, y, z by {angles} degrees (deviations {deviations})"));
            }
        }
        if let Some(ForceBias { mean, sigma }) = self.biases.estimate().filter(|_| self.is_verified()) {
            let [mean, sigma] = [list(&mean), list(&sigma)];
            lines.push(format!("bias of the accelerations {mean} m/s^2 along x, y, z (deviations {sigma})"));
        }
        lines.iter().map(|line| format!("inertial unit: {line}")).collect()
    }

    /// Names of the active corrections.
    fn corrections(&self) -> Vec<String> {
        let InertialCorrection { rate, force, rotation, force_bias, late_s } = &self.correction;
        let mut parts = Vec::new();
        if force.scale != 1.0 {
            parts.push("accelerations are in g, corrected".to_owned());
        }
        if rate.scale != 1.0 {
            parts.push("angular rates are in degrees per second, corrected".to_owned());
        }
        if rate.axes != Axes::BODY {
            parts.push(format!("angular rates: {}, corrected", rate.axes));
        }
        if force.axes != Axes::BODY {
            parts.push(format!("accelerations: {}, corrected", force.axes));
        }
        if rotation.angle() > 0.0 {
            parts.push(format!("rotated by {:.2} degrees, corrected", rotation.angle() / DEGREE));
        }
        if *force_bias != Vector3::zeros() {
            parts.push(format!("accelerations have a bias of {} m/s^2 along x, y, z, corrected", list(force_bias)));
        }
        if *late_s != 0.0 {
            parts.push(format!("stamps {:.0} ms late, corrected", late_s * 1e3));
        }
        parts
    }

    fn withhold(&mut self, reason: String) {
        self.trust = Trust::Withheld(reason);
        self.has_changed = true;
    }
}

/// The components of a vector.
fn list(v: &Vector3<f64>) -> String {
    format!("{:.2}, {:.2}, {:.2}", v.x, v.y, v.z)
}

/// Time offset of a step, s: positive if the stamps of the unit are late.
fn lag_s(step: usize) -> f64 {
    (step as f64 - LAG_STEPS as f64) * LAG_STEP_S
}
