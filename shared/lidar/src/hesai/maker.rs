//! The maker Hesai.

use super::{Decoder, Model, is_gps, is_pulse_locked};
use crate::calibration::{BeamAngles, angles_from_csv};
use crate::maker::{MakerDecoder, MakerModel, MakerUnit, Unit, is_same_unit};
use crate::velodyne::DATA_PORT;
use crate::{CalibrationError, ClockReference};
use std::sync::Arc;

/// UDP port of packets of the receiver.
const GPS_PORT: u16 = 10_110;

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
        GPS_PORT
    }

    fn is_named_by(&self, payload: &[u8]) -> bool {
        self.is_data(payload)
    }

    fn unit(&self) -> Unit {
        Arc::new(HesaiUnit { model: *self, angles: self.beams().to_vec() })
    }

    fn calibrated_unit(&self, text: &str) -> Result<Unit, CalibrationError> {
        let angles = angles_from_csv(text, self.title(), self.n_beams())?;
        Ok(Arc::new(HesaiUnit { model: *self, angles }))
    }
}

#[derive(Debug, PartialEq)]
struct HesaiUnit {
    model: Model,
    angles: Vec<BeamAngles>,
}

impl MakerUnit for HesaiUnit {
    fn may_have_sent(&self, payload: &[u8]) -> bool {
        self.model.is_data(payload)
    }

    fn packet_nanos(&self, payload: &[u8]) -> i64 {
        self.model.packet_nanos(payload)
    }

    fn elevations_deg(&self) -> Vec<f64> {
        self.angles.iter().map(|beam| beam.elevation_deg).collect()
    }

    fn decoder(&self) -> Arc<dyn MakerDecoder> {
        Arc::new(Decoder::new(self.model, &self.angles))
    }

    fn is_same(&self, other: &dyn MakerUnit) -> bool {
        is_same_unit(self, other)
    }

    fn clock_reference(&self, payload: &[u8]) -> Option<ClockReference> {
        let is_locked = is_pulse_locked(payload)?;
        Some(if is_locked { ClockReference::Pulse } else { ClockReference::PulseAbsent })
    }

    fn is_auxiliary(&self, payload: &[u8]) -> bool {
        is_gps(payload)
    }
}
