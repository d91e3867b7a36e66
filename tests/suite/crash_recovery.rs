//! SIGKILL of any process at any moment, any number of times: the run continues, by `--resume` if its supervisor was
//! killed, and the final files are byte for byte the files of an undisturbed run. `benches/crash_soak.rs` does the same
//! for hours.

use replica_tests::{
    Launch, Random, domain_of, drive, leftovers, output_text, pipeline, reference, result_files, run_under_kills,
    undisturbed,
};
use std::collections::BTreeMap;

/// Kills under `seed` and compares with the files of an undisturbed run.
fn assert_survives(expected: &BTreeMap<String, Vec<u8>>, launch: &Launch, stages: &[&str], n_kills: usize, seed: u64) {
    assert!(!expected.is_empty());
    // Shown when the test fails.
    println!("seed {seed}");
    let kills = run_under_kills(launch, stages, n_kills, &mut Random::new(seed));
    println!("{kills:?}");
    assert_eq!(kills.total(), n_kills);
    assert_eq!(kills.struck.len(), stages.len() + 2, "every victim was killed: {kills:?}");
    let got = result_files(&launch.output());
    assert_eq!(expected.keys().collect::<Vec<_>>(), got.keys().collect::<Vec<_>>(), "other files");
    for (name, bytes) in expected {
        assert!(*bytes == got[name], "{name} differs");
    }
    assert_eq!(launch.summary()["outcome"], "done");
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn killed_processes_do_not_change_the_result() {
    let source = "ticks = 600\npoints = 5000";
    let expected = [("sink.txt".to_owned(), undisturbed(source, ""))].into();
    let launch = Launch::misbehaving("restarts = 1000", source, "");
    assert_survives(&expected, &launch, &["source", "relay", "sink"], 45, 1);
}

#[test]
fn killed_processes_do_not_change_the_clouds() {
    // Barriers do not change the result, so the reference run of the pipeline is sufficient.
    let expected = reference("pipeline", || pipeline(&drive(), "", ""));
    let stages = ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"];
    let launch = pipeline(&drive(), "restarts = 1000", "").with("--set").with("run.barrier_s=0.2");
    assert_survives(&expected, &launch, &stages, 10, 2);
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn killed_processes_do_not_change_regions_and_materials() {
    let launch = |run: &str| {
        let settings = ["calibrate.color_lines='simplified'", "colorize.regions=true", "colorize.materials=true"];
        settings.iter().fold(pipeline(&drive(), run, ""), |launch, setting| launch.with("--set").with(setting))
    };
    let expected = reference("regions", || launch(""));
    let launch = launch("restarts = 1000").with("--set").with("run.barrier_s=0.2");
    assert_survives(&expected, &launch, &["calibrate", "colorize", "export"], 10, 3);
}

/// A stage that fails once between any two barriers continues, however often it fails: each new barrier is progress.
#[test]
fn restart_counter_resets_at_each_new_barrier() {
    let launch = Launch::misbehaving("restarts = 1", "ticks = 200\npoints = 500", "fault = \"error\"\nevery = 40");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert!(launch.summary()["total"]["restarts"].as_u64() == Some(4), "{}", output_text(&output));
    let expected = undisturbed("ticks = 200\npoints = 500", "");
    assert!(launch.read("sink.txt") == expected, "the restarts changed the result");
}
