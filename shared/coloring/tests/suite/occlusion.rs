//! Occlusion compared with the ground truth of a simulated town: rays from the cameras through the scene.

use coloring::{
    AgeLimits, CHUNK, Candidates, Choices, Chunk, PointBuffers, PosedExposure, ProjectionCamera, SubmapPoints,
    VisibilityMap, visibility_maps,
};
use geometry::{CameraModel, Pose, RigCamera, Stamp};
use messages::{ClassId, POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use raytrace::Ray;
use simulation::{DriveSpec, Simulation};
use town::Snapshot;

/// Two seconds at 10 Hz: a submap at 36 km/h.
const N_SWEEPS: usize = 20;
const SWEEP_NANOS: i64 = 100_000_000;
/// Columns per revolution of an HDL-32E.
const N_COLUMNS: u32 = 2160;
const N_RINGS: u32 = 32;
const LIMITS: AgeLimits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };
/// One point in this many is compared with all cameras; coprime to the number of rings.
const STRIDE: usize = 23;
/// Largest share of the colored points that a solid object occludes. The remaining errors are cars that pass the camera
/// between two LiDAR revolutions, poles, and objects beyond the ends of the submap.
const MAX_WRONG: f64 = 0.01;
/// Upper ends of the ranges of the table, m.
const RANGES_M: [f64; 4] = [5.0, 10.0, 20.0, 80.0];

struct Town {
    simulation: Simulation,
    /// Stamp of the first shot.
    begin: Stamp,
}

impl Town {
    fn seconds(&self, stamp: i64) -> f64 {
        Stamp(stamp).seconds_since(self.simulation.motion.begin)
    }

    /// Sweeps and points of the LiDAR, shot by shot, in the frame of the first shot.
    fn points(&self) -> (Vec<SubmapSweep>, Vec<SubmapPoint>) {
        let submap_from_world = self.simulation.motion.pose_at(self.begin).inverse();
        let stamp_of = |sweep: usize| self.begin.0 + sweep as i64 * SWEEP_NANOS;
        let sweep = |i| SubmapSweep { stamp: stamp_of(i), ..SubmapSweep::default() };
        let column = |i: usize| {
            let sweep_idx = i / N_COLUMNS as usize;
            let column = i as u32 % N_COLUMNS;
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

    /// Class of the object that occludes `p` (world frame) from the camera, with the tolerances of `truth/visibility`.
    /// Rays hit leaves at random: a hit beyond the point means that it is visible.
    fn occluder(&self, snapshot: &Snapshot, eye: &Point3<f64>, p: &Point3<f64>) -> Option<ClassId> {
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

struct TrueExposure {
    stamp: i64,
    snapshot: Snapshot,
    eye: Point3<f64>,
    camera_from_world: Pose,
    model: CameraModel,
}

/// Counts of points in a span of ranges.
#[derive(Clone, Copy, Debug, Default)]
struct Score {
    /// Points that are visible in some exposure, by ground truth.
    visible: usize,
    /// Visible points with a color.
    visible_colored: usize,
    /// Points with a color.
    colored: usize,
    /// Points with the color of an exposure from which they are occluded.
    wrong: usize,
    /// Wrong points that leaves occlude.
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
    /// Share of the colored points that are wrong, without points behind leaves.
    fn wrong_of_colored(&self) -> f64 {
        (self.wrong - self.behind_leaves) as f64 / self.colored.max(1) as f64
    }
}

/// Scores by range, with and without occlusion.
fn scores(town: &Town) -> [[Score; RANGES_M.len()]; 2] {
    let (sweeps, points) = town.points();
    let world_from_submap = town.simulation.motion.pose_at(town.begin);
    let until = town.begin.0 + N_SWEEPS as i64 * SWEEP_NANOS + 1_000_000_000;
    let near = |stamp: &Stamp| (town.begin.0 - 1_000_000_000..until).contains(&stamp.0);
    let cameras: Vec<ProjectionCamera> = (town.simulation.rig.cameras.iter())
        .map(|c| ProjectionCamera::from(&RigCamera { body_from_camera: c.body_from_camera, model: c.lens.clone() }))
        .collect();
    let mut exposures: Vec<PosedExposure<'_>> = Vec::new();
    let mut truth: Vec<TrueExposure> = Vec::new();
    for stamp in town.simulation.exposures().into_iter().filter(near) {
        let world_from_body = town.simulation.motion.pose_at(stamp);
        for (camera, spec) in cameras.iter().zip(&town.simulation.rig.cameras) {
            let world_from_camera = world_from_body * spec.body_from_camera;
            exposures.push(camera.exposure(stamp.0, &world_from_body, &world_from_submap));
            truth.push(TrueExposure {
                stamp: stamp.0,
                snapshot: town.simulation.scene.at(town.seconds(stamp.0)),
                eye: Point3::from(world_from_camera.translation.vector),
                camera_from_world: world_from_camera.inverse(),
                model: spec.lens.clone(),
            });
        }
    }
    let mut buffers = PointBuffers::default();
    let submap = SubmapPoints::new(&points, &sweeps, town.begin.0, N_RINGS, &mut buffers);
    let tested = visibility_maps(&submap, &exposures);
    let untested: Vec<VisibilityMap> = exposures.iter().map(|_| VisibilityMap::unobstructed()).collect();
    [tested, untested].map(|visibility| {
        let candidates = Candidates { points: &submap, exposures: &exposures, visibility: &visibility, limits: LIMITS };
        let of_chunk = |(index, points): (usize, &[SubmapPoint])| {
            let mut choices = Choices::default();
            let mut chunk = Chunk::default();
            submap.read_chunk(index, &mut chunk);
            choices.choose(&chunk, &candidates);
            let mut chosen = vec![None; points.len()];
            choices.chosen().for_each(|choice| chosen[choice.i] = Some(choice.exposure));
            let mut table = [Score::default(); RANGES_M.len()];
            for (point, choice) in points.iter().zip(chosen).step_by(STRIDE) {
                let stamp = sweeps[usize::from(point.sweep_idx)].stamp + i64::from(point.offset_nanos);
                let p = world_from_submap * Point3::new(point.x, point.y, point.z).cast::<f64>();
                let limit_s = if point.flags == 0 { LIMITS.max_age_s } else { LIMITS.max_moving_age_s };
                let sees = |exposure: &TrueExposure| {
                    (exposure.stamp - stamp).unsigned_abs() as f64 * 1e-9 <= f64::from(limit_s)
                        && exposure.model.pixel_from_camera(&(exposure.camera_from_world * p)).is_some()
                        && town.occluder(&exposure.snapshot, &exposure.eye, &p).is_none()
                };
                let lidar = town.simulation.motion.pose(town.seconds(stamp)).translation.vector;
                let range_m = (p.coords - lidar).norm();
                let Some(score) = RANGES_M.iter().position(|end| range_m < *end).map(|i| &mut table[i]) else {
                    continue;
                };
                let is_visible = truth.iter().any(sees);
                score.visible += usize::from(is_visible);
                score.visible_colored += usize::from(is_visible && choice.is_some());
                score.colored += usize::from(choice.is_some());
                let occluder = choice.and_then(|i: usize| town.occluder(&truth[i].snapshot, &truth[i].eye, &p));
                score.wrong += usize::from(occluder.is_some());
                score.behind_leaves += usize::from(occluder == Some(ClassId::Vegetation));
            }
            table
        };
        (points.par_chunks(CHUNK).enumerate())
            .map(of_chunk)
            .reduce(|| [Score::default(); RANGES_M.len()], |a, b| std::array::from_fn(|i| a[i].plus(b[i])))
    })
}

#[test]
fn occluded_points_stay_uncolored_and_visible_points_are_colored() {
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
        println!("{name} occlusion:");
        for (score, end) in table.iter().zip(RANGES_M) {
            let [colored, hidden] = [score.colored_of_visible(), score.wrong_of_colored()].map(|share| 100.0 * share);
            let leaves = 100.0 * score.behind_leaves as f64 / score.colored.max(1) as f64;
            let n = score.visible;
            println!(
                "  up to {end} m: {n} visible, {colored:.1} % colored; {hidden:.2} % occluded, {leaves:.2} % by leaves"
            );
        }
    }
    let all = |table: &[Score]| table.iter().fold(Score::default(), |sum, score| sum.plus(*score));
    let tested = all(&sums[0]);
    let untested = all(&sums[1]);
    println!("with: {tested:?}\nwithout: {untested:?}");
    let wrong = tested.wrong_of_colored();
    let wrong_before = untested.wrong_of_colored();
    assert!(tested.visible > 10_000, "{tested:?}");
    assert!(wrong < MAX_WRONG, "{wrong} of the colored points are occluded from their exposure");
    assert!(wrong_before > 3.0 * wrong, "{wrong} instead of {wrong_before}: occlusion has hardly any effect");
    assert!(tested.colored_of_visible() > 0.94, "{tested:?}");
}
