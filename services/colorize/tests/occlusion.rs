//! Who sees what, against the truth of a simulated town: rays from the cameras through the scene itself.

mod common;

use colorize::choose::{Choices, Limits, Sources, View};
use colorize::chunk::{CHUNK, Chunk};
use colorize::cloud::{Cloud, Memory};
use colorize::occlusion::{Sight, sights};
use colorize::views::Camera;
use geometry::{CameraModel, Pose, RigCamera, Stamp};
use messages::{ClassId, POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use simulation::scene::Snapshot;
use simulation::trace::Ray;
use simulation::{DriveSpec, Simulation};

/// Two seconds at 10 Hz, as the stage before cuts them at 36 km/h.
const N_SWEEPS: usize = 20;
const SWEEP_NANOS: i64 = 100_000_000;
/// As an HDL-32E.
const N_COLUMNS: u32 = 2160;
const N_RINGS: u32 = 32;
const LIMITS: Limits = Limits { max_age_s: 1.0, max_moving_age_s: 0.1 };
/// Every so manyth point is looked at by all cameras; prime to the number of rings.
const STRIDE: usize = 23;
/// Share of the colored points that may be hidden by something solid. What remains are cars that pass before the camera while
/// the lidar looks elsewhere, poles, and what is beyond the ends of the submap.
const WRONG_MAX: f64 = 0.01;
/// Upper ends of the ranges of the table, m.
const RANGES_M: [f64; 4] = [5.0, 10.0, 20.0, 80.0];

struct Town {
    simulation: Simulation,
    /// First shot.
    begin: Stamp,
}

impl Town {
    fn seconds(&self, stamp: i64) -> f64 {
        Stamp(stamp).seconds_since(self.simulation.motion.begin)
    }

    /// What the lidar's ring of columns meets, shot by shot, in the frame of the first.
    fn points(&self) -> (Vec<SubmapSweep>, Vec<SubmapPoint>) {
        let submap_from_world = self.simulation.motion.pose_at(self.begin).inverse();
        let stamp_of = |sweep: usize| self.begin.0 + sweep as i64 * SWEEP_NANOS;
        let sweep = |i| SubmapSweep { stamp: stamp_of(i), ..SubmapSweep::default() };
        let column = |i: usize| {
            let (sweep_idx, column) = (i / N_COLUMNS as usize, i as u32 % N_COLUMNS);
            let offset_nanos = (SWEEP_NANOS * i64::from(column) / i64::from(N_COLUMNS)) as u32;
            let seconds = self.seconds(stamp_of(sweep_idx) + i64::from(offset_nanos));
            let [now, later] = [seconds, seconds + 1.0].map(|seconds| self.simulation.scene.at(seconds));
            let world_from_lidar = self.simulation.motion.pose(seconds) * self.simulation.rig.lidar.body_from_lidar;
            let shoot = move |ring: u32| {
                let azimuth = f64::from(column) * std::f64::consts::TAU / f64::from(N_COLUMNS);
                let elevation = (-30.67 + 1.333 * f64::from(ring)).to_radians();
                let across = elevation.cos();
                let direction = Vector3::new(across * azimuth.cos(), -across * azimuth.sin(), elevation.sin());
                let ray = Ray {
                    origin: world_from_lidar.translation.vector.cast(),
                    direction: (world_from_lidar * direction).cast(),
                    seed: i as u64 * 32 + u64::from(ring),
                };
                let hit = self.simulation.scene.cast(&now, &ray, 80.0)?;
                let again = self.simulation.scene.cast(&later, &ray, 80.0).map(|hit| hit.range_m);
                let moves = hit.surface.instance > 0 && again.is_none_or(|m| (m - hit.range_m).abs() > 0.2);
                let p = submap_from_world * world_from_lidar * Point3::from(direction * f64::from(hit.range_m));
                Some(SubmapPoint {
                    x: p.x as f32,
                    y: p.y as f32,
                    z: p.z as f32,
                    offset_nanos,
                    sweep_idx: sweep_idx as u16,
                    ring: ring as u8,
                    flags: if moves { POINT_DYNAMIC } else { 0 },
                    ..SubmapPoint::default()
                })
            };
            (0..N_RINGS).filter_map(shoot).collect::<Vec<_>>()
        };
        let points = (0..N_SWEEPS * N_COLUMNS as usize).into_par_iter().flat_map_iter(column).collect();
        ((0..N_SWEEPS).map(sweep).collect(), points)
    }

    /// What stands before `p` (world frame), seen from the camera, with the tolerances of `truth/visibility`. Leaves meet
    /// rays by chance: one beyond the point says that nothing stands before it.
    fn before(&self, snapshot: &Snapshot, eye: &Point3<f64>, p: &Point3<f64>) -> Option<ClassId> {
        let toward = p - eye;
        let distance = toward.norm();
        let direction = (toward / distance).cast::<f32>();
        let ray = Ray { origin: eye.coords.cast(), direction, seed: 0 };
        let hit = self.simulation.scene.cast(snapshot, &ray, distance as f32)?;
        let gap = distance - f64::from(hit.range_m);
        let across = gap * f64::from(hit.normal.dot(&direction).abs());
        let is_there = gap < 0.1 || (gap < 0.5 && (hit.surface.class == ClassId::Vegetation || across < 0.06));
        (!is_there).then_some(hit.surface.class)
    }
}

struct Exposure {
    stamp: i64,
    snapshot: Snapshot,
    eye: Point3<f64>,
    camera_from_world: Pose,
    model: CameraModel,
}

/// Of the points at some range.
#[derive(Clone, Copy, Debug, Default)]
struct Score {
    /// Seen by some exposure, by truth.
    visible: usize,
    /// Those of them that have a color.
    visible_colored: usize,
    colored: usize,
    /// Colored by an exposure from which something stands before them.
    wrong: usize,
    /// Those of them that are behind leaves.
    behind_leaves: usize,
}

impl Score {
    fn plus(self, other: Self) -> Self {
        Self {
            visible: self.visible + other.visible,
            visible_colored: self.visible_colored + other.visible_colored,
            colored: self.colored + other.colored,
            wrong: self.wrong + other.wrong,
            behind_leaves: self.behind_leaves + other.behind_leaves,
        }
    }
    fn colored_of_visible(&self) -> f64 {
        self.visible_colored as f64 / self.visible.max(1) as f64
    }
    /// Leaves left out.
    fn wrong_of_colored(&self) -> f64 {
        (self.wrong - self.behind_leaves) as f64 / self.colored.max(1) as f64
    }
}

/// By range, with and without the occlusion test.
fn scores(town: &Town) -> [[Score; RANGES_M.len()]; 2] {
    let (sweeps, points) = town.points();
    let world_from_submap = town.simulation.motion.pose_at(town.begin);
    let until = town.begin.0 + N_SWEEPS as i64 * SWEEP_NANOS + 1_000_000_000;
    let near = |stamp: &Stamp| (town.begin.0 - 1_000_000_000..until).contains(&stamp.0);
    let cameras: Vec<Camera> = (town.simulation.rig.cameras.iter())
        .map(|c| Camera::from(&RigCamera { body_from_camera: c.body_from_camera, model: c.lens.clone() }))
        .collect();
    let (mut views, mut exposures): (Vec<View<'_>>, Vec<Exposure>) = (Vec::new(), Vec::new());
    for stamp in town.simulation.exposures().into_iter().filter(near) {
        let world_from_body = town.simulation.motion.pose_at(stamp);
        for (camera, spec) in cameras.iter().zip(&town.simulation.rig.cameras) {
            let world_from_camera = world_from_body * spec.body_from_camera;
            views.push(camera.view(stamp.0, &world_from_body, &world_from_submap));
            exposures.push(Exposure {
                stamp: stamp.0,
                snapshot: town.simulation.scene.at(town.seconds(stamp.0)),
                eye: Point3::from(world_from_camera.translation.vector),
                camera_from_world: world_from_camera.inverse(),
                model: spec.lens.clone(),
            });
        }
    }
    let mut memory = Memory::default();
    let cloud = Cloud::new(&points, &sweeps, town.begin.0, N_RINGS, &mut memory);
    let tested = sights(&cloud, &views);
    let untested: Vec<Sight> = views.iter().map(|_| Sight::free()).collect();
    [tested, untested].map(|sights| {
        let sources = Sources { cloud: &cloud, views: &views, sights: &sights, limits: LIMITS };
        let of_chunk = |(chunk, points): (&Chunk, &[SubmapPoint])| {
            let mut choices = Choices::default();
            choices.fill(chunk, &sources);
            let mut chosen = vec![None; points.len()];
            choices.seen().for_each(|(i, view, _)| chosen[i] = Some(view));
            let mut table = [Score::default(); RANGES_M.len()];
            for (point, choice) in points.iter().zip(chosen).step_by(STRIDE) {
                let stamp = sweeps[usize::from(point.sweep_idx)].stamp + i64::from(point.offset_nanos);
                let p = world_from_submap * Point3::new(point.x, point.y, point.z).cast::<f64>();
                let limit_s = if point.flags == 0 { LIMITS.max_age_s } else { LIMITS.max_moving_age_s };
                let sees = |exposure: &Exposure| {
                    (exposure.stamp - stamp).unsigned_abs() as f64 * 1e-9 <= f64::from(limit_s)
                        && exposure.model.pixel_from_camera(&(exposure.camera_from_world * p)).is_some()
                        && town.before(&exposure.snapshot, &exposure.eye, &p).is_none()
                };
                let lidar = town.simulation.motion.pose(town.seconds(stamp)).translation.vector;
                let range_m = (p.coords - lidar).norm();
                let Some(score) = RANGES_M.iter().position(|end| range_m < *end).map(|i| &mut table[i]) else {
                    continue;
                };
                let is_visible = exposures.iter().any(sees);
                score.visible += usize::from(is_visible);
                score.visible_colored += usize::from(is_visible && choice.is_some());
                score.colored += usize::from(choice.is_some());
                let before =
                    choice.and_then(|view: usize| town.before(&exposures[view].snapshot, &exposures[view].eye, &p));
                score.wrong += usize::from(before.is_some());
                score.behind_leaves += usize::from(before == Some(ClassId::Vegetation));
            }
            table
        };
        (cloud.chunks().par_iter().zip(points.par_chunks(CHUNK)))
            .map(of_chunk)
            .reduce(|| [Score::default(); RANGES_M.len()], |a, b| std::array::from_fn(|i| a[i].plus(b[i])))
    })
}

#[test]
fn what_is_hidden_stays_without_color_and_what_is_visible_gets_one() {
    let mut simulation = Simulation::new(&DriveSpec::urban(1, 12.0)).expect("a town");
    let mut sums = [[Score::default(); RANGES_M.len()]; 2];
    for seconds in [3, 5, 8] {
        let begin = simulation.motion.begin.plus_nanos(seconds * 1_000_000_000);
        let town = Town { simulation, begin };
        for (sum, table) in sums.iter_mut().zip(scores(&town)) {
            sum.iter_mut().zip(table).for_each(|(sum, score)| *sum = sum.plus(score));
        }
        simulation = town.simulation;
    }
    for (name, table) in ["with", "without"].iter().zip(&sums) {
        println!("{name} the occlusion test:");
        for (score, end) in table.iter().zip(RANGES_M) {
            let [colored, hidden] = [score.colored_of_visible(), score.wrong_of_colored()].map(|share| 100.0 * share);
            let leaves = 100.0 * score.behind_leaves as f64 / score.colored.max(1) as f64;
            let n = score.visible;
            println!(
                "  up to {end} m: {n} visible, {colored:.1} % colored; {hidden:.2} % hidden, {leaves:.2} % by leaves"
            );
        }
    }
    let all = |table: &[Score]| table.iter().fold(Score::default(), |sum, score| sum.plus(*score));
    let (tested, untested) = (all(&sums[0]), all(&sums[1]));
    println!("with: {tested:?}\nwithout: {untested:?}");
    let (wrong, wrong_before) = (tested.wrong_of_colored(), untested.wrong_of_colored());
    assert!(tested.visible > 10_000, "{tested:?}");
    assert!(wrong < WRONG_MAX, "{wrong} of the colored points are hidden from their exposure");
    assert!(wrong_before > 3.0 * wrong, "{wrong} instead of {wrong_before}: hardly anything was found");
    assert!(tested.colored_of_visible() > 0.94, "{tested:?}");
}
