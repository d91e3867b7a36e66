//! Turning rates of the path against the inertial unit: the clock, and the sense of rotation.

use super::cause_of;
use crate::GivenPath;
use drive::imu::ImuSample;
use geometry::Stamp;

/// Width of a bin, ns: shorter than the time in which a vehicle starts to turn.
const BIN_NANOS: i64 = 50_000_000;
/// Longest compared time: 15 minutes.
const MAX_BINS: usize = 18_000;
/// Searched time difference around each candidate: 40 s, above the leap seconds and the offset of TAI.
const MAX_LAG: i64 = 800;
/// Least standard deviation of the rate, rad/s: a vehicle that hardly turns does not show its time.
const MIN_TURNING_RADPS: f64 = 0.02;
/// Correlation of a path that turns as the unit. Solutions of the same drive have above 0.95.
const MIN_CORRELATION: f64 = 0.7;
/// Largest time difference that is accepted, s: 0.5 m at 10 m/s. It is found to 10 ms.
const MAX_OFFSET_S: f64 = 0.05;
/// Least number of common bins.
const MIN_BINS: usize = 200;

/// Rates about the body's z axis in bins of equal width.
struct Rates {
    begin: i64,
    /// NaN in bins without samples.
    values: Vec<f64>,
}

/// Result of a comparison.
#[derive(Clone, Copy)]
struct Fit {
    /// Seconds by which the path is late.
    late_s: f64,
    correlation: f64,
    /// Rate of the path per rate of the unit.
    factor: f64,
}

pub(super) fn agrees(path: &GivenPath, imu: &[ImuSample]) -> Result<String, String> {
    let Some(measured) = rates_from_imu(imu, path) else {
        return Ok("turning and time not compared: no inertial unit within the time of the path".into());
    };
    if deviation(&measured.values) < MIN_TURNING_RADPS {
        return Ok("turning and time not compared: the vehicle hardly turns".into());
    }
    let at = Stamp(measured.begin);
    let near = best_fit(path, &measured, 0);
    if let Some(fit) = near
        && fit.correlation.abs() >= MIN_CORRELATION
    {
        return judged(&fit, at);
    }
    let far = (-14..=14).filter(|hours| *hours != 0).filter_map(|hours| best_fit(path, &measured, hours * 3600));
    let best = far.chain(near).max_by(|a, b| a.correlation.abs().total_cmp(&b.correlation.abs()));
    match best {
        Some(fit) if fit.correlation.abs() >= MIN_CORRELATION => judged(&fit, at),
        best => Err(format!(
            "the path does not turn as the inertial unit does (correlation {:.2}, expected {MIN_CORRELATION} or more, for any time difference \
             up to 14 h); it may be the path of another drive, or the axes of [imu] or trajectory.body_from_reference are wrong",
            best.map_or(0.0, |fit| fit.correlation)
        )),
    }
}

fn judged(fit: &Fit, at: Stamp) -> Result<String, String> {
    let Fit { late_s, correlation, factor } = *fit;
    if correlation < 0.0 {
        return Err(format!(
            "the path turns right where the inertial unit turns left (correlation {correlation:.2}): an axis of the path is mirrored, \
             or its heading counts the other way; check trajectory.heading, or the axes of [imu]"
        ));
    }
    if late_s.abs() > MAX_OFFSET_S {
        let side = if late_s > 0.0 { "late" } else { "early" };
        let cause = cause_of(late_s, at).unwrap_or_else(|| {
            format!(
                "if the clock of the inertial unit is right, set trajectory.delay_nanos = {:.0}",
                (late_s * 1e3).round() * 1e6
            )
        });
        return Err(format!(
            "the path is {:.2} s {side}, by the turning rate of the inertial unit (correlation {correlation:.2}); {cause}",
            late_s.abs()
        ));
    }
    if !(0.8..1.25).contains(&factor) {
        let unit = if (40.0..80.0).contains(&factor) || (0.0125..0.025).contains(&factor) {
            "; one of them is in degrees and was read as radians, or the reverse"
        } else {
            ""
        };
        return Err(format!("the path turns {factor:.3} times as fast as the inertial unit{unit}"));
    }
    Ok(format!(
        "turning agrees with the inertial unit (correlation {correlation:.3}, time difference {:.0} ms)",
        late_s * 1e3
    ))
}

/// Mean rates of the samples; `None` with too few of them within the path.
fn rates_from_imu(imu: &[ImuSample], path: &GivenPath) -> Option<Rates> {
    let begin = imu.first()?.stamp.0.max(path.span()[0].0);
    let begin = if begin > imu.last()?.stamp.0 { imu.first()?.stamp.0 } else { begin };
    let n = (((imu.last()?.stamp.0 - begin) / BIN_NANOS) as usize).min(MAX_BINS);
    let mut sums = vec![0.0; n];
    let mut counts = vec![0_u32; n];
    for sample in imu {
        let bin = (sample.stamp.0 - begin).div_euclid(BIN_NANOS);
        if let Some(sum) = usize::try_from(bin).ok().and_then(|bin| sums.get_mut(bin)) {
            *sum += sample.angular_rate[2];
            counts[bin as usize] += 1;
        }
    }
    let mean = |(sum, count): (f64, u32)| if count > 0 { sum / f64::from(count) } else { f64::NAN };
    (n >= MIN_BINS).then(|| Rates { begin, values: sums.into_iter().zip(counts).map(mean).collect() })
}

/// The best time difference around a number of seconds.
fn best_fit(path: &GivenPath, measured: &Rates, around_s: i64) -> Option<Fit> {
    let n = measured.values.len() as i64;
    let begin = measured.begin + around_s * 1_000_000_000 - MAX_LAG * BIN_NANOS;
    let [first, last] = path.span();
    if first.0 > begin + (n + 2 * MAX_LAG) * BIN_NANOS || last.0 < begin {
        return None;
    }
    let poses: Vec<_> = (0..=n + 2 * MAX_LAG).map(|bin| path.at(Stamp(begin + bin * BIN_NANOS))).collect();
    let seconds = BIN_NANOS as f64 * 1e-9;
    let rate = |pair: &[Option<geometry::Pose>]| match pair {
        [Some(a), Some(b)] => (a.rotation.inverse() * b.rotation).scaled_axis().z / seconds,
        _ => f64::NAN,
    };
    let given: Vec<f64> = poses.windows(2).map(rate).collect();
    let fits: Vec<Option<(f64, f64)>> =
        (0..=2 * MAX_LAG as usize).map(|lag| correlated(&measured.values, &given[lag..])).collect();
    let (lag, (correlation, factor)) = fits
        .iter()
        .enumerate()
        .filter_map(|(lag, fit)| Some((lag, (*fit)?)))
        .max_by(|a, b| a.1.0.abs().total_cmp(&b.1.0.abs()))?;
    // The vertex of the parabola through three correlations.
    let at_lag = |lag: Option<usize>| lag.and_then(|lag| Some(fits.get(lag)?.as_ref()?.0));
    let vertex = match (at_lag(lag.checked_sub(1)), at_lag(Some(lag + 1))) {
        (Some(before), Some(after)) => {
            let curvature = before - 2.0 * correlation + after;
            if curvature.abs() > 1e-12 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
        }
        _ => 0.0,
    };
    let late_s = around_s as f64 + (lag as f64 + vertex - MAX_LAG as f64) * seconds;
    Some(Fit { late_s, correlation, factor })
}

/// Correlation of two series where both have values, and the slope of the second over the first.
fn correlated(a: &[f64], b: &[f64]) -> Option<(f64, f64)> {
    let mut n = 0.0;
    let [mut sum_a, mut sum_b, mut aa, mut bb, mut ab] = [0.0; 5];
    for (a, b) in a.iter().zip(b) {
        if a.is_finite() && b.is_finite() {
            n += 1.0;
            sum_a += a;
            sum_b += b;
            aa += a * a;
            bb += b * b;
            ab += a * b;
        }
    }
    if n < MIN_BINS as f64 || n < 0.5 * a.len() as f64 {
        return None;
    }
    let covariance = ab - sum_a * sum_b / n;
    let (var_a, var_b) = (aa - sum_a * sum_a / n, bb - sum_b * sum_b / n);
    (var_a > 0.0 && var_b > 0.0).then(|| (covariance / (var_a * var_b).sqrt(), covariance / var_a))
}

fn deviation(values: &[f64]) -> f64 {
    let sound: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let n = sound.len().max(1) as f64;
    let mean = sound.iter().sum::<f64>() / n;
    (sound.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt()
}
