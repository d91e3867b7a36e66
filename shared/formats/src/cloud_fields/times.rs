//! Times of points: their unit and their origin.
//!
//! | driver | field | values |
//! |---|---|---|
//! | Velodyne | `time` f32 | s from the stamp, often negative |
//! | Ouster | `t` u32 | ns from the stamp |
//! | Hesai, Robosense | `timestamp` f64 | s since 1970 |
//! | Livox | `offset_time` u32, `timestamp` f64 | ns from the stamp; ns since 1970 |
//!
//! The names do not determine the units: forks of the same driver write s, ms, µs or ns. The unit is determined by the
//! time from the first to the last point of a cloud, which is 5 ms to 0.5 s, because the units differ by factors of a
//! thousand.

/// Shortest and longest time from the first to the last point of a cloud, s.
const SPAN_S: [f64; 2] = [0.005, 0.5];
/// Times that count from the stamp are nearer to 0 than this, times since 1970 are nearer to the stamp than this, s.
const NEAR_S: f64 = 10.0;
/// Units with their lengths in ns.
const UNITS: [(&str, f64); 4] = [("s", 1e9), ("ms", 1e6), ("us", 1e3), ("ns", 1.0)];

/// Origin of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Begin {
    Stamp,
    Epoch,
    /// Origin of a clock that was not set.
    Other,
}

/// Unit and origin of times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeForm {
    unit: &'static str,
    unit_nanos: f64,
    begin: Begin,
}

impl TimeForm {
    /// Determines the form of the times of a cloud from their smallest and largest value and from its stamp. `None` if no
    /// unit gives the duration of a sweep.
    pub fn from_range(min: f64, max: f64, stamp: i64) -> Option<Self> {
        let fits = |(_, nanos): &&(&str, f64)| (SPAN_S[0]..=SPAN_S[1]).contains(&((max - min) * nanos * 1e-9));
        let (unit, unit_nanos) = *UNITS.iter().find(fits)?;
        let first_s = min * unit_nanos * 1e-9;
        let begin = if first_s.abs() <= NEAR_S {
            Begin::Stamp
        } else if (first_s - stamp as f64 * 1e-9).abs() <= NEAR_S {
            Begin::Epoch
        } else {
            Begin::Other
        };
        Some(Self { unit, unit_nanos, begin })
    }

    /// Converts the times of a message with this stamp to ns since the Unix epoch. `None` if a time is outside the years
    /// 1678 to 2261.
    pub fn nanos(self, times: impl Iterator<Item = f64>, stamp: i64) -> Option<Vec<i64>> {
        let mut nanos = times.map(|time| self.whole_nanos(time)).collect::<Option<Vec<i64>>>()?;
        let shift = match self.begin {
            Begin::Stamp => stamp,
            Begin::Epoch => 0,
            Begin::Other => stamp.checked_sub(nanos.iter().copied().min().unwrap_or(0))?,
        };
        for time in &mut nanos {
            *time = time.checked_add(shift)?;
        }
        Some(nanos)
    }

    fn whole_nanos(self, time: f64) -> Option<i64> {
        // ns since 1970 as f64 have a resolution of 256 ns; whole seconds and fraction do not.
        let whole = time.trunc() * self.unit_nanos;
        let rest = time.fract() * self.unit_nanos;
        let is_in_range = whole.abs() < 9.2e18;
        is_in_range.then(|| time.trunc() as i64 * self.unit_nanos as i64 + rest.round() as i64)
    }

    /// Times from the stamp in a unit; `None` for other words than `s`, `ms`, `us` and `ns`.
    pub(super) fn in_unit(name: &str) -> Option<Self> {
        let (unit, unit_nanos) = *UNITS.iter().find(|(unit, _)| *unit == name)?;
        Some(Self { unit, unit_nanos, begin: Begin::Stamp })
    }

    /// A time after its origin, ns. `None` if it is not a time.
    pub(super) fn offset_nanos(self, time: f64) -> Option<i64> {
        self.whole_nanos(time)
    }

    /// Whether times count from the stamp.
    pub(super) fn is_from_stamp(self) -> bool {
        self.begin == Begin::Stamp
    }

    /// Whether times count from 1970.
    pub(super) fn is_from_epoch(self) -> bool {
        self.begin == Begin::Epoch
    }

    /// Name of the unit.
    pub fn unit(self) -> &'static str {
        self.unit
    }

    /// Converts a time to s.
    pub fn seconds(self, time: f64) -> f64 {
        time * self.unit_nanos * 1e-9
    }

    /// Text for the report.
    pub fn text(self) -> String {
        let begin = match self.begin {
            Begin::Stamp => "from the stamp",
            Begin::Epoch => "since 1970",
            Begin::Other => "of another clock; sweeps begin at the stamps",
        };
        format!("{} {begin}", self.unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAMP: i64 = 1_700_000_000_000_000_000;

    #[test]
    fn forms_of_all_drivers_are_recognized_by_their_span() {
        for (driver, first, last, text, begin) in [
            ("Velodyne", -0.1, 0.0, "s from the stamp", STAMP - 100_000_000),
            ("Ouster", 0.0, 100_000_000.0, "ns from the stamp", STAMP),
            ("Hesai", 1_700_000_000.0, 1_700_000_000.1, "s since 1970", STAMP),
            ("Livox", 1.7e18, 1.7e18 + 1e8, "ns since 1970", STAMP),
            ("ms", 0.0, 100.0, "ms from the stamp", STAMP),
            ("us", 0.0, 100_000.0, "us from the stamp", STAMP),
            // Time since the sensor was switched on.
            ("own clock", 5000.0, 5000.1, "s of another clock; sweeps begin at the stamps", STAMP),
        ] {
            let form = TimeForm::from_range(first, last, STAMP).unwrap_or_else(|| panic!("{driver}"));
            let nanos = form.nanos([last, first].into_iter(), STAMP).expect("in range");
            assert_eq!((form.text().as_str(), nanos[1]), (text, begin), "{driver}");
            assert!((nanos[0] - nanos[1] - 100_000_000).abs() < 300, "{driver}: {nanos:?}");
        }
    }

    #[test]
    fn times_without_the_span_of_a_sweep_have_no_form() {
        let form = TimeForm::from_range(1.7e9, 1.7e9 + 0.1, STAMP).expect("s");
        assert_eq!(form.nanos([1_700_000_000.25].into_iter(), 0), Some(vec![1_700_000_000_250_000_000]));
        for (first, last) in [(0.0, 0.0), (0.0, 2.0), (5.0, 5.002), (0.0, 2e9), (f64::NAN, f64::NAN)] {
            assert_eq!(TimeForm::from_range(first, last, STAMP), None, "{first} {last}");
        }
        let form = TimeForm::from_range(0.0, 0.1, STAMP).expect("s");
        assert_eq!(form.nanos([1e300].into_iter(), STAMP), None);
        assert_eq!(form.nanos([f64::NAN].into_iter(), STAMP), None);
    }
}
