//! Fixes from position packets.

use crate::nmea::{Fix, FixJoiner, LogStats};
use serde::{Deserialize, Serialize};

/// Joins the sentences of position packets to fixes. A receiver sends one or two sentences per second. The sensor repeats the last
/// sentence 200 times per second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Receiver {
    joiner: FixJoiner,
    /// Hashes of the last two sentences.
    recent: [u64; 2],
}

impl Receiver {
    /// Reads the sentence of a packet. Returns the fix that it completes.
    pub(super) fn take(&mut self, sentence: &str) -> Option<Fix> {
        let digest = digest(sentence);
        // Sentences are empty without receiver.
        if sentence.is_empty() || self.recent.contains(&digest) {
            return None;
        }
        self.recent = [digest, self.recent[0]];
        self.joiner.take(sentence.as_bytes())
    }

    /// Completes the last fix.
    pub(super) fn finish(&mut self) -> Option<Fix> {
        self.joiner.finish()
    }

    pub(super) fn stats(&self) -> LogStats {
        self.joiner.stats().in_file("position packets")
    }
}

/// FNV-1a hash, so that the saved position need not contain sentences.
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
            vdop: None,
            deviation: None,
        };
        let mut receiver = Receiver::default();
        let mut fixes = Vec::new();
        for second in 0..3 {
            let both = [rmc_from_fix(&fix(second)), gga_from_fix(&fix(second), 44.6)];
            for packet in 0..200 {
                fixes.extend(receiver.take(&both[packet % 2]));
                fixes.extend(receiver.take(""));
            }
        }
        fixes.extend(receiver.finish());
        assert_eq!(fixes.iter().map(|fix| fix.stamp).collect::<Vec<_>>(), [0, 1, 2].map(|second| fix(second).stamp));
        assert!(fixes.iter().all(|fix| fix.altitude_m.is_some()));
        assert_eq!(receiver.stats(), LogStats { sentences: 6, ..LogStats::default() });
    }
}
