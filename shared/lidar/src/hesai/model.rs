//! Properties of the models.

use super::packet::{self, Layout};
use super::tables;
use crate::BeamAngles;

/// A supported Hesai.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Pandar40P: 40 beams, +15 to -25 deg.
    Pandar40p,
    /// PandarXT-32: 32 beams, +15 to -16 deg.
    PandarXt32,
    /// PandarQT64: 64 beams, +52 to -52 deg.
    PandarQt64,
}

/// Firing times of blocks and beams, relative to the time in the packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Timing {
    /// First block of a packet, ns. Beams are added.
    pub(super) first_nanos: i32,
    /// Time from one shot to the next, ns.
    pub(super) block_nanos: i32,
    /// Whether `first_nanos` is the time of the last shot of the packet.
    pub(super) counts_back: bool,
    /// Each beam after its block, ns; the earliest is not 0.
    pub(super) beam_nanos: &'static [i32],
}

impl Model {
    /// All models.
    pub const ALL: [Model; 3] = [Model::Pandar40p, Model::PandarXt32, Model::PandarQt64];

    /// Name in `drive.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Pandar40p => "pandar40p",
            Model::PandarXt32 => "pandarxt32",
            Model::PandarQt64 => "pandarqt64",
        }
    }

    /// Name of the manufacturer.
    pub const fn title(self) -> &'static str {
        match self {
            Model::Pandar40p => "Pandar40P",
            Model::PandarXt32 => "PandarXT-32",
            Model::PandarQt64 => "PandarQT64",
        }
    }

    /// Whether a payload has size and header of its data packets.
    pub fn is_data(self, payload: &[u8]) -> bool {
        self.layout().is_data(payload)
    }

    /// Number of beams.
    pub const fn n_beams(self) -> usize {
        self.beams().len()
    }

    /// Time of a packet, ns since 1970 by the clock of the sensor.
    pub(crate) fn packet_nanos(self, payload: &[u8]) -> i64 {
        packet::nanos(self.layout(), payload)
    }

    /// Beams of a unit without a correction file.
    pub(crate) const fn beams(self) -> &'static [BeamAngles] {
        match self {
            Model::Pandar40p => &tables::PANDAR40P,
            Model::PandarXt32 => &tables::XT32,
            Model::PandarQt64 => &tables::QT64,
        }
    }

    pub(super) const fn layout(self) -> &'static Layout {
        match self {
            Model::Pandar40p => &packet::PANDAR40P,
            Model::PandarXt32 => &packet::XT32,
            Model::PandarQt64 => &packet::QT64,
        }
    }

    pub(super) const fn timing(self) -> Timing {
        match self {
            Model::Pandar40p => Timing {
                first_nanos: -28_580,
                block_nanos: 55_560,
                counts_back: true,
                beam_nanos: &tables::PANDAR40P_NANOS,
            },
            Model::PandarXt32 => {
                Timing { first_nanos: 5_632, block_nanos: 50_000, counts_back: true, beam_nanos: &tables::XT32_NANOS }
            }
            Model::PandarQt64 => Timing {
                first_nanos: 25_710,
                block_nanos: 166_667,
                counts_back: false,
                beam_nanos: &tables::QT64_NANOS,
            },
        }
    }
}
