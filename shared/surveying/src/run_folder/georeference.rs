//! Placement of the clouds of a run on the Earth.

use crate::crs::{Crs, CrsError, MapProjection};
use crate::error::DeliverError;
use delivery::{GeoreferenceFile, UtmOrigin};
use files::regular_file;
use geometry::{Geodetic, LocalFrame, Point3};
use std::path::Path;

/// Frames of the clouds and of the trajectory.
#[derive(Debug)]
pub struct Georeference {
    /// Frame of the trajectory: east, north, up at the origin. `None` without GNSS.
    local: Option<LocalFrame>,
    /// Projection of the clouds and the heading of grid north, clockwise from true north, rad. `None` if the clouds are
    /// in the local frame.
    utm: Option<(MapProjection, f64)>,
}

impl Georeference {
    /// Reads `georeference.json`.
    pub fn load(path: &Path) -> Result<Self, DeliverError> {
        let text = regular_file::read_to_string(path).map_err(DeliverError::file(path, "read"))?;
        let GeoreferenceFile { frame, trajectory_frame, origin, utm, .. } =
            serde_json::from_str(&text).map_err(|error| DeliverError::content(path, error.to_string()))?;
        if let Some(Geodetic { latitude_deg, longitude_deg, altitude_m }) = origin
            && Geodetic::new(latitude_deg, longitude_deg, altitude_m).is_none()
        {
            let rule = format!("origin {latitude_deg} {longitude_deg} {altitude_m} is not a valid position");
            return Err(DeliverError::content(path, rule));
        }
        let utm = match (frame == trajectory_frame, utm) {
            (true, _) => None,
            (false, Some(UtmOrigin { epsg, convergence_deg, .. })) => {
                let projection = Crs::from_epsg(epsg).and_then(|crs| crs.projection(None));
                let projection = projection.map_err(|error| DeliverError::content(path, error.to_string()))?;
                Some((projection, convergence_deg.to_radians()))
            }
            (false, None) => {
                let rule = format!("the clouds are in frame {frame:?}; expected the local frame or `utm`");
                return Err(DeliverError::content(path, rule));
            }
        };
        Ok(Self { local: origin.map(LocalFrame::new), utm })
    }

    /// The placement of clouds in a local frame.
    pub(crate) fn for_local(local: LocalFrame) -> Self {
        Self { local: Some(local), utm: None }
    }
    /// The local frame. `None` if the run is not georeferenced.
    pub fn local(&self) -> Option<&LocalFrame> {
        self.local.as_ref()
    }
    /// Whether the clouds are in UTM.
    pub fn is_utm(&self) -> bool {
        self.utm.is_some()
    }
    /// Angle from true north, the y axis of the trajectory, to the y axis of the clouds, clockwise, rad.
    pub fn convergence(&self) -> f64 {
        self.utm.as_ref().map_or(0.0, |(_, convergence)| *convergence)
    }
    /// Geographic position of coordinates of the clouds. `None` if the run is not georeferenced.
    pub fn geodetic_from_cloud(&self, xyz: [f64; 3]) -> Result<Option<Geodetic>, CrsError> {
        match (&self.utm, &self.local) {
            (Some((projection, _)), _) => Ok(Some(projection.unproject(xyz)?)),
            (None, Some(local)) => Ok(Some(local.geodetic_from_world(&Point3::from(xyz)))),
            (None, None) => Ok(None),
        }
    }
}
