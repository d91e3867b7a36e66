//! Power loss at any moment: whatever of the unsynced writes and renames is lost, `--resume` gives the files of an
//! undisturbed run or refuses with a text that names the file. `benches/crash_soak.rs --power-loss` tries more moments.

use replica_tests::power_loss::{RecordedRun, Survival};
use replica_tests::{Random, drive, in_own_namespace, lidar_pipeline};

/// Number of moments that are tried: each is a run.
const N: usize = 16;

fn assert_survived(run: &RecordedRun, survival: &Survival) {
    println!("{} changes, {} syncs\n{survival}", run.journal().n_changes(), run.journal().n_syncs());
    assert!(run.journal().n_syncs() > 20, "the programs sync their files");
    assert!(run.expected().len() > 3, "there are clouds");
    assert_eq!(survival.total(), N);
    assert!(survival.faults.is_empty(), "{survival}");
}

#[test]
#[cfg_attr(not(user_file_systems), ignore = "needs a mount namespace (unshare) and /dev/fuse")]
fn power_loss_at_any_moment_never_changes_the_clouds_unnoticed() {
    if !in_own_namespace!("power_loss_at_any_moment_never_changes_the_clouds_unnoticed") {
        return;
    }
    let run = RecordedRun::new(lidar_pipeline(&drive(), ""), None);
    let survival = run.survive(N, &mut Random::new(3));
    assert_survived(&run, &survival);
    assert!(survival.resumed > 0, "{survival}");
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn power_loss_never_mixes_a_run_with_the_one_that_it_replaces() {
    if !in_own_namespace!("power_loss_never_mixes_a_run_with_the_one_that_it_replaces") {
        return;
    }
    let earlier = ["--set", "slam_aggregate.submap_m=5.0"];
    let run = RecordedRun::new(lidar_pipeline(&drive(), ""), Some(&earlier));
    let survival = run.survive(N, &mut Random::new(4));
    assert_survived(&run, &survival);
}
