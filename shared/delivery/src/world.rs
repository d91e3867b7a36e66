//! The final frame of the results, from the placement of the submaps at the end of the drive.

use crate::deviations::Deviations;
use crate::error::DeliveryError;
use crate::georeference::{GeoreferenceFile, Uses, UtmOrigin};
use geometry::{Geodetic, LocalFrame, Point3, Pose, Stamp, Utm, UtmError};
use messages::{FRAME_EAST_NORTH_UP, PlacementHeader, PlacementRow, PoseDeviation};

/// Settings of the frame of the clouds.
#[derive(Clone, Copy, Debug)]
pub struct FrameChoice {
    /// Coordinates in UTM instead of the local frame.
    pub wants_utm: bool,
    /// Largest standard deviation of the heading of a submap at which UTM coordinates are allowed, degrees.
    pub max_heading_deviation_deg: f64,
}

/// Poses of all submaps, and the frame of the clouds.
pub struct World {
    choice: FrameChoice,
    submaps: Vec<PlacedSubmap>,
    georeference: GeoreferenceFile,
    local: Option<LocalFrame>,
    /// Projection of the coordinates, if the frame is UTM.
    utm: Option<Utm>,
    /// Reason why the place has no UTM coordinates.
    outside_utm: Option<String>,
}

/// Pose of a submap before and after the correction.
#[derive(Clone, Copy, Debug)]
pub struct PlacedSubmap {
    /// Time of its first shot.
    pub stamp: Stamp,
    /// Pose before the correction.
    pub odom_from_submap: Pose,
    /// Pose after the correction.
    pub world_from_submap: Pose,
    /// Standard deviations along the axes of the submap, m.
    pub sigma_m: [f32; 3],
    /// Standard deviations about the axes of the submap, rad.
    pub sigma_rad: [f32; 3],
    /// Standard deviations in the world.
    pub deviation: PoseDeviation,
}

impl World {
    /// The frame that the placement allows.
    pub fn new(header: &PlacementHeader, rows: &[PlacementRow], choice: FrameChoice) -> Result<Self, DeliveryError> {
        let submaps = rows.iter().map(PlacedSubmap::new).collect::<Result<Vec<_>, _>>()?;
        let is_on_earth = header.frame == FRAME_EAST_NORTH_UP;
        let origin = is_on_earth.then(|| {
            let PlacementHeader { latitude_deg, longitude_deg, altitude_m, .. } = *header;
            Geodetic::new(latitude_deg, longitude_deg, altitude_m)
                .ok_or(DeliveryError::Origin { position_deg: [latitude_deg, longitude_deg], altitude_m })
        });
        let origin = origin.transpose()?;
        let local = origin.map(LocalFrame::new);
        // Near the poles there is no UTM: the results stay in the local frame.
        let (map, outside_utm) = match origin.as_ref().map(Utm::from_geodetic).transpose() {
            Err(error @ UtmError::Latitude(_)) => (None, Some(error.to_string())),
            found => (found?, None),
        };
        let place = local.as_ref().zip(map.as_ref()).map(|(local, utm)| UtmOrigin::new(local, utm)).transpose()?;
        let deviations = Deviations::from_rows(rows);
        // With a wrong heading, UTM coordinates are wrong without any visible sign.
        let limit = choice.max_heading_deviation_deg;
        let is_turned = deviations.is_some_and(|deviations| deviations.undetermined_heading(limit).is_some());
        let utm = map.filter(|_| choice.wants_utm && !is_turned);
        let local_name = match origin {
            Some(Geodetic { latitude_deg, longitude_deg, altitude_m }) => {
                format!("local east-north-up around {latitude_deg} {longitude_deg} {altitude_m}, m")
            }
            None => "local, first place and heading of the vehicle, z up, m".to_owned(),
        };
        let georeference = GeoreferenceFile {
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
        Ok(Self { choice, submaps, georeference, local, utm, outside_utm })
    }
    /// Description of the frame of the clouds.
    pub fn frame(&self) -> &str {
        &self.georeference.frame
    }
    /// Header line with the coordinate reference system, which GIS software reads.
    pub fn crs(&self) -> Option<String> {
        self.utm.as_ref().map(|utm| format!("crs EPSG:{}", utm.epsg()))
    }
    /// Reason why coordinates are local although UTM was chosen.
    pub fn lacks_utm(&self) -> Option<String> {
        if !self.choice.wants_utm || self.utm.is_some() {
            return None;
        }
        if let Some(reason) = &self.outside_utm {
            return Some(reason.clone());
        }
        let limit = self.choice.max_heading_deviation_deg;
        let heading = self.deviations().and_then(|deviations| deviations.undetermined_heading(limit));
        let heading = heading.map(|reason| format!("{reason}; max_heading_deviation_deg = 180 accepts the heading"));
        Some(heading.unwrap_or_else(|| "the drive is not georeferenced".to_owned()))
    }
    /// Standard deviations of the poses. `None` if the result is not georeferenced.
    pub fn deviations(&self) -> Option<Deviations> {
        self.georeference.standard_deviations.filter(|_| self.local.is_some())
    }
    /// The placed submap with this number.
    pub fn submap(&self, seq: u64) -> Option<&PlacedSubmap> {
        self.submaps.get(usize::try_from(seq).ok()?)
    }
    /// Coordinates in the frame of the clouds, from a point in the local frame, m.
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
    /// The text of `georeference.json`.
    pub fn to_json(&self) -> String {
        let text =
            serde_json::to_string_pretty(&self.georeference).expect("string keys and plain values always encode");
        text + "\n"
    }
}

impl PlacedSubmap {
    fn new(row: &PlacementRow) -> Result<Self, DeliveryError> {
        let poses = row.world_from_submap.to_pose().zip(row.odom_from_submap.to_pose());
        let (world_from_submap, odom_from_submap) =
            poses.ok_or_else(|| DeliveryError::PlacementPose { row: Box::new(*row) })?;
        let stamp = Stamp(row.stamp);
        let sigma_m = row.sigma_m;
        let sigma_rad = row.sigma_rad;
        Ok(Self { stamp, odom_from_submap, world_from_submap, sigma_m, sigma_rad, deviation: row.deviation() })
    }
    /// Correction of poses and points near the submap.
    pub fn world_from_odom(&self) -> Pose {
        self.world_from_submap * self.odom_from_submap.inverse()
    }
}

fn utm_frame(utm: &Utm) -> String {
    let zone = utm.zone();
    let hemisphere = utm.hemisphere();
    let epsg = utm.epsg();
    format!("UTM {zone}{hemisphere} (EPSG:{epsg}) easting northing, height above the WGS84 ellipsoid, m")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: UTM covers latitudes -80 to 84 degrees (DMA TM 8358.2, chapter 1).
    #[test]
    fn results_near_a_pole_stay_in_the_local_frame() {
        for (latitude_deg, wants_utm, reason) in [
            (85.0, true, Some("latitude 85 degrees is outside UTM; expected -80 to 84")),
            (-80.5, true, Some("latitude -80.5 degrees is outside UTM; expected -80 to 84")),
            (85.0, false, None),
            (83.9, true, None),
        ] {
            let header = PlacementHeader { latitude_deg, frame: FRAME_EAST_NORTH_UP, ..PlacementHeader::default() };
            let choice = FrameChoice { wants_utm, max_heading_deviation_deg: 5.0 };
            let world = World::new(&header, &[], choice).expect("has a frame");
            assert_eq!(world.lacks_utm().as_deref(), reason);
            assert_eq!(world.crs().is_some(), wants_utm && reason.is_none(), "{latitude_deg}");
            let place = world.georeference.origin.map(|origin| origin.latitude_deg);
            assert_eq!((place, world.georeference.utm.is_some()), (Some(latitude_deg), latitude_deg == 83.9));
        }
    }
}
