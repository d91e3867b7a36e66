//! The maker Ouster. Packets do not name the model, and cannot be decoded without the metadata of the sensor.

use super::{DATA_PORT, Decoder, IMU_PORT, Metadata, is_imu};
use crate::maker::{MAX_RETURNS_PER_PACKET, MakerDecoder, MakerModel, MakerUnit, Unit, is_same_unit};
use crate::{Blocks, CalibrationError, ClockReference, Scratch};
use std::ops::Range;
use std::sync::Arc;

/// An OS0, OS1 or OS2: the metadata file has the number of beams and the packet format.
pub(crate) struct Model;

impl MakerModel for Model {
    fn name(&self) -> &'static str {
        "ouster"
    }

    fn title(&self) -> &'static str {
        "Ouster"
    }

    fn data_port(&self) -> u16 {
        DATA_PORT
    }

    fn auxiliary_port(&self) -> u16 {
        IMU_PORT
    }

    fn is_named_by(&self, _payload: &[u8]) -> bool {
        false
    }

    fn unit(&self) -> Unit {
        Arc::new(UnknownOuster)
    }

    fn calibrated_unit(&self, text: &str) -> Result<Unit, CalibrationError> {
        Ok(Arc::new(Metadata::from_json(text)?))
    }
}

/// An Ouster without metadata.
#[derive(Debug, PartialEq)]
struct UnknownOuster;

impl MakerUnit for UnknownOuster {
    fn may_have_sent(&self, _payload: &[u8]) -> bool {
        false
    }

    fn packet_nanos(&self, _payload: &[u8]) -> i64 {
        0
    }

    fn elevations_deg(&self) -> Vec<f64> {
        Vec::new()
    }

    fn decoder(&self) -> Arc<dyn MakerDecoder> {
        Arc::new(UnknownOuster)
    }

    fn is_same(&self, other: &dyn MakerUnit) -> bool {
        is_same_unit(self, other)
    }

    fn is_auxiliary(&self, payload: &[u8]) -> bool {
        is_imu(payload)
    }

    fn missing_file(&self) -> Option<&'static str> {
        Some("the metadata file (JSON) of the sensor")
    }
}

impl MakerDecoder for UnknownOuster {
    fn blocks(&self, _payload: &[u8]) -> Blocks {
        Blocks::default()
    }

    fn decode(&self, _: &[u8], _: Range<usize>, _: i64, _: &mut Scratch<MAX_RETURNS_PER_PACKET>) {}
}

impl MakerUnit for Metadata {
    fn may_have_sent(&self, payload: &[u8]) -> bool {
        self.is_data(payload)
    }

    fn packet_nanos(&self, payload: &[u8]) -> i64 {
        Metadata::packet_nanos(self, payload)
    }

    fn elevations_deg(&self) -> Vec<f64> {
        Metadata::elevations_deg(self).to_vec()
    }

    fn decoder(&self) -> Arc<dyn MakerDecoder> {
        Arc::new(Decoder::new(self))
    }

    fn is_same(&self, other: &dyn MakerUnit) -> bool {
        is_same_unit(self, other)
    }

    fn clock_reference(&self, payload: &[u8]) -> Option<ClockReference> {
        match self.timestamp_mode.as_deref().filter(|_| self.is_data(payload))? {
            "TIME_FROM_INTERNAL_OSC" => Some(ClockReference::FreeRunning),
            "TIME_FROM_SYNC_PULSE_IN" => Some(ClockReference::Pulse),
            "TIME_FROM_PTP_1588" => Some(ClockReference::Ptp),
            _ => None,
        }
    }

    fn is_auxiliary(&self, payload: &[u8]) -> bool {
        is_imu(payload)
    }

    fn other_serial_number(&self, payload: &[u8]) -> Option<u64> {
        Metadata::other_serial_number(self, payload)
    }
}
