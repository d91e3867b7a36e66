//! The colors of the pixels of a sweep, as an ideal camera at the LiDAR would measure them.

use geometry::NO_POINT;
use segmentation::ModelInput;
use segmentation::spherical::RangeSweep;
use simulation::Simulation;
use town_sweeps::IdealCamera;

/// Red, green and blue of each pixel, 0 to 1; zeros without a hit.
pub fn colors(simulation: &Simulation, cloud: &ModelInput<'_>, sweep: &RangeSweep) -> Vec<[f32; 3]> {
    let (pixels, shown): (Vec<usize>, Vec<usize>) = (sweep.image.nearest.iter().enumerate())
        .filter(|(_, point)| **point != NO_POINT)
        .map(|(pixel, point)| (pixel, sweep.points.start + *point as usize))
        .unzip();
    let values = IdealCamera::color().values(simulation, cloud.header, cloud.points, &shown);
    let mut colors = vec![[0.0; 3]; sweep.image.nearest.len()];
    for (pixel, value) in pixels.into_iter().zip(values.as_chunks::<3>().0) {
        if !value[0].is_nan() {
            colors[pixel] = *value;
        }
    }
    colors
}
