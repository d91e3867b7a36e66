//! The colors of the points of a sweep, as an ideal camera at the lidar would see them: reflectance and texture of the surface in
//! sun and sky light, with cast shadows; without noise, automatic gain, parallax or registration errors.

use geometry::{NO_POINT, Point3, Pose};
use messages::SubmapSweep;
use raytrace::{Ray, Vec3};
use segmentation::ModelInput;
use segmentation::spherical::RangeSweep;
use simulation::Simulation;
use simulation::light::sun_on;
use simulation::sensors::filter::Filter;
use simulation::sensors::look::Palette;
use town::SceneHit;

/// Center and width of the filters of the color cameras, nm.
const FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Share of the sky that is visible in a street.
const SKY_VIEW: f32 = 0.6;
/// Points are traced in groups of this duration, ns; moving objects stand still within a group.
const GROUP_NANOS: u32 = 2_000_000;
/// Largest distance between the hit of the ray and the point, m: the edge of a lidar beam may hit another surface than its center.
const NEAR_M: f32 = 0.3;
/// Range of the rays, m: the range of the lidar.
const REACH_M: f32 = 120.0;

/// Red, green and blue of each pixel, 0 to 1; zeros without a hit.
pub fn colors(simulation: &Simulation, cloud: &ModelInput<'_>, sweep: &RangeSweep) -> Vec<[f32; 3]> {
    let mut colors = vec![[0.0; 3]; sweep.image.nearest.len()];
    // The only sweep of its submap: the frame is the body frame at its start.
    let submap_sweep: &SubmapSweep = &cloud.header.sweeps[0];
    let begin = geometry::Stamp(submap_sweep.stamp);
    let world_from_submap: Pose = simulation.motion.pose_at(begin);
    let since_drive = (submap_sweep.stamp - simulation.motion.begin.0) as f64 * 1e-9;
    let world = |[x, y, z]: [f32; 3]| -> Vec3 {
        (world_from_submap * Point3::new(f64::from(x), f64::from(y), f64::from(z))).coords.cast()
    };
    let mut shown: Vec<(usize, usize)> = (sweep.image.nearest.iter().enumerate())
        .filter(|(_, point)| **point != NO_POINT)
        .map(|(pixel, point)| (pixel, sweep.points.start + *point as usize))
        .collect();
    let offset = |point: usize| cloud.points[point].offset_nanos / GROUP_NANOS;
    shown.sort_by_key(|(pixel, point)| (offset(*point), *pixel));
    let filters = FILTERS.map(|(center, sigma)| Filter::gauss(center, sigma));
    // A white target in the sun has the value 1, as after the white balance of the cameras.
    let palette = Palette::new(&filters, |sun, sky| sun + 0.4 * sky);
    for group in shown.chunk_by(|a, b| offset(a.1) == offset(b.1)) {
        let seconds = since_drive + f64::from(cloud.points[group[0].1].offset_nanos) * 1e-9;
        let (rays, ranges): (Vec<Ray>, Vec<f32>) = group
            .iter()
            .map(|&(pixel, point)| {
                let p = &cloud.points[point];
                let [x, y, z] = sweep.polar.pixels[pixel].ray;
                let [eye, at] = [world([p.x - x, p.y - y, p.z - z]), world([p.x, p.y, p.z])];
                let ray = Ray { origin: eye, direction: (at - eye).normalize(), seed: point as u64 };
                (ray, (at - eye).norm())
            })
            .unzip();
        let movers = simulation.scene.movers_near(&rays[0].origin, REACH_M, seconds);
        let snapshot = simulation.scene.some_at(&movers, seconds);
        let hits = simulation.scene.cast_all(&rays, REACH_M, |_| &snapshot);
        let seen = (0..group.len()).filter_map(|i| {
            let hit = hits[i].filter(|hit| (hit.range_m - ranges[i]).abs() < NEAR_M)?;
            Some((group[i].0, (rays[i], hit)))
        });
        let (pixels, hits): (Vec<usize>, Vec<(Ray, SceneHit)>) = seen.unzip();
        let suns = sun_on(&simulation.scene, &hits, |_| &snapshot);
        for ((pixel, (_, hit)), sun) in pixels.into_iter().zip(&hits).zip(suns) {
            let part = palette.part(hit, sun, SKY_VIEW, 1.0);
            // The square root approximates the sRGB curve.
            colors[pixel] = std::array::from_fn(|band| palette.band(&part, band).clamp(0.0, 1.0).sqrt());
        }
    }
    colors
}
