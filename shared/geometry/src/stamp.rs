//! Time stamps.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Nanoseconds since the Unix epoch (UTC).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Stamp(pub i64);

impl Stamp {
    /// `seconds` since the epoch. Exact to about 0.2 µs for dates of this century.
    pub fn from_seconds(seconds: f64) -> Self {
        Stamp((seconds * 1e9).round() as i64)
    }
    /// Seconds from `earlier` to this stamp.
    pub fn seconds_since(self, earlier: Stamp) -> f64 {
        (self.0 - earlier.0) as f64 * 1e-9
    }
    /// This stamp moved by `nanos`.
    #[must_use]
    pub fn plus_nanos(self, nanos: i64) -> Self {
        Stamp(self.0 + nanos)
    }
}

impl fmt::Display for Stamp {
    /// Seconds with nine exact decimals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09}", self.0.div_euclid(1_000_000_000), self.0.rem_euclid(1_000_000_000))
    }
}
