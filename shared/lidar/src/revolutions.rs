//! Splits the stream of blocks into revolutions.

/// A decrease of the encoder angle by more than this ends a revolution. Smaller decreases are jitter.
const JITTER: u16 = 1000;
/// A gap of this length ends the revolution: at 10 Hz the sensor may have completed a revolution in it.
const MAX_GAP_NANOS: i64 = 100_000_000;
/// Longest revolution. The slowest sensor takes 200 ms, so a longer one means that the motor stands still.
const MAX_NANOS: i64 = 500_000_000;
/// Maximum number of returns of a revolution: two echoes of an HDL-64E (2.2 million per second) in a slow revolution, or
/// of an Ouster with 128 beams and 2048 columns, with a reserve.
pub(super) const MAX_RETURNS: usize = 600_000;

/// A revolution that is being read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Revolution {
    /// Time of its first firing, ns since the epoch.
    pub(super) begin: i64,
    last: i64,
    last_azimuth: u16,
    /// Encoder counts covered so far.
    pub(super) turned: u32,
    pub(super) n_returns: usize,
}

/// Reason why a revolution ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The encoder passed zero.
    Wrapped,
    /// A gap, a motor that stands still, or too many returns.
    Forced,
}

impl Revolution {
    /// Begins a revolution with a block.
    pub(super) fn begin(at: i64, azimuth: u16) -> Self {
        Self { begin: at, last: at, last_azimuth: azimuth, turned: 0, n_returns: 0 }
    }

    /// Adds a block. An error if the block belongs to the next revolution.
    pub(super) fn take(&mut self, at: i64, azimuth: u16) -> Result<(), End> {
        if azimuth < self.last_azimuth && self.last_azimuth - azimuth > JITTER {
            return Err(End::Wrapped);
        }
        if at - self.last > MAX_GAP_NANOS || at - self.begin > MAX_NANOS || self.n_returns > MAX_RETURNS {
            return Err(End::Forced);
        }
        self.turned += u32::from(azimuth.saturating_sub(self.last_azimuth));
        self.last = at;
        self.last_azimuth = azimuth;
        Ok(())
    }

    /// Covered part of a revolution, 0 to 1. `full`: encoder counts of a complete one.
    pub(super) fn share(&self, full: u16) -> f64 {
        (f64::from(self.turned) / f64::from(full)).min(1.0)
    }

    /// Time of its last block.
    pub(super) fn last(&self) -> i64 {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::super::TURN;
    use super::*;

    #[test]
    fn revolution_ends_where_the_encoder_passes_zero() {
        let mut revolution = Revolution::begin(0, 20);
        for (i, azimuth) in (38..36_000).step_by(18).enumerate() {
            // Every tenth reading has jitter.
            let azimuth = if i % 10 == 0 { azimuth - 19 } else { azimuth };
            assert_eq!(revolution.take(i as i64 * 46_080, azimuth), Ok(()));
        }
        assert!(revolution.share(TURN) > 0.99);
        assert_eq!(revolution.take(95_000_000, 5), Err(End::Wrapped));
    }

    #[test]
    fn gap_or_standing_motor_ends_the_revolution() {
        let mut revolution = Revolution::begin(0, 100);
        assert_eq!(revolution.take(99_000_000, 35_000), Ok(()));
        assert_eq!(revolution.take(200_000_000, 35_900), Err(End::Forced));
        let mut still = Revolution::begin(0, 100);
        let end = (1..1000).find(|i| still.take(i * 552_960, 100).is_err()).expect("ends");
        assert_eq!(end, 905);
    }
}
