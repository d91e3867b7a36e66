//! Random changes of training spheres for networks on points, in addition to the ones of their positions and colors.

use super::ground_shape::GroundShape;
use super::{random_exponent, random_gain, random_height_error_m};
use random::Random;
use segmentation::points::CellCloud;
use training::ClassifiedCells;

/// Share of the spheres with intensities that imitate another sensor.
const FOREIGN: f32 = 0.5;
/// Share of the spheres of other sensors whose surfaces have intensities independent of their class.
const BY_SURFACE: f32 = 0.5;
/// Side of a surface with one reflectance, m: the width of a shop front, the length of a car.
const SURFACE_M: f32 = 3.0;
/// Largest distance of ground cells from the ground, m.
const GROUND_M: f32 = 0.15;
/// Fewest ground cells whose median is known.
const MIN_GROUND: usize = 50;

/// Changes the heights of the ground.
pub fn reshape_ground(sphere: &mut ClassifiedCells, ground_shape: &GroundShape, random: &mut Random) {
    let ClassifiedCells { cloud, truth } = sphere;
    ground_shape.each_change(truth, random, |cell, change_m| {
        cloud.positions[cell][2] += change_m;
        cloud.heights_m[cell] += change_m;
    });
}

/// Adds one error to all heights above the ground.
pub fn shift_heights(cloud: &mut CellCloud, random: &mut Random) {
    let error_m = random_height_error_m(random);
    cloud.heights_m.iter_mut().for_each(|height| *height += error_m);
}

/// Changes the intensities as another sensor would, and scales them to the median of the ground in the training data as `infer` does.
/// Without this median only the gain changes.
pub fn change_intensities(sphere: &mut ClassifiedCells, trained_median: Option<u8>, random: &mut Random) {
    let ClassifiedCells { cloud, truth } = sphere;
    let Some(median) = trained_median.filter(|median| *median > 0 && random.chance(FOREIGN)).map(f32::from) else {
        let gain = random_gain(random);
        return cloud.intensities.iter_mut().for_each(|intensity| *intensity = (*intensity * gain).min(255.0));
    };
    let exponent = random_exponent(random);
    let of_class: Vec<f32> = (0..=u8::MAX).map(|_| (0.4 * random.gauss()).exp()).collect();
    let is_by_surface = random.chance(BY_SURFACE);
    let seed = random.bits();
    for ((intensity, class), position) in cloud.intensities.iter_mut().zip(truth.iter()).zip(&cloud.positions) {
        let factor =
            if is_by_surface { surface_factor(seed, *class, *position) } else { of_class[usize::from(*class)] };
        *intensity = median * factor * (*intensity / median).powf(exponent);
    }
    let ground = cloud.heights_m.iter().zip(&cloud.intensities).filter(|(height_m, _)| height_m.abs() < GROUND_M);
    let mut ground: Vec<f32> = ground.map(|(_, intensity)| *intensity).collect();
    if ground.len() < MIN_GROUND {
        return cloud.intensities.clear();
    }
    let middle = ground.len() / 2;
    let (_, found, _) = ground.select_nth_unstable_by(middle, f32::total_cmp);
    let gain = median / found.max(1e-3);
    cloud.intensities.iter_mut().for_each(|intensity| *intensity = (*intensity * gain).min(255.0));
}

/// Factor of the surface around a cell: equal for cells of a class in a square of the top view.
fn surface_factor(seed: u64, class: u8, [x, y, _]: [f32; 3]) -> f32 {
    let [x, y] = [x, y].map(|v| (v / SURFACE_M).floor() as i32 as u32);
    let stream = (u64::from(x) << 32 | u64::from(y)).wrapping_mul(31).wrapping_add(u64::from(class));
    (0.6 * Random::for_stream(seed, stream).gauss()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of ground with intensity 12, and a wall with 40.
    fn street() -> ClassifiedCells {
        let ground = (0..1600).map(|i| [0.25 * (i % 40) as f32, 0.25 * (i / 40) as f32, 0.0]);
        let wall = (0..400).map(|i| [0.0, 0.25 * (i % 40) as f32, 0.5 + 0.25 * (i / 40) as f32]);
        let positions: Vec<[f32; 3]> = ground.chain(wall).collect();
        let is_ground = |i: usize| i < 1600;
        let cloud = CellCloud {
            heights_m: positions.iter().map(|p| p[2]).collect(),
            intensities: (0..2000).map(|i| if is_ground(i) { 12.0 } else { 40.0 }).collect(),
            colors: Vec::new(),
            positions,
        };
        ClassifiedCells { cloud, truth: (0..2000).map(|i| u8::from(!is_ground(i))).collect() }
    }

    #[test]
    fn changed_intensities_keep_the_median_of_the_ground() {
        let mut n_foreign = 0;
        for seed in 0..60 {
            let mut sphere = street();
            change_intensities(&mut sphere, Some(12), &mut Random::new(seed));
            let mut ground = sphere.cloud.intensities[..1600].to_vec();
            ground.sort_by(f32::total_cmp);
            assert!((8.0..17.0).contains(&ground[800]), "seed {seed}: {}", ground[800]);
            n_foreign += usize::from((ground[800] - 12.0).abs() < 1e-3);
        }
        assert!((20..40).contains(&n_foreign), "{n_foreign}");
    }

    #[test]
    fn without_median_only_the_gain_changes() {
        let mut sphere = street();
        change_intensities(&mut sphere, None, &mut Random::new(1));
        let gain = random_gain(&mut Random::new(1));
        assert!(sphere.cloud.intensities.iter().take(1600).all(|intensity| *intensity == 12.0 * gain));
    }

    #[test]
    fn rough_ground_moves_with_its_height() {
        let mut sphere = street();
        let ground_shape = GroundShape::new(&["road", "building"].map(str::to_owned));
        reshape_ground(&mut sphere, &ground_shape, &mut Random::new(3));
        let ClassifiedCells { cloud, .. } = sphere;
        assert!(cloud.positions.iter().zip(&cloud.heights_m).all(|(position, height)| position[2] == *height));
        let moved = cloud.heights_m[..1600].iter().filter(|height| **height != 0.0).count();
        assert!(moved > 1500 && street().cloud.heights_m[1600..] == cloud.heights_m[1600..], "{moved}");
    }
}
