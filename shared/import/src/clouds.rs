//! Third-party labeled clouds as recordings of the topics `submap`, `trajectory`, `class`, `instance` and `color`: the points are
//! already registered, so they enter the pipeline after the odometry.
//!
//! A source is read twice: once to find the positions of the scanner, once to sort the points into tiles, which are files
//! next to the recording. One tile at a time is in memory.

mod classes;
mod finder;
mod invented;
mod layout;
mod nearest;
mod points;
mod recording;
mod scanner;
mod sweep;
mod sweeps;
mod text_points;
mod tile_files;
mod true_path;

pub(crate) use layout::Layout;

use crate::Partial;
use crate::error::{At, ImportError};
use finder::Finder;
use layout::Columns;
use points::{CloudPoint, each_point};
use recording::{Given, SubmapRecording};
use std::collections::BTreeMap;
use std::path::Path;
use sweeps::Sweeps;
use tile_files::{TileFiles, TilePoint};

/// Extension of recordings.
pub(crate) const EXTENSION: &str = "mcap";
/// Larger coordinates are map coordinates, m. They are reduced: f32 resolves a millimeter up to 8 km.
const MAX_COORDINATE_M: f64 = 8_000.0;
/// Reduced coordinates have an origin at a multiple of this, m.
const ORIGIN_STEP_M: f64 = 1_000.0;
/// Unknown classes that are counted one by one: a damaged file may have any number.
const MAX_UNKNOWN: usize = 1024;
/// Unknown classes that are named in the report.
const MAX_NAMED: usize = 8;

/// Counts of imported points, for the report.
#[derive(Default)]
struct Account {
    n_points: u64,
    n_invalid: u64,
    n_unlabeled: u64,
    n_cut_intensities: u64,
    n_sweeps: u64,
    /// Points per class id of the data set that has no meaning.
    unknown: BTreeMap<i64, u64>,
}

/// Imports the clouds of `source`, a file or a folder, as the recording `out`. Returns lines for the operator.
pub(crate) fn import(layout: Layout, source: &Path, out: &Path) -> Result<Vec<String>, ImportError> {
    if out.extension().is_none_or(|extension| extension != EXTENSION) {
        let rule = format!("{} becomes a recording; its name must end in .{EXTENSION}", layout.title());
        return Err(ImportError::at(out, rule));
    }
    let files = layout.files(source)?;
    let partial = Partial::create(out)?;
    let path = partial.folder.join("recording.mcap");
    let columns: Vec<Columns> =
        files.iter().map(|file| Columns::from_layout(layout, file)).collect::<Result<_, _>>()?;
    let first = columns.first().ok_or_else(|| ImportError::at(source, "has no clouds"))?;
    let has_positions = first.has_positions();
    if let Some(other) = columns.iter().position(|other| other.has_positions() != has_positions) {
        let rule = format!("must have positions of the scanner and times as {}, or neither", files[0].display());
        return Err(ImportError::at(&files[other], rule));
    }
    let given = Given {
        instances: columns.iter().all(Columns::has_instances),
        colors: columns.iter().all(Columns::has_colors),
    };
    let origin = origin(&files[0], first)?;
    let about = about(layout, source, origin, has_positions);
    let mut recording = SubmapRecording::create(&path, &about, &given)?;
    let mut account = Account::default();
    for (number, (file, columns)) in files.iter().zip(&columns).enumerate() {
        let (sweeps, mut tiles) = sort(file, columns, origin, &partial.folder, recording.next_stamp(), &mut account)?;
        for tile in 0..sweeps.n_tiles() {
            let share = (number as f64 + (tile + 1) as f64 / sweeps.n_tiles() as f64) / files.len() as f64;
            recording.set_progress(share);
            tiles.take(tile, |points| recording.add(&sweeps, tile, points))?;
        }
        recording.end_file(sweeps.len());
    }
    let n_submaps = recording.finish()?;
    std::fs::rename(&path, out).at(out)?;
    let name = layout.title();
    let plural = if n_submaps == 1 { "" } else { "s" };
    let mut report = vec![format!("{}: {n_submaps} submap{plural} ({name})", out.display())];
    report.extend(account.report(name, has_positions, origin));
    for (what, is_given, has) in [
        ("instances", given.instances, Columns::has_instances as fn(&Columns) -> bool),
        ("colors", given.colors, Columns::has_colors),
    ] {
        let n_with = columns.iter().filter(|columns| has(columns)).count();
        if n_with > 0 && !is_given {
            report.push(format!("not imported: {what}, which only {n_with} of {} files have", columns.len()));
        }
    }
    if !first.left.is_empty() {
        report.push(format!("not imported: columns {}", first.left.join(", ")));
    }
    Ok(report)
}

/// Sorts the points of a file into tiles.
fn sort(
    file: &Path,
    columns: &Columns,
    origin: [f64; 3],
    folder: &Path,
    next_stamp: i64,
    account: &mut Account,
) -> Result<(Sweeps, TileFiles), ImportError> {
    let local = |point: &CloudPoint| {
        let less = |position: [f64; 3]| std::array::from_fn(|k| position[k] - origin[k]);
        CloudPoint { position: less(point.position), scanner: point.scanner.map(less), ..*point }
    };
    let sweeps = if columns.has_positions() {
        let mut bins = true_path::Bins::default();
        each_point(file, columns, |point| bins.add(&local(point)).map_err(|rule| ImportError::at(file, rule)))?;
        bins.sweeps(next_stamp)
    } else {
        let mut ground = invented::GroundCells::default();
        each_point(file, columns, |point| ground.add(&local(point)).map_err(|rule| ImportError::at(file, rule)))?;
        ground.sweeps(next_stamp)
    };
    if sweeps.is_empty() {
        return Err(ImportError::at(file, "has no valid points"));
    }
    let mut tiles = TileFiles::create(folder.join("tiles"))?;
    let mut finder = Finder::default();
    each_point(file, columns, |point| {
        let point = local(point);
        let Some((sweep, row)) = finder.row(&point, &sweeps) else {
            account.n_invalid += 1;
            return Ok(());
        };
        let class = columns.class_of(point.label);
        account.count(&point, class);
        let CloudPoint { instance, color, .. } = point;
        let added = TilePoint { point: row, class: class.map_or(0, |class| class as u8), color, instance };
        tiles.add(sweeps.tile_of(sweep), &added)
    })?;
    account.n_sweeps += sweeps.len() as u64;
    Ok((sweeps, tiles))
}

impl Account {
    fn count(&mut self, point: &CloudPoint, class: Option<messages::ClassId>) {
        self.n_points += 1;
        self.n_cut_intensities += u64::from(point.intensity > 255.0);
        match class {
            Some(messages::ClassId::Unlabeled) => self.n_unlabeled += 1,
            Some(_) => {}
            None => {
                self.n_unlabeled += 1;
                if self.unknown.len() < MAX_UNKNOWN || self.unknown.contains_key(&point.label) {
                    *self.unknown.entry(point.label).or_default() += 1;
                }
            }
        }
    }
}

/// Offset subtracted from all coordinates: map coordinates are reduced by a multiple of a thousand meters.
fn origin(file: &Path, columns: &Columns) -> Result<[f64; 3], ImportError> {
    let first = points::first_point(file, columns)?;
    let Some(first) = first else { return Err(ImportError::at(file, "has no valid points")) };
    let [x, y, _] = first.position;
    if x.abs().max(y.abs()) <= MAX_COORDINATE_M {
        return Ok([0.0; 3]);
    }
    Ok([x, y].map(|value| (value / ORIGIN_STEP_M).floor() * ORIGIN_STEP_M)).map(|[x, y]| [x, y, 0.0])
}

fn about(layout: Layout, source: &Path, origin: [f64; 3], has_positions: bool) -> BTreeMap<String, String> {
    let name = source.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let [x, y, z] = origin;
    BTreeMap::from([
        ("imported".to_owned(), format!("{name} ({})", layout.title())),
        ("origin".to_owned(), format!("{x} {y} {z}")),
        ("scanner_positions".to_owned(), if has_positions { "true" } else { "invented" }.to_owned()),
    ])
}

impl Account {
    /// Lines of the report.
    fn report(&self, name: &str, has_positions: bool, origin: [f64; 3]) -> Vec<String> {
        let n_points = self.n_points;
        let n_sweeps = self.n_sweeps;
        let mut lines = vec![format!("imported: {n_points} points with classes")];
        lines.push(if has_positions {
            format!("imported: positions of the scanner and times, as {n_sweeps} sweeps of 0.1 s")
        } else {
            format!(
                "the files have no positions of the scanner: {n_sweeps} are invented, 2 m above the ground where it has the \
                 most points"
            )
        });
        lines.push("rings belong to an invented scanner: an HDL-32E with wider rings above and below".to_owned());
        if origin != [0.0; 3] {
            lines.push(format!("coordinates are reduced by {} {} m (x, y)", origin[0], origin[1]));
        }
        let share = 100.0 * self.n_unlabeled as f64 / n_points.max(1) as f64;
        lines.push(format!("points without a class: {} ({share:.1} %)", self.n_unlabeled));
        for (id, n) in self.unknown.iter().take(MAX_NAMED) {
            lines.push(format!("class {id} of the files has no meaning in {name}: {n} points are unlabeled"));
        }
        if self.unknown.len() > MAX_NAMED {
            lines.push(format!("{} more classes have no meaning", self.unknown.len() - MAX_NAMED));
        }
        for (n, what) in [
            (self.n_invalid, "not imported: points whose numbers are not finite or too large"),
            (self.n_cut_intensities, "intensities above 255 are cut"),
        ] {
            if n > 0 {
                lines.push(format!("{what}: {n}"));
            }
        }
        lines
    }
}
