//! Objects as GeoJSON (RFC 7946): WGS84, rings counter-clockwise and closed.

use super::ObjectSummary;
use crate::crs::CrsError;
use crate::geojson::{convex_polygon, rounded};
use crate::run_folder::Georeference;
use serde_json::{Value, json};

/// One feature per object: the footprint as a polygon, cut at the antimeridian, at the ellipsoidal height of the lowest point. `None` if the run
/// is not georeferenced.
pub fn geojson(summaries: &[ObjectSummary], georeference: &Georeference) -> Result<Option<String>, CrsError> {
    if georeference.local().is_none() {
        return Ok(None);
    }
    let features = summaries.iter().filter_map(|summary| feature(summary, georeference).transpose());
    let features: Vec<Value> = features.collect::<Result<_, CrsError>>()?;
    Ok(Some(json!({ "type": "FeatureCollection", "features": features }).to_string() + "\n"))
}

fn feature(summary: &ObjectSummary, georeference: &Georeference) -> Result<Option<Value>, CrsError> {
    let ObjectSummary { id, class, n_points, n_clouds, score, footprint, low_m, high_m } = summary;
    let mut ring = Vec::new();
    for [x, y] in summary.corners() {
        let Some(place) = georeference.geodetic_from_cloud([x, y, *low_m])? else { return Ok(None) };
        ring.push(place);
    }
    Ok(Some(json!({
        "type": "Feature",
        "id": id,
        "geometry": convex_polygon(&ring),
        "properties": {
            "id": id, "class": class, "points": n_points, "clouds": n_clouds,
            "length_m": rounded(footprint.length_m, 1e2), "width_m": rounded(footprint.width_m, 1e2),
            "height_m": rounded(high_m - low_m, 1e2), "heading_rad": rounded(footprint.heading, 1e3),
            "score": score.map(|score| rounded(score, 1e3)),
        },
    })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Geodetic, OrientedRectangle, Point3};

    #[test]
    fn footprint_is_a_closed_counter_clockwise_polygon() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("georeference.json");
        let text = r#"{"frame":"local","trajectory_frame":"local","origin":{"latitude_deg":48.846222,"longitude_deg":2.346414,"altitude_m":104.6}}"#;
        std::fs::write(&path, text).expect("writes");
        let georeference = Georeference::load(&path).expect("is sound");
        let local = georeference.local().expect("is placed");
        let footprint = OrientedRectangle { center: [30.0, -12.0], length_m: 4.0, width_m: 2.0, heading: 0.5 };
        let summary = ObjectSummary {
            id: 7,
            class: "vehicles",
            n_points: 900,
            n_clouds: 2,
            score: Some(0.75),
            footprint,
            low_m: 0.25,
            high_m: 1.75,
        };
        let text = geojson(&[summary], &georeference).expect("converts").expect("is placed");
        let found: Value = serde_json::from_str(&text).expect("JSON");
        let feature = &found["features"][0];
        assert_eq!((&feature["properties"]["height_m"], &feature["properties"]["score"]), (&json!(1.5), &json!(0.75)));
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
