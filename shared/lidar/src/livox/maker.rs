//! The maker Livox.

use super::{Decoder, Model};
use crate::maker::{MakerDecoder, MakerModel, MakerUnit, Unit, is_same_unit};
use crate::{CalibrationError, ClockReference};
use std::sync::Arc;

impl MakerModel for Model {
    fn name(&self) -> &'static str {
        Model::name(*self)
    }

    fn title(&self) -> &'static str {
        Model::title(*self)
    }

    fn data_port(&self) -> u16 {
        Model::data_port(*self)
    }

    fn auxiliary_port(&self) -> u16 {
        self.imu_port()
    }

    fn is_named_by(&self, payload: &[u8]) -> bool {
        self.is_data(payload)
    }

    fn unit(&self) -> Unit {
        Arc::new(LivoxUnit { model: *self })
    }

    fn calibrated_unit(&self, _text: &str) -> Result<Unit, CalibrationError> {
        Err(CalibrationError::NotNeeded(self.title()))
    }
}

#[derive(Debug, PartialEq)]
struct LivoxUnit {
    model: Model,
}

impl MakerUnit for LivoxUnit {
    fn may_have_sent(&self, payload: &[u8]) -> bool {
        self.model.is_data(payload)
    }

    fn packet_nanos(&self, payload: &[u8]) -> i64 {
        self.model.packet_nanos(payload)
    }

    fn elevations_deg(&self) -> Vec<f64> {
        Vec::new()
    }

    fn decoder(&self) -> Arc<dyn MakerDecoder> {
        Arc::new(Decoder::new(self.model))
    }

    fn is_same(&self, other: &dyn MakerUnit) -> bool {
        is_same_unit(self, other)
    }

    fn clock_reference(&self, payload: &[u8]) -> Option<ClockReference> {
        if !self.model.is_data(payload) {
            return None;
        }
        match self.model.time_type(payload)? {
            0 => Some(ClockReference::FreeRunning),
            1 => Some(ClockReference::Ptp),
            // Mid-360: 2 GPS. Avia: 3 pulse and date, 4 pulse.
            2..=4 => Some(ClockReference::Pulse),
            _ => None,
        }
    }

    fn is_auxiliary(&self, payload: &[u8]) -> bool {
        self.model.is_imu(payload)
    }
}
