//! Decoder of the packets of any maker.

use crate::field_of_view::SilentSector;
use crate::maker::{Cut, MAX_RETURNS_PER_PACKET, MakerDecoder};
use crate::{Blocks, Lidar, Scratch};
use messages::SweepPoint;
use std::ops::Range;
use std::sync::Arc;

/// Decoder of the packets of a sensor, with its tables.
#[derive(Clone, Debug)]
pub struct PacketDecoder {
    lidar: Lidar,
    n_rings: usize,
    maker: Arc<dyn MakerDecoder>,
    /// Buffer of [`PacketDecoder::decode_into`].
    scratch: Option<Box<Scratch<MAX_RETURNS_PER_PACKET>>>,
}

impl PacketDecoder {
    /// Computes the tables of a sensor.
    pub fn new(lidar: &Lidar) -> Self {
        Self { lidar: lidar.clone(), n_rings: lidar.n_rings(), maker: lidar.unit.decoder(), scratch: None }
    }

    /// The decoder of a stream in which the sensor fires nothing in a sector.
    #[must_use]
    pub(crate) fn across(self, sector: Option<SilentSector>) -> Self {
        let maker = sector.and_then(|sector| self.maker.across(sector)).unwrap_or_else(|| Arc::clone(&self.maker));
        Self { maker, ..self }
    }

    /// The sensor.
    pub fn lidar(&self) -> &Lidar {
        &self.lidar
    }

    /// Number of rings; 0 for a sensor without rings.
    pub fn n_rings(&self) -> usize {
        self.n_rings
    }

    /// Appends all returns of a payload, with times after its first firing. `false` if it is not a data packet of the sensor.
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
    pub(crate) fn blocks(&self, payload: &[u8]) -> Blocks {
        self.maker.blocks(payload)
    }

    /// Replaces the content of `scratch` with the returns of some blocks. `packet_nanos` is the time of the packet minus the stamp of
    /// the sweep.
    pub(crate) fn decode(
        &self,
        payload: &[u8],
        blocks: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    ) {
        scratch.len = 0;
        self.maker.decode(payload, blocks, packet_nanos, scratch);
    }

    /// Condition that ends a sweep.
    pub(crate) fn cut(&self) -> Cut {
        self.maker.cut()
    }

    /// Whether packets follow each other at equal intervals, so that a gap shows lost packets.
    pub(crate) fn is_regular(&self) -> bool {
        self.maker.is_regular()
    }
}
