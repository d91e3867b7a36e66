//! Times of a trajectory in UTC.

use crate::decode::{Count, RawPath, RawTime};
use drive::manifest::{Clock, TrajectoryEntry};
use formats::gps_time::{EPOCH_NANOS, WEEK_NANOS, leap_seconds_at_unix, unix_nanos_from_gps};
use geometry::Stamp;

/// Largest time of a clock, ns: a century and more.
const MAX_NANOS: i64 = 4_000_000_000_000_000_000;
const DAY_NANOS: i64 = WEEK_NANOS / 7;
/// Stamps before this are not dates: 1990-01-01, ns.
const MIN_DATE_NANOS: i64 = 631_152_000_000_000_000;

/// Converts the times of a file.
pub(crate) struct TimeLine {
    clock: Clock,
    count: Count,
    /// Start of the period, ns since the epoch of GPS time, on the clock of the file.
    period_start: i64,
    delay_nanos: i64,
}

impl TimeLine {
    /// `reference`: a stamp of the drive, which selects the week or day.
    pub fn new(raw: &RawPath, entry: &TrajectoryEntry, reference: Option<Stamp>) -> Result<Self, String> {
        let delay_nanos = entry.delay_nanos;
        let clock = entry.clock.or(raw.clock).ok_or(
            "times since an epoch are UTC (since 1970) or GPS time (since 1980); set trajectory.clock to \"utc\" or \"gps\"",
        )?;
        let is_day = matches!(clock, Clock::GpsDay | Clock::UtcDay);
        let count = if is_day { Count::Period } else { raw.count };
        let mut line = Self { clock, count, period_start: 0, delay_nanos };
        let is_numbered = raw.poses.iter().all(|pose| pose.time.week.is_some());
        if count == Count::Epoch || is_numbered {
            return Ok(line);
        }
        if let Some(week) = entry.gps_week.filter(|_| !is_day) {
            line.period_start = i64::from(week).saturating_mul(WEEK_NANOS);
            return Ok(line);
        }
        let reference = reference
            .filter(|stamp| stamp.0 >= MIN_DATE_NANOS)
            .ok_or("the drive has no date that selects the GPS week of the times; set trajectory.gps_week")?;
        // The period whose path is nearest to the start of the drive.
        let period = if is_day { DAY_NANOS } else { WEEK_NANOS };
        let nominal = line.nanos_from_stamp(reference).div_euclid(period) * period;
        let times = raw.poses.first().zip(raw.poses.last());
        let (first, last) = times.map_or((0, 0), |(first, last)| (first.time.nanos, last.time.nanos));
        let last = if last < first { last + period } else { last };
        let distance = |start: &i64| {
            let from = line.stamp_at(start.saturating_add(first)).0;
            let to = line.stamp_at(start.saturating_add(last)).0;
            if (from..=to).contains(&reference.0) {
                0
            } else {
                from.abs_diff(reference.0).min(to.abs_diff(reference.0))
            }
        };
        let nearest = [nominal, nominal - period, nominal + period].into_iter().min_by_key(distance);
        line.period_start = nearest.unwrap_or(nominal);
        Ok(line)
    }

    fn is_gps(&self) -> bool {
        matches!(self.clock, Clock::Gps | Clock::GpsDay)
    }

    /// ns since the epoch of GPS time on the clock of the file.
    fn nanos_from_stamp(&self, stamp: Stamp) -> i64 {
        stamp.0 - EPOCH_NANOS + if self.is_gps() { leap_seconds(stamp) * 1_000_000_000 } else { 0 }
    }

    /// The stamp of a time in ns since the epoch of GPS time on the clock of the file.
    fn stamp_at(&self, nanos: i64) -> Stamp {
        // Damaged numbers must not overflow.
        let nanos = nanos.clamp(-MAX_NANOS, MAX_NANOS);
        Stamp(if self.is_gps() { unix_nanos_from_gps(nanos) } else { nanos + EPOCH_NANOS } - self.delay_nanos)
    }

    fn stamp(&self, time: RawTime, wrapped: i64) -> Stamp {
        match (self.count, time.week) {
            (Count::Epoch, _) if self.is_gps() => self.stamp_at(time.nanos),
            (Count::Epoch, _) => Stamp(time.nanos.saturating_sub(self.delay_nanos)),
            (Count::Period, Some(week)) => {
                self.stamp_at(i64::from(week).saturating_mul(WEEK_NANOS).saturating_add(time.nanos))
            }
            (Count::Period, None) => {
                self.stamp_at(self.period_start.saturating_add(wrapped).saturating_add(time.nanos))
            }
        }
    }

    /// The stamps of times in their order. Seconds of a week or day may start again at zero.
    pub fn stamps(&self, times: impl Iterator<Item = RawTime>) -> Vec<Stamp> {
        let period = if matches!(self.clock, Clock::GpsDay | Clock::UtcDay) { DAY_NANOS } else { WEEK_NANOS };
        let mut wrapped = 0;
        let mut before = i64::MIN;
        let mut stamps = Vec::new();
        for time in times {
            if before != i64::MIN && before.saturating_sub(time.nanos) > period / 2 {
                wrapped = i64::saturating_add(wrapped, period);
            }
            before = time.nanos;
            stamps.push(self.stamp(time, wrapped));
        }
        stamps
    }
}

/// Seconds by which GPS time is ahead of UTC at a stamp.
pub(crate) fn leap_seconds(stamp: Stamp) -> i64 {
    leap_seconds_at_unix(stamp.0.div_euclid(1_000_000_000) as f64)
}
