//! Live heap bytes over rounds around the same block. The test is a separate program because it counts all allocations.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod block;
#[path = "../suite/matched.rs"]
mod matched;

use block::{LAP_SUBMAPS, Vehicle, local_map};
use cap::Cap;
use geometry::Point3;
use georeference::{GeoreferenceSettings, Georeferencer};
use registration::LocalMap;
use std::alloc::System;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

fn settings() -> GeoreferenceSettings {
    GeoreferenceSettings {
        gnss: true,
        imu: true,
        loops: true,
        unsmooth_fixes: false,
        antenna_in_body: Point3::origin(),
        imu_in_body: Point3::origin(),
        origin: None,
        max_keyframes: 1000,
    }
}

/// Bytes that a submap of 20 m and two seconds keeps until the end of the drive: its pose, the measurements of
/// odometry, loop and gravity (860 bytes), and two fixes (480 bytes). A growing vector reserves up to twice its length.
const MAX_BYTES_PER_SUBMAP: usize = 2 * 1340;
/// Largest size of a keyframe in bytes, see `Keyframe`.
const MAX_BYTES_PER_PLACE: usize = 81_000;

#[test]
fn rounds_around_the_same_block_keep_a_keyframe_for_each_place_and_the_measurements() {
    let maps: Vec<LocalMap> = (0..LAP_SUBMAPS).map(local_map).collect();
    let settings = settings();
    let mut georeferencer = Georeferencer::new(&settings);
    let mut vehicle = Vehicle::default();
    let begin = MEMORY.allocated();
    let mut live = |n_laps: usize| {
        let mut n_loops = 0;
        for _ in 0..n_laps * LAP_SUBMAPS {
            n_loops += usize::from(vehicle.drive_submap(&mut georeferencer, &settings, &maps));
        }
        (MEMORY.allocated() - begin, n_loops)
    };
    let (first, _) = live(1);
    println!("{first} bytes after the first of {LAP_SUBMAPS} submaps");
    assert!(first < LAP_SUBMAPS * (MAX_BYTES_PER_PLACE + MAX_BYTES_PER_SUBMAP), "{first} bytes after a round");
    let mut before = first;
    let mut n_laps = 1;
    // As many rounds again each time.
    for _ in 0..3 {
        let (after, n_loops) = live(n_laps);
        let n_submaps = n_laps * LAP_SUBMAPS;
        assert!(n_loops > n_submaps * 9 / 10, "{n_loops} of {n_submaps} places recognized");
        let per_submap = after.saturating_sub(before) / n_submaps;
        println!("{n_laps} more rounds: {n_loops} of {n_submaps} places recognized, {per_submap} bytes per submap");
        assert!(per_submap < MAX_BYTES_PER_SUBMAP, "{per_submap} bytes per submap after {n_laps} more rounds");
        before = after;
        n_laps *= 2;
    }
}
