//! `georeference.json`: the frame of the results and its placement on the Earth.

use crate::deviations::Deviations;
use crate::error::DeliveryError;
use geometry::{Geodetic, LocalFrame, Point3, Utm};
use serde::{Deserialize, Serialize};

/// The content of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GeoreferenceFile {
    /// Version of this file format.
    #[serde(default)]
    pub version: u32,
    /// Frame of the clouds.
    pub frame: String,
    /// Frame of the trajectory. It is the frame of the clouds, unless these are in UTM.
    pub trajectory_frame: String,
    /// Origin of the local frame (WGS84). `None` without fixes.
    pub origin: Option<Geodetic>,
    /// UTM coordinates of the origin.
    pub utm: Option<UtmOrigin>,
    /// Standard deviations of the poses of the submaps. In a frame without origin, they are relative to the first submap.
    pub standard_deviations: Option<Deviations>,
    /// Loop closures.
    #[serde(default)]
    pub closed_loops: Uses,
    /// Fixes of the receiver.
    #[serde(default)]
    pub fixes: Uses,
    /// Number of submaps with a gravity measurement.
    #[serde(default)]
    pub uprights: u32,
}

/// The origin in UTM.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UtmOrigin {
    /// EPSG number of the zone.
    pub epsg: u32,
    /// Number and hemisphere of the zone, for example `31N`.
    #[serde(default)]
    pub zone: String,
    /// Easting, m.
    #[serde(default)]
    pub easting_m: f64,
    /// Northing, m.
    #[serde(default)]
    pub northing_m: f64,
    /// Meridian convergence with the sign of PROJ: angle from true north (the y axis of the local frame) to grid north, clockwise,
    /// deg. Positive west of the central meridian in the southern hemisphere and east of it in the northern one.
    pub convergence_deg: f64,
}

/// Numbers of used and rejected measurements of a kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Uses {
    /// Number of used measurements.
    pub used: u32,
    /// Number of measurements rejected because they contradict the others.
    pub refused: u32,
}

impl UtmOrigin {
    pub(crate) fn new(local: &LocalFrame, utm: &Utm) -> Result<Self, DeliveryError> {
        let project = |p: Point3<f64>| utm.project(&local.geodetic_from_world(&p)).map_err(DeliveryError::from);
        let [easting_m, northing_m, _] = project(Point3::origin())?;
        let [east, north, _] = project(Point3::new(0.0, 100.0, 0.0))?;
        Ok(Self {
            epsg: utm.epsg(),
            zone: format!("{}{}", utm.zone(), utm.hemisphere()),
            easting_m,
            northing_m,
            convergence_deg: -(east - easting_m).atan2(north - northing_m).to_degrees(),
        })
    }
}
