//! Stamps of the sensors compared with each other: a clock may be in another time zone or time scale.

use super::{Answer, Verdict};
use crate::survey::{SensorKind, SensorStamps, Survey};
use geometry::Stamp;

/// Name of the LiDAR in verdicts.
pub(super) const LIDAR: &str = "lidar";
/// Least share of the sweeps that the measurements of a sensor on the same clock cover.
const MIN_OVERLAP: f64 = 0.5;
/// Least share after correction of the clock.
const MIN_CORRECTED: f64 = 0.9;
/// Largest difference between starts and between ends of recordings, s.
const MAX_APART_S: f64 = 5.0;
/// Seconds by which GPS time and TAI are ahead of UTC since 2017.
const SCALES: [(i64, &str); 3] =
    [(18, "GPS time instead of UTC (18 leap seconds)"), (37, "TAI instead of UTC"), (19, "TAI instead of GPS time")];
/// Time zones range from -12 to +14 hours, in quarters of an hour.
const QUARTERS: std::ops::RangeInclusive<i64> = -56..=56;
const QUARTER_S: i64 = 900;

/// A verdict for each sensor with measurements.
pub(super) fn verdicts(survey: &Survey) -> Vec<Verdict> {
    let others = survey.stamps.iter().filter(|sensor| sensor.kind != SensorKind::Lidar);
    let judged: Vec<(&SensorStamps, Judgment)> = others.map(|sensor| (sensor, judgment(sensor, survey.span))).collect();
    let offsets: Vec<Option<i64>> = judged.iter().map(|(_, judgment)| judgment.offset_s).collect();
    let common = offsets.first().copied().flatten();
    if let Some(seconds) = common.filter(|_| offsets.len() > 1 && offsets.iter().all(|offset| *offset == common)) {
        let value = format!("the stamps of all other sensors are {seconds} s later");
        let advice = format!("the clock of the LiDAR is off by {} s: {}", -seconds, reason(-seconds));
        return vec![Verdict::new("clock", LIDAR, false, [value, format!("{MAX_APART_S} s"), advice])];
    }
    judged.into_iter().map(|(sensor, judgment)| judgment.verdict(&sensor.name)).collect()
}

struct Judgment {
    overlap: f64,
    /// Start relative to the start of the sweeps, s.
    begin_s: f64,
    answer: Answer,
    /// A known offset that explains the stamps.
    offset_s: Option<i64>,
}

fn judgment(sensor: &SensorStamps, lidar: [Stamp; 2]) -> Judgment {
    let Some(span) = sensor.span else {
        return Judgment { overlap: 0.0, begin_s: 0.0, answer: Answer::Unknown, offset_s: None };
    };
    let overlap_at = |seconds: i64| {
        overlap(span.map(|stamp| stamp.0.saturating_sub(seconds * 1_000_000_000)), lidar, sensor.interval_s)
    };
    let overlap = overlap_at(0);
    let begin_s = span[0].seconds_since(lidar[0]);
    if overlap >= MIN_OVERLAP {
        return Judgment { overlap, begin_s, answer: Answer::Fits, offset_s: None };
    }
    let scales = SCALES.iter().flat_map(|(seconds, _)| [*seconds, -seconds]);
    let zones = QUARTERS.map(|quarter| quarter * QUARTER_S);
    let fits = |seconds: &i64| overlap_at(*seconds) >= MIN_CORRECTED && (begin_s - *seconds as f64).abs() < MAX_APART_S;
    let offset_s = scales.chain(zones).filter(fits).min_by(|a, b| {
        let off = |seconds: i64| (begin_s - seconds as f64).abs();
        off(*a).total_cmp(&off(*b))
    });
    Judgment { overlap, begin_s, answer: Answer::Doubt, offset_s }
}

/// Overlap as a share of the shorter of two spans. Measurements are valid up to the next one.
fn overlap([begin, end]: [i64; 2], lidar: [Stamp; 2], interval_s: f64) -> f64 {
    let end = end.saturating_add((interval_s * 1e9) as i64);
    let common = end.min(lidar[1].0).saturating_sub(begin.max(lidar[0].0)).max(0) as f64;
    let shorter = end.saturating_sub(begin).min(lidar[1].0 - lidar[0].0).max(1) as f64;
    common / shorter
}

impl Judgment {
    fn verdict(&self, name: &str) -> Verdict {
        if self.answer == Answer::Unknown {
            return Verdict::unknown("clock", name, "no measurements");
        }
        let value = format!("begins {:+.3} s after the sweeps, {:.0} % overlap", self.begin_s, 100.0 * self.overlap);
        let limit = format!("at least {:.0} %", 100.0 * MIN_OVERLAP);
        let advice = match self.offset_s {
            Some(seconds) => format!("subtract {seconds} s from its stamps: {}", reason(seconds)),
            None => format!("its stamps are on another clock, {:.1} s off at the start; check its clock", self.begin_s),
        };
        Verdict::new("clock", name, self.answer == Answer::Fits, [value, limit, advice])
    }
}

/// Name of an offset.
fn reason(seconds: i64) -> String {
    let of_scale = SCALES.iter().find(|(scale, _)| *scale == seconds.abs());
    match of_scale {
        Some((_, scale)) if seconds > 0 => (*scale).to_owned(),
        Some((scale, _)) => format!("corrected twice for {scale}"),
        None => format!("local time of a zone {:+} hours from UTC", seconds as f64 / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    fn sensor(begin_s: i64, end_s: i64) -> SensorStamps {
        SensorStamps {
            kind: SensorKind::Imu,
            name: "imu".to_owned(),
            n: 100,
            span: Some([begin_s, end_s].map(|s| Stamp(s * SECOND))),
            interval_s: 0.01,
            gap_s: 0.01,
        }
    }

    #[track_caller]
    fn check([begin_s, end_s]: [i64; 2], answer: Answer, offset_s: Option<i64>) {
        let found = judgment(&sensor(begin_s, end_s), [Stamp(100 * SECOND), Stamp(112 * SECOND)]);
        assert_eq!(found.answer, answer);
        assert_eq!(found.offset_s, offset_s);
    }

    #[test]
    fn offsets_of_zones_and_leap_seconds_are_named() {
        check([100, 112], Answer::Fits, None);
        check([99, 113], Answer::Fits, None);
        check([3700, 3712], Answer::Doubt, Some(3600));
        check([118, 130], Answer::Doubt, Some(18));
        check([63, 75], Answer::Doubt, Some(-37));
        check([100 - 19_800, 112 - 19_800], Answer::Doubt, Some(-19_800));
        check([50_000, 50_012], Answer::Doubt, None);
        assert_eq!(reason(18), "GPS time instead of UTC (18 leap seconds)");
        assert_eq!(reason(-7200), "local time of a zone -2 hours from UTC");
    }
}
