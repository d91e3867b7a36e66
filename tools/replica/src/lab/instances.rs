//! `replica instances`: lists the objects in the clouds of a run.

mod geojson;
mod object_summary;

use crate::cloud_files::cloud_files;
use formats::ply::Vertices;
use geometry::OrientedRectangle;
pub use object_summary::ObjectSummary;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Side of the cells from which footprints are computed, m.
const CELL_M: f64 = 0.05;

/// List the objects in the clouds of a run as CSV or GeoJSON.
///
/// Prints class, number of points, oriented bounding box and height of each object, in m and rad.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Output folder of a run or a PLY file, with the fields semantic and instance
    path: PathBuf,
    /// Print GeoJSON (WGS84); the output folder must have a georeference.json with an origin
    #[arg(long)]
    geojson: bool,
}

/// The points of one object.
#[derive(Default)]
pub struct Object {
    /// Number of points by class.
    classes: BTreeMap<u8, u64>,
    n_points: u64,
    n_clouds: u64,
    cells: BTreeSet<(i64, i64)>,
    /// Heights of the lowest and the highest point, m.
    z: Option<(f64, f64)>,
}

/// Prints the objects.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // Errors here are reported before the clouds are read, which takes longer.
    let local = if args.geojson { Some(geojson::local_frame(&args.path)?) } else { None };
    let mut objects: BTreeMap<i64, Object> = BTreeMap::new();
    for file in cloud_files(&args.path)? {
        add(&mut objects, &Vertices::load(&file)?)?;
    }
    let summaries: Vec<ObjectSummary> = objects.iter().filter_map(|(id, object)| object.summary(*id)).collect();
    let text = local.map_or_else(|| table(&summaries), |local| geojson::text(&summaries, &local));
    // A reader that closes the pipe early has seen enough.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(ExitCode::SUCCESS)
}

/// Adds the points of a cloud, which has the fields semantic and instance, to the objects by id.
pub fn add(objects: &mut BTreeMap<i64, Object>, cloud: &Vertices) -> anyhow::Result<()> {
    let (x, y, z) = (cloud.f64s("x")?, cloud.f64s("y")?, cloud.f64s("z")?);
    let (classes, instances) = (cloud.u8s("semantic")?, cloud.i64s("instance")?);
    let mut seen = BTreeSet::new();
    // Points without a finite position are ignored.
    let has_position = |point_idx: usize| [&x, &y, &z].iter().all(|axis| axis[point_idx].is_finite());
    let of_objects = instances.iter().enumerate().filter(|(_, instance)| **instance != 0);
    for (point_idx, &instance) in of_objects.filter(|(point_idx, _)| has_position(*point_idx)) {
        let object = objects.entry(instance).or_default();
        *object.classes.entry(classes[point_idx]).or_default() += 1;
        object.n_points += 1;
        object.n_clouds += u64::from(seen.insert(instance));
        let cell = |v: f64| (v / CELL_M).floor() as i64;
        object.cells.insert((cell(x[point_idx]), cell(y[point_idx])));
        let (low, high) = object.z.unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
        object.z = Some((low.min(z[point_idx]), high.max(z[point_idx])));
    }
    Ok(())
}

impl Object {
    /// `None` without points.
    pub fn summary(&self, id: i64) -> Option<ObjectSummary> {
        let centers: Vec<[f64; 2]> =
            self.cells.iter().map(|&(i, j)| [i, j].map(|v| (v as f64 + 0.5) * CELL_M)).collect();
        let most_frequent = self.classes.iter().max_by_key(|(class, n)| (**n, std::cmp::Reverse(**class)));
        let class = most_frequent.map_or("", |(class, _)| messages::class_name(*class));
        let footprint = OrientedRectangle::around(&centers)?;
        Some(ObjectSummary { id, class, n_points: self.n_points, n_clouds: self.n_clouds, footprint, z: self.z? })
    }
}

fn table(summaries: &[ObjectSummary]) -> String {
    let mut text = "id,class,points,clouds,x_m,y_m,z_m,length_m,width_m,height_m,heading_rad\n".to_owned();
    for ObjectSummary { id, class, n_points, n_clouds, footprint, z: (low, high) } in summaries {
        let OrientedRectangle { center: [x, y], length_m, width_m, heading } = footprint;
        let height_m = high - low;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{id},{class},{n_points},{n_clouds},{x:.2},{y:.2},{low:.2},{length_m:.2},{width_m:.2},{height_m:.2},{heading:.3}"
        );
    }
    text
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
        let mut objects = BTreeMap::new();
        for half in 0..2 {
            let path = folder.path().join(format!("{half}.ply"));
            let mut writer = PlyWriter::create(&path, &header, 40 * 36).expect("creates");
            let encode = |i: usize, row: &mut Row<'_>| {
                let (x, y) = ((i / 36) as f32 * 0.05 + half as f32 * 2.0 + 0.02, (i % 36) as f32 * 0.05 + 0.02);
                row.f32(x).f32(y).f32(if i == 0 { 1.5 } else { 0.25 }).u8(if i < 9 { 0 } else { 10 }).i32(5);
            };
            writer.write_each(40 * 36, encode).expect("writes");
            writer.finish().expect("finishes");
            add(&mut objects, &Vertices::load(&path).expect("loads")).expect("adds");
        }
        let summaries: Vec<ObjectSummary> = objects.iter().filter_map(|(id, object)| object.summary(*id)).collect();
        let table = table(&summaries);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 2, "{table}");
        assert_eq!(lines[1], "5,vehicles,2880,2,2.00,0.90,0.25,3.95,1.75,1.25,0.000");
    }
}
