//! Instances as GeoJSON (RFC 7946): WGS84, longitude before latitude, rings counter-clockwise and closed.

use super::object_summary::ObjectSummary;
use anyhow::{Context as _, ensure};
use geometry::{Geodetic, LocalFrame, OrientedRectangle, Point3};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::Path;

/// The fields of a run's `georeference.json` that are used here.
#[derive(Deserialize)]
struct Georeference {
    /// Frame of the clouds.
    frame: String,
    /// Frame of the trajectory: always the local one.
    trajectory_frame: String,
    origin: Option<Geodetic>,
}

/// The local frame of a run's clouds.
pub fn local_frame(run: &Path) -> anyhow::Result<LocalFrame> {
    let path = run.join("georeference.json");
    let place = || path.display().to_string();
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("{}: GeoJSON needs the geographic position of the clouds", place()))?;
    let georeference: Georeference = serde_json::from_str(&text).with_context(place)?;
    ensure!(
        georeference.frame == georeference.trajectory_frame,
        "{}: the clouds are in frame {:?}; GeoJSON needs the local frame\nhint: set [export] frame = \"world\"",
        place(),
        georeference.frame
    );
    let origin = georeference.origin.with_context(|| {
        format!("{}: has no `origin`; GeoJSON needs the geographic position of the clouds", place())
    })?;
    let Geodetic { latitude_deg, longitude_deg, altitude_m } = origin;
    let origin = Geodetic::new(latitude_deg, longitude_deg, altitude_m).with_context(|| {
        format!("{}: origin {latitude_deg} {longitude_deg} {altitude_m} is not a valid position", place())
    })?;
    Ok(LocalFrame::new(origin))
}

/// One feature per object: the footprint as a polygon, at the ellipsoidal height of the lowest point.
pub fn text(summaries: &[ObjectSummary], local: &LocalFrame) -> String {
    let features: Vec<Value> = summaries.iter().map(|summary| feature(summary, local)).collect();
    json!({ "type": "FeatureCollection", "features": features }).to_string() + "\n"
}

fn feature(summary: &ObjectSummary, local: &LocalFrame) -> Value {
    let ObjectSummary { id, class, n_points, n_clouds, footprint, z: (low, high) } = summary;
    let OrientedRectangle { center: [x, y], length_m, width_m, heading } = footprint;
    let (sin, cos) = heading.sin_cos();
    // Counter-clockwise, and back to the first corner.
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]];
    let ring = corners.map(|[along, across]| {
        let (u, v) = (along * length_m, across * width_m);
        let place = local.geodetic_from_world(&Point3::new(x + u * cos - v * sin, y + u * sin + v * cos, *low));
        // The eighth decimal of a degree is about 1 mm.
        json!([rounded(place.longitude_deg, 1e8), rounded(place.latitude_deg, 1e8), rounded(place.altitude_m, 1e2)])
    });
    json!({
        "type": "Feature",
        "id": id,
        "geometry": { "type": "Polygon", "coordinates": [ring] },
        "properties": {
            "id": id, "class": class, "points": n_points, "clouds": n_clouds,
            "length_m": rounded(*length_m, 1e2), "width_m": rounded(*width_m, 1e2),
            "height_m": rounded(high - low, 1e2), "heading_rad": rounded(*heading, 1e3),
        },
    })
}

/// Rounded to a multiple of `1 / unit`.
fn rounded(value: f64, unit: f64) -> f64 {
    (value * unit).round() / unit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprint_is_a_closed_counter_clockwise_polygon() {
        let origin = Geodetic::new(48.846_222, 2.346_414, 104.6).expect("a place");
        let local = LocalFrame::new(origin);
        let footprint = OrientedRectangle { center: [30.0, -12.0], length_m: 4.0, width_m: 2.0, heading: 0.5 };
        let summary =
            ObjectSummary { id: 7, class: "vehicles", n_points: 900, n_clouds: 2, footprint, z: (0.25, 1.75) };
        let found: Value = serde_json::from_str(&text(&[summary], &local)).expect("JSON");
        let feature = &found["features"][0];
        assert_eq!(feature["properties"]["height_m"], 1.5);
        let ring: Vec<[f64; 3]> =
            serde_json::from_value(feature["geometry"]["coordinates"][0].clone()).expect("positions");
        assert_eq!((ring.len(), ring[0]), (5, ring[4]));
        let corners: Vec<Point3<f64>> = ring
            .iter()
            .map(|&[lon, lat, altitude]| {
                local.world_from_geodetic(&Geodetic::new(lat, lon, altitude).expect("a place"))
            })
            .collect();
        // Twice the area, positive if counter-clockwise.
        let doubled: f64 = corners.windows(2).map(|pair| pair[0].x * pair[1].y - pair[1].x * pair[0].y).sum();
        assert!((doubled - 16.0).abs() < 0.05, "{doubled}");
        let along = corners[1] - corners[0];
        assert!((along.y.atan2(along.x) - 0.5).abs() < 1e-3 && (along.norm() - 4.0).abs() < 0.005, "{along}");
        let mean = corners[..4].iter().map(|corner| corner.coords).sum::<geometry::Vector3<f64>>() / 4.0;
        assert!((mean - geometry::Vector3::new(30.0, -12.0, 0.25)).norm() < 0.01, "{mean}");
    }
}
