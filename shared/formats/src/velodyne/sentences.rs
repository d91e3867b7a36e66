//! Fixes out of position packets.

use crate::nmea::{Fix, FixJoiner, LogStats};
use serde::{Deserialize, Serialize};

/// A receiver speaks once a second, of each moment in one or two sentences; the sensor sends the last one again and again,
/// 200 times a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Sentences {
    joiner: FixJoiner,
    /// Digests of the last two sentences.
    recent: [u64; 2],
}

impl Sentences {
    /// Takes the sentence of a packet, and gives the fix that it completes.
    pub(super) fn take(&mut self, sentence: &str) -> Option<Fix> {
        let digest = digest(sentence);
        // Without a receiver packets are empty.
        if sentence.is_empty() || self.recent.contains(&digest) {
            return None;
        }
        self.recent = [digest, self.recent[0]];
        self.joiner.take(sentence.as_bytes())
    }

    /// The fix that is still open.
    pub(super) fn finish(&mut self) -> Option<Fix> {
        self.joiner.finish()
    }

    pub(super) fn stats(&self) -> LogStats {
        self.joiner.stats()
    }
}

/// FNV-1a: no sentence has to be kept in the saved position.
fn digest(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmea::{gga_from_fix, rmc_from_fix};
    use geometry::Stamp;

    #[test]
    fn repeated_sentences_give_one_fix() {
        let fix = |second: i64| Fix {
            stamp: Stamp(1_600_000_000_000_000_000 + second * 1_000_000_000),
            position_deg: [48.8, 2.3],
            altitude_m: Some(104.0),
            speed_mps: Some(5.0),
            course_deg: Some(90.0),
            hdop: Some(0.9),
            satellites: 8,
            quality: 4,
        };
        let mut sentences = Sentences::default();
        let mut fixes = Vec::new();
        for second in 0..3 {
            let both = [rmc_from_fix(&fix(second)), gga_from_fix(&fix(second), 44.6)];
            for packet in 0..200 {
                fixes.extend(sentences.take(&both[packet % 2]));
                fixes.extend(sentences.take(""));
            }
        }
        fixes.extend(sentences.finish());
        assert_eq!(fixes.iter().map(|fix| fix.stamp).collect::<Vec<_>>(), [0, 1, 2].map(|second| fix(second).stamp));
        assert!(fixes.iter().all(|fix| fix.altitude_m.is_some()));
        assert_eq!(sentences.stats(), LogStats { sentences: 6, ..LogStats::default() });
    }
}
