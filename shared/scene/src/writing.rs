//! From a run to the files of a scene, tile by tile.

use crate::assets::{Assets, Fixed, Movable};
use crate::error::SceneError;
use crate::glb::Mesh;
use crate::ground::{CompletedTile, Completion, GroundKind, GroundVertex, MeasuredGround, triangles};
use crate::removal::{Boxes, RemovedPoints, removed};
use crate::road::{RoadNetwork, RoadStrips, RoadSummary, Traffic, driven_roads, opendrive};
use crate::static_points::{ScenePoint, StaticPoints, write_points};
use crate::tile::{STEP_M, STEPS, Tile};
use crate::tileset::{TileMesh, tileset};
use files::atomic_file::write_atomic;
use geometry::LocalFrame;
use messages::ClassId;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use surveying::objects::objects_of;
use surveying::{Georeference, RunFolder};

/// Names of files and folders of a scene.
pub const SUMMARY: &str = "scene.json";
/// The road network.
pub const ROADS: &str = "roads.xodr";
/// Objects.
pub const OBJECTS: &str = "objects.json";
/// The tileset of the ground.
pub const TILESET: &str = "tileset.json";
/// Folder of the ground meshes.
pub const GROUND: &str = "ground";
/// Folder of the points.
pub const POINTS: &str = "points";

/// A mesh deviates from the heights of the ground by at most this, m: less than the noise of the LiDAR's ranges.
const TOLERANCE_M: f32 = 0.01;
/// Color of ground that no camera saw.
const GRAY: [u8; 3] = [128; 3];
/// The bounds of a cloud are rounded to its coordinates, m.
const BOUNDS_MARGIN_M: f64 = 0.1;

/// What a scene contains.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SceneSummary {
    /// Frame of all coordinates, m.
    pub frame: String,
    /// Latitude and longitude in degrees and ellipsoidal height in m of the origin. None without placement.
    pub origin: Option<[f64; 3]>,
    /// Points of the run.
    pub points: u64,
    /// Points that do not belong to the static world.
    pub removed: RemovedPoints,
    /// Points of the scene: one for each cube of 5 cm.
    pub static_points: u64,
    /// Measured ground, m^2.
    pub measured_ground_m2: f64,
    /// Ground that was completed, m^2.
    pub completed_ground_m2: f64,
    /// Number of triangles of the ground.
    pub triangles: u64,
    /// The road network.
    pub roads: RoadSummary,
    /// Number of the objects that can move.
    pub movable: usize,
    /// Number of the objects that moved.
    pub moving: usize,
    /// Fixed objects by class.
    pub fixed: BTreeMap<&'static str, usize>,
    /// What the scene lacks, and why.
    pub left_out: Vec<String>,
}

#[derive(Serialize)]
struct Objects<'a> {
    movable: &'a [Movable],
    fixed: &'a [Fixed],
}

/// Writes the scene of a run into the existing folder `out`. `progress` receives numbers of points.
pub fn write_scene(
    run: &RunFolder,
    traffic: Traffic,
    out: &Path,
    mut progress: impl FnMut(u64),
) -> Result<SceneSummary, SceneError> {
    check(run)?;
    let frame = run.georeference.as_ref().and_then(Georeference::local);
    let mut writer = Writer::new(run, out)?;
    let mut assets = Assets::default();
    let objects = objects_of(run)?.unwrap_or_default();
    let boxes = Boxes::new(&objects);
    for (number, entry) in run.index.clouds.iter().enumerate() {
        run.each_point(entry, |point| {
            writer.summary.points += 1;
            assets.add(point);
            if let Some(reason) = removed(point, &boxes) {
                writer.summary.removed.count(reason);
            } else {
                writer.ground.add(point);
                writer.strips.add(point);
                writer.points.add(point);
            }
        })?;
        writer.write_complete(number)?;
        progress(entry.n_points);
    }
    let Writer { mut summary, strips, meshes, .. } = writer;
    let RoadNetwork { document, summary: roads } = opendrive(&strips, traffic, frame);
    let movable = assets.movable(&objects);
    let fixed = assets.fixed();
    summary.roads = roads;
    summary.movable = movable.len();
    summary.moving = movable.iter().filter(|object| object.moves).count();
    for object in &fixed {
        *summary.fixed.entry(object.class).or_default() += 1;
    }
    summary.left_out = left_out(run, &summary);
    let objects = Objects { movable: &movable, fixed: &fixed };
    for (name, text) in [
        (ROADS, document),
        (OBJECTS, json(&objects)),
        (TILESET, json(&tileset(&meshes, frame))),
        (SUMMARY, json(&summary)),
    ] {
        let path = out.join(name);
        write_atomic(&path, text.as_bytes()).map_err(SceneError::file(&path))?;
    }
    Ok(summary)
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// Refuses runs without what every part of a scene needs.
fn check(run: &RunFolder) -> Result<(), SceneError> {
    let unfit = |rule: &str| Err(SceneError::Unfit { path: run.path().to_owned(), rule: rule.to_owned() });
    if run.georeference.as_ref().is_some_and(Georeference::is_utm) {
        return unfit(
            "the clouds are in UTM; a scene needs the local frame\nhint: run the drive again with [export] frame = \"world\"",
        );
    }
    if run.index.clouds.iter().any(|entry| entry.n_points > 0 && entry.classes.is_none()) {
        return unfit(
            "the clouds have no classes, which separate ground, objects and buildings\nhint: run the drive with the stage infer",
        );
    }
    Ok(())
}

/// What the scene lacks.
fn left_out(run: &RunFolder, summary: &SceneSummary) -> Vec<String> {
    let mut lines = Vec::new();
    let mut add = |is_missing: bool, line: &str| lines.extend(is_missing.then(|| line.to_owned()));
    let clouds = &run.index.clouds;
    add(
        clouds.iter().all(|entry| entry.n_colored.unwrap_or(0) == 0),
        "colors: no camera saw the points of the run, so the ground is gray",
    );
    add(
        clouds.iter().all(|entry| entry.n_instances.is_none()),
        "objects that can move: the run has no instances; their points are removed by class only",
    );
    add(summary.origin.is_none(), "place on the Earth: the run is not georeferenced");
    add(summary.roads.roads == 0, "roads: the path is on no ground that is classified as road, or too short");
    add(
        true,
        "buildings, fences and vegetation as surfaces, junctions, textures: this version writes their points only",
    );
    lines
}

/// Tiles that are being collected and written.
struct Writer<'a> {
    out: &'a Path,
    /// Index of the last cloud that may have points in a tile.
    last: BTreeMap<Tile, usize>,
    strips: RoadStrips,
    ground: MeasuredGround,
    points: StaticPoints,
    completion: Completion,
    /// Tiles that are complete but not written, because their neighbors are not complete.
    waiting: BTreeSet<Tile>,
    /// Tiles in the completion.
    kept: BTreeSet<Tile>,
    meshes: Vec<TileMesh>,
    summary: SceneSummary,
}

impl<'a> Writer<'a> {
    fn new(run: &RunFolder, out: &'a Path) -> Result<Self, SceneError> {
        let mut last = BTreeMap::new();
        for (number, entry) in run.index.clouds.iter().enumerate() {
            let Some([low, high]) = entry.bounds else { continue };
            for tile in Tile::between([low[0], low[1]], [high[0], high[1]], BOUNDS_MARGIN_M) {
                last.insert(tile, number);
            }
        }
        for folder in [GROUND, POINTS] {
            let path = out.join(folder);
            std::fs::create_dir_all(&path).map_err(SceneError::file(&path))?;
        }
        let local = run.georeference.as_ref().and_then(Georeference::local).map(LocalFrame::origin);
        let summary = SceneSummary {
            frame: run.index.frame.clone(),
            origin: local.map(|origin| [origin.latitude_deg, origin.longitude_deg, origin.altitude_m]),
            ..SceneSummary::default()
        };
        Ok(Self {
            out,
            last,
            strips: RoadStrips::new(driven_roads([&run.trajectory])),
            ground: MeasuredGround::default(),
            points: StaticPoints::default(),
            completion: Completion::default(),
            waiting: BTreeSet::new(),
            kept: BTreeSet::new(),
            meshes: Vec::new(),
            summary,
        })
    }

    /// Writes the tiles in which no cloud after this one has points, nor in their neighbors.
    fn write_complete(&mut self, cloud: usize) -> Result<(), SceneError> {
        let Self { last, .. } = self;
        let is_complete = |tile: &Tile| last.get(tile).is_none_or(|last| *last <= cloud);
        let complete: BTreeSet<Tile> = self.ground.tiles().chain(self.points.tiles()).filter(is_complete).collect();
        for tile in complete {
            if let Some(vertices) = self.ground.take(tile) {
                self.completion.insert(tile, vertices);
                self.kept.insert(tile);
            }
            self.waiting.insert(tile);
        }
        let ready: Vec<Tile> =
            self.waiting.iter().copied().filter(|tile| tile.block().all(|tile| is_complete(&tile))).collect();
        let unneeded = |waiting: &BTreeSet<Tile>, tile: &Tile| {
            tile.block().all(|near| is_complete(&near) && !waiting.contains(&near))
        };
        let mut waiting = self.waiting.clone();
        for tile in &ready {
            waiting.remove(tile);
        }
        let forgotten: Vec<Tile> = self.kept.iter().copied().filter(|tile| unneeded(&waiting, tile)).collect();
        for tile in ready {
            self.write(tile)?;
            self.waiting.remove(&tile);
        }
        for tile in forgotten {
            self.completion.remove(tile);
            self.kept.remove(&tile);
        }
        Ok(())
    }

    fn write(&mut self, tile: Tile) -> Result<(), SceneError> {
        let mut points = self.points.take(tile);
        if self.completion.contains(tile) {
            let ground = self.completion.complete(tile, |place| self.strips.direction(place));
            self.write_ground(tile, &ground)?;
            points.extend(completed_points(tile, &ground));
        }
        self.summary.static_points += points.len() as u64;
        let path = self.out.join(POINTS).join(format!("{}.ply", tile.name()));
        Ok(write_points(&path, &points, &self.summary.frame)?)
    }

    fn write_ground(&mut self, tile: Tile, ground: &CompletedTile) -> Result<(), SceneError> {
        let [measured, completed] = ground.counts();
        self.summary.measured_ground_m2 += measured as f64 * STEP_M * STEP_M;
        self.summary.completed_ground_m2 += completed as f64 * STEP_M * STEP_M;
        let corner = tile.corner();
        let heights = ground.vertices.iter().filter(|vertex| vertex.is_known()).map(|vertex| vertex.height_m);
        let low_m = f64::from(heights.clone().fold(f32::INFINITY, f32::min)).floor();
        let mesh = mesh(ground, low_m);
        self.summary.triangles += mesh.triangles.len() as u64;
        let name = tile.name();
        let Some(bytes) = mesh.to_glb(&name, [corner[0], corner[1], low_m]) else { return Ok(()) };
        let file = format!("{GROUND}/{name}.glb");
        let path = self.out.join(&file);
        write_atomic(&path, &bytes).map_err(SceneError::file(&path))?;
        let place = |p: &[f32; 3]| [corner[0] + f64::from(p[0]), corner[1] + f64::from(p[1]), low_m + f64::from(p[2])];
        let bound = |start: f64, choose: fn(f64, f64) -> f64| {
            let places = mesh.positions.iter().map(place);
            places.fold([start; 3], |bound, p| std::array::from_fn(|axis| choose(bound[axis], p[axis])))
        };
        self.meshes
            .push(TileMesh { file, bounds: [bound(f64::INFINITY, f64::min), bound(f64::NEG_INFINITY, f64::max)] });
        Ok(())
    }
}

/// The triangulated ground of a tile, from its south-west corner and this height.
fn mesh(ground: &CompletedTile, low_m: f64) -> Mesh {
    let side = STEPS + 1;
    let mut mesh = Mesh::default();
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    for triangle in triangles(&ground.vertices, TOLERANCE_M) {
        let corners = triangle.map(|idx| {
            *numbers.entry(idx).or_insert_with(|| {
                let vertex = &ground.vertices[idx as usize];
                let place = [idx as usize % side, idx as usize / side].map(|steps| (steps as f64 * STEP_M) as f32);
                mesh.positions.push([place[0], place[1], (f64::from(vertex.height_m) - low_m) as f32]);
                mesh.colors.push(if vertex.rgb == [0; 3] { GRAY } else { vertex.rgb });
                mesh.scores.push(vertex.score);
                mesh.positions.len() as u32 - 1
            })
        });
        mesh.triangles.push(corners);
    }
    mesh
}

/// Completed vertices as points.
fn completed_points(tile: Tile, ground: &CompletedTile) -> Vec<ScenePoint> {
    let side = STEPS + 1;
    let first = tile.first_vertex();
    let own = ground.vertices.iter().enumerate().map(|(idx, vertex)| ([idx % side, idx / side], vertex));
    let own = own.filter(|([x, y], vertex)| *x < STEPS && *y < STEPS && vertex.is_known() && vertex.score < 1.0);
    let point = |([x, y], vertex): ([usize; 2], &GroundVertex)| {
        let [x, y] = first.plus(x as i64, y as i64).place();
        let class = match vertex.kind {
            GroundKind::Road => ClassId::Road,
            GroundKind::Marking => ClassId::RoadLine,
            GroundKind::Sidewalk => ClassId::Sidewalk,
            GroundKind::Other => ClassId::Ground,
        };
        ScenePoint { xyz: [x, y, f64::from(vertex.height_m)], rgb: vertex.rgb, class: class as u8, score: vertex.score }
    };
    own.map(point).collect()
}
