//! Spectra of points compared with the spectra of their materials.

use crate::score::Table;
use crate::{Part, SubmapPoint};
use coloring::ProjectionCamera;
use geometry::{RigCamera, Stamp};
use messages::{CubeHeader, CubeView};
use raytrace::Ray;
use simulation::light::sun_direction;

/// Smallest number of bands for a meaningful angle.
const MIN_BANDS: usize = 8;
/// Distance of shadow rays from the surface, so that it does not shade itself, m.
const OFF_M: f32 = 0.1;

impl Part<'_> {
    /// Spectra of one mosaic camera as the stage samples them: the cell under the pixel of the chosen exposure.
    pub fn spectra(&self, points: &[SubmapPoint], index: usize) -> Table {
        let spec = &self.town.simulation.rig.mosaics[index];
        let model = spec.lens.clone();
        let camera = ProjectionCamera::from(&RigCamera { body_from_camera: spec.body_from_camera, model });
        let mut exposures = Vec::new();
        let mut true_exposures = Vec::new();
        let mut cubes = Vec::new();
        for cube in self.recorded.cubes.iter().filter(|cube| self.is_near(cube.stamp())) {
            let header = cube.header();
            let odom_from_body = self.recorded.trajectory.at(Stamp(cube.stamp()));
            let (Some(odom_from_body), Some(cells)) = (odom_from_body, CubeView::new(header, cube.rows())) else {
                continue;
            };
            if header.camera as usize != index {
                continue;
            }
            let area = [header.x0, header.y0, header.width * header.pattern, header.height * header.pattern];
            exposures.push(camera.exposure_of_area(cube.stamp(), &odom_from_body, &self.odom_from_submap, area));
            true_exposures.push(self.town.exposure(cube.stamp(), &spec.body_from_camera, &spec.lens));
            cubes.push((header, cells));
        }
        self.tables(points, &exposures, None, |truth, chosen, score| {
            let (Some((exposure, pixel)), Some(material), false) = (chosen, truth.material, truth.moves) else {
                return;
            };
            let (header, cells) = &cubes[exposure];
            let Some((bands, spectrum)) = spectrum(header, cells, pixel) else { return };
            // Occluded points are counted with the colors.
            if self.town.occluder(&true_exposures[exposure], &truth.p).is_some() {
                return;
            }
            let at_truth =
                true_exposures[exposure].pixel(&truth.p).and_then(|pixel| spectrum_of(header, cells, pixel, bands));
            score.angles_to_cell.extend(at_truth.map(|at_truth| angle(&spectrum, &at_truth)));
            let of_material = material.spectrum();
            let expected: Vec<f64> =
                places(bands).map(|band| f64::from(of_material.at(header.wavelengths_nm[band]))).collect();
            let sun = sun_direction();
            let origin = truth.p.coords.cast::<f32>() + sun * OFF_M;
            let ray = Ray { origin, direction: sun, seed: 0 };
            let is_shaded = self.town.simulation.scene.is_blocked(&true_exposures[exposure].snapshot, &ray, 250.0);
            score.angles_to_material[usize::from(is_shaded)].push(angle(&spectrum, &expected));
        })
    }
}

/// Valid bands and their reflectances in the cell of a pixel.
fn spectrum(header: &CubeHeader, cells: &CubeView<'_>, pixel: [f32; 2]) -> Option<(u32, Vec<f64>)> {
    let in_use = (1_u64 << header.n_bands) - 1;
    let bands = cells.masks()[cell(header, pixel)] & header.valid_bands & in_use as u32;
    (bands.count_ones() as usize >= MIN_BANDS).then_some(())?;
    Some((bands, spectrum_of(header, cells, pixel, bands)?))
}

/// Reflectances of given bands in the cell of a pixel. `None` if one of them is invalid or the pixel is outside the active area.
fn spectrum_of(header: &CubeHeader, cells: &CubeView<'_>, pixel: [f32; 2], bands: u32) -> Option<Vec<f64>> {
    let [x, y] = [pixel[0] + 0.5 - header.x0 as f32, pixel[1] + 0.5 - header.y0 as f32];
    let is_inside = |at: f32, n: u32| at >= 0.0 && at < (n * header.pattern) as f32;
    let cell = (is_inside(x, header.width) && is_inside(y, header.height)).then(|| cell(header, pixel))?;
    let are_valid = cells.masks()[cell] & bands == bands;
    are_valid.then(|| places(bands).map(|band| f64::from(cells.band(band)[cell])).collect())
}

fn cell(header: &CubeHeader, [u, v]: [f32; 2]) -> usize {
    let index = |at: f32, first: u32, n: u32| (((at + 0.5 - first as f32).max(0.0) as u32) / header.pattern).min(n - 1);
    (index(v, header.y0, header.height) * header.width + index(u, header.x0, header.width)) as usize
}

fn places(bands: u32) -> impl Iterator<Item = usize> {
    (0..32).filter(move |band| bands >> band & 1 == 1)
}

/// Spectral angle, rad (Kruse et al. 1993).
fn angle(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt().max(1e-12)).clamp(-1.0, 1.0).acos()
}
