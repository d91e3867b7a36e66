//! Clocks of the sensors compared with the host clock: offset, drift and jitter of (arrival - stamp).
//!
//! A measurement arrives with a delay that is never below zero and mostly near its minimum. The minimum over a window
//! is therefore the sum of the clock offset and the least delay, which are indistinguishable.

use geometry::Stamp;
use std::collections::BTreeMap;
use std::fmt::Write;

/// First length of a window, ns: a camera at 1 Hz has one image in it.
const WINDOW_NANOS: i64 = 1_000_000_000;
/// Largest number of windows of a sensor; beyond it, pairs are joined. A day has windows of three minutes.
const MAX_WINDOWS: usize = 512;
/// Shortest time for a drift. Over a shorter time, jitter of milliseconds hides the drift of a quartz, some ten ppm.
const MIN_DRIFT_S: f64 = 60.0;

/// Header of the table in a recording.
const HEADER: &str = "sensor,measurements,offset_s,drift_ppm,jitter_s";

/// Arrivals of one sensor.
#[derive(Clone, Debug, Default)]
struct Arrivals {
    windows: Vec<Window>,
    window_nanos: i64,
    /// First arrival, and its delay, the reference of all delays.
    first: Option<(i64, i64)>,
    n: u64,
}

/// Delays relative to the first one, s.
#[derive(Clone, Copy, Debug)]
struct Window {
    /// Time of the least delay after the first arrival, s.
    time_s: f64,
    least_s: f64,
    n: f64,
    sum: f64,
    squares: f64,
}

/// Estimate for the clock of one sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockEstimate {
    /// Measurements that were compared.
    pub n: u64,
    /// Arrival minus stamp at the end, s: sum of least delay and clock offset.
    pub offset_s: f64,
    /// Rate at which the offset grows, ppm; `None` for less than a minute.
    pub drift_ppm: Option<f64>,
    /// Typical delay above the offset (rms), s.
    pub jitter_s: f64,
}

/// Clocks of all sensors, by name.
#[derive(Clone, Debug, Default)]
pub struct Clocks(BTreeMap<String, Arrivals>);

impl Clocks {
    /// Adds a measurement of a sensor.
    pub fn add(&mut self, sensor: &str, stamp: Stamp, arrived: Stamp) {
        if let Some(arrivals) = self.0.get_mut(sensor) {
            arrivals.add(stamp, arrived);
        } else {
            self.0.entry(sensor.to_owned()).or_default().add(stamp, arrived);
        }
    }

    /// All sensors with measurements.
    pub fn estimates(&self) -> Vec<(&str, ClockEstimate)> {
        self.0.iter().filter_map(|(name, arrivals)| Some((name.as_str(), arrivals.estimate()?))).collect()
    }

    /// CSV with one line for each sensor.
    pub fn table(&self) -> String {
        let mut text = format!("{HEADER}\n");
        for (name, ClockEstimate { n, offset_s, drift_ppm, jitter_s }) in self.estimates() {
            let drift = drift_ppm.map(|ppm| format!("{ppm:.3}")).unwrap_or_default();
            // Names of cameras may have any character.
            let name = name.replace([',', '\n', '\r', '"'], " ");
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name},{n},{offset_s:.6},{drift},{jitter_s:.6}");
        }
        text
    }
}

impl std::fmt::Display for ClockEstimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "arrival - stamp {:.1} ms", self.offset_s * 1e3)?;
        if let Some(ppm) = self.drift_ppm {
            write!(f, ", drift {ppm:.1} ppm")?;
        }
        write!(f, ", jitter {:.1} ms, {} measurements", self.jitter_s * 1e3, self.n)
    }
}

impl Arrivals {
    fn add(&mut self, stamp: Stamp, arrived: Stamp) {
        let delay = arrived.0.saturating_sub(stamp.0);
        let (first, first_delay) = *self.first.get_or_insert((arrived.0, delay));
        self.window_nanos = self.window_nanos.max(WINDOW_NANOS);
        let since = arrived.0.saturating_sub(first).max(0);
        let time_s = since as f64 * 1e-9;
        let delay_s = delay.saturating_sub(first_delay) as f64 * 1e-9;
        self.n += 1;
        let window = Window { time_s, least_s: delay_s, n: 1.0, sum: delay_s, squares: delay_s * delay_s };
        let index = |time_s: f64, nanos: i64| (time_s * 1e9) as i64 / nanos;
        let is_same = |last: &&mut Window| index(last.time_s, self.window_nanos) >= index(time_s, self.window_nanos);
        match self.windows.last_mut().filter(is_same) {
            Some(last) => last.join(&window),
            None => self.windows.push(window),
        }
        if self.windows.len() > MAX_WINDOWS {
            self.window_nanos *= 2;
            let mut joined: Vec<Window> = Vec::with_capacity(MAX_WINDOWS);
            for window in self.windows.drain(..) {
                let nanos = self.window_nanos;
                match joined.last_mut().filter(|last| index(last.time_s, nanos) == index(window.time_s, nanos)) {
                    Some(last) => last.join(&window),
                    None => joined.push(window),
                }
            }
            self.windows = joined;
        }
    }

    /// Fits a line through the minima of the windows.
    fn estimate(&self) -> Option<ClockEstimate> {
        let last = self.windows.last()?;
        let (_, first_delay) = self.first?;
        let n = self.windows.len() as f64;
        let mean = |value: fn(&Window) -> f64| self.windows.iter().map(value).sum::<f64>() / n;
        let time_s = mean(|window| window.time_s);
        let least_s = mean(|window| window.least_s);
        let moment = |value: &dyn Fn(&Window) -> f64| {
            self.windows.iter().map(|window| (window.time_s - time_s) * value(window)).sum::<f64>()
        };
        let has_drift = last.time_s >= MIN_DRIFT_S && n >= 10.0;
        let drift = if has_drift {
            moment(&|window| window.least_s - least_s) / moment(&|window| window.time_s - time_s)
        } else {
            0.0
        };
        let least = self.windows.iter().map(|window| window.least_s).fold(f64::INFINITY, f64::min);
        let at = |time: f64| if has_drift { least_s + drift * (time - time_s) } else { least };
        let mut squares = 0.0;
        let mut count = 0.0;
        for window in &self.windows {
            let at = at(window.time_s);
            squares += window.squares - 2.0 * at * window.sum + window.n * at * at;
            count += window.n;
        }
        Some(ClockEstimate {
            n: self.n,
            offset_s: first_delay as f64 * 1e-9 + at(last.time_s),
            drift_ppm: has_drift.then_some(drift * 1e6),
            jitter_s: (squares / f64::max(count, 1.0)).max(0.0).sqrt(),
        })
    }
}

impl Window {
    fn join(&mut self, other: &Self) {
        if other.least_s < self.least_s {
            self.time_s = other.time_s;
            self.least_s = other.least_s;
        }
        self.n += other.n;
        self.sum += other.sum;
        self.squares += other.squares;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Estimates a clock that is `offset_s` behind the host and `ppm` slower; delays are 2 ms and up to 10 ms more.
    fn estimate(seconds: i64, offset_s: f64, ppm: f64) -> ClockEstimate {
        let mut clocks = Clocks::default();
        let begin = 1_700_000_000_000_000_000_i64;
        let mut random = 1_u64;
        for k in 0..seconds * 10 {
            let host = begin + k * 100_000_000;
            let stamp = host - ((offset_s + ppm * 1e-6 * (k as f64 * 0.1)) * 1e9) as i64;
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let delay = 2_000_000 + (random >> 40) as i64 * 10_000_000 / (1 << 24);
            clocks.add("lidar", Stamp(stamp), Stamp(host + delay));
        }
        let estimates = clocks.estimates();
        assert_eq!(estimates[0].0, "lidar");
        estimates[0].1
    }

    #[test]
    fn offset_and_drift_of_a_clock_are_found() {
        let steady = estimate(30, 0.25, 0.0);
        assert!((steady.offset_s - 0.252).abs() < 2e-4, "{steady:?}");
        assert_eq!((steady.n, steady.drift_ppm), (300, None));
        // Delays of 0 to 10 ms above the least have an rms of 5.8 ms.
        assert!((steady.jitter_s - 0.0058).abs() < 1e-3, "{steady:?}");
        for (seconds, ppm) in [(300, 40.0), (4000, -15.0)] {
            let drifting = estimate(seconds, -3.0, ppm);
            assert!((drifting.drift_ppm.expect("is known") - ppm).abs() < 2.0, "{drifting:?}");
            let at_end = -3.0 + 0.002 + ppm * 1e-6 * seconds as f64;
            assert!((drifting.offset_s - at_end).abs() < 2e-3, "{drifting:?}");
        }
    }

    #[test]
    fn memory_of_a_long_run_is_bounded() {
        let mut clocks = Clocks::default();
        for k in 0..10 * MAX_WINDOWS as i64 {
            clocks.add("imu", Stamp(k * WINDOW_NANOS), Stamp(k * WINDOW_NANOS + 7_000_000));
        }
        assert!(clocks.0["imu"].windows.len() <= MAX_WINDOWS);
        assert!((clocks.estimates()[0].1.offset_s - 0.007).abs() < 1e-9);
        let extreme = [(i64::MIN, i64::MAX), (i64::MAX, i64::MIN), (0, 0)];
        for (stamp, arrived) in extreme {
            clocks.add("a,b", Stamp(stamp), Stamp(arrived));
        }
        assert!(
            clocks.table().starts_with("sensor,measurements,offset_s,drift_ppm,jitter_s\na b,3,"),
            "{}",
            clocks.table()
        );
    }
}
