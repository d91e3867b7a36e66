//! Odometry laid onto positions: where is north?

use geometry::{Isometry3, Point3, Pose, Translation3, UnitQuaternion};
use nalgebra::{Vector2, Vector3};

/// The same point in two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// m.
    pub p_in_odom: Point3<f64>,
    /// m, and wrong at times.
    pub p_in_world: Point3<f64>,
}

/// See [`first_guess`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// A turn about z and a translation.
    pub world_from_odom: Pose,
    /// Root mean square distance of the sightings that fit from their center, across the ground, m: the lever by which their
    /// errors turn the whole.
    pub spread_m: f64,
    /// Sightings that fit, weighed.
    pub n_fitting: f64,
}

/// Errors beyond which a sighting counts less than a quarter at the end, m: twice what a receiver under the open sky has.
const SCALE_M: f64 = 3.0;
/// From round to round, as in [`crate::PoseGraph::solve`].
const SHARPENING: f64 = 1.4;

/// Turn and translation that lay the most sightings upon each other (graduated non-convexity, Yang et al. 2020; within each
/// round the closed form of Umeyama 1991 in two dimensions). Height is the mean of differences. `None` without sightings.
pub fn first_guess(sightings: &[Sighting]) -> Option<Alignment> {
    if sightings.is_empty() {
        return None;
    }
    let mut weights = vec![1.0; sightings.len()];
    let mut alignment = weighted(sightings, &weights);
    let off = |alignment: &Alignment, sighting: &Sighting| {
        (alignment.world_from_odom * sighting.p_in_odom - sighting.p_in_world).xy().norm_squared()
    };
    let worst = sightings.iter().map(|sighting| off(&alignment, sighting)).fold(0.0, f64::max);
    let mut scale = 2.0 * worst.max(SCALE_M * SCALE_M);
    loop {
        for (weight, sighting) in weights.iter_mut().zip(sightings) {
            *weight = (scale / (off(&alignment, sighting) + scale)).powi(2);
        }
        alignment = weighted(sightings, &weights);
        if scale <= SCALE_M * SCALE_M {
            return Some(alignment);
        }
        scale = (scale / SHARPENING).max(SCALE_M * SCALE_M);
    }
}

fn weighted(sightings: &[Sighting], weights: &[f64]) -> Alignment {
    let total: f64 = weights.iter().sum();
    let pairs = || sightings.iter().zip(weights);
    let mean = |of: fn(&Sighting) -> Vector3<f64>| pairs().map(|(s, w)| of(s) * *w).sum::<Vector3<f64>>() / total;
    let (odom, world) = (mean(|s| s.p_in_odom.coords), mean(|s| s.p_in_world.coords));
    let (mut cosine, mut sine, mut squares) = (0.0, 0.0, 0.0);
    for (sighting, weight) in pairs() {
        let a: Vector2<f64> = (sighting.p_in_odom.coords - odom).xy();
        let b: Vector2<f64> = (sighting.p_in_world.coords - world).xy();
        cosine += weight * a.dot(&b);
        sine += weight * a.perp(&b);
        squares += weight * a.norm_squared();
    }
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sine.atan2(cosine));
    Alignment {
        world_from_odom: Isometry3::from_parts(Translation3::from(world - turn * odom), turn),
        spread_m: (squares / total).sqrt(),
        n_fitting: total,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sightings(is_wrong: impl Fn(usize) -> bool) -> (Pose, Vec<Sighting>) {
        let truth = Isometry3::new(Vector3::new(120.0, -40.0, 7.0), Vector3::z() * 2.2);
        let make = |k: usize| {
            let along = k as f64 * 5.0;
            let p_in_odom = Point3::new(along, 20.0 * (along / 60.0).sin(), 0.1);
            let off = if is_wrong(k) { Vector3::new(25.0, -40.0 + k as f64, 30.0) } else { Vector3::zeros() };
            Sighting { p_in_odom, p_in_world: truth * p_in_odom + off }
        };
        (truth, (0..40).map(make).collect())
    }

    #[test]
    fn the_turn_is_found_with_a_quarter_of_wrong_positions_in_a_row() {
        let (truth, sightings) = sightings(|k| (8..18).contains(&k));
        let found = first_guess(&sightings).expect("there are some");
        assert!(found.world_from_odom.rotation.angle_to(&truth.rotation) < 0.01);
        let off = (found.world_from_odom * sightings[20].p_in_odom - truth * sightings[20].p_in_odom).xy().norm();
        assert!(off < 0.5, "{off} m");
        assert!((29.0..31.0).contains(&found.n_fitting), "{}", found.n_fitting);
    }

    #[test]
    fn a_short_way_says_that_it_is_short() {
        let (_, sightings) = sightings(|_| false);
        assert!(first_guess(&sightings[..3]).expect("some").spread_m < 10.0);
        assert!(first_guess(&sightings).expect("some").spread_m > 50.0);
        assert_eq!(first_guess(&[]), None);
    }
}
