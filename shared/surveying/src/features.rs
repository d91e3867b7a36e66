//! Lines and areas in coordinates of the delivery, as GeoJSON with the member `crs` of GeoJSON 2008, which GDAL, QGIS and geopandas read.
//! RFC 7946 allows WGS 84 only, in which a centimeter is the seventh decimal.

use crate::error::DeliverError;
use crate::geojson::rounded;
use crate::target_frame::TargetFrame;
use files::atomic_file::write_atomic;
use serde_json::{Map, Value, json};
use std::path::Path;

/// A line with its properties.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its vertices, m.
    pub places: Vec<[f64; 3]>,
    /// Properties of the feature.
    pub properties: Map<String, Value>,
}

/// Coordinates in whole mm.
fn position(place: &[f64; 3]) -> Value {
    json!(place.map(|value| rounded(value, 1e3)))
}

/// A line in coordinates of the delivery as a feature.
pub(crate) fn line_feature(Line { places, properties }: &Line) -> Value {
    let coordinates: Vec<Value> = places.iter().map(position).collect();
    json!({
        "type": "Feature",
        "properties": properties,
        "geometry": { "type": "LineString", "coordinates": coordinates },
    })
}

/// A rectangle in coordinates of the delivery as a feature: its lower left and upper right corner, m.
pub(crate) fn rectangle_feature([low, high]: [[f64; 2]; 2], properties: &Value) -> Value {
    let ring = [low, [high[0], low[1]], high, [low[0], high[1]], low];
    json!({
        "type": "Feature",
        "properties": properties,
        "geometry": { "type": "Polygon", "coordinates": [ring.map(|corner| corner.map(|value| rounded(value, 1e3)))] },
    })
}

/// Writes features in coordinates of the delivery, one a line. Local coordinates have no system.
pub(crate) fn write_features(path: &Path, frame: &TargetFrame<'_>, features: &[Value]) -> Result<(), DeliverError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let crs = frame.crs().map_or(
        Value::Null,
        |(crs, _)| json!({ "type": "name", "properties": { "name": format!("urn:ogc:def:crs:EPSG::{}", crs.epsg()) } }),
    );
    let mut text = format!("{{\n\"type\": \"FeatureCollection\",\n\"name\": {},\n\"crs\": {crs},\n", json!(name));
    text += "\"features\": [";
    for (number, feature) in features.iter().enumerate() {
        text += if number == 0 { "\n" } else { ",\n" };
        text += &feature.to_string();
    }
    text += "\n]\n}\n";
    write_atomic(path, text.as_bytes()).map_err(DeliverError::file(path, "write"))
}

/// Writes lines whose vertices are in the frame of the clouds. Returns their number.
pub fn write_lines(path: &Path, frame: &TargetFrame<'_>, lines: &[Line]) -> Result<usize, DeliverError> {
    let mut converter = frame.converter();
    let mut converted = |line: &Line| {
        let places: Result<_, _> = line.places.iter().map(|place| converter.convert(*place)).collect();
        Ok::<_, DeliverError>(line_feature(&Line { places: places?, properties: line.properties.clone() }))
    };
    let features: Vec<Value> = lines.iter().map(&mut converted).collect::<Result<_, _>>()?;
    write_features(path, frame, &features)?;
    Ok(features.len())
}
