//! The colors of the pixels of a sweep, as an ideal camera at the LiDAR would see them.

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
    let values = IdealCamera::of_color().values(simulation, cloud.header, cloud.points, &shown);
    let mut colors = vec![[0.0; 3]; sweep.image.nearest.len()];
    for (pixel, value) in pixels.into_iter().zip(values.as_chunks::<3>().0) {
        if !value[0].is_nan() {
            colors[pixel] = *value;
        }
    }
    colors
}

#[cfg(test)]
mod tests {
    use super::*;
    use segmentation::ground;
    use segmentation::spherical::range_sweeps;
    use simulation::Town;
    use town_sweeps::{Mount, TownDrive};

    /// The published results of the color experiments have these colors.
    #[test]
    fn colors_of_simulated_sweeps_stay_the_same() {
        for (town, seed, mount, n_expected, expected) in [
            (Town::Urban, 501, Mount::Rig, 71_352_u32, [0.269_258, 0.264_597, 0.256_388]),
            (Town::Rural, 601, Mount::KITTI, 90_006, [0.283_768, 0.274_915, 0.261_687]),
        ] {
            let drive = TownDrive { town, seed, seconds: 30.0 };
            let simulation = drive.simulation().expect("makes a town");
            let (mut n, mut sums) = (0_u32, [0.0_f64; 3]);
            for submap in &drive.submaps_in(&simulation, 3, 1, 1, mount).expect("long enough") {
                let cloud = ModelInput::new(&submap.header, &submap.points);
                let heights_m = ground::heights(&cloud);
                for color in range_sweeps(&cloud, 1024, &heights_m)
                    .iter()
                    .flat_map(|sweep| colors(&simulation, &cloud, sweep))
                    .filter(|color| *color != [0.0; 3])
                {
                    n += 1;
                    sums.iter_mut().zip(color).for_each(|(sum, value)| *sum += f64::from(value));
                }
            }
            // Processors may round rays differently.
            assert!(n.abs_diff(n_expected) < 20, "{n} pixels");
            for (sum, expected) in sums.iter().zip(expected) {
                assert!((sum / f64::from(n) - expected).abs() < 1e-4, "{sums:?} of {n} pixels");
            }
        }
    }
}
