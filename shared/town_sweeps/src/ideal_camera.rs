//! What an ideal camera at the LiDAR would see at the points of a submap: reflectance and texture of the surface in sun and sky
//! light, with cast shadows; without noise, automatic gain, parallax or registration errors.

use geometry::{Point3, Pose, Stamp};
use messages::{SubmapHeader, SubmapPoint, SubmapSweep};
use random::hash;
use raytrace::{Ray, Vec3};
use simulation::Simulation;
use simulation::light::sun_on;
use simulation::sensors::filter::Filter;
use simulation::sensors::look::Palette;
use std::ops::RangeInclusive;
use town::SceneHit;

/// Wavelengths of the bands that an ideal camera can have, nm: those of the spectra of materials.
pub const BANDS_NM: RangeInclusive<u16> = 400..=1000;

/// Center and standard deviation of the filters of a color camera, nm.
const COLOR_FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Standard deviation of the filter of a band, nm: about 20 nm wide at half of its height, as the bands of the mosaic cameras.
const BAND_SIGMA_NM: f32 = 8.0;
/// Share of the sky that is visible in a street.
const SKY_VIEW: f32 = 0.6;
/// Points are traced in groups of this duration, ns; moving objects stand still within a group.
const GROUP_NANOS: u32 = 2_000_000;
/// Largest distance between the hit of the ray and the point, m: the edge of a LiDAR beam may hit another surface than its center.
const NEAR_M: f32 = 0.3;
/// Rays of a point at most: nearly all leaves then have a color, as all other surfaces.
const N_RAYS: u64 = 32;
/// Range of the rays, m: the range of the LiDAR.
const REACH_M: f32 = 120.0;

/// A camera at the LiDAR that sees every point when the LiDAR does.
pub struct IdealCamera {
    palette: Palette,
    n_bands: usize,
    /// Value of a signal; a white target in the sun has the signal 1.
    value: fn(f32) -> f32,
    /// Rays of a point at most.
    n_rays: u64,
}

impl IdealCamera {
    /// Red, green and blue of 0 to 1.
    pub fn of_color() -> Self {
        let filters = COLOR_FILTERS.map(|(center, sigma)| Filter::gauss(center, sigma));
        // The square root approximates the sRGB curve.
        Self::new(&filters, |signal| signal.clamp(0.0, 1.0).sqrt())
    }
    /// Reflectances of 0 to 2 in bands at one or more wavelengths in [`BANDS_NM`]. As `calibrate` measures them, they are
    /// relative to a white target in the sun: a surface in the shade has lower ones.
    pub fn of_bands(wavelengths_nm: &[u16]) -> Self {
        let filters: Vec<Filter> =
            wavelengths_nm.iter().map(|nm| Filter::gauss(f32::from(*nm), BAND_SIGMA_NM)).collect();
        Self::new(&filters, |signal| signal.clamp(0.0, 2.0))
    }
    fn new(filters: &[Filter], value: fn(f32) -> f32) -> Self {
        // A white target in the sun has the value 1, as after the white balance of the cameras.
        let palette = Palette::new(filters, |sun, sky| sun + 0.4 * sky);
        Self { palette, n_bands: filters.len(), value, n_rays: N_RAYS }
    }
    /// Up to `n_rays` rays for a point, until one meets its surface; 32 by default. Rays go through leaves and fences at random: with
    /// one ray, most points of vegetation have no value and all others have one, which would tell the class.
    #[must_use]
    pub fn with_rays(self, n_rays: u64) -> Self {
        Self { n_rays, ..self }
    }
    /// Number of values of a point.
    pub fn n_bands(&self) -> usize {
        self.n_bands
    }
    /// The values of some points of a submap of a simulation, one point after the other; NaN where no ray meets the surface of the
    /// point. `shown` has the index of each point.
    pub fn values(
        &self,
        simulation: &Simulation,
        header: &SubmapHeader,
        points: &[SubmapPoint],
        shown: &[usize],
    ) -> Vec<f32> {
        let mut values = vec![f32::NAN; shown.len() * self.n_bands];
        let mut places: Vec<usize> = (0..shown.len()).collect();
        for number in 0..self.n_rays {
            self.trace(simulation, (header, points), (shown, &mut places, number), &mut values);
            places.retain(|place| values[place * self.n_bands].is_nan());
        }
        values
    }
    /// Traces the ray of this number to each place of `shown`.
    fn trace(
        &self,
        simulation: &Simulation,
        (header, points): (&SubmapHeader, &[SubmapPoint]),
        (shown, places, number): (&[usize], &mut [usize], u64),
        values: &mut [f32],
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
                    let (eye, at) = eye_and_point(sweep, &points[shown[*place]]);
                    let [eye, at] = [world(eye), world(at)];
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
                Some((group[i], (rays[i], hit)))
            });
            let (seen, hits): (Vec<usize>, Vec<(Ray, SceneHit)>) = seen.unzip();
            let suns = sun_on(&simulation.scene, &hits, |_| &snapshot);
            for ((place, (_, hit)), sun) in seen.into_iter().zip(&hits).zip(suns) {
                let part = self.palette.part(hit, sun, SKY_VIEW, 1.0);
                let of_point = &mut values[place * self.n_bands..][..self.n_bands];
                for (band, value) in of_point.iter_mut().enumerate() {
                    *value = (self.value)(self.palette.band(&part, band));
                }
            }
        }
    }
}

/// Position of the LiDAR when it saw a point, and the point, in the submap frame.
fn eye_and_point(sweep: &SubmapSweep, point: &SubmapPoint) -> ([f32; 3], [f32; 3]) {
    let share = (point.offset_nanos as f32 / sweep.duration_nanos.max(1) as f32).min(1.0);
    let (begin, end) = (&sweep.submap_from_lidar_begin, &sweep.submap_from_lidar_end);
    let at = [point.x, point.y, point.z];
    // The point minus the ray of the range image, with the rounding of that subtraction: published experiments depend on it.
    let eye = std::array::from_fn(|axis| at[axis] - (at[axis] - (begin[axis] + share * (end[axis] - begin[axis]))));
    (eye, at)
}
