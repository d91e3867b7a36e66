//! GeoJSON (RFC 7946): WGS84, longitude before latitude.

use crate::geojson::line;
use geometry::{LocalFrame, Point3, Trajectory};
use serde_json::json;

/// The path as one line, cut at the antimeridian, with its first and last time.
pub(super) fn text(trajectory: &Trajectory, local: &LocalFrame) -> String {
    let poses = trajectory.poses();
    let place = |pose: &geometry::Pose| local.geodetic_from_world(&Point3::from(pose.translation.vector));
    let places: Vec<_> = poses.iter().map(|(_, pose)| place(pose)).collect();
    let time = |at: Option<&(geometry::Stamp, geometry::Pose)>| at.map(|(stamp, _)| stamp.to_string());
    let feature = json!({
        "type": "Feature",
        "geometry": line(&places),
        "properties": {
            "begin_unix_s": time(poses.first()), "end_unix_s": time(poses.last()),
            "length_m": (trajectory.length_m() * 100.0).round() / 100.0,
        },
    });
    json!({ "type": "FeatureCollection", "features": [feature] }).to_string() + "\n"
}
