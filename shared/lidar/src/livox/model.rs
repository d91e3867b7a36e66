//! Properties of the models, and the header of packets.

use files::calendar;

/// A supported Livox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Mid-360: 360 x 59 deg.
    Mid360,
    /// Avia: 70 x 77 deg.
    Avia,
}

/// Values of the points of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// x y z in mm, i32. Echoes follow each other.
    Millimeters,
    /// x y z in cm, i16.
    Centimeters,
    /// Range, zenith angle, azimuth.
    Spherical,
}

/// The points of a data packet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points<'a> {
    pub(super) format: Format,
    pub(super) n_echoes: usize,
    /// Time from the first to the last shot, ns.
    pub(super) span_nanos: i64,
    pub(super) bytes: &'a [u8],
}

impl Format {
    pub(super) const fn point_bytes(self) -> usize {
        match self {
            Format::Millimeters => 14,
            Format::Centimeters => 8,
            Format::Spherical => 10,
        }
    }
}

impl Model {
    /// Both models.
    pub const ALL: [Model; 2] = [Model::Mid360, Model::Avia];

    /// Name in `drive.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Mid360 => "mid360",
            Model::Avia => "avia",
        }
    }

    /// Name of the manufacturer.
    pub const fn title(self) -> &'static str {
        match self {
            Model::Mid360 => "Livox Mid-360",
            Model::Avia => "Livox Avia",
        }
    }

    /// Whether a payload has size and header of its data packets.
    pub fn is_data(self, payload: &[u8]) -> bool {
        self.points(payload).is_some()
    }

    /// UDP port of data packets at the receiver, as set by the manufacturer.
    pub const fn data_port(self) -> u16 {
        match self {
            Model::Mid360 => 56_301,
            Model::Avia => 55_100,
        }
    }

    /// UDP port of IMU packets at the receiver.
    pub(crate) const fn imu_port(self) -> u16 {
        match self {
            Model::Mid360 => 56_401,
            Model::Avia => 55_101,
        }
    }

    /// Whether a payload is a packet of its IMU.
    pub(crate) fn is_imu(self, payload: &[u8]) -> bool {
        match self {
            Model::Mid360 => payload.len() == 36 + 24 && payload[10] == 0,
            Model::Avia => payload.len() == 18 + 24 && payload[9] == 6,
        }
    }

    /// Type of the time of a data packet.
    pub(crate) fn time_type(self, payload: &[u8]) -> Option<u8> {
        payload.get(if self == Model::Mid360 { 11 } else { 8 }).copied()
    }

    /// Time of a data packet: ns since 1970, or since the start of the sensor.
    pub(crate) fn packet_nanos(self, payload: &[u8]) -> i64 {
        let (time_at, has_date) = match self {
            Model::Mid360 => (28, false),
            // 3: date and time of a receiver.
            Model::Avia => (10, payload.get(8) == Some(&3)),
        };
        let Some(bytes): Option<&[u8; 8]> = payload.get(time_at..).and_then(|rest| rest.first_chunk()) else {
            return 0;
        };
        if !has_date {
            return i64::try_from(u64::from_le_bytes(*bytes)).unwrap_or(i64::MAX);
        }
        let [year, month, day, hour, micros @ ..] = *bytes;
        let days = calendar::days_from_date(2000 + i64::from(year), i64::from(month), i64::from(day)).unwrap_or(0);
        (days * 24 + i64::from(hour)) * 3_600_000_000_000 + i64::from(u32::from_le_bytes(micros)) * 1000
    }

    /// The points of a data packet; `None` for other payloads.
    pub(super) fn points(self, payload: &[u8]) -> Option<Points<'_>> {
        let u16_at = |at: usize| Some(u16::from_le_bytes(*payload.get(at..)?.first_chunk()?));
        match self {
            Model::Mid360 => {
                let format = match payload.get(10)? {
                    1 => Format::Millimeters,
                    2 => Format::Centimeters,
                    3 => Format::Spherical,
                    _ => return None,
                };
                let bytes = payload.get(36..)?;
                let n_points = usize::from(u16_at(5)?);
                let is_whole =
                    usize::from(u16_at(1)?) == payload.len() && n_points * format.point_bytes() == bytes.len();
                let span_nanos = i64::from(u16_at(3)?) * 100;
                (is_whole && n_points > 0 && payload[0] == 0).then_some(Points {
                    format,
                    n_echoes: 1,
                    span_nanos,
                    bytes,
                })
            }
            Model::Avia => {
                // Shots per packet and time between shots: 240 000 shots per second.
                let (format, n_echoes, n_shots) = match payload.get(9)? {
                    2 => (Format::Millimeters, 1, 96),
                    3 => (Format::Spherical, 1, 96),
                    4 => (Format::Millimeters, 2, 48),
                    7 => (Format::Millimeters, 3, 30),
                    _ => return None,
                };
                let bytes = payload.get(18..)?;
                let span_nanos = (n_shots - 1) as i64 * 1_000_000_000 / 240_000;
                let is_whole = bytes.len() == n_shots * n_echoes * format.point_bytes() && payload[0] == 5;
                is_whole.then_some(Points { format, n_echoes, span_nanos, bytes })
            }
        }
    }
}
