//! SIGKILL of any process, at any moment, any number of times: the run goes on, by `--resume` after its supervisor's own death,
//! and the final files are byte for byte those of an undisturbed run. `benches/crash_soak.rs` does the same for hours.

use replica_tests::{
    Launch, Random, domain_of, leftovers, pipeline, result_files, run_under_kills, said, simulated_drive,
};
use std::path::Path;

/// Kills under `seed` and compares with an undisturbed run of the same launch file.
fn assert_survives(make: impl Fn() -> Launch, stages: &[&str], n_kills: usize, seed: u64) {
    let undisturbed = make();
    let output = undisturbed.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let expected = result_files(&undisturbed.output());
    assert!(!expected.is_empty());
    // Shown when the test fails.
    println!("seed {seed}");
    let launch = make();
    let kills = run_under_kills(&launch, stages, n_kills, &mut Random::new(seed));
    println!("{kills:?}");
    assert_eq!(kills.total(), n_kills);
    assert_eq!(kills.struck.len(), stages.len() + 2, "nobody was spared: {kills:?}");
    let got = result_files(&launch.output());
    assert_eq!(expected.keys().collect::<Vec<_>>(), got.keys().collect::<Vec<_>>(), "other files");
    for (name, bytes) in &expected {
        assert!(*bytes == got[name], "{name} differs");
    }
    assert_eq!(launch.summary()["outcome"], "done");
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn kills_of_all_kinds_do_not_show_in_the_result() {
    let make = || Launch::of_misbehaving("restarts = 1000", "ticks = 600\npoints = 5000", "");
    assert_survives(make, &["source", "relay", "sink"], 45, 1);
}

#[test]
fn kills_of_all_kinds_do_not_show_in_the_clouds() {
    let drive = Path::new(env!("CARGO_TARGET_TMPDIR")).join("crash_drive");
    simulated_drive(&drive, 6, 4.0);
    let stages = ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"];
    let make = || pipeline(&drive, "restarts = 1000", "").with("--set").with("run.barrier_s=0.2");
    assert_survives(make, &stages, 10, 2);
}

/// A stage that dies once between any two barriers gets on, however often it does: what counts is that the run does.
#[test]
fn restarts_are_counted_anew_with_each_barrier() {
    let launch = Launch::of_misbehaving("restarts = 1", "ticks = 200\npoints = 500", "fault = \"error\"\nevery = 40");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(launch.summary()["total"]["restarts"].as_u64() == Some(4), "{}", said(&output));
    let undisturbed = Launch::of_misbehaving("", "ticks = 200\npoints = 500", "");
    assert_eq!(undisturbed.run().status.code(), Some(0));
    assert!(launch.read("sink.txt") == undisturbed.read("sink.txt"), "the result shows the restarts");
}
