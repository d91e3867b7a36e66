//! Random augmentation of training spheres (thesis 6.3.2), which prevents memorized shapes and colors. All functions
//! depend only on their arguments.

use random::Random;
use serde::{Deserialize, Serialize};

/// Largest number of nodes of the grid of an elastic distortion along each axis; larger spheres get larger cells.
const MOST_NODES: usize = 128;

/// Settings of the augmentation. The default has the values of the thesis; 0 disables a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Augmentation {
    /// Elastic distortions, applied in order.
    pub elastic: Vec<Elastic>,
    /// Probability of the elastic distortions.
    pub elastic_probability: f32,
    /// Standard deviation of the noise of each coordinate, m.
    pub noise_m: f32,
    /// Rotation about the vertical axis.
    pub rotation: bool,
    /// Each axis is scaled by 1 - `scale` to 1 + `scale`.
    pub scale: f32,
    /// Probability of mirroring x, and of mirroring y.
    pub symmetry: f32,
    /// Standard deviation of the noise of each color, as a share of full scale.
    pub chromatic: f32,
    /// Probability that a sphere has no colors: all are set to 0.
    pub color_dropout: f32,
}

/// Smooth random displacements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Elastic {
    /// Distance between the nodes with random displacements, m.
    pub cell_m: f32,
    /// Standard deviation of the displacements before smoothing, m.
    pub magnitude_m: f32,
}

impl Default for Augmentation {
    fn default() -> Self {
        Self {
            elastic: vec![Elastic { cell_m: 0.2, magnitude_m: 0.4 }, Elastic { cell_m: 0.8, magnitude_m: 1.6 }],
            elastic_probability: 0.95,
            noise_m: 0.1,
            rotation: true,
            scale: 0.2,
            symmetry: 0.5,
            chromatic: 0.05,
            color_dropout: 0.2,
        }
    }
}

impl Augmentation {
    /// The first violated rule, or `None`.
    pub fn problem(&self) -> Option<String> {
        // All conditions are false for NaN.
        let shares = [
            ("elastic_probability", self.elastic_probability),
            ("symmetry", self.symmetry),
            ("color_dropout", self.color_dropout),
        ];
        let lengths = [("noise_m", self.noise_m), ("chromatic", self.chromatic)];
        let elastic = self.elastic.iter().flat_map(|elastic| [elastic.cell_m, elastic.magnitude_m]);
        let wrong = |what: &str, value: f32, rule: &str| Some(format!("{what} = {value}; must be {rule}"));
        if let Some((key, value)) = shares.into_iter().find(|(_, value)| !(0.0..=1.0).contains(value)) {
            return wrong(key, value, "0 to 1");
        }
        if let Some((key, value)) = lengths.into_iter().find(|(_, value)| !(0.0..=100.0).contains(value)) {
            return wrong(key, value, "0 to 100");
        }
        if !(0.0..1.0).contains(&self.scale) {
            return wrong("scale", self.scale, "at least 0 and less than 1");
        }
        let mut invalid = elastic.filter(|length| !(1e-3..=1e3).contains(length));
        invalid.next().and_then(|length| wrong("a length of elastic", length, "0.001 to 1000"))
    }
    /// Augments positions, m, relative to the center of the sphere, and colors of 0 to 1. Returns the factor of the
    /// heights.
    pub fn apply(&self, positions: &mut [[f32; 3]], colors: &mut [[f32; 3]], random: &mut Random) -> f32 {
        if random.chance(self.elastic_probability) {
            self.elastic.iter().for_each(|elastic| distort(positions, *elastic, random));
        }
        add_noise(positions, self.noise_m, random);
        if self.rotation {
            rotate(positions, random.range(0.0, std::f32::consts::TAU));
        }
        let factors: [f32; 3] = std::array::from_fn(|_| random.range(1.0 - self.scale, 1.0 + self.scale));
        scale(positions, factors);
        let mirrored = [random.chance(self.symmetry), random.chance(self.symmetry), false];
        scale(positions, mirrored.map(|mirrored| if mirrored { -1.0 } else { 1.0 }));
        add_noise(colors, self.chromatic, random);
        colors.as_flattened_mut().iter_mut().for_each(|color| *color = color.clamp(0.0, 1.0));
        if random.chance(self.color_dropout) {
            colors.fill([0.0; 3]);
        }
        factors[2]
    }
}

/// Adds noise to each value.
pub fn add_noise(rows: &mut [[f32; 3]], deviation: f32, random: &mut Random) {
    rows.as_flattened_mut().iter_mut().for_each(|value| *value += deviation * random.gauss());
}

/// Rotates about the vertical axis, rad.
pub fn rotate(positions: &mut [[f32; 3]], angle: f32) {
    let (sin, cos) = angle.sin_cos();
    for [x, y, _] in positions {
        (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
    }
}

/// Scales each axis by its own factor.
pub fn scale(positions: &mut [[f32; 3]], factors: [f32; 3]) {
    for position in positions {
        (0..3).for_each(|axis| position[axis] *= factors[axis]);
    }
}

/// Elastic distortion (Simard et al. 2003; as in `MinkowskiEngine`): random displacements at the nodes of a grid,
/// smoothed twice by means of three nodes along each axis, and linear interpolation between them. Points with non-finite
/// coordinates are unchanged.
pub fn distort(positions: &mut [[f32; 3]], elastic: Elastic, random: &mut Random) {
    let finite = || positions.iter().filter(|position| position.iter().all(|v| v.is_finite()));
    let low: [f32; 3] = std::array::from_fn(|axis| finite().fold(f32::INFINITY, |low, p| low.min(p[axis])));
    let high: [f32; 3] = std::array::from_fn(|axis| finite().fold(f32::NEG_INFINITY, |high, p| high.max(p[axis])));
    let longest = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f32::max);
    let cell = elastic.cell_m.max(longest / (MOST_NODES - 3) as f32);
    if finite().next().is_none() || !(cell > 0.0 && cell.is_finite()) {
        return;
    }
    // A node before the first point, and two after the last.
    let nodes: [usize; 3] = std::array::from_fn(|axis| ((high[axis] - low[axis]) / cell) as usize + 3);
    let n = nodes.iter().product();
    let mut field: Vec<[f32; 3]> = (0..n).map(|_| std::array::from_fn(|_| random.gauss())).collect();
    for _ in 0..2 {
        for axis in 0..3 {
            field = smoothed(&field, nodes, axis);
        }
    }
    let steps = [nodes[1] * nodes[2], nodes[2], 1];
    for position in positions.iter_mut().filter(|position| position.iter().all(|v| v.is_finite())) {
        let at: [f32; 3] = std::array::from_fn(|axis| (position[axis] - low[axis]) / cell + 1.0);
        let first: [usize; 3] = std::array::from_fn(|axis| (at[axis] as usize).min(nodes[axis] - 2));
        let mut displacement = [0.0; 3];
        for corner in 0..8 {
            let mut node = 0;
            let mut weight = 1.0;
            for axis in 0..3 {
                let upper = corner >> axis & 1;
                let fraction = at[axis] - first[axis] as f32;
                node += (first[axis] + upper) * steps[axis];
                weight *= if upper == 1 { fraction } else { 1.0 - fraction };
            }
            (0..3).for_each(|axis| displacement[axis] += weight * field[node][axis]);
        }
        (0..3).for_each(|axis| position[axis] += elastic.magnitude_m * displacement[axis]);
    }
}

/// The mean of three nodes along an axis; nodes outside the grid have no displacement.
fn smoothed(field: &[[f32; 3]], nodes: [usize; 3], axis: usize) -> Vec<[f32; 3]> {
    let step: usize = nodes[axis + 1..].iter().product();
    let mean = |node: usize| {
        let place = node / step % nodes[axis];
        let before = if place > 0 { field[node - step] } else { [0.0; 3] };
        let after = if place + 1 < nodes[axis] { field[node + step] } else { [0.0; 3] };
        std::array::from_fn(|i| (before[i] + field[node][i] + after[i]) / 3.0)
    };
    (0..field.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(n: usize) -> Vec<[f32; 3]> {
        let mut random = Random::new(1);
        (0..n).map(|_| std::array::from_fn(|_| random.range(-5.0, 5.0))).collect()
    }

    #[test]
    fn elastic_distortion_moves_neighbors_together() {
        let mut positions = cube(2000);
        let near: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|v| v + 0.01)).collect();
        let before = positions.clone();
        positions.extend(near);
        let elastic = Elastic { cell_m: 0.8, magnitude_m: 1.6 };
        distort(&mut positions, elastic, &mut Random::new(2));
        let moved = |i: usize| -> f32 { (0..3).map(|a| (positions[i][a] - before[i][a]).powi(2)).sum::<f32>().sqrt() };
        let mean = (0..2000).map(moved).sum::<f32>() / 2000.0;
        // Six means of three nodes reduce the deviation of a node from 1 to (19 / 81)^(3 / 2) = 0.11, interpolation by up to half of it.
        assert!((0.06..0.35).contains(&mean), "{mean}");
        for i in 0..2000 {
            let apart = (0..3).map(|a| (positions[i + 2000][a] - positions[i][a] - 0.01).powi(2)).sum::<f32>().sqrt();
            assert!(apart < 0.03, "{apart}");
        }
        let mut again = before.clone();
        distort(&mut again, elastic, &mut Random::new(3));
        assert_ne!(again[..], positions[..2000]);
    }

    #[test]
    fn elastic_distortion_of_unusual_clouds_stays_bounded() {
        for cloud in [
            vec![],
            vec![[1.0; 3]],
            vec![[f32::NAN; 3], [0.0; 3]],
            vec![[-1e9; 3], [1e9; 3]],
            vec![[-3e38; 3], [3e38; 3]],
        ] {
            let mut positions = cloud.clone();
            distort(&mut positions, Elastic { cell_m: 0.2, magnitude_m: 0.4 }, &mut Random::new(2));
            let are_finite = |points: &[[f32; 3]]| points.iter().map(|p| p[0].is_finite()).collect::<Vec<_>>();
            assert_eq!(are_finite(&positions), are_finite(&cloud));
        }
    }

    #[test]
    fn scale_of_augmentation_differs_by_axis_and_stays_within_bounds() {
        let only_scale = Augmentation {
            elastic_probability: 0.0,
            noise_m: 0.0,
            rotation: false,
            symmetry: 0.0,
            chromatic: 0.0,
            color_dropout: 0.0,
            ..Augmentation::default()
        };
        let mut random = Random::new(3);
        let mut factors = Vec::new();
        for _ in 0..200 {
            let mut positions = vec![[1.0; 3]];
            only_scale.apply(&mut positions, &mut [], &mut random);
            assert!(positions[0].iter().all(|v| (0.8..=1.2).contains(v)), "{positions:?}");
            assert!(positions[0][0] != positions[0][1] && positions[0][1] != positions[0][2]);
            factors.push(positions[0][2]);
        }
        assert!(factors.iter().any(|f| *f < 0.85) && factors.iter().any(|f| *f > 1.15));
    }

    #[test]
    fn colors_are_dropped_with_the_given_probability_and_stay_in_range() {
        let mut random = Random::new(4);
        let mut dropped = 0;
        for _ in 0..2000 {
            let mut colors = vec![[0.0, 0.5, 1.0]; 8];
            Augmentation::default().apply(&mut [[1.0; 3]; 8], &mut colors, &mut random);
            assert!(colors.as_flattened().iter().all(|color| (0.0..=1.0).contains(color)));
            let all_dropped = colors.iter().all(|color| *color == [0.0; 3]);
            assert_eq!(all_dropped, colors.iter().any(|color| color[2] == 0.0), "all colors of a sphere or none");
            dropped += usize::from(all_dropped);
        }
        assert!((340..460).contains(&dropped), "{dropped} of 2000, expected 400");
    }

    #[test]
    fn chromatic_noise_has_its_standard_deviation() {
        let mut colors = vec![[0.5; 3]; 10_000];
        add_noise(&mut colors, 0.05, &mut Random::new(5));
        let squares = colors.as_flattened().iter().map(|color| f64::from(color - 0.5).powi(2)).sum::<f64>();
        assert!(((squares / 30_000.0).sqrt() - 0.05).abs() < 0.001);
    }

    #[test]
    fn rotation_keeps_heights_and_distances_from_the_axis() {
        let before = cube(100);
        let mut after = cube(100);
        rotate(&mut after, 1.2);
        for (before, after) in before.iter().zip(&after) {
            assert_eq!(before[2], after[2]);
            assert!((before[0].hypot(before[1]) - after[0].hypot(after[1])).abs() < 1e-5);
            assert!((before[0] - after[0]).abs() + (before[1] - after[1]).abs() > 0.0);
        }
    }
}
