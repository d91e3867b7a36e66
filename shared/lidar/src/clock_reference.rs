//! The clock reference that a LiDAR reports.

use std::fmt;

/// Reference of the clock of a LiDAR.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ClockReference {
    /// The pulse per second of a GNSS receiver, or of another clock at the same input.
    Pulse,
    /// The clock is being set by the pulse.
    PulseSynchronizing,
    /// No pulse at the input.
    PulseAbsent,
    /// The sensor reports an error of the pulse.
    PulseError,
    /// A clock on the network (IEEE 1588 or 802.1AS).
    Ptp,
    /// No reference: times count from the start of the sensor.
    FreeRunning,
}

impl ClockReference {
    /// Whether the clock follows its reference.
    pub fn is_locked(self) -> bool {
        matches!(self, Self::Pulse | Self::Ptp)
    }
}

impl fmt::Display for ClockReference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pulse => "PPS locked",
            Self::PulseSynchronizing => "PPS synchronizing",
            Self::PulseAbsent => "PPS absent",
            Self::PulseError => "PPS error",
            Self::Ptp => "PTP",
            Self::FreeRunning => "free-running",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::velodyne::{PulseStatus, encode_position_packet};
    use crate::{Lidar, Model, hesai, velodyne};
    use geometry::Stamp;

    #[test]
    fn states_of_the_pulse_are_told_apart() {
        let velodyne = Lidar::from(Model::Velodyne(velodyne::Model::Hdl32e));
        let of = |pulse| velodyne.clock_reference(&encode_position_packet(Stamp(0), pulse, ""));
        assert_eq!(of(PulseStatus::Absent), Some(ClockReference::PulseAbsent));
        assert_eq!(of(PulseStatus::Synchronizing), Some(ClockReference::PulseSynchronizing));
        assert_eq!(of(PulseStatus::Locked), Some(ClockReference::Pulse));
        assert_eq!(of(PulseStatus::Error), Some(ClockReference::PulseError));
        let mut unknown = encode_position_packet(Stamp(0), PulseStatus::Locked, "");
        unknown[202] = 77;
        assert_eq!(velodyne.clock_reference(&unknown), None);
        assert_eq!(velodyne.clock_reference(&[0; 1206]), None);
        let hesai = Lidar::from(Model::Hesai(hesai::Model::Pandar40p));
        let mut packet = [0xdf; 512];
        packet[..2].copy_from_slice(&[0xff, 0xee]);
        for (flag, expected) in [(1, Some(ClockReference::Pulse)), (0, Some(ClockReference::PulseAbsent)), (9, None)] {
            packet[507] = flag;
            assert_eq!(hesai.clock_reference(&packet), expected);
        }
        assert_eq!(hesai.clock_reference(&packet[..511]), None);
        assert!(ClockReference::Ptp.is_locked() && !ClockReference::FreeRunning.is_locked());
    }

    #[test]
    fn type_of_the_time_in_livox_packets_is_the_reference() {
        let lidar = Lidar::from(Model::Livox(crate::livox::Model::Mid360));
        // One point in mm.
        let mut payload = [0_u8; 36 + 14];
        (payload[1], payload[5], payload[10]) = (50, 1, 1);
        for (kind, expected) in [
            (0, Some(ClockReference::FreeRunning)),
            (1, Some(ClockReference::Ptp)),
            (2, Some(ClockReference::Pulse)),
            (200, None),
        ] {
            payload[11] = kind;
            assert_eq!(lidar.clock_reference(&payload), expected);
        }
    }
}
