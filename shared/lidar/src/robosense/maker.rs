//! The maker Robosense.

use super::{DATA_PORT, DEVICE_PORT, Decoder, Model, angles, is_device, packet_nanos};
use crate::CalibrationError;
use crate::calibration::{BeamAngles, angles_from_csv};
use crate::maker::{MakerDecoder, MakerModel, MakerUnit, Unit, is_same_unit};
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
        DEVICE_PORT
    }

    fn is_named_by(&self, payload: &[u8]) -> bool {
        Model::from_payload(payload) == Some(*self)
    }

    fn is_device_packet(&self, payload: &[u8]) -> bool {
        is_device(payload)
    }

    fn unit(&self) -> Unit {
        Arc::new(RobosenseUnit { model: *self, calibration: None })
    }

    fn calibrated_unit(&self, text: &str) -> Result<Unit, CalibrationError> {
        let angles = angles_from_csv(text, self.title(), self.n_beams())?;
        Ok(Arc::new(RobosenseUnit { model: *self, calibration: Some(angles) }))
    }
}

#[derive(Debug, PartialEq)]
struct RobosenseUnit {
    model: Model,
    /// Angles from a file or from a packet with the state of the device.
    calibration: Option<Vec<BeamAngles>>,
}

impl RobosenseUnit {
    fn angles(&self) -> &[BeamAngles] {
        self.calibration.as_deref().unwrap_or(self.model.beams())
    }
}

impl MakerUnit for RobosenseUnit {
    fn may_have_sent(&self, payload: &[u8]) -> bool {
        self.model.is_data(payload)
    }

    fn packet_nanos(&self, payload: &[u8]) -> i64 {
        packet_nanos(payload)
    }

    fn elevations_deg(&self) -> Vec<f64> {
        self.angles().iter().map(|beam| beam.elevation_deg).collect()
    }

    fn decoder(&self) -> Arc<dyn MakerDecoder> {
        Arc::new(Decoder::new(self.model, self.angles()))
    }

    fn is_same(&self, other: &dyn MakerUnit) -> bool {
        is_same_unit(self, other)
    }

    fn is_auxiliary(&self, payload: &[u8]) -> bool {
        is_device(payload)
    }

    fn missing_file(&self) -> Option<&'static str> {
        let is_missing = self.model == Model::Rs32 && self.calibration.is_none();
        is_missing.then_some("the angle file (CSV) of the unit or its device packets")
    }

    fn receives_calibration(&self) -> bool {
        self.calibration.is_none()
    }

    fn with_device_packet(&self, payload: &[u8]) -> Option<Unit> {
        let angles = angles(self.model, payload).filter(|_| self.receives_calibration())?;
        Some(Arc::new(Self { model: self.model, calibration: Some(angles) }))
    }
}
