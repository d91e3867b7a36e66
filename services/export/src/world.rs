//! The final frame of the results, from the placement of the submaps at the end of the drive.

use crate::deviations::Deviations;
use crate::settings::Settings;
use geometry::{Geodetic, LocalFrame, Point3, Pose, Stamp, Utm, UtmError};
use messages::{FRAME_EAST_NORTH_UP, PlacementRow, PlacementTopic, PoseDeviation};
use serde::Serialize;
use stage::{Outputs, Received, StepError};

/// Poses of all submaps, and the frame of the clouds by the settings.
pub(crate) struct World {
    submaps: Vec<PlacedSubmap>,
    georeference: Georeference,
    local: Option<LocalFrame>,
    /// Projection of the coordinates, if the frame is UTM.
    utm: Option<Utm>,
}

/// Pose of a submap before and after the correction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedSubmap {
    pub stamp: Stamp,
    pub odom_from_submap: Pose,
    pub world_from_submap: Pose,
    /// Standard deviations along and about the axes of the submap, m and rad.
    pub sigma_m: [f32; 3],
    pub sigma_rad: [f32; 3],
    /// Standard deviations in the world.
    pub deviation: PoseDeviation,
}

/// `georeference.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Georeference {
    /// Version of this file format.
    version: u32,
    /// Frame of the clouds.
    frame: String,
    /// Frame of the trajectory.
    trajectory_frame: String,
    /// Origin of the local frame (WGS84).
    origin: Option<Geodetic>,
    /// UTM coordinates of the origin.
    utm: Option<UtmOrigin>,
    /// Standard deviations of the poses of the submaps. In a frame without origin: against the first submap.
    standard_deviations: Option<Deviations>,
    closed_loops: Uses,
    fixes: Uses,
    /// Number of submaps with a gravity measurement.
    uprights: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct UtmOrigin {
    epsg: u32,
    zone: String,
    easting_m: f64,
    northing_m: f64,
    /// Meridian convergence with the sign of PROJ: angle from true north (the y axis of the local frame) to grid north, clockwise,
    /// deg. Positive west of the central meridian in the southern hemisphere and east of it in the northern one.
    convergence_deg: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Uses {
    used: u32,
    refused: u32,
}

impl World {
    pub fn new(placement: &Received<PlacementTopic>, settings: &Settings) -> Result<Self, StepError> {
        let header = placement.header();
        let submaps = placement.rows().iter().map(PlacedSubmap::new).collect::<Result<Vec<_>, _>>()?;
        let is_on_earth = header.frame == FRAME_EAST_NORTH_UP;
        let origin = is_on_earth.then(|| {
            Geodetic::new(header.latitude_deg, header.longitude_deg, header.altitude_m).ok_or_else(|| {
                let [lat, lon] = [header.latitude_deg, header.longitude_deg];
                StepError::data(format!(
                    "placement: origin {lat} {lon} {} is not a position on the Earth",
                    header.altitude_m
                ))
            })
        });
        let origin = origin.transpose()?;
        let local = origin.map(LocalFrame::new);
        let map = origin.as_ref().map(Utm::of).transpose().map_err(StepError::data)?;
        let place = local.as_ref().zip(map.as_ref()).map(|(local, utm)| UtmOrigin::of(local, utm)).transpose()?;
        let deviations = Deviations::of(placement.rows());
        // With a wrong heading, UTM coordinates are wrong, and nothing in them shows it.
        let is_turned = deviations.is_some_and(|deviations| deviations.undetermined_heading(settings).is_some());
        let utm = map.filter(|_| settings.frame == "utm" && !is_turned);
        let local_name = match origin {
            Some(Geodetic { latitude_deg, longitude_deg, altitude_m }) => {
                format!("local east-north-up around {latitude_deg} {longitude_deg} {altitude_m}, m")
            }
            None => "local, first place and heading of the vehicle, z up, m".to_owned(),
        };
        let georeference = Georeference {
            version: 1,
            frame: utm.as_ref().map_or_else(|| local_name.clone(), utm_frame),
            trajectory_frame: local_name,
            origin,
            utm: place,
            standard_deviations: deviations,
            closed_loops: Uses { used: header.n_loops, refused: header.n_loops_refused },
            fixes: Uses { used: header.n_fixes, refused: header.n_fixes_refused },
            uprights: header.n_uprights,
        };
        Ok(Self { submaps, georeference, local, utm })
    }
    /// Description of the frame of the clouds.
    pub fn frame(&self) -> &str {
        &self.georeference.frame
    }
    /// Header line with the coordinate reference system, which GIS software reads.
    pub fn crs(&self) -> Option<String> {
        self.utm.as_ref().map(|utm| format!("crs EPSG:{}", utm.epsg()))
    }
    /// Why coordinates are local, if the settings require UTM.
    pub fn lacks_utm(&self, settings: &Settings) -> Option<String> {
        if settings.frame != "utm" || self.utm.is_some() {
            return None;
        }
        let deviations = self.georeference.standard_deviations.filter(|_| self.local.is_some());
        let heading = deviations.and_then(|deviations| deviations.undetermined_heading(settings));
        Some(heading.unwrap_or_else(|| "the drive is not georeferenced".to_owned()))
    }
    /// Doubts of a result that is placed on the Earth.
    pub fn report_doubts(&self, settings: &Settings, outputs: &mut Outputs) {
        if let Some(deviations) = self.georeference.standard_deviations.filter(|_| self.local.is_some()) {
            deviations.report_doubts(settings, outputs);
        }
    }
    pub fn submap(&self, seq: u64) -> Option<&PlacedSubmap> {
        self.submaps.get(usize::try_from(seq).ok()?)
    }
    /// Coordinates in the frame of the clouds of a point in the local frame, m.
    pub fn coordinates(&self, p: &Point3<f64>) -> Result<[f64; 3], UtmError> {
        match (&self.utm, &self.local) {
            (Some(utm), Some(local)) => utm.project(&local.geodetic_from_world(p)),
            _ => Ok(p.coords.into()),
        }
    }
    /// All submaps by number.
    pub fn submaps(&self) -> &[PlacedSubmap] {
        &self.submaps
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
        let (world_from_submap, odom_from_submap) = poses.ok_or_else(|| {
            StepError::data(format!("placement of submap {}: {row:?} has no valid poses", row.submap))
        })?;
        let (stamp, sigma_m, sigma_rad) = (Stamp(row.stamp), row.sigma_m, row.sigma_rad);
        Ok(Self { stamp, odom_from_submap, world_from_submap, sigma_m, sigma_rad, deviation: row.deviation() })
    }
    /// Correction of poses and points near the submap.
    pub fn world_from_odom(&self) -> Pose {
        self.world_from_submap * self.odom_from_submap.inverse()
    }
}

fn utm_frame(utm: &Utm) -> String {
    let (zone, hemisphere, epsg) = (utm.zone(), utm.hemisphere(), utm.epsg());
    format!("UTM {zone}{hemisphere} (EPSG:{epsg}) easting northing, height above the WGS84 ellipsoid, m")
}

impl UtmOrigin {
    fn of(local: &LocalFrame, utm: &Utm) -> Result<Self, StepError> {
        let project = |p: Point3<f64>| utm.project(&local.geodetic_from_world(&p)).map_err(StepError::data);
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
