//! The maker Velodyne.

use super::{
    DATA_PACKET_BYTES, DATA_PORT, DataPacket, Decoder, Laser, Model, POSITION_PORT, PositionPacket, lasers_from_file,
};
use crate::clock::Epoch;
use crate::field_of_view::SilentSector;
use crate::maker::{MAX_RETURNS_PER_PACKET, MakerDecoder, MakerModel, MakerUnit, Unit, is_same_unit};
use crate::{Blocks, CalibrationError, ClockReference, Scratch};
use std::ops::Range;
use std::sync::Arc;

impl MakerModel for Model {
    fn name(&self) -> &'static str {
        Model::name(*self)
    }

    fn title(&self) -> &'static str {
        Model::title(*self)
    }

    fn data_port(&self) -> u16 {
        DATA_PORT
    }

    fn auxiliary_port(&self) -> u16 {
        POSITION_PORT
    }

    fn is_named_by(&self, payload: &[u8]) -> bool {
        DataPacket::new(payload).and_then(Model::from_packet) == Some(*self)
    }

    fn is_data_of_maker(&self, payload: &[u8]) -> bool {
        DataPacket::new(payload).is_some()
    }

    fn evidence(&self, payload: &[u8]) -> String {
        match (self, DataPacket::new(payload)) {
            (Model::Hdl64e, _) => "has the blocks of an HDL-64E".to_owned(),
            (_, Some(packet)) => format!("factory byte {:#04x} names the {}", packet.product(), self.title()),
            (_, None) => format!("has the size and the header of a {}", self.title()),
        }
    }

    fn unit(&self) -> Unit {
        Arc::new(VelodyneUnit { model: *self, lasers: None })
    }

    fn calibrated_unit(&self, text: &str) -> Result<Unit, CalibrationError> {
        Ok(Arc::new(VelodyneUnit { model: *self, lasers: Some(lasers_from_file(text, *self)?) }))
    }
}

#[derive(Debug, PartialEq)]
struct VelodyneUnit {
    model: Model,
    /// Lasers of the calibration file.
    lasers: Option<Vec<Laser>>,
}

impl VelodyneUnit {
    fn lasers(&self) -> &[Laser] {
        self.lasers.as_deref().unwrap_or(self.model.lasers())
    }
}

impl MakerUnit for VelodyneUnit {
    fn may_have_sent(&self, payload: &[u8]) -> bool {
        DataPacket::new(payload).is_some_and(|packet| self.model.may_have_sent(packet))
    }

    /// The product byte may be 0 or a status.
    fn is_sure_sender(&self, payload: &[u8]) -> bool {
        self.model.is_named_by(payload)
    }

    fn packet_nanos(&self, payload: &[u8]) -> i64 {
        DataPacket::new(payload).map_or(0, |packet| i64::from(packet.micros()) * 1000)
    }

    fn elevations_deg(&self) -> Vec<f64> {
        self.lasers().iter().map(|laser| laser.elevation_deg).collect()
    }

    fn decoder(&self) -> Arc<dyn MakerDecoder> {
        Arc::new(Decoder::with_lasers(self.model, self.lasers()))
    }

    fn is_same(&self, other: &dyn MakerUnit) -> bool {
        is_same_unit(self, other)
    }

    fn epoch(&self) -> Epoch {
        Epoch::Hour
    }

    fn clock_reference(&self, payload: &[u8]) -> Option<ClockReference> {
        match PositionPacket::new(payload)?.pulse {
            0 => Some(ClockReference::PulseAbsent),
            1 => Some(ClockReference::PulseSynchronizing),
            2 => Some(ClockReference::Pulse),
            3 => Some(ClockReference::PulseError),
            _ => None,
        }
    }

    fn is_auxiliary(&self, payload: &[u8]) -> bool {
        PositionPacket::new(payload).is_some()
    }

    fn sentence<'a>(&self, payload: &'a [u8]) -> Option<&'a str> {
        PositionPacket::new(payload).map(|packet| packet.nmea)
    }

    fn is_short(&self, payload: &[u8]) -> bool {
        payload.len() < DATA_PACKET_BYTES
    }
}

impl MakerDecoder for Decoder {
    fn blocks(&self, payload: &[u8]) -> Blocks {
        DataPacket::new(payload).map(|packet| Decoder::blocks(self, packet)).unwrap_or_default()
    }

    fn decode(
        &self,
        payload: &[u8],
        blocks: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    ) {
        if let Some(packet) = DataPacket::new(payload) {
            Decoder::decode(self, packet, blocks, packet_nanos, scratch);
        }
    }

    fn across(&self, sector: SilentSector) -> Option<Arc<dyn MakerDecoder>> {
        Some(Arc::new(Decoder::across(self, sector)))
    }
}
