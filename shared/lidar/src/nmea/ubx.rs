//! Standard deviations from UBX-NAV-PVT messages (u-blox) in a log of sentences.

use super::{Fix, StatedDeviation};
use files::calendar::{DAY_NANOS, days_from_date};
use geometry::Stamp;

/// Two sync bytes, class, identity and length of UBX-NAV-PVT.
const HEAD: [u8; 6] = [0xb5, 0x62, 0x01, 0x07, 92, 0];
const N_PAYLOAD: usize = 92;
/// A message belongs to the fix within this time, ns: half of the shortest epoch, 20 Hz.
const SAME_EPOCH_NANOS: i64 = 25_000_000;
/// Flags of a valid date and time, and of a valid position.
const VALID_TIME: u8 = 0b11;
const VALID_FIX: u8 = 1;

/// The accuracy of one epoch.
struct Accuracy {
    stamp: Stamp,
    deviation: StatedDeviation,
}

/// Fixes without standard deviations get the deviations in the messages of their time. Messages with a wrong checksum are skipped.
pub(super) fn accuracies(log: &[u8], fixes: &mut [Fix]) {
    let mut rest = log;
    let mut found: Vec<Accuracy> = Vec::new();
    while let Some(at) = rest.windows(HEAD.len()).position(|bytes| bytes == HEAD) {
        rest = &rest[at..];
        match accuracy(rest) {
            Some(accuracy) => {
                found.push(accuracy);
                rest = &rest[HEAD.len() + N_PAYLOAD..];
            }
            None => rest = &rest[1..],
        }
    }
    found.sort_by_key(|accuracy| accuracy.stamp);
    for fix in fixes.iter_mut().filter(|fix| fix.deviation.is_none()) {
        let first = found.partition_point(|accuracy| accuracy.stamp.0 < fix.stamp.0 - SAME_EPOCH_NANOS);
        let near = found.get(first).filter(|accuracy| accuracy.stamp.0 <= fix.stamp.0 + SAME_EPOCH_NANOS);
        fix.deviation = near.map(|accuracy| accuracy.deviation);
    }
}

/// The accuracy in the message at the start of these bytes.
fn accuracy(bytes: &[u8]) -> Option<Accuracy> {
    let sum = bytes.get(HEAD.len() + N_PAYLOAD..HEAD.len() + N_PAYLOAD + 2)?;
    let summed = bytes[2..HEAD.len() + N_PAYLOAD].iter().fold([0_u8; 2], |[a, b], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    });
    if sum != summed {
        return None;
    }
    let payload = &bytes[HEAD.len()..];
    let at = |offset: usize| <[u8; 4]>::try_from(&payload[offset..offset + 4]).ok();
    let metres = |offset| at(offset).map(|bytes| f64::from(u32::from_le_bytes(bytes)) * 1e-3);
    if payload[11] & VALID_TIME != VALID_TIME || payload[21] & VALID_FIX == 0 {
        return None;
    }
    let year = i64::from(u16::from_le_bytes([payload[4], payload[5]]));
    let days = days_from_date(year, i64::from(payload[6]), i64::from(payload[7]))?;
    let [hour, minute, second] = [8, 9, 10].map(|offset| i64::from(payload[offset]));
    let nanos = i64::from(i32::from_le_bytes(at(16)?));
    let stamp = Stamp(days * DAY_NANOS + ((hour * 60 + minute) * 60 + second) * 1_000_000_000 + nanos);
    // The horizontal accuracy includes both axes.
    let deviation = StatedDeviation { across_m: metres(40)? / 2_f64.sqrt(), up_m: metres(44)? };
    Some(Accuracy { stamp, deviation })
}

#[cfg(test)]
mod tests {
    use crate::nmea::fixes;

    /// UBX-NAV-PVT of 2021-03-01 12:35:21 with horizontal and vertical accuracies, mm.
    fn message(accuracies_mm: [u32; 2]) -> Vec<u8> {
        let mut payload = [0_u8; 92];
        payload[4..6].copy_from_slice(&2021_u16.to_le_bytes());
        payload[6..12].copy_from_slice(&[3, 1, 12, 35, 21, 0b111]);
        payload[20..22].copy_from_slice(&[3, 1]);
        for (offset, mm) in [40, 44].into_iter().zip(accuracies_mm) {
            payload[offset..offset + 4].copy_from_slice(&mm.to_le_bytes());
        }
        let mut bytes = [&super::HEAD[..], &payload].concat();
        let sum = bytes[2..].iter().fold([0_u8; 2], |[a, b], byte| {
            let a = a.wrapping_add(*byte);
            [a, b.wrapping_add(a)]
        });
        bytes.extend(sum);
        bytes
    }

    #[test]
    fn accuracies_of_ubx_messages_belong_to_the_fix_of_their_time() {
        // The receiver sends line ends within messages: 10 mm are the byte of a line end.
        let gga = |second: u32| format!("$GPGGA,1235{second}.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,\r\n");
        let rmc = "$GPRMC,123521.00,A,4807.038,N,01131.000,E,022.4,084.4,010321,,\r\n";
        let log = [&message([2000, 10])[..], gga(21).as_bytes(), rmc.as_bytes(), gga(22).as_bytes()].concat();
        let (found, _) = fixes(&log);
        assert_eq!(found.len(), 2);
        let deviation = found[0].deviation.expect("is stated");
        assert!(
            (deviation.across_m - 2_f64.sqrt()).abs() < 1e-9 && (deviation.up_m - 0.01).abs() < 1e-9,
            "{deviation:?}"
        );
        assert_eq!(found[1].deviation, None);
        let mut damaged = log.clone();
        damaged[50] ^= 1;
        assert_eq!(fixes(&damaged).0[0].deviation, None);
    }
}
