//! Decoders of all makers behind one interface.

use super::calibration::Beams;
use super::clock::Epoch;
use super::{Blocks, Lidar, Model, Scratch, TURN};
use crate::{hesai, livox, ouster, robosense, velodyne};
use messages::SweepPoint;
use std::ops::Range;

/// Most returns of a packet: 16 columns of an Ouster with 128 beams and two echoes.
pub(super) const MAX_RETURNS_PER_PACKET: usize = 4096;

/// What decides where a sweep ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// The encoder passes the begin of a revolution. A whole revolution has `full` encoder counts.
    Turn {
        /// Encoder counts of a whole revolution.
        full: u16,
    },
    /// A piece of time ends: the sensor does not rotate.
    Time {
        /// Length of a piece, ns.
        nanos: i64,
    },
}

/// Decoder of the packets of a sensor, with its tables.
#[derive(Clone, Debug)]
pub struct PacketDecoder {
    lidar: Lidar,
    n_rings: usize,
    maker: Maker,
    /// Buffer of [`PacketDecoder::decode_into`].
    scratch: Option<Box<Scratch<MAX_RETURNS_PER_PACKET>>>,
}

#[derive(Clone, Debug)]
enum Maker {
    Velodyne(Box<velodyne::Decoder>),
    Hesai(hesai::Decoder),
    Ouster(Box<ouster::Decoder>),
    Robosense(robosense::Decoder),
    Livox(livox::Decoder),
    /// An Ouster whose metadata is not known.
    Unknown,
}

impl Lidar {
    /// Whether it may have sent a payload as a data packet.
    pub fn may_have_sent(&self, payload: &[u8]) -> bool {
        match (self.model(), &self.beams) {
            (Model::Velodyne(model), _) => {
                velodyne::DataPacket::new(payload).is_some_and(|packet| model.may_have_sent(packet))
            }
            (Model::Hesai(model), _) => model.is_data(payload),
            (Model::Ouster, Beams::Ouster(metadata)) => metadata.is_data(payload),
            (Model::Ouster, _) => false,
            (Model::Robosense(model), _) => model.is_data(payload),
            (Model::Livox(model), _) => model.is_data(payload),
        }
    }

    /// Serial number in a data packet of another sensor of the same kind.
    pub(super) fn other_serial_number(&self, payload: &[u8]) -> Option<u64> {
        if let Beams::Ouster(metadata) = &self.beams { metadata.other_serial_number(payload) } else { None }
    }

    /// Whether a payload is another packet of the sensor: of its IMU, receiver or status.
    pub(super) fn is_auxiliary(&self, payload: &[u8]) -> bool {
        match self.model() {
            // Position packets are read, not skipped.
            Model::Velodyne(_) => false,
            Model::Hesai(_) => hesai::is_gps(payload),
            Model::Ouster => ouster::is_imu(payload),
            Model::Robosense(_) => robosense::is_device(payload),
            Model::Livox(model) => model.is_imu(payload),
        }
    }

    /// Time in a data packet, ns since [`Lidar::epoch`].
    pub(super) fn packet_nanos(&self, payload: &[u8]) -> i64 {
        match (self.model(), &self.beams) {
            (Model::Velodyne(_), _) => {
                velodyne::DataPacket::new(payload).map_or(0, |packet| i64::from(packet.micros()) * 1000)
            }
            (Model::Hesai(model), _) => model.packet_nanos(payload),
            (Model::Ouster, Beams::Ouster(metadata)) => metadata.packet_nanos(payload),
            (Model::Ouster, _) => 0,
            (Model::Robosense(_), _) => robosense::packet_nanos(payload),
            (Model::Livox(model), _) => model.packet_nanos(payload),
        }
    }

    /// What the times in packets count from.
    pub(super) fn epoch(&self) -> Epoch {
        if matches!(self.model(), Model::Velodyne(_)) { Epoch::Hour } else { Epoch::Unix }
    }
}

impl PacketDecoder {
    /// Computes the tables of a sensor.
    pub fn new(lidar: &Lidar) -> Self {
        let maker = match (lidar.model(), &lidar.beams) {
            (Model::Velodyne(model), Beams::Velodyne(lasers)) => {
                Maker::Velodyne(Box::new(velodyne::Decoder::with_lasers(model, lasers)))
            }
            (Model::Velodyne(model), _) => Maker::Velodyne(Box::new(velodyne::Decoder::new(model))),
            (Model::Hesai(model), Beams::Angles(angles)) => Maker::Hesai(hesai::Decoder::new(model, angles)),
            (Model::Hesai(model), _) => Maker::Hesai(hesai::Decoder::new(model, model.beams())),
            (Model::Robosense(model), Beams::Angles(angles)) => {
                Maker::Robosense(robosense::Decoder::new(model, angles))
            }
            (Model::Robosense(model), _) => Maker::Robosense(robosense::Decoder::new(model, model.beams())),
            (Model::Ouster, Beams::Ouster(metadata)) => Maker::Ouster(Box::new(ouster::Decoder::new(metadata))),
            (Model::Ouster, _) => Maker::Unknown,
            (Model::Livox(model), _) => Maker::Livox(livox::Decoder::new(model)),
        };
        Self { lidar: lidar.clone(), n_rings: lidar.n_rings(), maker, scratch: None }
    }

    /// The sensor.
    pub fn lidar(&self) -> &Lidar {
        &self.lidar
    }

    /// Number of rings; 0 if the sensor has none.
    pub fn n_rings(&self) -> usize {
        self.n_rings
    }

    /// Appends all returns of a payload, with times after its first firing. `false` if it is no data packet of the sensor.
    pub fn decode_into(&mut self, payload: &[u8], returns: &mut Vec<SweepPoint>) -> bool {
        let is_data = self.lidar.may_have_sent(payload);
        if is_data {
            let blocks = self.blocks(payload);
            let mut scratch = self.scratch.take().unwrap_or_default();
            let first = (0..blocks.len()).filter_map(|index| blocks.get(index)).map(|(nanos, _)| nanos).min();
            self.decode(payload, 0..blocks.len(), -first.unwrap_or(0), &mut scratch);
            returns.extend_from_slice(scratch.returns());
            self.scratch = Some(scratch);
        }
        is_data
    }

    /// Times and angles of the blocks of a data packet.
    pub(super) fn blocks(&self, payload: &[u8]) -> Blocks {
        match &self.maker {
            Maker::Velodyne(decoder) => {
                velodyne::DataPacket::new(payload).map(|packet| decoder.blocks(packet)).unwrap_or_default()
            }
            Maker::Hesai(decoder) => decoder.blocks(payload),
            Maker::Ouster(decoder) => decoder.blocks(payload),
            Maker::Robosense(decoder) => decoder.blocks(payload),
            Maker::Livox(decoder) => decoder.blocks(payload),
            Maker::Unknown => Blocks::default(),
        }
    }

    /// Replaces the content of `scratch` with the returns of some blocks. `packet_nanos` is the time of the packet minus the stamp of
    /// the sweep.
    pub(super) fn decode(
        &self,
        payload: &[u8],
        blocks: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    ) {
        scratch.len = 0;
        match &self.maker {
            Maker::Velodyne(decoder) => {
                if let Some(packet) = velodyne::DataPacket::new(payload) {
                    decoder.decode(packet, blocks, packet_nanos, scratch);
                }
            }
            Maker::Hesai(decoder) => decoder.decode(payload, blocks, packet_nanos, scratch),
            Maker::Ouster(decoder) => decoder.decode(payload, blocks, packet_nanos, scratch),
            Maker::Robosense(decoder) => decoder.decode(payload, blocks, packet_nanos, scratch),
            // The packet is one block.
            Maker::Livox(decoder) if !blocks.is_empty() => decoder.decode(payload, packet_nanos, scratch),
            Maker::Livox(_) | Maker::Unknown => {}
        }
    }

    /// What decides where a sweep ends.
    pub(super) fn cut(&self) -> Cut {
        match &self.maker {
            Maker::Ouster(decoder) => Cut::Turn { full: decoder.full_turn() },
            Maker::Livox(_) => Cut::Time { nanos: livox::SWEEP_NANOS },
            Maker::Velodyne(_) | Maker::Hesai(_) | Maker::Robosense(_) | Maker::Unknown => Cut::Turn { full: TURN },
        }
    }

    /// Whether packets follow each other in equal steps, so that a gap shows lost packets.
    pub(super) fn is_regular(&self) -> bool {
        !matches!(&self.maker, Maker::Ouster(decoder) if decoder.full_turn() < TURN)
    }
}
