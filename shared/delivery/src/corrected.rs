//! Correction of the trajectory by the placement of the submaps.

use crate::world::PlacedSubmap;
use geometry::{Pose, Trajectory, interpolate};

/// Converts `odom_from_body` to `world_from_body`. The correction of a pose is interpolated in time between the
/// corrections of its submap and the next one, so the trajectory has no steps. At the first shot of a submap only its own
/// correction applies. The first and the last correction also apply before the first and after the last submap.
pub fn corrected(odometry: &Trajectory, submaps: &[PlacedSubmap]) -> Trajectory {
    let mut world = Trajectory::default();
    for (stamp, odom_from_body) in odometry.poses() {
        let next = submaps.partition_point(|submap| submap.stamp <= *stamp);
        let moved = |submap: &PlacedSubmap| submap.world_from_odom() * odom_from_body;
        let pose: Pose = match (next.checked_sub(1).map(|k| &submaps[k]), submaps.get(next)) {
            (Some(before), Some(after)) => {
                let share = stamp.seconds_since(before.stamp) / after.stamp.seconds_since(before.stamp);
                interpolate(&moved(before), &moved(after), share)
            }
            (Some(only), None) | (None, Some(only)) => moved(only),
            (None, None) => *odom_from_body,
        };
        // The stamps come from a trajectory, so they do not decrease.
        world.push(*stamp, pose);
    }
    world
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, Stamp, Vector3};
    use messages::PoseDeviation;

    fn submap(seconds: i64, odom_from_submap: Pose, world_from_odom: Pose) -> PlacedSubmap {
        PlacedSubmap {
            stamp: Stamp(seconds * 1_000_000_000),
            odom_from_submap,
            world_from_submap: world_from_odom * odom_from_submap,
            sigma_m: [0.0; 3],
            sigma_rad: [0.0; 3],
            deviation: PoseDeviation::default(),
        }
    }

    #[test]
    fn trajectory_follows_its_submaps_without_steps() {
        let along = |x: f64| Isometry3::translation(x, 0.0, 0.0);
        let turned = Isometry3::new(Vector3::new(500.0, 20.0, 1.0), Vector3::new(0.0, 0.0, 1.2));
        let more = Isometry3::new(Vector3::new(500.3, 20.1, 1.1), Vector3::new(0.0, 0.0, 1.21));
        let submaps = [submap(10, along(0.0), turned), submap(12, along(20.0), more)];
        let mut odometry = Trajectory::default();
        for k in 0..60 {
            odometry.push(Stamp(9_000_000_000 + k * 100_000_000), along(k as f64 - 10.0));
        }
        let world = corrected(&odometry, &submaps);
        let at = |seconds: f64| world.at(Stamp((seconds * 1e9) as i64)).expect("there");
        let off = |seconds: f64, world_from_odom: &Pose| {
            let expected = world_from_odom * odometry.at(Stamp((seconds * 1e9) as i64)).expect("there");
            (at(seconds).translation.vector - expected.translation.vector).norm()
        };
        // At the first shot of each submap, before the first and after the last submap.
        assert!(off(10.0, &turned) < 1e-9 && off(9.0, &turned) < 1e-9);
        assert!(off(12.0, &more) < 1e-9 && off(14.0, &more) < 1e-9);
        assert!(
            off(11.0, &turned) > 0.1 && off(11.0, &more) > 0.1,
            "half way between two submaps the correction is interpolated"
        );
        let steps = world.poses().windows(2).map(|p| (p[1].1.translation.vector - p[0].1.translation.vector).norm());
        let longest = steps.fold(0.0, f64::max);
        assert!(longest < 1.05, "{longest} m between poses, expected about 1 m");
    }
}
