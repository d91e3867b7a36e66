//! The colors of a sweep's points as an ideal camera beside the lidar would see them: reflectance and texture of the surface in
//! the light of sun and sky, with cast shadows; without noise, automatic gain, parallax or errors of registration.

use geometry::{NO_POINT, Point3, Pose};
use learning::Cloud;
use learning::spherical::Sweep;
use messages::SubmapSweep;
use simulation::Simulation;
use simulation::light::{Light, SKY_STRENGTH, sun_on};
use simulation::scene::SceneHit;
use simulation::spectrum::{Filter, Spectrum};
use simulation::trace::{Ray, Vec3};

/// Middle and width of the filters of the color cameras, nm.
const FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Share of the sky that a place in a street sees.
const OPEN: f32 = 0.6;
/// Points are cast anew in groups of so many ns; movers stand still within one.
const GROUP_NANOS: u32 = 2_000_000;
/// What is met must lie this near to the point, m: the beam's side may have met something else than its middle does.
const NEAR_M: f32 = 0.3;
/// Movers farther than this are not looked for, m.
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
    let view = View::new();
    for group in shown.chunk_by(|a, b| offset(a.1) == offset(b.1)) {
        let seconds = since_drive + f64::from(cloud.points[group[0].1].offset_nanos) * 1e-9;
        let rays: Vec<(usize, Ray, f32)> = group
            .iter()
            .map(|&(pixel, point)| {
                let p = &cloud.points[point];
                let [x, y, z] = sweep.polar.pixels[pixel].ray;
                let [eye, at] = [world([p.x - x, p.y - y, p.z - z]), world([p.x, p.y, p.z])];
                let ray = Ray { origin: eye, direction: (at - eye).normalize(), seed: point as u64 };
                (pixel, ray, (at - eye).norm())
            })
            .collect();
        let movers = simulation.scene.movers_near(&rays[0].1.origin, REACH_M, seconds);
        let snapshot = simulation.scene.some_at(&movers, seconds);
        let seen = rays.iter().filter_map(|(pixel, ray, range_m)| {
            let hit = simulation.scene.cast(&snapshot, ray, range_m + NEAR_M)?;
            ((hit.range_m - range_m).abs() < NEAR_M).then_some((*pixel, (*ray, hit)))
        });
        let (pixels, hits): (Vec<usize>, Vec<(Ray, SceneHit)>) = seen.unzip();
        let suns = sun_on(&simulation.scene, &hits, |_| &snapshot);
        for ((pixel, (_, hit)), sun) in pixels.into_iter().zip(&hits).zip(suns) {
            colors[pixel] = view.color(hit, sun);
        }
    }
    colors
}

struct View {
    filters: [Filter; 3],
    sunlight: Spectrum,
    skylight: Spectrum,
    /// What counts as 1 of each color: a white target in the sun, as the cameras balance it.
    white: [f32; 3],
}

impl View {
    fn new() -> Self {
        let filters = FILTERS.map(|(center, sigma)| Filter::gauss(center, sigma));
        let (sunlight, skylight) = (Spectrum::sunlight(), Spectrum::skylight());
        let white = Spectrum::from_fn(|_| 1.0);
        let through =
            |filter: &Filter| white.through(&sunlight, filter) + 0.4 * SKY_STRENGTH * white.through(&skylight, filter);
        let white = filters.each_ref().map(through);
        Self { filters, sunlight, skylight, white }
    }
    /// With the square root in place of the curve of sRGB.
    fn color(&self, hit: &SceneHit, sun: f32) -> [f32; 3] {
        let properties = hit.surface.material.properties();
        let light = Light::on(sun, OPEN);
        let texture = properties.texture(&hit.texture_point, &hit.normal);
        std::array::from_fn(|c| {
            let through = |of: &Spectrum| properties.spectrum.through(of, &self.filters[c]);
            let level = light.sun * through(&self.sunlight) + SKY_STRENGTH * light.sky * through(&self.skylight);
            (texture * level / self.white[c]).clamp(0.0, 1.0).sqrt()
        })
    }
}
