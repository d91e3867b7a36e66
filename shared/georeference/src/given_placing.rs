//! Placement of submaps by a given path: odom is the world already.

use crate::Placed;
use crate::georeferencer::FixUse;
use geometry::{Geodetic, Pose, Stamp, Vector3};
use given_path::Deviation;
use messages::{FRAME_EAST_NORTH_UP, FRAME_LOCAL, PlacementHeader, PlacementRow, PoseDeviation};
use serde::{Deserialize, Serialize};

/// The submaps of a run whose poses are given.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct GivenPlacing {
    submaps: Vec<GivenSubmap>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct GivenSubmap {
    world_from_submap: Pose,
    stamp: Stamp,
    deviation: Deviation,
}

impl GivenPlacing {
    /// Starts a submap.
    pub fn begin_submap(&mut self, world_from_submap: Pose, stamp: Stamp, deviation: Deviation) {
        self.submaps.push(GivenSubmap { world_from_submap, stamp, deviation });
    }

    /// The poses of all submaps; `None` without submaps. `origin`: of the world, if the path is georeferenced.
    pub fn placed(&self, origin: Option<Geodetic>) -> Option<Placed> {
        let rows: Vec<PlacementRow> = (0..).zip(&self.submaps).map(|(number, submap)| submap.row(number)).collect();
        let first = rows.first()?;
        let largest = rows.iter().map(PlacementRow::deviation).fold(first.deviation(), PoseDeviation::max);
        let coordinate = |of: fn(&Geodetic) -> f64| origin.as_ref().map_or(0.0, of);
        let header = PlacementHeader {
            latitude_deg: coordinate(|origin| origin.latitude_deg),
            longitude_deg: coordinate(|origin| origin.longitude_deg),
            altitude_m: coordinate(|origin| origin.altitude_m),
            frame: if origin.is_some() { FRAME_EAST_NORTH_UP } else { FRAME_LOCAL },
            ..PlacementHeader::default()
        };
        let PoseDeviation { position_m, height_m, heading_deg } = largest;
        let summary = format!(
            "placed {} submaps by the given path; largest standard deviation of a submap: position {position_m:.2} m, height {height_m:.2} m, \
             heading {heading_deg:.2} deg",
            rows.len()
        );
        let fixes = FixUse { n: 0, n_used: 0, spread_m: 0.0, delay: None };
        Some(Placed { header, rows, fixes, shape: None, steps: None, summary })
    }
}

impl GivenSubmap {
    fn row(&self, number: u64) -> PlacementRow {
        let [east, north, up] = self.deviation.east_north_up_m;
        let [roll, pitch, heading] = self.deviation.roll_pitch_heading_rad;
        // A submap is rotated about the vertical only.
        let ahead = self.world_from_submap.rotation * Vector3::x();
        let along = (east * ahead.x).hypot(north * ahead.y);
        let across = (east * ahead.y).hypot(north * ahead.x);
        PlacementRow {
            submap: number,
            stamp: self.stamp.0,
            world_from_submap: self.world_from_submap.into(),
            odom_from_submap: self.world_from_submap.into(),
            sigma_m: [along, across, up].map(|m| m as f32),
            sigma_rad: [roll, pitch, heading].map(|rad| rad as f32),
        }
    }
}
