//! Ground of other streets: rougher than the simulator's, with lower kerbs, and seen by sensors of other noise.

use messages::ClassId;
use random::Random;

/// Limits of the changes of ground, for each output class.
pub struct GroundShape(Vec<Limits>);

/// Limits for one class, m; 0 for classes other than ground.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Limits {
    /// Largest standard deviation of the heights.
    ///
    /// In the real sweeps of HDL-64E, roads lie 0.5 to 1.2 cm from the plane of their neighbors, and grass and soil 1 to 2.5 cm; a Livox
    /// Avia shows roads with 0.6 to 3 cm. Leaves lie 3 to 15 cm from it: more roughness would make bushes out of grass.
    roughness_m: f32,
    /// Largest distance by which the class is lowered.
    lowered_m: f32,
}

/// Roughness of grass and soil, m.
const SOFT_M: f32 = 0.03;
/// Roughness of paved ground, m.
const PAVED_M: f32 = 0.02;
/// The simulator's kerbs are 0.14 m high; at driveways and crossings real ones are flush with the road.
const KERB_M: f32 = 0.14;

impl GroundShape {
    /// The limits of outputs with these class names.
    pub fn new(classes: &[String]) -> Self {
        use ClassId::{Ground, Road, RoadLine, Sidewalk, Terrain};
        let limits = |name: &String| match ClassId::ALL.iter().find(|class| class.name() == name) {
            Some(Terrain | Ground) => Limits { roughness_m: SOFT_M, lowered_m: 0.0 },
            Some(Road | RoadLine) => Limits { roughness_m: PAVED_M, lowered_m: 0.0 },
            Some(Sidewalk) => Limits { roughness_m: PAVED_M, lowered_m: KERB_M },
            _ => Limits::default(),
        };
        Self(classes.iter().map(limits).collect())
    }

    /// Draws how each class is lowered and the standard deviation of its heights, then passes each index of `truth` whose class is ground to
    /// `move_by`, with the change of its height, m.
    pub fn each_change(&self, truth: &[u8], random: &mut Random, mut move_by: impl FnMut(usize, f32)) {
        let draw = |limits: &Limits| Limits {
            roughness_m: limits.roughness_m * random.unit(),
            lowered_m: if limits.lowered_m > 0.0 { limits.lowered_m * random.unit() } else { 0.0 },
        };
        let drawn: Vec<Limits> = self.0.iter().map(draw).collect();
        for (index, class) in truth.iter().enumerate() {
            if let Some(drawn) = drawn.get(usize::from(*class)).filter(|drawn| **drawn != Limits::default()) {
                move_by(index, drawn.roughness_m * random.gauss() - drawn.lowered_m);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_ground_changes_grass_is_rougher_than_roads_and_sidewalks_sink() {
        let classes = ["building", "road", "terrain", "sidewalk"].map(str::to_owned);
        let shape = GroundShape::new(&classes);
        let truth: Vec<u8> = (0..4000).map(|i| (i % 4) as u8).collect();
        // Largest root mean square of the changes of each class, and lowest mean.
        let mut most = [0.0_f32; 4];
        let mut lowest = [0.0_f32; 4];
        for seed in 0..100 {
            let mut sums = [0.0; 4];
            let mut squares = [0.0; 4];
            shape.each_change(&truth, &mut Random::new(seed), |index, change_m| {
                sums[index % 4] += change_m;
                squares[index % 4] += change_m * change_m;
            });
            for class in 0..4 {
                most[class] = most[class].max((squares[class] / 1000.0_f32).sqrt());
                lowest[class] = lowest[class].min(sums[class] / 1000.0);
            }
        }
        assert_eq!(most[0], 0.0);
        assert!((0.015..1.1 * PAVED_M).contains(&most[1]) && (0.025..1.1 * SOFT_M).contains(&most[2]), "{most:?}");
        assert!((-1.02 * KERB_M..-0.9 * KERB_M).contains(&lowest[3]) && lowest[2] > -0.005, "{lowest:?}");
    }
}
