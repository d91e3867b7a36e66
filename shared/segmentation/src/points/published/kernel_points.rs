//! Placement of kernel points: they repel each other and are attracted by the center, where the first one stays (Thomas
//! et al. 2019, supplement). The code uses only additions, multiplications, divisions and square roots, so it gives the
//! same numbers on every machine.

use random::Random;

/// Mean distance of the outer kernel points from the center, as a share of the radius.
const MEAN_RADIUS: f64 = 0.66;
/// Largest number of steps; 15 points converge after about 1500.
const STEPS: usize = 5000;
/// Step per force, its decay per step, and the longest step.
const STEP: f64 = 1e-2;
const DECAY: f64 = 0.9995;
const LONGEST: f64 = 0.05;
/// A placement has converged if no force changes by more.
const SETTLED: f64 = 1e-7;

/// Kernel points in a sphere of radius 1. The first is the center.
pub(super) fn kernel_points(n: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = Random::for_stream(seed, 0);
    let mut points = vec![[0.0; 3]];
    while points.len() < n {
        let point: [f64; 3] = std::array::from_fn(|_| f64::from(random.range(-1.0, 1.0)));
        if (0.01..0.5).contains(&squared(point)) {
            points.push(point);
        }
    }
    points.truncate(n);
    let mut step = STEP;
    let mut strengths = vec![0.0_f64; n];
    for _ in 0..STEPS {
        let forces: Vec<[f64; 3]> = (0..n).map(|i| force(&points, i)).collect();
        let mut change = 0.0_f64;
        for (i, force) in forces.iter().enumerate().skip(1) {
            let strength = squared(*force).sqrt();
            change = change.max((strength - strengths[i]).abs());
            strengths[i] = strength;
            let length = (step * strength).min(LONGEST) / (strength + 1e-6);
            (0..3).for_each(|axis| points[i][axis] += length * force[axis]);
        }
        step *= DECAY;
        if change < SETTLED {
            break;
        }
    }
    let mean = points[1..].iter().map(|point| squared(*point).sqrt()).sum::<f64>() / (n.max(2) - 1) as f64;
    let scale = if mean > 0.0 { MEAN_RADIUS / mean } else { 1.0 };
    points.into_iter().map(|point| point.map(|v| v * scale)).collect()
}

/// The points with a random rotation.
pub(super) fn turned(points: &[[f64; 3]], seed: u64) -> Vec<[f64; 3]> {
    let mut random = Random::for_stream(seed, 1);
    // A random unit quaternion, uniformly distributed.
    let [w, x, y, z] = loop {
        let q: [f64; 4] = std::array::from_fn(|_| f64::from(random.range(-1.0, 1.0)));
        let square = q.iter().map(|v| v * v).sum::<f64>();
        if (0.01..1.0).contains(&square) {
            break q.map(|v| v / square.sqrt());
        }
    };
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    points.iter().map(|p| rows.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])).collect()
}

/// Repulsion by all other points and attraction by the center.
fn force(points: &[[f64; 3]], i: usize) -> [f64; 3] {
    let mut force = points[i].map(|v| -10.0 * v);
    for (_, other) in points.iter().enumerate().filter(|(j, _)| *j != i) {
        let offset: [f64; 3] = std::array::from_fn(|axis| points[i][axis] - other[axis]);
        let square = squared(offset);
        let scale = 1.0 / (square * square.sqrt() + 1e-6);
        (0..3).for_each(|axis| force[axis] += scale * offset[axis]);
    }
    force
}

fn squared(p: [f64; 3]) -> f64 {
    p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outer_points_are_in_equilibrium_around_the_fixed_center() {
        let points = kernel_points(15, 1);
        assert_eq!(points[0], [0.0; 3]);
        let radii: Vec<f64> = points[1..].iter().map(|point| squared(*point).sqrt()).collect();
        assert!((radii.iter().sum::<f64>() / 14.0 - MEAN_RADIUS).abs() < 1e-12);
        // Equal forces on all sides: the points are spread evenly over a thin shell.
        assert!(radii.iter().all(|radius| (radius - MEAN_RADIUS).abs() < 0.05), "{radii:?}");
        let nearest = (1..15).map(|i| {
            let other = |j: &usize| squared(std::array::from_fn(|axis| points[i][axis] - points[*j][axis])).sqrt();
            (0..15).filter(|j| *j != i).map(|j| other(&j)).fold(f64::INFINITY, f64::min)
        });
        assert!(nearest.fold(f64::INFINITY, f64::min) > 0.5);
        assert_eq!(points, kernel_points(15, 1));
    }

    #[test]
    fn turned_points_keep_their_distances() {
        let points = kernel_points(15, 2);
        let turned = turned(&points, 7);
        assert!((squared(points[3]) - squared(turned[3])).abs() < 1e-12);
        let distance = |p: &[[f64; 3]]| squared(std::array::from_fn(|axis| p[4][axis] - p[9][axis]));
        assert!((distance(&points) - distance(&turned)).abs() < 1e-12);
        assert!(squared(std::array::from_fn(|axis| points[5][axis] - turned[5][axis])) > 1e-6);
    }
}
