//! Where one revolution ends and the next begins.

use super::packet::TURN;

/// The encoder may stutter by a count or two; a fall by more than this is the end of a turn.
const JITTER: u16 = 1000;
/// A gap in which the sensor may have gone through a whole turn (at 10 Hz) ends the revolution.
const MAX_GAP_NANOS: i64 = 100_000_000;
/// The slowest sensor takes 200 ms; one that takes longer stands still.
const MAX_NANOS: i64 = 500_000_000;
/// Two echoes of the fastest firing sensor (2.2 million a second) in a slow turn, and reserve.
pub(super) const MAX_RETURNS: usize = 600_000;

/// A revolution under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Revolution {
    /// Of its first firing, ns since the epoch.
    pub(super) begin: i64,
    last: i64,
    last_azimuth: u16,
    /// Encoder counts that it has gone through.
    pub(super) turned: u32,
    pub(super) n_returns: usize,
}

/// Why a block does not belong to the revolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The encoder began anew.
    Wrapped,
    /// A gap, a standing motor or too many returns.
    Forced,
}

impl Revolution {
    /// Starts with a block.
    pub(super) fn begin(at: i64, azimuth: u16) -> Self {
        Self { begin: at, last: at, last_azimuth: azimuth, turned: 0, n_returns: 0 }
    }

    /// Takes the block in, or says why it is the first of the next revolution.
    pub(super) fn take(&mut self, at: i64, azimuth: u16) -> Result<(), End> {
        if azimuth < self.last_azimuth && self.last_azimuth - azimuth > JITTER {
            return Err(End::Wrapped);
        }
        if at - self.last > MAX_GAP_NANOS || at - self.begin > MAX_NANOS || self.n_returns > MAX_RETURNS {
            return Err(End::Forced);
        }
        self.turned += u32::from(azimuth.saturating_sub(self.last_azimuth));
        (self.last, self.last_azimuth) = (at, azimuth);
        Ok(())
    }

    /// Share of a turn that it went through, 0 to 1.
    pub(super) fn share(&self) -> f64 {
        (f64::from(self.turned) / f64::from(TURN)).min(1.0)
    }

    /// When its last block fired.
    pub(super) fn last(&self) -> i64 {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_ends_where_the_encoder_begins_anew() {
        let mut revolution = Revolution::begin(0, 20);
        for (i, azimuth) in (38..36_000).step_by(18).enumerate() {
            // Every tenth reading stutters.
            let azimuth = if i % 10 == 0 { azimuth - 19 } else { azimuth };
            assert_eq!(revolution.take(i as i64 * 46_080, azimuth), Ok(()));
        }
        assert!(revolution.share() > 0.99);
        assert_eq!(revolution.take(95_000_000, 5), Err(End::Wrapped));
    }

    #[test]
    fn gaps_and_standing_motors_end_it_too() {
        let mut revolution = Revolution::begin(0, 100);
        assert_eq!(revolution.take(99_000_000, 35_000), Ok(()));
        assert_eq!(revolution.take(200_000_000, 35_900), Err(End::Forced));
        let mut still = Revolution::begin(0, 100);
        let end = (1..1000).find(|i| still.take(i * 552_960, 100).is_err()).expect("ends");
        assert_eq!(end, 905);
    }
}
