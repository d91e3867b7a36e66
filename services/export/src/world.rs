//! The frame of the results: what the end of the drive says about where its submaps lie.

use crate::Settings;
use crate::trajectory::corrected;
use geometry::{Geodetic, LocalFrame, Point3, Pose, Stamp, Trajectory, Utm};
use messages::{FRAME_EAST_NORTH_UP, Placement, PlacementRow};
use serde::Serialize;
use stage::{Received, StepError};

/// Submaps in the frame that the settings ask for.
pub(crate) struct World {
    submaps: Vec<PlacedSubmap>,
    georeference: Georeference,
    local: Option<LocalFrame>,
    /// If coordinates are to be those of a map.
    utm: Option<Utm>,
}

/// A submap where the drive began to see it, and where it lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedSubmap {
    pub stamp: Stamp,
    pub odom_from_submap: Pose,
    pub world_from_submap: Pose,
    /// Standard deviations along and about the submap's axes, m and rad.
    pub sigma_m: [f32; 3],
    pub sigma_rad: [f32; 3],
}

/// `georeference.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Georeference {
    /// Of this layout.
    version: u32,
    /// Of clouds.
    frame: String,
    /// Of trajectories.
    trajectory_frame: String,
    /// WGS84, of the local frame.
    origin: Option<Geodetic>,
    /// Where the origin lies on the map.
    utm: Option<UtmPlace>,
    closed_loops: Uses,
    fixes: Uses,
    /// Submaps in which gravity was measured.
    uprights: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct UtmPlace {
    epsg: u32,
    zone: String,
    easting_m: f64,
    northing_m: f64,
    /// From grid north to the y axis, clockwise, deg: what a cloud in the local frame is to be turned by on a map.
    convergence_deg: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Uses {
    used: u32,
    refused: u32,
}

impl World {
    pub fn new(placement: &Received<Placement>, settings: &Settings) -> Result<Self, StepError> {
        let header = placement.header();
        let submaps = placement.rows().iter().map(PlacedSubmap::new).collect::<Result<Vec<_>, _>>()?;
        let is_on_earth = header.frame == FRAME_EAST_NORTH_UP;
        let origin = is_on_earth.then(|| {
            Geodetic::new(header.latitude_deg, header.longitude_deg, header.altitude_m).ok_or_else(|| {
                let [lat, lon] = [header.latitude_deg, header.longitude_deg];
                StepError::data(format!("placement: origin {lat} {lon} {} is no place", header.altitude_m))
            })
        });
        let origin = origin.transpose()?;
        let local = origin.map(LocalFrame::new);
        let map = origin.as_ref().map(Utm::of).transpose().map_err(StepError::data)?;
        let place = local.as_ref().zip(map.as_ref()).map(|(local, utm)| UtmPlace::of(local, utm)).transpose()?;
        let utm = map.filter(|_| settings.frame == "utm");
        let local_name = match origin {
            Some(Geodetic { latitude_deg, longitude_deg, altitude_m }) => {
                format!("local east-north-up around {latitude_deg} {longitude_deg} {altitude_m}, m")
            }
            None => "local, first place and heading of the vehicle, z up, m".to_owned(),
        };
        let georeference = Georeference {
            version: 1,
            frame: utm.as_ref().map_or_else(|| local_name.clone(), frame_on_map),
            trajectory_frame: local_name,
            origin,
            utm: place,
            closed_loops: Uses { used: header.n_loops, refused: header.n_loops_refused },
            fixes: Uses { used: header.n_fixes, refused: header.n_fixes_refused },
            uprights: header.n_uprights,
        };
        Ok(Self { submaps, georeference, local, utm })
    }
    /// Of the clouds, in words.
    pub fn frame(&self) -> &str {
        &self.georeference.frame
    }
    /// The line of PLY headers that GIS software looks for.
    pub fn crs(&self) -> Option<String> {
        self.utm.as_ref().map(|utm| format!("crs EPSG:{}", utm.epsg()))
    }
    /// Whether the settings ask for a map and there is none.
    pub fn lacks_map(&self, settings: &Settings) -> bool {
        settings.frame == "utm" && self.utm.is_none()
    }
    pub fn submap(&self, seq: u64) -> Option<&PlacedSubmap> {
        self.submaps.get(usize::try_from(seq).ok()?)
    }
    /// Coordinates of a point of the world (local, m).
    pub fn coordinates(&self, p: &Point3<f64>) -> Result<[f64; 3], StepError> {
        match (&self.utm, &self.local) {
            (Some(utm), Some(local)) => utm.project(&local.geodetic_from_world(p)).map_err(StepError::data),
            _ => Ok(p.coords.into()),
        }
    }
    /// `world_from_body`, of `odom_from_body`.
    pub fn trajectory(&self, odometry: &Trajectory) -> Trajectory {
        corrected(odometry, &self.submaps)
    }
    pub fn to_json(&self) -> String {
        let text =
            serde_json::to_string_pretty(&self.georeference).expect("string keys and plain values always encode");
        text + "\n"
    }
}

impl PlacedSubmap {
    fn new(row: &PlacementRow) -> Result<Self, StepError> {
        let poses = row.world_from_submap.to_pose().zip(row.odom_from_submap.to_pose());
        let (world_from_submap, odom_from_submap) =
            poses.ok_or_else(|| StepError::data(format!("placement of submap {}: {row:?} is no place", row.submap)))?;
        let (stamp, sigma_m, sigma_rad) = (Stamp(row.stamp), row.sigma_m, row.sigma_rad);
        Ok(Self { stamp, odom_from_submap, world_from_submap, sigma_m, sigma_rad })
    }
    /// What moves a pose or a point near the submap from the odometry's frame to the world.
    pub fn world_from_odom(&self) -> Pose {
        self.world_from_submap * self.odom_from_submap.inverse()
    }
}

fn frame_on_map(utm: &Utm) -> String {
    let (zone, hemisphere, epsg) = (utm.zone(), utm.hemisphere(), utm.epsg());
    format!("UTM {zone}{hemisphere} (EPSG:{epsg}) easting northing, height above the WGS84 ellipsoid, m")
}

impl UtmPlace {
    fn of(local: &LocalFrame, utm: &Utm) -> Result<Self, StepError> {
        let project = |p: Point3<f64>| utm.project(&local.geodetic_from_world(&p)).map_err(StepError::data);
        let [easting_m, northing_m, _] = project(Point3::origin())?;
        let [east, north, _] = project(Point3::new(0.0, 100.0, 0.0))?;
        Ok(Self {
            epsg: utm.epsg(),
            zone: format!("{}{}", utm.zone(), utm.hemisphere()),
            easting_m,
            northing_m,
            convergence_deg: (east - easting_m).atan2(north - northing_m).to_degrees(),
        })
    }
}
