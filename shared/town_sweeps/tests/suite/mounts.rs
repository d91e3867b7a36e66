//! Random lidars of the training.

use simulation::Town;
use std::collections::BTreeSet;
use town_sweeps::{Mount, TownDrive};

#[test]
fn random_mounts_have_all_numbers_of_rings_and_some_have_none() {
    let drive = TownDrive { town: Town::Rural, seed: 9101, seconds: 4.0 };
    let submaps = drive.submaps(24, 1, 1, Mount::Random).expect("makes a town");
    let rings: BTreeSet<u32> = submaps.iter().map(|submap| submap.header.n_rings).collect();
    assert_eq!(rings, BTreeSet::from([0, 16, 32, 64]));
    let heights_m: Vec<f32> = submaps
        .iter()
        .map(|submap| {
            // The origin of the submap is the body frame, 1 m above the road.
            submap.header.sweeps[0].submap_from_lidar_begin[2] + 1.0
        })
        .collect();
    assert!(heights_m.iter().all(|height| (0.9..3.2).contains(height)), "{heights_m:?}");
    let spread = heights_m.iter().copied().fold(0.0, f32::max) - heights_m.iter().copied().fold(9.0, f32::min);
    assert!(spread > 0.7, "{heights_m:?}");
}
