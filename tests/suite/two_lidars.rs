//! A vehicle with two LiDARs through the real stages: both are in the clouds, and the bytes are the same whatever happens to the processes.

use formats::ply::Vertices;
use replica_tests::{Launch, output_text, pipeline, reference, result_files, two_lidar_drive, wait_for};
use rustix::process::{Signal, kill_process};

fn launch() -> Launch {
    pipeline(&two_lidar_drive(), "", "")
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn clouds_of_two_lidars_are_the_same_after_a_kill() {
    let calm = launch();
    let output = calm.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let expected = result_files(&calm.output());
    let mut n_of = [0_usize; 2];
    let number = |name: &str| name.strip_prefix("submap_")?.strip_suffix(".ply")?.parse::<u32>().ok();
    for name in expected.keys().filter(|name| number(name).is_some()) {
        let cloud = Vertices::load(&calm.output().join("clouds").join(name)).expect("a PLY file");
        for lidar in cloud.u8s("lidar").expect("has the column") {
            n_of[usize::from(lidar)] += 1;
        }
    }
    assert!(n_of[1] * 5 > n_of[0] && n_of[0] > 100_000, "{n_of:?}");
    let n_sweeps = calm.stage_summary("acquire")["counters"]["lidar_rear_sweeps"].as_u64();
    assert!(n_sweeps >= Some(38), "{n_sweeps:?}");
    assert!(reference("two_lidars", launch) == expected, "another run gives other bytes");
    for stage in ["acquire", "slam_aggregate"] {
        // On a busy machine the run may end before the kill; then another run is killed.
        let killed = wait_for("a kill in the middle of the drive", || {
            let launch = launch();
            let running = launch.start();
            launch.wait_for_barrier(1);
            let was_killed = running.find_stage(stage).is_some_and(|pid| kill_process(pid, Signal::KILL).is_ok());
            assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
            (was_killed && launch.stage_summary(stage)["faults"] == 1).then_some(launch)
        });
        assert!(result_files(&killed.output()) == expected, "a killed {stage} changed the result");
    }
}
