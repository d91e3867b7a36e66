//! Rates between two heartbeats of a stage.

use run::health::Health;

/// Two heartbeats of a stage; rates are taken between them.
#[derive(Clone, Default)]
pub struct HeartbeatPair {
    /// The earlier one.
    pub base: Option<Health>,
    /// The latest one.
    pub last: Option<Health>,
}

impl HeartbeatPair {
    /// Time between the two, s. `None` before there are two.
    pub fn seconds(&self) -> Option<f64> {
        let base = self.base.as_ref()?;
        let last = self.last.as_ref()?;
        let nanos = last.beat_nanos.checked_sub(base.beat_nanos).filter(|nanos| *nanos > 0)?;
        Some(nanos as f64 * 1e-9)
    }

    /// Increase of a count per second. 0 after a restart, which resets counts.
    pub fn rate(&self, count: impl Fn(&Health) -> f64) -> Option<f64> {
        let base = self.base.as_ref()?;
        let last = self.last.as_ref()?;
        Some(((count(last) - count(base)) / self.seconds()?).max(0.0))
    }
}
