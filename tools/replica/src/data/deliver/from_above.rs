//! Views from above: rasters with the completed ground, and lines of the terrain and of roads.

use super::Args;
use pictures::class_color::class_color;
use scene::CompletedTerrain;
use scene::road::{RoadLine, RoadLineKind};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::path::Path;
use surveying::{
    CONTOURS, CellCounts, CloudOptions, Line, RasterOptions, RunFolder, StaticWorld, TargetFrame, write_contours,
    write_lines, write_rasters,
};

/// Name of the file with kerbs and edges of roads.
const BREAKLINES: &str = "breaklines.geojson";
/// Name of the file with markings of roads.
const MARKINGS: &str = "markings.geojson";

/// Views from above.
#[derive(Default, Serialize)]
pub struct FromAbove {
    /// Raster files.
    pub rasters: Vec<&'static str>,
    /// Number of lines by file.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<LineFile>,
    /// Cells of terrain and orthophoto by their source. `None` without classes or rasters.
    pub cells: Option<CellCounts>,
}

/// A file with lines.
#[derive(Serialize)]
pub struct LineFile {
    pub file: &'static str,
    pub n: usize,
}

impl FromAbove {
    /// The shares of completed cells in words.
    pub fn completed(&self) -> Option<String> {
        let cells = self.cells?;
        let share = |completed: u64, measured: u64| 100.0 * completed as f64 / (completed + measured).max(1) as f64;
        let terrain = share(cells.terrain_completed, cells.terrain_measured);
        let words = |share: f64, name: &str| format!("{share:.1} % of the {name}");
        let mut text = words(terrain, "terrain");
        if cells.orthophoto_measured > 0 {
            let orthophoto = share(cells.orthophoto_completed, cells.orthophoto_measured);
            text.push_str(", ");
            text.push_str(&words(orthophoto, "orthophoto"));
        }
        Some(text)
    }
}

/// Writes the files. Runs without classes have no ground to complete.
pub fn write(
    args: &Args,
    runs: &[RunFolder],
    target: &TargetFrame<'_>,
    options: &CloudOptions,
    out: &Path,
) -> anyhow::Result<FromAbove> {
    let has_classes = runs.iter().all(|run| run.index.clouds.iter().all(|entry| entry.classes.is_some()));
    let terrain = has_classes.then(|| CompletedTerrain::new(runs, out, |_| ())).transpose()?;
    let rasters = RasterOptions {
        cell_mm: args.cell_m,
        class_colors: std::array::from_fn(|id| class_color(id as u8)),
        world: terrain.as_ref().map(|terrain| terrain as &dyn StaticWorld),
        keeps_nodes: args.lines,
    };
    let written = write_rasters(runs, target, options, &rasters, out)?;
    let mut lines = Vec::new();
    if let Some(terrain) = terrain.as_ref().filter(|_| args.lines) {
        lines.push(LineFile { file: CONTOURS, n: write_contours(&written, args.contour_m, target, out)? });
        let found = terrain.road_lines();
        for (file, is_marking) in [(BREAKLINES, false), (MARKINGS, true)] {
            let is_wanted = |line: &&RoadLine| matches!(line.kind, RoadLineKind::Marking { .. }) == is_marking;
            let chosen: Vec<Line> = found.iter().filter(is_wanted).map(delivered).collect();
            lines.push(LineFile { file, n: write_lines(&out.join(file), target, &chosen)? });
        }
    }
    let cells = terrain.is_some().then_some(written.counts);
    Ok(FromAbove { rasters: written.files, lines, cells })
}

/// A line of a road with its properties.
fn delivered(RoadLine { kind, places }: &RoadLine) -> Line {
    let properties = match kind {
        RoadLineKind::Kerb { height_m } => json!({ "kind": "kerb", "step_m": (height_m * 1000.0).round() / 1000.0 }),
        RoadLineKind::Edge => json!({ "kind": "road_edge", "step_m": Value::Null }),
        RoadLineKind::Marking { is_solid } => {
            json!({ "kind": "marking", "paint": if *is_solid { "solid" } else { "broken" } })
        }
    };
    let properties = match properties {
        Value::Object(properties) => properties,
        _ => Map::new(),
    };
    Line { places: places.clone(), properties }
}
