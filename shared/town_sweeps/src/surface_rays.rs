//! The surfaces at the points of a submap.

use geometry::{Point3, Pose, Stamp};
use messages::{SubmapHeader, SubmapPoint, SubmapSweep};
use random::hash;
use raytrace::{Ray, Vec3};
use simulation::Simulation;
use simulation::light::{RayHit, sun_on};
use town::{Material, SceneHit};

/// Points are traced in groups of this duration, ns; moving objects are static within a group.
const GROUP_NANOS: u32 = 2_000_000;
/// Largest distance between the hit of the ray and the point, m: the edge of a LiDAR beam may hit another surface than its center.
const NEAR_M: f32 = 0.3;
/// Range of the rays, m: the range of the LiDAR.
const REACH_M: f32 = 120.0;
/// Largest number of rays per point: with it, nearly all leaves are found, like all other surfaces.
pub(crate) const N_RAYS: u64 = 32;

/// The surface of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueSurface {
    /// Material of the surface.
    pub material: Material,
    /// Whether the surface is in direct sunlight.
    pub is_sunlit: bool,
}

/// The surfaces of some points of a submap of a simulation; `None` if no ray hits the surface of the point. `shown`
/// contains the index of each point.
pub fn true_surfaces(
    simulation: &Simulation,
    header: &SubmapHeader,
    points: &[SubmapPoint],
    shown: &[usize],
) -> Vec<Option<TrueSurface>> {
    let mut surfaces = vec![None; shown.len()];
    trace_points(simulation, header, points, shown, N_RAYS, |place, hit, sun| {
        surfaces[place] = Some(TrueSurface { material: hit.surface.material, is_sunlit: sun > 0.0 });
    });
    surfaces
}

/// Calls `visit` once for each entry of `shown` whose surface a ray hits, with the hit and the share of the full sun on
/// it. Rays pass through leaves and fences at random; `n_rays` are tried.
pub(crate) fn trace_points(
    simulation: &Simulation,
    header: &SubmapHeader,
    points: &[SubmapPoint],
    shown: &[usize],
    n_rays: u64,
    mut visit: impl FnMut(usize, &SceneHit, f32),
) {
    let mut is_found = vec![false; shown.len()];
    let mut places: Vec<usize> = (0..shown.len()).collect();
    for number in 0..n_rays {
        trace(simulation, header, points, shown, &mut places, number, &mut |place, hit, sun| {
            is_found[place] = true;
            visit(place, hit, sun);
        });
        places.retain(|place| !is_found[*place]);
    }
}

/// Traces the ray of this number to the entries of `shown` at `places`, which it sorts by time.
fn trace(
    simulation: &Simulation,
    header: &SubmapHeader,
    points: &[SubmapPoint],
    shown: &[usize],
    places: &mut [usize],
    number: u64,
    visit: &mut dyn FnMut(usize, &SceneHit, f32),
) {
    // The submap frame is the body frame at the start of the first sweep.
    let world_from_submap: Pose = simulation.motion.pose_at(Stamp(header.sweeps[0].stamp));
    let world = |[x, y, z]: [f32; 3]| -> Vec3 {
        (world_from_submap * Point3::new(f64::from(x), f64::from(y), f64::from(z))).coords.cast()
    };
    let time_group = |place: &usize| {
        let point = &points[shown[*place]];
        (point.sweep_idx, point.offset_nanos / GROUP_NANOS)
    };
    places.sort_by_key(time_group);
    for group in places.chunk_by(|a, b| time_group(a) == time_group(b)) {
        let first = &points[shown[group[0]]];
        let sweep = &header.sweeps[usize::from(first.sweep_idx)];
        let since_drive = (sweep.stamp - simulation.motion.begin.0) as f64 * 1e-9;
        let seconds = since_drive + f64::from(first.offset_nanos) * 1e-9;
        let (rays, ranges): (Vec<Ray>, Vec<f32>) = group
            .iter()
            .map(|place| {
                let point = &points[shown[*place]];
                let [eye, at] = [world(eye(sweep, point)), world([point.x, point.y, point.z])];
                let point = shown[*place] as u64;
                let seed = if number == 0 { point } else { hash(point, number) };
                let ray = Ray { origin: eye, direction: (at - eye).normalize(), seed };
                (ray, (at - eye).norm())
            })
            .unzip();
        let movers = simulation.scene.movers_near(&rays[0].origin, REACH_M, seconds);
        let snapshot = simulation.scene.some_at(&movers, seconds);
        let hits = simulation.scene.cast_all(&rays, REACH_M, |_| &snapshot);
        let seen = (0..group.len()).filter_map(|i| {
            let hit = hits[i].filter(|hit| (hit.range_m - ranges[i]).abs() < NEAR_M)?;
            Some((group[i], RayHit { ray: rays[i], hit }))
        });
        let (seen, hits): (Vec<usize>, Vec<RayHit>) = seen.unzip();
        let suns = sun_on(&simulation.scene, &hits, |_| &snapshot);
        for ((place, RayHit { hit, .. }), sun) in seen.into_iter().zip(&hits).zip(suns) {
            visit(place, hit, sun);
        }
    }
}

/// Position of the LiDAR at the shot of a point, in the submap frame.
fn eye(sweep: &SubmapSweep, point: &SubmapPoint) -> [f32; 3] {
    let share = (point.offset_nanos as f32 / sweep.duration_nanos.max(1) as f32).min(1.0);
    let begin = &sweep.submap_from_lidar_begin;
    let end = &sweep.submap_from_lidar_end;
    let at = [point.x, point.y, point.z];
    // The point minus the ray of the range image, with the rounding of this subtraction: published experiments depend on
    // it.
    std::array::from_fn(|axis| at[axis] - (at[axis] - (begin[axis] + share * (end[axis] - begin[axis]))))
}
