//! PLY for CloudCompare, which reads fields named `scalar_…` of type float. Times are relative, because at current Unix
//! times a float resolves only two minutes.

use crate::cloud::{self, Cloud, Present, Spectra, extra_fields};
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use crate::target_frame::TargetFrame;
use formats::ply::{Header, Kind, PlyWriter, Property, Row};
use geometry::Stamp;
use messages::columns::{Column, ColumnField, Presence};
use rayon::prelude::*;
use std::path::Path;

/// Points that are converted with one converter.
const PART_POINTS: usize = 1 << 14;

/// Writes a PLY for each cloud of the run into the existing folder `out`. Returns the names of the files.
pub fn write_cloudcompare(
    run: &RunFolder,
    frame: &TargetFrame<'_>,
    has_bands: bool,
    out: &Path,
) -> Result<Vec<String>, DeliverError> {
    let clouds = cloud::open_all(std::slice::from_ref(run))?.clouds;
    let bands = if has_bands { cloud::band_names(std::slice::from_ref(run))? } else { Vec::new() };
    let begin = Stamp(run.begin_nanos().unwrap_or(0));
    clouds.iter().map(|cloud| write_cloud(frame, cloud, &bands, begin, out)).collect()
}

fn write_cloud(
    frame: &TargetFrame<'_>,
    cloud: &Cloud<'_>,
    bands: &[String],
    begin: Stamp,
    out: &Path,
) -> Result<String, DeliverError> {
    let name = format!("submap_{:04}.ply", cloud.entry.seq);
    let path = out.join(&name);
    let present = cloud.columns.present();
    let mut header = Header::new([("x", Kind::Double), ("y", Kind::Double), ("z", Kind::Double)])
        .comment(format!("REPLICA submap {}", cloud.entry.seq))
        .info(format!("frame {}", frame.description()))
        .info(format!("scalar_time s since {begin} s after 1970-01-01T00:00:00Z"));
    let mut add = |name: &str, kind: Kind| header.properties.push(Property::new(name, kind));
    let has_color = present.has("color");
    if has_color {
        for name in ["red", "green", "blue"] {
            add(name, Kind::UChar);
        }
    }
    for name in ["intensity", "time", "frame", "laser", "moving"] {
        add(&format!("scalar_{name}"), Kind::Float);
    }
    let fields = scalar_fields(&present);
    for (_, field) in &fields {
        add(&format!("scalar_{}", field.name), Kind::Float);
    }
    for band in bands {
        add(&format!("scalar_{band}"), Kind::Float);
    }
    let spectra = Spectra::load(cloud, bands)?;
    let begin_s = begin.0 as f64 * 1e-9;
    let mut writer = PlyWriter::create(&path, &header, cloud.len())?;
    cloud.each_block(|first, rows| {
        let row_size = cloud.columns.row_size();
        let n = rows.len() / row_size;
        let xyz = converted(frame, cloud, rows)?;
        writer.write_each(n, |i, row: &mut Row<'_>| {
            let cloud_row = &rows[i * row_size..][..row_size];
            let point = cloud.columns.point(cloud_row);
            let [x, y, z] = xyz[i];
            row.f64(x).f64(y).f64(z);
            if has_color {
                let [red, green, blue] = point.rgb;
                row.u8(red).u8(green).u8(blue);
            }
            row.f32(f32::from(point.intensity)).f32((point.time_s - begin_s) as f32).f32(point.frame as f32);
            row.f32(f32::from(point.ring)).f32(f32::from(u8::from(point.is_moving)));
            for (place, _) in &fields {
                row.f32(cloud.columns.extra(*place, cloud_row));
            }
            let spectrum = if bands.is_empty() { None } else { spectra.get(first + i) };
            for band in 0..bands.len() {
                row.f32(spectrum.map_or(f32::NAN, |spectrum| spectrum[band]));
            }
        })?;
        Ok(())
    })?;
    writer.finish_unsynced()?;
    Ok(name)
}

/// The fields of the columns that have their own topic, and of several LiDARs, in the order of the clouds of the run:
/// their index in [`extra_fields`] and their entry in the table.
fn scalar_fields(present: &Present) -> Vec<(usize, &'static ColumnField)> {
    let fields = extra_fields(present.table()).into_iter().enumerate();
    let is_scalar = |column: &Column| column.presence != Presence::Always && present.has(column.name);
    let mut fields: Vec<_> = fields.filter(|(_, (column, _))| is_scalar(column)).collect();
    // Fields of a column keep their order.
    fields.sort_by_key(|(_, (column, _))| column.place);
    fields.into_iter().map(|(place, (_, field))| (place, field)).collect()
}

/// Coordinates in the system of the delivery. Points without finite coordinates are not converted.
fn converted(frame: &TargetFrame<'_>, cloud: &Cloud<'_>, rows: &[u8]) -> Result<Vec<[f64; 3]>, DeliverError> {
    let row_size = cloud.columns.row_size();
    let parts: Result<Vec<Vec<[f64; 3]>>, DeliverError> = rows
        .par_chunks(PART_POINTS * row_size)
        .map(|rows| {
            let mut converter = frame.converter();
            let convert = |row: &[u8]| {
                let xyz = cloud.columns.point(row).xyz;
                let is_finite = xyz.iter().all(|value| value.is_finite());
                if is_finite { Ok(converter.convert(xyz)?) } else { Ok(xyz) }
            };
            rows.chunks_exact(row_size).map(convert).collect()
        })
        .collect();
    Ok(parts?.concat())
}
