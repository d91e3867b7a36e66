//! The completed ground of runs for deliveries: the same ground as in a scene, tile by tile from a temporary file.
//!
//! A scene is written while its clouds are read, and keeps the tiles to which later clouds return. A survey returns to all of them, so
//! ground points are sorted by tile first. Memory holds nine tiles (43 MB), the latest 256 MB of points, and the strips along the roads.

use crate::ground::{CompletedTile, Completion, GroundPoint, GroundVertex, MeasuredGround};
use crate::removal::{Boxes, removed};
use crate::road::{RoadLine, RoadStrips, driven_roads, road_lines};
use crate::tile::{STEP_M, STEPS, Tile};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use surveying::objects::objects_of;
use surveying::{CloudPoint, DeliverError, Georeference, GroundSample, KeyedRecords, RunFolder, Spool, StaticWorld};

/// Bytes of a ground point.
const POINT_BYTES: usize = GroundPoint::N_BYTES;
/// Points read from the temporary file at a time.
const POINTS_AT_A_TIME: usize = 1 << 18;
/// Vertices along the side of a completed tile, with both borders.
const SIDE: usize = STEPS + 1;

/// The ground of one or several runs in one frame.
pub struct CompletedTerrain {
    points: Spool<Tile>,
    strips: RoadStrips,
    /// Boxes of the objects of each run.
    boxes: Vec<Boxes>,
}

impl CompletedTerrain {
    /// Reads the clouds of runs. `folder` receives an unnamed temporary file of 16 bytes for each ground point. Without the directions of
    /// streets, in runs whose clouds are in UTM, gaps are closed from the nearest ground around.
    pub fn new(runs: &[RunFolder], folder: &Path, mut progress: impl FnMut(u64)) -> Result<Self, DeliverError> {
        let is_utm = |run: &&RunFolder| run.georeference.as_ref().is_some_and(Georeference::is_utm);
        let paths = runs.iter().filter(|run| !is_utm(run)).map(|run| &run.trajectory);
        let mut strips = RoadStrips::new(driven_roads(paths));
        let mut points = Spool::create(folder, POINT_BYTES)?;
        let mut all_boxes = Vec::new();
        for run in runs {
            let boxes = Boxes::new(&objects_of(run)?.unwrap_or_default());
            for entry in &run.index.clouds {
                let mut records = Vec::new();
                let mut keys = Vec::new();
                run.each_point(entry, |point| {
                    if removed(point, &boxes).is_some() {
                        return;
                    }
                    if let Some(ground) = GroundPoint::new(point) {
                        strips.add(point);
                        records.extend(ground.to_bytes());
                        keys.push(ground.vertex.tile());
                    }
                })?;
                points.add(&records, &keys)?;
                progress(entry.n_points);
            }
            all_boxes.push(boxes);
        }
        Ok(Self { points, strips, boxes: all_boxes })
    }

    /// Kerbs, edges and markings of the driven streets, in the frame of the clouds.
    pub fn road_lines(&self) -> Vec<RoadLine> {
        road_lines(&self.strips)
    }

    /// Passes the completed tiles to `take`, by column, then row.
    pub fn each_tile(
        &self,
        mut take: impl FnMut(Tile, &CompletedTile) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError> {
        let all: BTreeSet<Tile> = self.points.keys().into_iter().map(|KeyedRecords { key, .. }| key).collect();
        let mut completion = Completion::default();
        let mut kept: BTreeSet<Tile> = BTreeSet::new();
        for tile in &all {
            let needed: BTreeSet<Tile> = tile.block().filter(|near| all.contains(near)).collect();
            for unneeded in kept.difference(&needed) {
                completion.remove(*unneeded);
            }
            let missing: Vec<Tile> = needed.difference(&kept).copied().collect();
            let read = |tile: &Tile| Ok((*tile, self.measured(*tile)?));
            let loaded: Result<BTreeMap<Tile, Option<Vec<GroundVertex>>>, DeliverError> =
                missing.par_iter().map(read).collect();
            for (tile, vertices) in loaded? {
                if let Some(vertices) = vertices {
                    completion.insert(tile, vertices);
                }
            }
            kept = needed;
            let mut ground = completion.complete(*tile, |place| self.strips.direction(place));
            completion.complete_colors(*tile, &mut ground);
            take(*tile, &ground)?;
        }
        Ok(())
    }

    /// The measured vertices of a tile.
    fn measured(&self, tile: Tile) -> Result<Option<Vec<GroundVertex>>, DeliverError> {
        let mut ground = MeasuredGround::default();
        self.points.each_piece(&tile, POINTS_AT_A_TIME, |records| {
            for record in records.as_chunks::<POINT_BYTES>().0 {
                ground.add_ground(&GroundPoint::from_bytes(tile, record));
            }
            Ok(())
        })?;
        Ok(ground.take(tile))
    }
}

impl StaticWorld for CompletedTerrain {
    fn is_removed(&self, run: usize, point: &CloudPoint) -> bool {
        self.boxes.get(run).is_some_and(|boxes| removed(point, boxes).is_some())
    }

    fn each_ground(
        &self,
        spacing_m: f64,
        take: &mut dyn FnMut(&[GroundSample]) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError> {
        let parts = (STEP_M / spacing_m).ceil().max(1.0) as usize;
        self.each_tile(|tile, ground| take(&samples(tile, ground, parts)))
    }
}

/// The ground of a tile: its vertices without the borders of neighbors, and between four known vertices `parts - 1` further places along
/// both axes.
fn samples(tile: Tile, ground: &CompletedTile, parts: usize) -> Vec<GroundSample> {
    let [x0, y0] = tile.corner();
    let mut found = Vec::new();
    for (x, y) in (0..STEPS).flat_map(|y| (0..STEPS).map(move |x| (x, y))) {
        let corners = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| &ground.vertices[y * SIDE + x]);
        let is_inside = corners.iter().all(|vertex| vertex.is_known());
        for (i, j) in (0..parts).flat_map(|j| (0..parts).map(move |i| (i, j))) {
            let vertex = corners[0];
            if (i, j) == (0, 0) && !vertex.is_known() || (i, j) != (0, 0) && !is_inside {
                continue;
            }
            let [u, v] = [i, j].map(|part| part as f64 / parts as f64);
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let height_m: f64 = weights
                .iter()
                .zip(corners)
                .filter(|(weight, _)| **weight > 0.0)
                .map(|(weight, vertex)| weight * f64::from(vertex.height_m))
                .sum();
            // The color is from the nearest vertex.
            let nearest =
                if (i, j) == (0, 0) { vertex } else { corners[usize::from(u >= 0.5) + 2 * usize::from(v >= 0.5)] };
            found.push(GroundSample {
                xyz: [x0 + (x as f64 + u) * STEP_M, y0 + (y as f64 + v) * STEP_M, height_m],
                rgb: (nearest.rgb != [0; 3]).then_some(nearest.rgb),
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_between_vertices_are_on_the_surface_and_end_at_unknown_ground() {
        let vertex = |idx: usize| {
            let [x, y] = [idx % SIDE, idx / SIDE];
            let height_m = (0.1 * x as f64 + 0.2 * y as f64) as f32;
            let known = GroundVertex { height_m, rgb: [9, 9, 9], score: 1.0, ..GroundVertex::UNKNOWN };
            if x < 3 && y < 2 { known } else { GroundVertex::UNKNOWN }
        };
        let tile = CompletedTile { vertices: (0..SIDE * SIDE).map(vertex).collect() };
        let corner = Tile { column: -1, row: 2 };
        // Six vertices; two squares of four known ones have three further places each.
        for (parts, n) in [(1, 6), (2, 6 + 2 * 3), (3, 6 + 2 * 8)] {
            let found = samples(corner, &tile, parts);
            assert_eq!(found.len(), n);
            for GroundSample { xyz: [x, y, z], rgb } in found {
                let expected = (0.1 * (x + 50.0) + 0.2 * (y - 100.0)) / STEP_M;
                assert!((z - expected).abs() < 1e-5, "{x} {y} {z}");
                assert_eq!(rgb, Some([9; 3]));
            }
        }
    }
}
