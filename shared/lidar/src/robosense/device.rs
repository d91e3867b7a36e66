//! Angles of the beams in packets with the state of the device. Not tested on real packets.
//!
//! A packet is 1248 bytes, big-endian (manuals of RS-LiDAR-16 and RS-LiDAR-32, "DIFOP", appendix B):
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 8 | `a5 ff 00 5a 11 11 55 55` |
//! | 468 | 96 | RS-LiDAR-32: elevation of each laser: sign (0 positive, 1 negative), 0.001 deg (u16) |
//! | 564 | 96 | RS-LiDAR-32: azimuth of each laser in the same format; it is added to the encoder angle |
//! | 1165 | 48 | RS-LiDAR-16: elevation of each laser without sign, 0.0001 deg (u24); lasers 0 to 7 look down |

use super::Model;
use super::model::is_device;
use crate::BeamAngles;

const RS32_ELEVATIONS_AT: usize = 468;
const RS32_AZIMUTHS_AT: usize = 564;
const RS16_ELEVATIONS_AT: usize = 1165;
/// Bytes of an angle.
const ANGLE_BYTES: usize = 3;
/// Lasers of the RS-LiDAR-16 that look down.
const RS16_DOWN: usize = 8;
/// Largest elevation and azimuth of a laser, deg. The models have 25 and 8.
const MAX_ELEVATION_DEG: f64 = 30.0;
const MAX_AZIMUTH_DEG: f64 = 15.0;
/// Least difference of the highest and the lowest laser, deg: the models have 30 and 40. Other firmware may use other units.
const MIN_SPAN_DEG: f64 = 25.0;

/// Angles of the lasers in firing order. `None` for other packets, for units without calibration, and for angles that no unit has.
pub(crate) fn angles(model: Model, payload: &[u8]) -> Option<Vec<BeamAngles>> {
    if !is_device(payload) {
        return None;
    }
    let read = |at: usize, laser: usize| {
        payload.get(at + laser * ANGLE_BYTES..)?.first_chunk::<ANGLE_BYTES>().map(|bytes| bytes.map(f64::from))
    };
    let beam = |laser: usize| {
        let (elevation_deg, azimuth_deg) = match model {
            Model::Rs16 => {
                let [high, middle, low] = read(RS16_ELEVATIONS_AT, laser)?;
                let angle_deg = (high * 65_536.0 + middle * 256.0 + low) * 1e-4;
                (if laser < RS16_DOWN { -angle_deg } else { angle_deg }, 0.0)
            }
            Model::Rs32 => (signed(read(RS32_ELEVATIONS_AT, laser)?)?, signed(read(RS32_AZIMUTHS_AT, laser)?)?),
        };
        let is_possible = elevation_deg.abs() <= MAX_ELEVATION_DEG && azimuth_deg.abs() <= MAX_AZIMUTH_DEG;
        is_possible.then_some(BeamAngles { elevation_deg, azimuth_deg })
    };
    let angles: Vec<BeamAngles> = (0..model.n_beams()).map(beam).collect::<Option<_>>()?;
    let elevations = || angles.iter().map(|beam| beam.elevation_deg);
    let span_deg = elevations().fold(f64::MIN, f64::max) - elevations().fold(f64::MAX, f64::min);
    (span_deg >= MIN_SPAN_DEG).then_some(angles)
}

/// An angle with sign, deg; `None` for an invalid sign.
fn signed([sign, high, low]: [f64; ANGLE_BYTES]) -> Option<f64> {
    let angle_deg = (high * 256.0 + low) * 1e-3;
    match sign {
        0.0 => Some(angle_deg),
        1.0 => Some(-angle_deg),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet() -> Vec<u8> {
        let mut packet = vec![0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55];
        packet.resize(1248, 0);
        packet
    }

    #[test]
    fn angles_are_those_of_the_manuals() {
        let mut packet = packet();
        for laser in 0..16 {
            // 15 deg for laser 0, 1 deg for lasers 7 and 15: 0x2710.
            let angle = 10_000_u32 * (15 - 2 * (laser as u32 % 8));
            packet[1165 + 3 * laser..][..3].copy_from_slice(&angle.to_be_bytes()[1..]);
        }
        let found = angles(Model::Rs16, &packet).expect("has angles");
        assert_eq!([0, 7, 8, 15].map(|laser| found[laser].elevation_deg), [-15.0, -1.0, 15.0, 1.0]);
        assert_eq!(packet[1165 + 45..][..3], [0x00, 0x27, 0x10]);

        for laser in 0..32_usize {
            packet[468 + 3 * laser..][..3].copy_from_slice(&[0, 0x27, 0x10]);
            packet[564 + 3 * laser..][..3].copy_from_slice(&[1, 0x1f, 0x40]);
        }
        // The examples of the manual, and a span that a unit has.
        packet[468..][..3].copy_from_slice(&[1, 0x28, 0x29]);
        packet[468 + 27..][..3].copy_from_slice(&[1, 0x0a, 0x70]);
        packet[468 + 93..][..3].copy_from_slice(&[0, 0x3a, 0x98]);
        let found = angles(Model::Rs32, &packet).expect("has angles");
        let elevations = [0, 9, 10, 31].map(|laser| (found[laser].elevation_deg * 1000.0).round());
        assert_eq!(elevations, [-10_281.0, -2672.0, 10_000.0, 15_000.0]);
        assert_eq!(found[3].azimuth_deg, -8.0);
    }

    #[test]
    fn units_without_calibration_and_other_packets_have_no_angles() {
        for fill in [0, 0xff] {
            let mut packet = packet();
            packet[8..].fill(fill);
            for model in Model::ALL {
                assert_eq!(angles(model, &packet), None);
                assert_eq!(angles(model, &packet[..1247]), None);
                assert_eq!(angles(model, &[fill; 1248]), None);
            }
        }
        let mut packet = packet();
        packet[468..660].fill(0);
        packet[468] = 2;
        assert_eq!(angles(Model::Rs32, &packet), None);
    }
}
