//! The interface of a maker: the properties of a model, a unit, and a decoder of its packets.
//!
//! To add a maker, implement the three traits in its folder and add its models to [`crate::Model`], the only list of makers.

use crate::clock::Epoch;
use crate::field_of_view::SilentSector;
use crate::{Blocks, CalibrationError, ClockReference, Scratch, TURN};
use std::any::Any;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

/// Maximum number of returns of a packet: 16 columns of an Ouster with 128 beams and two echoes.
pub(crate) const MAX_RETURNS_PER_PACKET: usize = 4096;

/// A unit of a model, as the trait of its maker.
pub(crate) type Unit = Arc<dyn MakerUnit>;

/// Properties of a model.
pub(crate) trait MakerModel {
    /// Name in `drive.toml`.
    fn name(&self) -> &'static str;

    /// Name of the manufacturer.
    fn title(&self) -> &'static str;

    /// UDP port of data packets, as set by the manufacturer.
    fn data_port(&self) -> u16;

    /// UDP port of the other packets of the sensor.
    fn auxiliary_port(&self) -> u16;

    /// Whether a payload is a data packet that names this model.
    fn is_named_by(&self, payload: &[u8]) -> bool;

    /// Whether a payload has the form of the maker's data packets, even if it does not name a model.
    fn is_data_of_maker(&self, payload: &[u8]) -> bool {
        self.is_named_by(payload)
    }

    /// Whether a payload has the state of the device, from which [`MakerUnit::with_device_packet`] may take the calibration.
    fn is_device_packet(&self, _payload: &[u8]) -> bool {
        false
    }

    /// The property of a data packet that identifies the model, for errors: `has the size and the header of a Pandar40P`.
    fn evidence(&self, _payload: &[u8]) -> String {
        format!("has the size and the header of a {}", self.title())
    }

    /// A unit with the beams of its model.
    fn unit(&self) -> Unit;

    /// A unit with the beams in the text of its calibration file.
    fn calibrated_unit(&self, text: &str) -> Result<Unit, CalibrationError>;
}

/// A unit: a model with its nominal or calibrated beams.
pub(crate) trait MakerUnit: Any + Debug + Send + Sync {
    /// Whether it may have sent a payload as a data packet.
    fn may_have_sent(&self, payload: &[u8]) -> bool;

    /// Whether a payload is certainly a data packet of this model.
    fn is_sure_sender(&self, payload: &[u8]) -> bool {
        self.may_have_sent(payload)
    }

    /// Time in a data packet, ns since [`MakerUnit::epoch`].
    fn packet_nanos(&self, payload: &[u8]) -> i64;

    /// Elevations of the beams in firing order, deg; empty if the sensor has no fixed beams or they are unknown.
    fn elevations_deg(&self) -> Vec<f64>;

    /// Decoder of its packets, with its tables.
    fn decoder(&self) -> Arc<dyn MakerDecoder>;

    /// Whether `other` is the same model with the same beams.
    fn is_same(&self, other: &dyn MakerUnit) -> bool;

    /// Origin of the times in packets.
    fn epoch(&self) -> Epoch {
        Epoch::Unix
    }

    /// The clock reference reported in a packet, or in the metadata for all data packets.
    fn clock_reference(&self, _payload: &[u8]) -> Option<ClockReference> {
        None
    }

    /// Whether a payload is another packet of the sensor: from its IMU, its receiver or about its state.
    fn is_auxiliary(&self, _payload: &[u8]) -> bool {
        false
    }

    /// The NMEA sentence in an auxiliary packet.
    fn sentence<'a>(&self, _payload: &'a [u8]) -> Option<&'a str> {
        None
    }

    /// Whether a payload at a port of the sensor is too short for any of its packets.
    fn is_short(&self, _payload: &[u8]) -> bool {
        false
    }

    /// Serial number in a data packet of another sensor of the same kind.
    fn other_serial_number(&self, _payload: &[u8]) -> Option<u64> {
        None
    }

    /// Description of the missing file without which packets cannot be decoded.
    fn missing_file(&self) -> Option<&'static str> {
        None
    }

    /// Whether packets about the state of the device may hold the calibration of the unit.
    fn receives_calibration(&self) -> bool {
        false
    }

    /// The unit with the calibration in a packet about the state of the device. `None` for all other packets.
    fn with_device_packet(&self, _payload: &[u8]) -> Option<Unit> {
        None
    }
}

/// Implements [`MakerUnit::is_same`] for a unit with `PartialEq`.
pub(crate) fn is_same_unit<T: MakerUnit + PartialEq>(unit: &T, other: &dyn MakerUnit) -> bool {
    (other as &dyn Any).downcast_ref() == Some(unit)
}

/// Condition that ends a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// The encoder passes the start of a revolution.
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

/// Decoder of the data packets of a unit.
pub(crate) trait MakerDecoder: Debug + Send + Sync {
    /// Times and angles of the blocks of a data packet.
    fn blocks(&self, payload: &[u8]) -> Blocks;

    /// Appends the returns of some blocks of a data packet. `packet_nanos` is the time of the packet minus the stamp of the sweep.
    fn decode(
        &self,
        payload: &[u8],
        blocks: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    );

    /// The decoder for packets that may span a sector in which the sensor fires nothing; `None` if its packets have the times of
    /// their blocks, or end before the sector.
    fn across(&self, _sector: SilentSector) -> Option<Arc<dyn MakerDecoder>> {
        None
    }

    /// Condition that ends a sweep.
    fn cut(&self) -> Cut {
        Cut::Turn { full: TURN }
    }

    /// Whether packets follow each other at equal intervals, so that a gap shows lost packets.
    fn is_regular(&self) -> bool {
        true
    }
}
