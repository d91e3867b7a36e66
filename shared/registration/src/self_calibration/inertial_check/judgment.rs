//! Decides whether the unit is correct, wrong, or correct in other axes or units.

use super::comparison::{BestFit, Fit, Sums};
use super::force_bias::{BiasSums, ForceBias};
use super::{
    DEGREE, GRAVITY_MPS2, InertialCheck, InertialCorrection, InertialMounting, LAG_STEP_S, LAG_STEPS, Trust, lag_s,
};
use geometry::{UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Rotation3};

/// Least number of pairs for a decision: two seconds at 10 Hz for rates, one for forces.
pub(super) const MIN_RATES: f64 = 20.0;
pub(super) const MIN_FORCES: f64 = 10.0;
/// Least number of pairs for a verification.
const MIN_VERIFIED: f64 = 30.0;
/// Least rotation of the body that rates can be compared with, root mean square, rad/s: a turn at a crossing has 0.3.
const MIN_ROTATION: f64 = 0.02;
/// Rotation from which a correct unit must agree, rad/s.
const CLEAR_ROTATION: f64 = 0.05;
/// Lower bounds for the errors of the pairs: rad/s between two matched sweeps, and m/s^2.
const RATE_SIGMA: f64 = 0.004;
const FORCE_SIGMA: f64 = 0.3;
/// Number of neighboring pairs that count as one, because their errors are correlated.
const RATES_PER_PAIR: f64 = 4.0;
const FORCES_PER_PAIR: f64 = 10.0;
/// Log-likelihood ratio from which a fit is considered better than another: odds of three million.
const DECISIVE: f64 = 15.0;
/// Largest share of the rotation that a fit may leave unexplained.
const MAX_UNEXPLAINED: f64 = 0.3;
/// Root mean square of the forces that the fit may leave unexplained, m/s^2.
const MAX_FORCE_RESIDUAL: f64 = 1.5;
/// Largest scatter of the differences between a correct unit and the LiDAR, rad/s.
const MAX_RATE_NOISE: f64 = 0.1;
/// Smaller time offsets are not corrected, s: a fifth of a sweep moves a point by some centimetres in a turn.
const MIN_LATE_S: f64 = 0.02;
/// Smaller rotations of the mounting are not corrected, rad, and neither are rotations below this number of standard
/// deviations.
const MIN_ROTATED: f64 = 0.5 * DEGREE;
const SIGNIFICANT: f64 = 6.0;
/// Smaller biases of the accelerometers are not corrected, m/s^2: 1.2 degrees of inclination; industrial units have 0.05. Neither
/// are biases below this number of standard deviations.
const MIN_FORCE_BIAS: f64 = 0.2;
const SIGNIFICANT_BIAS: f64 = 4.0;
/// Least rotation for an estimate of the mounting, a sum of squares over pairs, rad^2/s^2: for example 30 degrees in 5
/// s.
const MIN_TURNED: f64 = 0.5;

/// The evidence about a kind of measurement.
struct Evidence {
    best: Fit,
    residual: f64,
    /// Log-likelihood ratio of the best fit to the current one, and to all others.
    over_current: f64,
    over_others: f64,
}

impl Evidence {
    fn is_decisive(&self) -> bool {
        self.over_others > DECISIVE
    }
}

impl InertialCheck {
    pub(super) fn judge(&mut self) {
        let rates: Vec<Sums> = self.rates.iter().map(Sums::centered).collect();
        let current = &rates[self.current_step()];
        if current.n() < MIN_RATES {
            return;
        }
        let rotation = (current.signal() / current.n()).sqrt();
        let rate = self.rate_evidence(&rates);
        let force = (self.forces.n() >= MIN_FORCES).then(|| self.force_evidence());
        let explains = rotation > MIN_ROTATION && rate.residual < MAX_UNEXPLAINED * current.signal();
        if let Some(force) = force.filter(|force| {
            explains && rate.is_decisive() && force.is_decisive() && is_small(force.residual, self.forces.n())
        }) {
            self.accept(rate.best, force.best);
        } else if let Some(reason) = self.disagreement(current, &rate) {
            if !matches!(self.trust, Trust::Withheld(_)) {
                self.withhold(reason);
            }
            return;
        }
        if matches!(self.trust, Trust::Withheld(_)) {
            return;
        }
        self.estimate_lateness(&rates);
        let current = &rates[self.current_step()];
        let agrees = rotation > MIN_ROTATION
            && current.residual(&self.correction.rate) < MAX_UNEXPLAINED * current.signal()
            && self.forces.n() >= MIN_FORCES
            && is_small(self.forces.residual(&self.correction.force), self.forces.n());
        if self.trust == Trust::Assumed && agrees && current.n() >= MIN_VERIFIED {
            self.trust = Trust::Verified;
        }
        if agrees {
            self.estimate_rotation(&current.clone());
            self.correct_force_bias();
        }
    }

    /// Index of the time offset that is corrected.
    pub(super) fn current_step(&self) -> usize {
        let step = (self.correction.late_s / LAG_STEP_S).round() as i64 + LAG_STEPS as i64;
        step.clamp(0, 2 * LAG_STEPS as i64) as usize
    }

    fn rate_evidence(&self, rates: &[Sums]) -> Evidence {
        let scales = [1.0, DEGREE];
        let found = rates.iter().map(|sums| {
            let best = sums.best(&scales).fit;
            (best, sums.residual(&best), sums)
        });
        let least = found.min_by(|(_, a, _), (_, b, _)| a.total_cmp(b));
        let Some((best, residual, sums)) = least else {
            return Evidence { best: Fit::NOMINAL, residual: 0.0, over_current: 0.0, over_others: 0.0 };
        };
        let variance = (residual / (3.0 * sums.n())).max(RATE_SIGMA * RATE_SIGMA);
        let likelier = |other: f64| (other - residual) / (2.0 * variance * RATES_PER_PAIR);
        // Fits with other axes at any time offset, and with these axes at the current one.
        let others = rates.iter().map(|sums| {
            let BestFit { fit, other_residual } = sums.best(&scales);
            if fit.axes == best.axes { other_residual } else { sums.residual(&fit) }
        });
        let over_others = likelier(others.fold(f64::MAX, f64::min));
        let of_current = rates.iter().map(|sums| sums.residual(&self.correction.rate)).fold(f64::MAX, f64::min);
        Evidence { best, residual, over_current: likelier(of_current), over_others }
    }

    fn force_evidence(&self) -> Evidence {
        let scales = [1.0, GRAVITY_MPS2];
        let BestFit { fit: best, other_residual } = self.forces.best(&scales);
        let residual = self.forces.residual(&best);
        let variance = (residual / (3.0 * self.forces.n())).max(FORCE_SIGMA * FORCE_SIGMA);
        let likelier = |other: f64| (other - residual) / (2.0 * variance * FORCES_PER_PAIR);
        let over_current = likelier(self.forces.residual(&self.correction.force));
        Evidence { best, residual, over_current, over_others: likelier(other_residual) }
    }

    /// Reason why the current correction does not fit.
    fn disagreement(&self, rates: &Sums, rate: &Evidence) -> Option<String> {
        let residual = rates.residual(&self.correction.rate);
        let n = rates.n();
        let signal = rates.signal();
        let rotation = (signal / n).sqrt();
        if rate.over_current > DECISIVE && residual > MAX_UNEXPLAINED * signal && rotation > MIN_ROTATION {
            return Some("its angular rates do not follow the rotation of the LiDAR".into());
        }
        if rotation > CLEAR_ROTATION && residual > 0.7 * signal {
            return Some("its angular rates have nothing in common with the rotation of the LiDAR".into());
        }
        if (residual / n).sqrt() > MAX_RATE_NOISE {
            let noise = (residual / n).sqrt();
            return Some(format!("its angular rates scatter by {noise:.2} rad/s around the rotation of the LiDAR"));
        }
        let of_forces = self.forces.residual(&self.correction.force);
        if self.forces.n() >= MIN_FORCES && !is_small(of_forces, self.forces.n()) {
            let off = (of_forces / self.forces.n()).sqrt();
            return Some(format!("its specific forces are {off:.1} m/s^2 off the acceleration of the LiDAR"));
        }
        let force = (self.forces.n() >= 3.0 * MIN_FORCES).then(|| self.force_evidence());
        if force.is_some_and(|force| force.over_current > DECISIVE) {
            return Some("its specific forces do not follow the acceleration of the LiDAR".into());
        }
        None
    }

    /// Uses the unit with these axes and units of measurement from now on.
    fn accept(&mut self, rate: Fit, force: Fit) {
        let is_new = rate != self.correction.rate || force != self.correction.force;
        if is_new || matches!(self.trust, Trust::Withheld(_)) {
            let late_s = self.correction.late_s;
            let rotation = if is_new { UnitQuaternion::identity() } else { self.correction.rotation };
            let force_bias = if is_new { Vector3::zeros() } else { self.correction.force_bias };
            self.correction = InertialCorrection { rate, force, rotation, force_bias, late_s };
            if is_new {
                self.biases = BiasSums::default();
            }
            self.trust = Trust::Verified;
            self.has_changed = true;
        }
    }

    /// Estimates the time offset, and corrects it if it is significant.
    fn estimate_lateness(&mut self, rates: &[Sums]) {
        let residual = |step: usize| rates[step].residual(&self.correction.rate);
        let Some(least) = (0..rates.len()).min_by(|a, b| residual(*a).total_cmp(&residual(*b))) else { return };
        let variance = (residual(least) / (3.0 * rates[least].n())).max(RATE_SIGMA * RATE_SIGMA) * RATES_PER_PAIR;
        if least == 0 || least + 1 == rates.len() || residual(least) > MAX_UNEXPLAINED * rates[least].signal() {
            return;
        }
        let [before, here, after] = [least - 1, least, least + 1].map(residual);
        let curvature = (before - 2.0 * here + after) / (LAG_STEP_S * LAG_STEP_S);
        let offset = (before - after) / (2.0 * LAG_STEP_S * curvature);
        let late_s = lag_s(least) + if offset.abs() < LAG_STEP_S { offset } else { 0.0 };
        let late_sigma_s = (2.0 * variance / curvature).sqrt();
        let unknown = InertialMounting {
            rotation: Vector3::zeros(),
            rotation_sigma: Vector3::repeat(std::f64::consts::PI),
            late_s,
            late_sigma_s,
        };
        self.mounting = Some(InertialMounting { late_s, late_sigma_s, ..self.mounting.unwrap_or(unknown) });
        let likelier = (residual(self.current_step()) - here) / (2.0 * variance);
        if likelier > DECISIVE && (late_s - self.correction.late_s).abs() > MIN_LATE_S {
            self.correction.late_s = late_s;
        }
    }

    /// Estimates the rotation of the mounting, and corrects it if it is significant.
    fn estimate_rotation(&mut self, rates: &Sums) {
        if rates.signal() < MIN_TURNED {
            return;
        }
        let svd = rates.products(&self.correction.rate).svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return };
        let sense = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
        let matrix = Rotation3::from_matrix_unchecked(u * sense * v_t);
        let rotation = UnitQuaternion::from_rotation_matrix(&matrix).scaled_axis();
        let residual = rates.residual(&self.correction.rate);
        let variance = (residual / (3.0 * rates.n())).max(RATE_SIGMA * RATE_SIGMA) * RATES_PER_PAIR;
        let [x, y, z]: [f64; 3] = rates.signals().into();
        // A rotation about one axis appears in the rates about the two others.
        let rotation_sigma = Vector3::new(y + z, z + x, x + y).map(|sum| (variance / sum.max(1e-12)).sqrt());
        let Some(mounting) = &mut self.mounting else { return };
        mounting.rotation = rotation;
        mounting.rotation_sigma = rotation_sigma;
        let clear = Vector3::from_fn(|axis, _| {
            if rotation[axis].abs() > SIGNIFICANT * rotation_sigma[axis] { rotation[axis] } else { 0.0 }
        });
        let wanted = UnitQuaternion::from_scaled_axis(clear);
        if wanted.angle_to(&self.correction.rotation) > MIN_ROTATED {
            self.correction.rotation = wanted;
            // The differences so far belong to another rotation.
            self.biases = BiasSums::default();
            self.correction.force_bias = Vector3::zeros();
            self.has_changed = true;
        }
    }

    /// Corrects the bias of the accelerometers if it is significant.
    fn correct_force_bias(&mut self) {
        let Some(ForceBias { mean, sigma }) = self.biases.estimate() else { return };
        let current = self.correction.force_bias;
        let wanted = Vector3::from_fn(|axis, _| {
            let is_clear = mean[axis].abs() > (SIGNIFICANT_BIAS * sigma[axis]).max(MIN_FORCE_BIAS);
            if is_clear { mean[axis] } else { current[axis] }
        });
        if (wanted - current).amax() > 0.5 * MIN_FORCE_BIAS {
            self.correction.force_bias = wanted;
            self.has_changed = true;
        }
    }
}

fn is_small(residual: f64, n: f64) -> bool {
    residual < n * MAX_FORCE_RESIDUAL * MAX_FORCE_RESIDUAL
}
