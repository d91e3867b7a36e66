//! Errors of a scene of a simulated drive, against the exact town.
//!
//! `scene_errors RUN DRIVE`: the output folder of a run, and the simulated drive. The scene is computed as `replica scene` does. Before it is
//! compared, the path of the run is aligned with the true path (heading and translation), so that errors of GNSS do not count.

use anyhow::Context;
use drive::{Drive, LabelReader, LabelledSweep, Shot, find_label};
use geometry::{Point3, Vector3};
use messages::ClassId;
use scene::road::{RoadStrips, Traffic, cross_sections, driven_roads, opendrive};
use scene::{Boxes, removed, write_scene};
use std::collections::BTreeMap;
use std::path::Path;
use studies::exact_town::{ExactTown, plane};
use surveying::objects::objects_of;
use surveying::{CloudPoint, RunFolder};

/// Rays to the ground start this far above the ground of the scene, below parked cars, m.
const ABOVE_M: f64 = 0.15;
/// The path of a run may be this far off in height, m.
const REACH_M: f64 = 1.5;
/// Rays to a road start this far above its height at the path: it falls by some percent across, m.
const CROSSFALL_M: f64 = 0.5;
/// The edge of a road is where this many steps of a ray's offset meet no road: 0.3 m.
const STEP_M: f64 = 0.05;
const N_OFF_ROAD: usize = 6;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [run, drive] = &arguments[..] else { anyhow::bail!("RUN DRIVE") };
    let run = RunFolder::open(Path::new(run))?;
    let town = ExactTown::open(Path::new(drive), &run.trajectory)?;
    let drive = Drive::open(Path::new(drive))?;
    let out = tempfile::tempdir()?;
    write_scene(&run, Traffic::Right, out.path(), |_| ())?;
    ground(out.path(), &town)?;
    let boxes = Boxes::new(&objects_of(&run)?.unwrap_or_default());
    removal(&run, &boxes, &drive)?;
    marks(&run, &drive, &town)?;
    edges(&run, &boxes, &town)?;
    Ok(())
}

/// A ground point: its place in the town, and its height above the true ground there, m; infinite without ground.
struct GroundPoint {
    place: Point3<f64>,
    off_m: f64,
    score: f64,
}

/// Heights of the vertices of the ground meshes, measured and completed.
fn ground(scene: &Path, town: &ExactTown) -> anyhow::Result<()> {
    let mut points = Vec::new();
    for entry in std::fs::read_dir(scene.join(scene::GROUND))? {
        let vertices = vertices_of_glb(&std::fs::read(entry?.path())?)?;
        let above = |vertex: &MeshVertex, above_m: f64| {
            let place = town.town_from_run * vertex.place + Vector3::new(0.0, 0.0, above_m);
            let found = town.below(&place, 2.0 * above_m.abs().max(ABOVE_M) + 0.3);
            found.map_or(f64::INFINITY, |hit| f64::from(hit.range_m) - above_m)
        };
        let mut offs: Vec<f64> = vertices.iter().step_by(5).map(|vertex| above(vertex, REACH_M)).collect();
        offs.sort_by(f64::total_cmp);
        let raised_m = offs[offs.len() / 2];
        let off_m = |vertex: &MeshVertex| above(vertex, ABOVE_M - raised_m) - raised_m;
        let point = |vertex: &MeshVertex| GroundPoint {
            place: town.town_from_run * vertex.place,
            off_m: off_m(vertex),
            score: vertex.score,
        };
        let mut of_tile: Vec<GroundPoint> = vertices.iter().map(point).collect();
        // The path of the run drifts and tilts by some centimetres, which is not an error of the surface.
        let near = of_tile.iter().filter(|point| point.score >= 1.0 && point.off_m.abs() < 0.5);
        let plane = plane(near.map(|point| [point.place.x, point.place.y, point.off_m]));
        for point in &mut of_tile {
            point.off_m -= plane.dot(&Vector3::new(1.0, point.place.x, point.place.y));
        }
        points.extend(of_tile);
    }
    println!("heights after a plane of each tile:");
    let line = |name: String, chosen: &dyn Fn(&GroundPoint) -> bool| {
        let offs: Vec<f64> = points.iter().filter(|point| chosen(point)).map(|point| point.off_m.abs()).collect();
        let share = |limit_m: f64| 100.0 * offs.iter().filter(|off| **off < limit_m).count() as f64 / offs.len() as f64;
        println!("{name}: {} vertices, {:.1} % within 5 cm, {:.1} % within 10 cm", offs.len(), share(0.05), share(0.1));
    };
    line("measured".into(), &|point| point.score >= 1.0);
    line("completed".into(), &|point| point.score < 1.0);
    for low in [0.2, 0.4, 0.6, 0.8, 0.9] {
        let high = if low < 0.8 { low + 0.2 } else { low + 0.1 };
        line(format!("  score {low:.1} to {high:.1}"), &|point| (low..high).contains(&point.score));
    }
    Ok(())
}

/// A vertex of a mesh.
struct MeshVertex {
    place: Point3<f64>,
    score: f64,
}

/// Vertices of a GLB file of a scene, in the frame of the run.
fn vertices_of_glb(bytes: &[u8]) -> anyhow::Result<Vec<MeshVertex>> {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
    let n_text = number(12);
    let text: serde_json::Value = serde_json::from_slice(&bytes[20..20 + n_text])?;
    let data = &bytes[28 + n_text..];
    let value = |at: usize| f64::from(f32::from_le_bytes(data[at..at + 4].try_into().expect("four bytes")));
    let offset =
        |view: usize| text["bufferViews"][view]["byteOffset"].as_u64().context("an offset").map(|at| at as usize);
    let n = text["accessors"][0]["count"].as_u64().context("a count")? as usize;
    let translation: [f64; 3] = serde_json::from_value(text["nodes"][0]["translation"].clone())?;
    let [positions, scores] = [offset(0)?, offset(2)?];
    let vertex = |i: usize| {
        let [x, y, z] = std::array::from_fn(|axis| translation[axis] + value(positions + 12 * i + 4 * axis));
        MeshVertex { place: Point3::new(x, -z, y), score: value(scores + 4 * i) }
    };
    Ok((0..n).map(vertex).collect())
}

/// Points of true objects that remain, and other points that were removed.
fn removal(run: &RunFolder, boxes: &Boxes, drive: &Drive) -> anyhow::Result<()> {
    let sweeps = labelled_sweeps(drive)?;
    let mut left: BTreeMap<(&str, bool), u64> = BTreeMap::new();
    let [mut n_objects, mut n_left, mut n_static, mut n_lost] = [0_u64; 4];
    for entry in &run.index.clouds {
        run.each_point(entry, |point| {
            let Ok(label) = find_label(&sweeps, &shot(point)) else { return };
            let is_removed = removed(point, boxes).is_some();
            if matches!(ClassId::from_id(label.class), Some(ClassId::Vehicles | ClassId::Pedestrian | ClassId::Dynamic))
            {
                n_objects += 1;
                n_left += u64::from(!is_removed);
                if !is_removed {
                    *left
                        .entry((messages::class_name(point.class), label.class == ClassId::Pedestrian as u8))
                        .or_default() += 1;
                }
            } else {
                n_static += 1;
                n_lost += u64::from(is_removed);
            }
        })?;
    }
    for ((class, is_person), n) in &left {
        println!("  left as {class}: {n}{}", if *is_person { " of people" } else { "" });
    }
    println!(
        "objects: {n_objects} points, {:.2} % left; static world: {n_static} points, {:.2} % lost",
        100.0 * n_left as f64 / n_objects as f64,
        100.0 * n_lost as f64 / n_static as f64
    );
    Ok(())
}

/// Mark of moving points: all points of an object in a second in which it moves.
fn marks(run: &RunFolder, drive: &Drive, town: &ExactTown) -> anyhow::Result<()> {
    /// Slower objects stand, m/s.
    const MIN_SPEED_MPS: f64 = 0.5;
    #[derive(Default)]
    struct Second {
        n: u64,
        n_moving: u64,
        n_marked: u64,
    }
    let sweeps = labelled_sweeps(drive)?;
    let begin = town.simulation.motion.begin.0;
    let movers = town.simulation.scene.movers();
    let mut seconds: BTreeMap<(u16, i64), Second> = BTreeMap::new();
    let mut n_marked = 0_u64;
    for entry in &run.index.clouds {
        let mut near: BTreeMap<i64, Vec<(Point3<f64>, f64)>> = BTreeMap::new();
        run.each_point(entry, |point| {
            n_marked += u64::from(point.is_moving);
            let Ok(label) = find_label(&sweeps, &shot(point)) else { return };
            if label.instance == 0 {
                return;
            }
            let time_s = point.time_s - begin as f64 * 1e-9;
            let tenth = (10.0 * time_s) as i64;
            let moving = near.entry(tenth).or_insert_with(|| {
                let at = |mover: &town::Mover, s: f64| mover.pose(s) * Point3::from(mover.center);
                let place = |mover: &town::Mover| {
                    let [a, b] = [-0.5, 0.5].map(|off| at(mover, tenth as f64 / 10.0 + off).cast::<f64>());
                    let is_moving = (b - a).norm() > MIN_SPEED_MPS;
                    is_moving.then(|| (nalgebra::center(&a, &b), f64::from(mover.radius) + REACH_M))
                };
                movers.iter().filter_map(place).collect()
            });
            let p = town.town_from_run * Point3::from(point.xyz);
            let second = seconds.entry((label.instance, time_s as i64)).or_default();
            second.n += 1;
            second.n_marked += u64::from(point.is_moving);
            second.n_moving += u64::from(moving.iter().any(|(center, reach_m)| (p - center).norm() < *reach_m));
        })?;
    }
    let moving = || seconds.values().filter(|second| 2 * second.n_moving > second.n);
    let n_points: u64 = moving().map(|second| second.n).sum();
    let n_found: u64 = moving().map(|second| second.n_marked).sum();
    println!(
        "moving: {n_points} points, {:.1} % of them marked; {n_marked} points marked, {:.1} % of them on moving objects",
        100.0 * n_found as f64 / n_points as f64,
        100.0 * n_found as f64 / n_marked as f64
    );
    Ok(())
}

fn labelled_sweeps(drive: &Drive) -> anyhow::Result<Vec<LabelledSweep>> {
    let mut reader: LabelReader = drive.label_reader().map_err(|cause| anyhow::anyhow!("{cause}"))?;
    let mut sweeps = Vec::new();
    while let Some(sweep) = reader.next_sweep().map_err(|cause| anyhow::anyhow!("{cause}"))? {
        sweeps.push(sweep);
    }
    Ok(sweeps)
}

fn shot(point: &CloudPoint) -> Shot {
    let off = Vector3::from(point.xyz) - Vector3::from(point.lidar_xyz);
    Shot {
        stamp: (point.time_s * 1e9).round() as i64,
        ring: point.ring,
        azimuth: None,
        range_m: Some(off.norm() as f32),
    }
}

/// Edges of the driven road against the town.
fn edges(run: &RunFolder, boxes: &Boxes, town: &ExactTown) -> anyhow::Result<()> {
    let mut strips = RoadStrips::new(driven_roads([&run.trajectory]));
    for entry in &run.index.clouds {
        run.each_point(entry, |point| {
            if removed(point, boxes).is_none() {
                strips.add(point);
            }
        })?;
    }
    let mut offs = Vec::new();
    let [mut n_sides, mut n_unseen] = [0; 2];
    for road in 0..strips.roads().len() {
        let stations = &strips.roads()[road].stations;
        for section in cross_sections(&strips, road) {
            let (Some(sides), Some(height_m)) = (section.sides, section.height_m) else { continue };
            let station = stations[section.station];
            let path = town.town_from_run * Point3::new(station.place[0], station.place[1], height_m);
            let found = town.below(&(path + Vector3::new(0.0, 0.0, REACH_M)), 2.0 * REACH_M);
            let height_m = found.map_or(height_m, |hit| height_m + REACH_M - f64::from(hit.range_m));
            for side in sides {
                n_sides += 1;
                if !side.is_seen {
                    n_unseen += 1;
                    continue;
                }
                let sign = side.edge_m.signum();
                let is_road = |left_m: f64| {
                    let [dx, dy] = station.direction;
                    let place = [station.place[0] - left_m * dy, station.place[1] + left_m * dx];
                    let from = town.town_from_run * Point3::new(place[0], place[1], height_m + CROSSFALL_M);
                    town.below(&from, 2.0 * CROSSFALL_M).is_some_and(|hit| {
                        matches!(hit.surface.class, ClassId::Road | ClassId::RoadLine | ClassId::Vehicles)
                    })
                };
                let mut n_off = 0;
                let true_m = (0..600).map(|k| k as f64 * STEP_M).find(|offset_m| {
                    n_off = if is_road(sign * offset_m) { 0 } else { n_off + 1 };
                    n_off == N_OFF_ROAD
                });
                let Some(true_m) = true_m.map(|end_m| sign * (end_m - STEP_M * (N_OFF_ROAD as f64 - 0.5))) else {
                    continue;
                };
                offs.push(side.edge_m - true_m);
            }
        }
    }
    offs.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let rms = (offs.iter().map(|off| off * off).sum::<f64>() / offs.len() as f64).sqrt();
    let at = |share: f64| offs.get((share * offs.len() as f64) as usize).copied().unwrap_or(f64::NAN).abs();
    println!(
        "road edges: {n_sides} sides, {n_unseen} unseen; {} compared, RMS {rms:.2} m, median {:.2}, 90 % {:.2}",
        offs.len(),
        at(0.5),
        at(0.9)
    );
    println!("{:?}", opendrive(&strips, Traffic::Right, None).summary);
    Ok(())
}
