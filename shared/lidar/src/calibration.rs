//! A LiDAR with the calibration of its unit.

use super::{Model, rings};
use crate::ouster::{Metadata, MetadataError};
use crate::robosense;
use crate::velodyne::{Laser, LaserFileError, lasers_from_file};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::sync::Arc;

/// A calibration file that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A model without calibration files.
    #[error("a {0} needs no calibration file; remove the entry")]
    NotNeeded(&'static str),
    /// A file of a Velodyne.
    #[error(transparent)]
    Lasers(#[from] LaserFileError),
    /// A metadata file of an Ouster.
    #[error(transparent)]
    Metadata(#[from] MetadataError),
    /// A line of a table of angles.
    #[error("line {line}: {text:?}; must be {rule}")]
    Angles {
        /// Line in the file.
        line: usize,
        /// The line found.
        text: String,
        /// What it must be.
        rule: &'static str,
    },
    /// A table of angles with too few or too many lines.
    #[error("has {found} beams; a {model} has {expected}")]
    NumberOfBeams {
        /// Beams found.
        found: usize,
        /// The model.
        model: &'static str,
        /// Beams of the model.
        expected: usize,
    },
}

/// Direction of a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BeamAngles {
    /// Angle above the horizon, deg.
    pub(crate) elevation_deg: f64,
    /// Added to the encoder angle, deg, clockwise.
    pub(crate) azimuth_deg: f64,
}

/// Beams of a unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Beams {
    /// Those of the model.
    OfModel,
    Velodyne(Arc<[Laser]>),
    Angles(Arc<[BeamAngles]>),
    Ouster(Arc<Metadata>),
}

/// A LiDAR: its model and, if a file has it, the calibration of the unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Lidar {
    model: Model,
    pub(super) beams: Beams,
    /// Name and content of the calibration file.
    file: Option<Arc<(String, String)>>,
    origin: Origin,
}

/// Where the data packets of a LiDAR come from, to tell several LiDARs on one network apart. `None`: anywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Address of the sender.
    pub sender: Option<Ipv4Addr>,
    /// UDP port to which the packets are sent.
    pub port: Option<u16>,
}

impl<T: Into<Model>> From<T> for Lidar {
    /// A unit with the beams of its model. An Ouster cannot be decoded without its metadata.
    fn from(model: T) -> Self {
        Self { model: model.into(), beams: Beams::OfModel, file: None, origin: Origin::default() }
    }
}

impl Lidar {
    /// Reads the calibration file of a unit: `db.xml` or YAML of a Velodyne, angle correction CSV of a Hesai, `angle.csv` of a Robosense,
    /// metadata JSON of an Ouster. `name` is the name of the file.
    pub fn with_calibration(model: Model, name: &str, text: String) -> Result<Self, CalibrationError> {
        let beams = match model {
            Model::Velodyne(of) => Beams::Velodyne(lasers_from_file(&text, of)?.into()),
            Model::Hesai(of) => Beams::Angles(angles_from_csv(&text, model.title(), of.n_beams())?.into()),
            Model::Robosense(of) => Beams::Angles(angles_from_csv(&text, model.title(), of.n_beams())?.into()),
            Model::Ouster => Beams::Ouster(Arc::new(Metadata::from_json(&text)?)),
            Model::Livox(_) => return Err(CalibrationError::NotNeeded(model.title())),
        };
        Ok(Self { model, beams, file: Some(Arc::new((name.to_owned(), text))), origin: Origin::default() })
    }

    /// The same LiDAR, whose data packets come from `origin` alone.
    #[must_use]
    pub fn with_origin(self, origin: Origin) -> Self {
        Self { origin, ..self }
    }

    /// The model.
    pub fn model(&self) -> Model {
        self.model
    }

    /// Whether data packets of this LiDAR may come from a sender (address and port) to a port.
    pub(super) fn may_come_from(&self, source: SocketAddrV4, port: u16) -> bool {
        self.origin.sender.is_none_or(|sender| sender == *source.ip()) && self.origin.port.is_none_or(|own| own == port)
    }

    /// Name and content of the calibration file of the unit.
    pub fn calibration_file(&self) -> Option<(&str, &str)> {
        self.file.as_ref().map(|file| (file.0.as_str(), file.1.as_str()))
    }

    /// Whether packets with the state of the device may have the calibration of the unit, which no file has.
    pub fn receives_calibration(&self) -> bool {
        matches!((self.model, &self.beams), (Model::Robosense(_), Beams::OfModel))
    }

    /// The LiDAR with the calibration in a packet with the state of the device. `None` for all other packets, and if a file of the unit
    /// has the calibration.
    pub fn with_device_packet(&self, payload: &[u8]) -> Option<Self> {
        let Model::Robosense(model) = self.model else { return None };
        let angles = robosense::angles(model, payload).filter(|_| self.receives_calibration())?;
        Some(Self { beams: Beams::Angles(angles.into()), ..self.clone() })
    }

    /// What its packets cannot be decoded without, if it is not there.
    pub fn missing_file(&self) -> Option<&'static str> {
        match (self.model, &self.beams) {
            (Model::Ouster, Beams::OfModel) => Some("the metadata file (JSON) of the sensor"),
            (Model::Robosense(robosense::Model::Rs32), Beams::OfModel) => {
                Some("the angle file (CSV) of the unit or its device packets")
            }
            _ => None,
        }
    }

    /// Elevations of the beams in firing order, deg; none if the sensor has no fixed beams or its metadata is not known.
    pub fn elevations_deg(&self) -> Vec<f64> {
        match (&self.beams, self.model) {
            (Beams::Velodyne(lasers), _) => lasers.iter().map(|laser| laser.elevation_deg).collect(),
            (Beams::Angles(angles), _) => angles.iter().map(|beam| beam.elevation_deg).collect(),
            (Beams::Ouster(metadata), _) => metadata.elevations_deg().to_vec(),
            (Beams::OfModel, Model::Velodyne(model)) => {
                model.lasers().iter().map(|laser| laser.elevation_deg).collect()
            }
            (Beams::OfModel, Model::Hesai(model)) => model.beams().iter().map(|beam| beam.elevation_deg).collect(),
            (Beams::OfModel, Model::Robosense(model)) => model.beams().iter().map(|beam| beam.elevation_deg).collect(),
            (Beams::OfModel, Model::Ouster | Model::Livox(_)) => Vec::new(),
        }
    }

    /// Number of rings; 0 if the sensor has none, or if they are not known.
    pub fn n_rings(&self) -> usize {
        self.elevations_deg().len()
    }

    /// Ring of each beam: its rank by elevation, 0 = lowest.
    pub fn rings(&self) -> Vec<u8> {
        rings(self.elevations_deg().into_iter())
    }
}

/// Angles of `n_expected` beams, one per line: `elevation, azimuth` in deg, after an optional number of the beam. Lines before the first
/// beam are a header.
fn angles_from_csv(text: &str, model: &'static str, n_expected: usize) -> Result<Vec<BeamAngles>, CalibrationError> {
    let mut angles = Vec::new();
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let fields: Vec<&str> = line.split(',').map(str::trim).filter(|field| !field.is_empty()).collect();
        if fields.is_empty() {
            continue;
        }
        let numbers: Option<Vec<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
        let error = |rule| CalibrationError::Angles { line: index + 1, text: line.chars().take(60).collect(), rule };
        let Some(numbers) = numbers else {
            if angles.is_empty() {
                continue;
            }
            return Err(error("numbers separated by commas"));
        };
        let [elevation_deg, azimuth_deg] = match numbers[..] {
            [elevation, azimuth] => [elevation, azimuth],
            [number, elevation, azimuth] if number == (angles.len() + 1) as f64 => [elevation, azimuth],
            _ => return Err(error("elevation and azimuth of a beam, after an optional number that counts from 1")),
        };
        if !(elevation_deg.abs() <= 90.0 && azimuth_deg.abs() <= 180.0) {
            return Err(error("an elevation of -90 to 90 and an azimuth of -180 to 180 deg"));
        }
        if angles.len() < n_expected + 1 {
            angles.push(BeamAngles { elevation_deg, azimuth_deg });
        }
    }
    if angles.len() != n_expected {
        return Err(CalibrationError::NumberOfBeams { found: angles.len(), model, expected: n_expected });
    }
    Ok(angles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_read_with_and_without_header_and_numbers() {
        let expected =
            [(1.5, -2.0), (0.5, 2.0)].map(|(elevation_deg, azimuth_deg)| BeamAngles { elevation_deg, azimuth_deg });
        for text in
            ["Laser id,Elevation,Azimuth\n1,1.5,-2\n2,0.5,2\n", "1.5,-2.0\r\n0.5,2\r\n", "\n1, 1.5 , -2,\n2,0.5,2"]
        {
            assert_eq!(angles_from_csv(text, "X", 2).expect("reads"), expected);
        }
        let error = |text: &str| angles_from_csv(text, "X", 2).expect_err("is wrong").to_string();
        assert_eq!(error("1,1.5,-2\n"), "has 1 beams; a X has 2");
        assert_eq!(error("1,2\n3,4\n5,6\n7,8\n9,9\n"), "has 3 beams; a X has 2");
        assert!(error("1,1.5,-2\n3,0.5,2\n").starts_with("line 2: \"3,0.5,2\"; must be elevation"));
        assert!(error("91,0\n").contains("an elevation of -90 to 90"));
        assert!(error("1,2\nx,y\n").starts_with("line 2: \"x,y\"; must be numbers"));
    }
}
