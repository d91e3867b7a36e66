//! Properties of the models, and the header of packets.

use crate::BeamAngles;
use files::calendar;

pub(super) const PACKET_BYTES: usize = 1248;
const DATA_HEADER: [u8; 8] = [0x55, 0xaa, 0x05, 0x0a, 0x5a, 0xa5, 0x50, 0xa0];
const DEVICE_HEADER: [u8; 8] = [0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55];
const TIME_AT: usize = 20;
const MODEL_AT: usize = 30;

/// A supported Robosense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// RS-LiDAR-16: 16 lasers, +15 to -15 deg.
    Rs16,
    /// RS-LiDAR-32: 32 lasers, +15 to -25 deg. Its angles are in a file of the unit.
    Rs32,
}

/// Angles of the RS-LiDAR-16: lasers 0 to 7 from -15 deg up, lasers 8 to 15 from +15 deg down.
static RS16: [BeamAngles; 16] = {
    let mut beams = [BeamAngles { elevation_deg: 0.0, azimuth_deg: 0.0 }; 16];
    let mut index = 0;
    while index < 8 {
        beams[index].elevation_deg = -15.0 + 2.0 * index as f64;
        beams[index + 8].elevation_deg = 15.0 - 2.0 * index as f64;
        index += 1;
    }
    beams
};

impl Model {
    /// Both models.
    pub const ALL: [Model; 2] = [Model::Rs16, Model::Rs32];

    /// Name in `drive.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Rs16 => "rs16",
            Model::Rs32 => "rs32",
        }
    }

    /// Name of the manufacturer.
    pub const fn title(self) -> &'static str {
        match self {
            Model::Rs16 => "RS-LiDAR-16",
            Model::Rs32 => "RS-LiDAR-32",
        }
    }

    /// The model that a data packet names.
    pub fn from_payload(payload: &[u8]) -> Option<Self> {
        match (is_data(payload), payload.get(MODEL_AT)) {
            (true, Some(1)) => Some(Model::Rs16),
            (true, Some(2)) => Some(Model::Rs32),
            _ => None,
        }
    }

    /// Whether a payload is a data packet that does not name the other model: some firmware leaves the model 0.
    pub fn is_data(self, payload: &[u8]) -> bool {
        is_data(payload) && Self::from_payload(payload).is_none_or(|model| model == self)
    }

    /// Number of lasers.
    pub const fn n_beams(self) -> usize {
        match self {
            Model::Rs16 => 16,
            Model::Rs32 => 32,
        }
    }

    /// Angles of a unit without a file; empty for the RS-LiDAR-32.
    pub(crate) const fn beams(self) -> &'static [BeamAngles] {
        match self {
            Model::Rs16 => &RS16,
            Model::Rs32 => &[],
        }
    }

    /// Firing time of a laser after the first laser of its round, ns.
    pub(super) const fn laser_nanos(self, laser: usize) -> i32 {
        match self {
            Model::Rs16 => 2_800 * laser as i32,
            // Lasers 16 to 31 fire halfway between lasers 0 to 15; the last of each half fires 1.44 µs later.
            Model::Rs32 => {
                let in_half = (laser % 16) as i32;
                2_880 * in_half + if in_half == 15 { 1_440 } else { 0 } + if laser >= 16 { 1_440 } else { 0 }
            }
        }
    }

    /// Time from one round of lasers to the next, ns.
    pub(super) const fn round_nanos(self) -> i32 {
        match self {
            Model::Rs16 => 55_500,
            Model::Rs32 => 55_520,
        }
    }

    /// Distance of the lasers from the axis, m.
    pub(super) const fn radius_m(self) -> f32 {
        match self {
            Model::Rs16 => 0.038_25,
            Model::Rs32 => 0.039_97,
        }
    }
}

fn is_data(payload: &[u8]) -> bool {
    payload.len() == PACKET_BYTES && payload.starts_with(&DATA_HEADER)
}

/// Whether a payload is a packet with the state of the device.
pub(crate) fn is_device(payload: &[u8]) -> bool {
    payload.len() == PACKET_BYTES && payload.starts_with(&DEVICE_HEADER)
}

/// Time of a data packet, ns since 1970.
pub(crate) fn packet_nanos(payload: &[u8]) -> i64 {
    let Some([year, month, day, hour, minute, second, rest @ ..]) = payload.get(TIME_AT..TIME_AT + 10) else {
        return 0;
    };
    let [millis, micros] = [0, 2].map(|at| i64::from(u16::from_be_bytes([rest[at], rest[at + 1]])));
    // A clock that was never set may have no date.
    let days = calendar::days_from_date(2000 + i64::from(*year), i64::from(*month), i64::from(*day)).unwrap_or(0);
    let seconds = days * 86_400 + i64::from(*hour) * 3600 + i64::from(*minute) * 60 + i64::from(*second);
    seconds * 1_000_000_000 + millis * 1_000_000 + micros * 1000
}
