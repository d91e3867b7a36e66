//! GeoJSON (RFC 7946): WGS84, longitude before latitude.

use crate::geojson::position;
use geometry::{LocalFrame, Point3, Trajectory};
use serde_json::json;

/// The path as one line, with its first and last time.
pub(super) fn text(trajectory: &Trajectory, local: &LocalFrame) -> String {
    let poses = trajectory.poses();
    let place = |p: Point3<f64>| position(&local.geodetic_from_world(&p));
    let line: Vec<_> = poses.iter().map(|(_, pose)| place(Point3::from(pose.translation.vector))).collect();
    let time = |at: Option<&(geometry::Stamp, geometry::Pose)>| at.map(|(stamp, _)| stamp.to_string());
    let feature = json!({
        "type": "Feature",
        "geometry": { "type": "LineString", "coordinates": line },
        "properties": {
            "begin_unix_s": time(poses.first()), "end_unix_s": time(poses.last()),
            "length_m": (trajectory.length_m() * 100.0).round() / 100.0,
        },
    });
    json!({ "type": "FeatureCollection", "features": [feature] }).to_string() + "\n"
}
