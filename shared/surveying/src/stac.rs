//! The delivery as an item of a catalog: STAC 1.1 (`SpatioTemporal` Asset Catalog) with the extension Projection 2.0.

use crate::error::DeliverError;
use crate::geojson::{convex_polygon, rounded};
use crate::run_folder::RunFolder;
use crate::target_frame::TargetFrame;
use files::atomic_file::write_atomic;
use files::calendar::text_of_nanos;
use geometry::Geodetic;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Name of the file.
pub const STAC_ITEM: &str = "stac_item.json";
/// Schema of the extension for coordinate reference systems.
const PROJECTION: &str = "https://stac-extensions.github.io/projection/v2.0.0/schema.json";

/// Endings of file names with media type, role and title. The first one that fits counts.
const KINDS: [AssetKind; 16] = [
    AssetKind::new(".copc.laz", "application/vnd.laszip+copc", "data", "all points, as an octree"),
    AssetKind::new(".laz", "application/vnd.laszip", "data", "points"),
    AssetKind::new(".las", "application/vnd.las", "data", "points"),
    AssetKind::new("orthophoto.tif", COG, "visual", "street from above without vehicles"),
    AssetKind::new("terrain.tif", COG, "data", "height of the ground"),
    AssetKind::new(".tif", COG, "data", "raster from above"),
    AssetKind::new(".aux.xml", "application/xml", "metadata", "names of the values of a raster"),
    AssetKind::new("trajectory.geojson", GEOJSON, "data", "path of the vehicle"),
    AssetKind::new("tiles.geojson", GEOJSON, "metadata", "squares of the tiles"),
    AssetKind::new(".geojson", GEOJSON, "data", "lines or objects"),
    AssetKind::new(".csv", "text/csv", "data", "table"),
    AssetKind::new(".svg", "image/svg+xml", "overview", "map"),
    AssetKind::new(".json", "application/json", "metadata", "facts of the delivery"),
    AssetKind::new(".txt", "text/plain", "data", "path of the vehicle or calibration"),
    AssetKind::new(".ply", "application/octet-stream", "data", "points for CloudCompare"),
    AssetKind::new("", "application/octet-stream", "data", "binary file"),
];
const COG: &str = "image/tiff; application=geotiff; profile=cloud-optimized";
const GEOJSON: &str = "application/geo+json";

/// What files of a kind are.
struct AssetKind {
    ending: &'static str,
    media_type: &'static str,
    role: &'static str,
    title: &'static str,
}

impl AssetKind {
    const fn new(ending: &'static str, media_type: &'static str, role: &'static str, title: &'static str) -> Self {
        Self { ending, media_type, role, title }
    }
}

/// Writes the item of all files that are in the folder `out`. Returns whether it was written: not for runs without place on the Earth and
/// deliveries in local coordinates.
pub fn write_stac_item(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    software: &str,
    out: &Path,
) -> Result<bool, DeliverError> {
    let Some((crs, vertical)) = frame.crs() else { return Ok(false) };
    let Some(ring) = footprint(runs)? else { return Ok(false) };
    let entries = || runs.iter().flat_map(|run| &run.index.clouds);
    let begin = entries().map(|entry| entry.stamp_begin).min().unwrap_or(0);
    let end = entries().map(|entry| entry.stamp_end).max().unwrap_or(0);
    let description = format!(
        "Labeled point cloud of a street, {} points, {}",
        entries().map(|entry| entry.n_points).sum::<u64>(),
        frame.description()
    );
    let item = json!({
        "type": "Feature",
        "stac_version": "1.1.0",
        "stac_extensions": [PROJECTION],
        "id": format!("replica-{}", compact(begin)),
        "geometry": convex_polygon(&ring),
        "bbox": bounds(&ring),
        "properties": {
            "title": "Street recorded by a mobile-mapping vehicle",
            "description": description,
            "datetime": Value::Null,
            "start_datetime": date_time(begin),
            "end_datetime": date_time(end),
            "proj:code": format!("EPSG:{}", crs.epsg()),
            "replica:heights": vertical.name(),
            "replica:software": software,
        },
        "links": [],
        "assets": assets(out)?,
    });
    let path = out.join(STAC_ITEM);
    let text = serde_json::to_string_pretty(&item).unwrap_or_default() + "\n";
    write_atomic(&path, text.as_bytes()).map_err(DeliverError::file(&path, "write"))?;
    Ok(true)
}

/// Corners of a rectangle around all clouds, counter-clockwise, at the height of the lowest point. `None` without place or points.
fn footprint(runs: &[RunFolder]) -> Result<Option<Vec<Geodetic>>, DeliverError> {
    let Some(georeference) = runs.first().and_then(|run| run.georeference.as_ref()) else { return Ok(None) };
    let bounds = runs.iter().flat_map(|run| &run.index.clouds).filter_map(|entry| entry.bounds);
    let around = bounds.reduce(|[a, b], [low, high]| {
        [std::array::from_fn(|axis| low[axis].min(a[axis])), std::array::from_fn(|axis| high[axis].max(b[axis]))]
    });
    let Some([low, high]) = around else { return Ok(None) };
    let mut ring = Vec::new();
    for [x, y] in [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]] {
        let Some(place) = georeference.geodetic_from_cloud([x, y, low[2]])? else { return Ok(None) };
        ring.push(place);
    }
    Ok(Some(ring))
}

/// West, south, east and north in degrees. West is larger than east if the ring crosses the antimeridian (RFC 7946).
fn bounds(ring: &[Geodetic]) -> [f64; 4] {
    let extremes = |values: &mut dyn Iterator<Item = f64>| {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
    };
    let [south, north] = extremes(&mut ring.iter().map(|place| place.latitude_deg));
    let [west, east] = extremes(&mut ring.iter().map(|place| place.longitude_deg));
    let [west, east] = if east - west > 180.0 {
        let own = |is_east: bool| ring.iter().map(|p| p.longitude_deg).filter(move |lon| (*lon > 0.0) == is_east);
        [extremes(&mut own(true))[0], extremes(&mut own(false))[1]]
    } else {
        [west, east]
    };
    [west, south, east, north].map(|value| rounded(value, 1e8))
}

/// RFC 3339, to the millisecond.
fn date_time(nanos: i64) -> String {
    text_of_nanos(nanos).trim_end_matches(" UTC").replacen(' ', "T", 1) + "Z"
}

/// Date and time without separators and fractions: `20231114T221320Z`.
fn compact(nanos: i64) -> String {
    let digits: String = date_time(nanos).chars().filter(|c| !matches!(c, '-' | ':')).collect();
    digits.split('.').next().unwrap_or_default().to_owned() + "Z"
}

/// The files of a folder and its folders, by name.
fn assets(out: &Path) -> Result<Map<String, Value>, DeliverError> {
    let mut names = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        let path = out.join(&folder);
        for entry in std::fs::read_dir(&path).map_err(DeliverError::file(&path, "list"))? {
            let entry = entry.map_err(DeliverError::file(&path, "list"))?;
            let name = folder.join(entry.file_name());
            if entry.path().is_dir() { folders.push(name) } else { names.push(name.to_string_lossy().into_owned()) }
        }
    }
    names.sort();
    let asset = |name: String| {
        let kind = KINDS.iter().find(|kind| name.ends_with(kind.ending))?;
        let AssetKind { media_type, role, title, .. } = kind;
        Some((
            name.clone(),
            json!({ "href": format!("./{name}"), "type": media_type, "title": title, "roles": [role] }),
        ))
    };
    Ok(names.into_iter().filter_map(asset).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_bounds_follow_their_standards() {
        let nanos = 1_700_000_000_302_999_999;
        assert_eq!(date_time(nanos), "2023-11-14T22:13:20.302Z");
        assert_eq!(compact(nanos), "20231114T221320Z");
        let place = |lon, lat| Geodetic::new(lat, lon, 0.0).expect("a place");
        assert_eq!(bounds(&[place(2.0, 48.0), place(2.1, 48.2)]), [2.0, 48.0, 2.1, 48.2]);
        let across = [place(179.9, -17.0), place(-179.8, -17.0), place(-179.8, -16.0), place(179.9, -16.0)];
        assert_eq!(bounds(&across), [179.9, -17.0, -179.8, -16.0]);
    }

    #[test]
    fn every_file_has_the_kind_of_its_ending() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("sequences")).expect("made");
        for name in ["points.copc.laz", "452150_5410700.laz", "terrain.tif", "trajectory.sbet", "sequences/000.bin"] {
            std::fs::write(folder.path().join(name), "").expect("writes");
        }
        let found = assets(folder.path()).expect("lists");
        assert_eq!(found.len(), 5);
        assert_eq!(found["points.copc.laz"]["type"], "application/vnd.laszip+copc");
        assert_eq!(found["452150_5410700.laz"]["type"], "application/vnd.laszip");
        assert_eq!(found["terrain.tif"]["title"], "height of the ground");
        assert_eq!(found["sequences/000.bin"]["href"], "./sequences/000.bin");
        assert_eq!(found["trajectory.sbet"]["type"], "application/octet-stream");
    }
}
