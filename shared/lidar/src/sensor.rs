//! A LiDAR with the calibration of its unit.

use crate::clock::Epoch;
use crate::maker::Unit;
use crate::{CalibrationError, ClockReference, Model, rings};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::sync::Arc;

/// A LiDAR: its model and the calibration of the unit, if a file contains it.
#[derive(Clone, Debug)]
pub struct Lidar {
    model: Model,
    pub(crate) unit: Unit,
    file: Option<Arc<CalibrationFile>>,
    origin: Origin,
}

/// The calibration file of a unit.
#[derive(Debug, PartialEq)]
struct CalibrationFile {
    name: String,
    text: String,
}

/// Source of the data packets of a LiDAR, to distinguish several LiDARs on one network. `None`: any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Address of the sender.
    pub sender: Option<Ipv4Addr>,
    /// UDP port to which the packets are sent.
    pub port: Option<u16>,
}

impl PartialEq for Lidar {
    fn eq(&self, other: &Self) -> bool {
        let is_same_unit = self.model == other.model && self.unit.is_same(&*other.unit);
        is_same_unit && self.file == other.file && self.origin == other.origin
    }
}

impl<T: Into<Model>> From<T> for Lidar {
    /// A unit with the beams of its model. An Ouster cannot be decoded without its metadata.
    fn from(model: T) -> Self {
        let model = model.into();
        Self { model, unit: model.maker().unit(), file: None, origin: Origin::default() }
    }
}

impl Lidar {
    /// Reads the calibration file of a unit: `db.xml` or YAML of a Velodyne, angle correction CSV of a Hesai, `angle.csv` of a Robosense,
    /// metadata JSON of an Ouster. `name` is the name of the file.
    pub fn with_calibration(model: Model, name: &str, text: String) -> Result<Self, CalibrationError> {
        let unit = model.maker().calibrated_unit(&text)?;
        let file = CalibrationFile { name: name.to_owned(), text };
        Ok(Self { model, unit, file: Some(Arc::new(file)), origin: Origin::default() })
    }

    /// Returns the LiDAR, restricted to data packets from `origin`.
    #[must_use]
    pub fn with_origin(self, origin: Origin) -> Self {
        Self { origin, ..self }
    }

    /// The model.
    pub fn model(&self) -> Model {
        self.model
    }

    /// Whether data packets of this LiDAR may come from a sender (address and port) to a port.
    pub(crate) fn may_come_from(&self, source: SocketAddrV4, port: u16) -> bool {
        self.origin.sender.is_none_or(|sender| sender == *source.ip()) && self.origin.port.is_none_or(|own| own == port)
    }

    /// Name and content of the calibration file of the unit.
    pub fn calibration_file(&self) -> Option<(&str, &str)> {
        self.file.as_ref().map(|file| (file.name.as_str(), file.text.as_str()))
    }

    /// Whether packets with the state of the device may contain the calibration of the unit, and no file does.
    pub fn receives_calibration(&self) -> bool {
        self.unit.receives_calibration()
    }

    /// The LiDAR with the calibration in a packet with the state of the device. `None` for all other packets, and if a file of the unit
    /// contains the calibration.
    pub fn with_device_packet(&self, payload: &[u8]) -> Option<Self> {
        Some(Self { unit: self.unit.with_device_packet(payload)?, ..self.clone() })
    }

    /// Description of the missing file without which packets cannot be decoded.
    pub fn missing_file(&self) -> Option<&'static str> {
        self.unit.missing_file()
    }

    /// Whether this LiDAR may have sent a payload as a data packet.
    pub fn may_have_sent(&self, payload: &[u8]) -> bool {
        self.unit.may_have_sent(payload)
    }

    /// The clock reference reported in a packet of the sensor, or in its metadata for all data packets. `None` if no
    /// reference is reported.
    pub fn clock_reference(&self, payload: &[u8]) -> Option<ClockReference> {
        self.unit.clock_reference(payload)
    }

    /// Time in a data packet, ns since [`Lidar::epoch`].
    pub(crate) fn packet_nanos(&self, payload: &[u8]) -> i64 {
        self.unit.packet_nanos(payload)
    }

    /// Origin of the times in packets.
    pub(crate) fn epoch(&self) -> Epoch {
        self.unit.epoch()
    }

    /// Elevations of the beams in firing order, deg; empty if the sensor has no fixed beams or its metadata is unknown.
    pub fn elevations_deg(&self) -> Vec<f64> {
        self.unit.elevations_deg()
    }

    /// Number of rings; 0 for a sensor without rings, or if the rings are unknown.
    pub fn n_rings(&self) -> usize {
        self.elevations_deg().len()
    }

    /// Ring of each beam: its rank by elevation, 0 = lowest.
    pub fn rings(&self) -> Vec<u8> {
        rings(self.elevations_deg().into_iter())
    }
}
