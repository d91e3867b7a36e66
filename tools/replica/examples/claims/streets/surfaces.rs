//! The colors of a sweep's points as an ideal camera beside the lidar would see them: reflectance and texture of the surface in
//! the light of sun and sky, with cast shadows; without noise, automatic gain, parallax or errors of registration.

use geometry::{NO_POINT, Point3, Pose};
use learning::Cloud;
use learning::spherical::Sweep;
use messages::SubmapSweep;
use simulation::Simulation;
use simulation::light::sun_on;
use simulation::scene::SceneHit;
use simulation::sensors::look::Palette;
use simulation::spectrum::Filter;
use simulation::trace::{Ray, Vec3};

/// Middle and width of the filters of the color cameras, nm.
const FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Share of the sky that a place in a street sees.
const OPEN: f32 = 0.6;
/// Points are cast anew in groups of so many ns; movers stand still within one.
const GROUP_NANOS: u32 = 2_000_000;
/// What is met must lie this near to the point, m: the beam's side may have met something else than its middle does.
const NEAR_M: f32 = 0.3;
/// Nothing farther is looked for, m: what the lidar reaches.
const REACH_M: f32 = 120.0;

/// By pixel, red, green and blue, 0 to 1; zeros where nothing is seen.
pub fn colors(simulation: &Simulation, cloud: &Cloud<'_>, sweep: &Sweep) -> Vec<[f32; 3]> {
    let mut colors = vec![[0.0; 3]; sweep.image.nearest.len()];
    // The only sweep of its submap: the frame is the body's at its begin.
    let of: &SubmapSweep = &cloud.header.sweeps[0];
    let begin = geometry::Stamp(of.stamp);
    let world_from_submap: Pose = simulation.motion.pose_at(begin);
    let since_drive = (of.stamp - simulation.motion.begin.0) as f64 * 1e-9;
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
    // What counts as 1 of each color: a white target in the sun, as the cameras balance it.
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
            let part = palette.part(hit, sun, OPEN, 1.0);
            // The square root in place of the curve of sRGB.
            colors[pixel] = std::array::from_fn(|band| palette.band(&part, band).clamp(0.0, 1.0).sqrt());
        }
    }
    colors
}
