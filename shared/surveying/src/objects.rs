//! Objects: the points of each instance number, with their oriented boxes.

mod csv;
mod geojson;

pub use csv::table;
pub use geojson::geojson;

use crate::cloud;
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use crate::target_frame::TargetFrame;
use csv::table_in_frame;
use files::atomic_file::write_atomic;
use formats::ply::{PlyError, Vertices};
use geometry::OrientedRectangle;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Side of the cells from which footprints are computed, m.
const CELL_M: f64 = 0.05;

/// Writes `objects.csv` in coordinates of the delivery into the existing folder `out`. If the coordinates are
/// georeferenced, it also writes `objects.geojson`. Returns the number of objects. `None` if the clouds have no
/// instances.
pub fn write_objects(run: &RunFolder, frame: &TargetFrame<'_>, out: &Path) -> Result<Option<usize>, DeliverError> {
    let Some(summaries) = objects_of(run)? else { return Ok(None) };
    let mut files = vec![("objects.csv", table_in_frame(&summaries, frame)?)];
    let georeference = run.georeference.as_ref().filter(|_| frame.crs().is_some());
    let geojson = georeference.map(|georeference| geojson(&summaries, georeference)).transpose()?.flatten();
    files.extend(geojson.map(|text| ("objects.geojson", text)));
    for (name, text) in &files {
        let path = out.join(name);
        write_atomic(&path, text.as_bytes()).map_err(DeliverError::file(&path, "write"))?;
    }
    Ok(Some(summaries.len()))
}

/// The objects of a run, in the frame of its clouds. `None` if the clouds have no instances.
pub fn objects_of(run: &RunFolder) -> Result<Option<Vec<ObjectSummary>>, DeliverError> {
    let clouds = cloud::open_all(std::slice::from_ref(run))?.clouds;
    let present = cloud::present(run.columns, &clouds);
    if !present.has("instance") || !present.has("class") {
        return Ok(None);
    }
    let mut objects = Objects::default();
    for cloud in &clouds {
        let present = cloud.columns.present();
        if present.has("instance") && present.has("class") {
            objects.add(&Vertices::load(&run.cloud(cloud.entry))?)?;
        }
    }
    Ok(Some(objects.summaries()))
}

/// Collects objects from the clouds that are added.
#[derive(Default)]
pub struct Objects(BTreeMap<i64, Object>);

/// Summary of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectSummary {
    /// Instance number.
    pub id: i64,
    /// Most frequent class.
    pub class: &'static str,
    /// Number of points.
    pub n_points: u64,
    /// Number of clouds that contain points of it.
    pub n_clouds: u64,
    /// Mean score of its points. `None` if the clouds have no scores.
    pub score: Option<f64>,
    /// Footprint in the frame of the clouds.
    pub footprint: OrientedRectangle,
    /// Height of the lowest point, m.
    pub low_m: f64,
    /// Height of the highest point, m.
    pub high_m: f64,
}

/// Statistics of the points of one object.
#[derive(Default)]
struct Object {
    /// Number of points by class.
    classes: BTreeMap<u8, u64>,
    n_points: u64,
    n_clouds: u64,
    /// Sum over the points of clouds with scores, and their number.
    scores: (f64, u64),
    cells: BTreeSet<(i64, i64)>,
    /// Heights of the lowest and the highest point, m.
    z: Option<(f64, f64)>,
}

impl Objects {
    /// Adds the points of a cloud with the columns `semantic` and `instance`. Points without a finite position are ignored.
    pub fn add(&mut self, cloud: &Vertices) -> Result<(), PlyError> {
        let x = cloud.f64s("x")?;
        let y = cloud.f64s("y")?;
        let z = cloud.f64s("z")?;
        let classes = cloud.u8s("semantic")?;
        let instances = cloud.i64s("instance")?;
        let scores = if cloud.has("score") { Some(cloud.f32s("score")?) } else { None };
        let mut seen = BTreeSet::new();
        let has_position = |point_idx: usize| [&x, &y, &z].iter().all(|axis| axis[point_idx].is_finite());
        let of_objects = instances.iter().enumerate().filter(|(_, instance)| **instance != 0);
        for (point_idx, &instance) in of_objects.filter(|(point_idx, _)| has_position(*point_idx)) {
            let object = self.0.entry(instance).or_default();
            *object.classes.entry(classes[point_idx]).or_default() += 1;
            object.n_points += 1;
            object.n_clouds += u64::from(seen.insert(instance));
            if let Some(scores) = &scores {
                object.scores = (object.scores.0 + f64::from(scores[point_idx]), object.scores.1 + 1);
            }
            let cell = |v: f64| (v / CELL_M).floor() as i64;
            object.cells.insert((cell(x[point_idx]), cell(y[point_idx])));
            let (low, high) = object.z.unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
            object.z = Some((low.min(z[point_idx]), high.max(z[point_idx])));
        }
        Ok(())
    }

    /// All objects, sorted by number.
    pub fn summaries(&self) -> Vec<ObjectSummary> {
        self.0.iter().filter_map(|(id, object)| object.summary(*id)).collect()
    }
}

impl Object {
    fn summary(&self, id: i64) -> Option<ObjectSummary> {
        let centers: Vec<[f64; 2]> =
            self.cells.iter().map(|&(i, j)| [i, j].map(|v| (v as f64 + 0.5) * CELL_M)).collect();
        let most_frequent = self.classes.iter().max_by_key(|(class, n)| (**n, std::cmp::Reverse(**class)));
        let class = most_frequent.map_or("", |(class, _)| messages::class_name(*class));
        let footprint = OrientedRectangle::around(&centers)?;
        let score = (self.scores.1 > 0).then(|| self.scores.0 / self.scores.1 as f64);
        let Self { n_points, n_clouds, .. } = *self;
        let (low_m, high_m) = self.z?;
        Some(ObjectSummary { id, class, n_points, n_clouds, score, footprint, low_m, high_m })
    }
}

impl ObjectSummary {
    /// Corners of the footprint in the frame of the clouds, m; counter-clockwise, the first side along the length.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let OrientedRectangle { center: [x, y], length_m, width_m, heading } = self.footprint;
        let (sin, cos) = heading.sin_cos();
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[along, across]| {
            let u = along * length_m;
            let v = across * width_m;
            [x + u * cos - v * sin, y + u * sin + v * cos]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::{Header, Kind, PlyWriter, Row};

    #[test]
    fn object_in_two_clouds_is_listed_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let header = Header::new(
            ["x", "y", "z"]
                .map(|name| (name, Kind::Float))
                .into_iter()
                .chain([("semantic", Kind::UChar), ("instance", Kind::Int)]),
        );
        let mut objects = Objects::default();
        for half in 0..2 {
            let path = folder.path().join(format!("{half}.ply"));
            let mut writer = PlyWriter::create(&path, &header, 40 * 36).expect("creates");
            let encode = |i: usize, row: &mut Row<'_>| {
                let x = (i / 36) as f32 * 0.05 + half as f32 * 2.0 + 0.02;
                let y = (i % 36) as f32 * 0.05 + 0.02;
                row.f32(x).f32(y).f32(if i == 0 { 1.5 } else { 0.25 }).u8(if i < 9 { 0 } else { 10 }).i32(5);
            };
            writer.write_each(40 * 36, encode).expect("writes");
            writer.finish().expect("finishes");
            objects.add(&Vertices::load(&path).expect("loads")).expect("adds");
        }
        let table = table(&objects.summaries());
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 2, "{table}");
        assert_eq!(lines[1], "5,vehicles,2880,2,2.00,0.90,0.25,3.95,1.75,1.25,0.000,");
    }
}
