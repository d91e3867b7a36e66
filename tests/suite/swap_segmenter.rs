//! The real stages: another segmenter replaces infer in the middle of a drive, and infer replaces it again.

use formats::ply::Vertices;
use replica_tests::swaps::{begin_swap, refused, started, swap_output};
use replica_tests::{
    ANY_DEVIATION, ANY_FIXES, Launch, PATIENT, Running, binary, long_drive, output_text, result_files, wait_for,
};
use rustix::process::{Signal, kill_process};
use std::path::Path;

#[test]
fn segmenter_is_swapped_mid_drive_and_back() {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    let text = format!(
        "[run]\ndrive = '{}'\noutput = 'out'\nbarrier_s = 0.2\nrestart_delay_s = 0.0\n{PATIENT}\n\
         [acquire]\n[slam_aggregate]\nsubmap_m = 1.0\n{ANY_FIXES}\n[infer]\nmodel = '{}'\n[export]\n{ANY_DEVIATION}\n",
        long_drive().display(),
        model.display()
    );
    let undisturbed = Launch::new(&text);
    let output = undisturbed.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));

    let launch = (0..3).find_map(|_| swapped_there_and_back(&text)).expect("a run that does not end too soon");
    let expected = clouds(&undisturbed);
    let got = clouds(&launch);
    assert_eq!(expected.len(), got.len(), "all clouds are there");
    let mut n_other_classes = 0;
    for ((name, expected), (_, got)) in expected.iter().zip(&got) {
        for field in ["x", "y", "z", "intensity", "timestamp"] {
            assert!(expected.f64s(field).expect("a column") == got.f64s(field).expect("a column"), "{name}: {field}");
        }
        n_other_classes += usize::from(expected.f64s("semantic").ok() != got.f64s("semantic").ok());
    }
    assert!((1..got.len()).contains(&n_other_classes), "{n_other_classes} of {} clouds are by the other", got.len());
    assert_eq!(undisturbed.read("trajectory.txt"), launch.read("trajectory.txt"));
}

/// A run with two swaps. `None` if it ended before the second one, on a busy machine.
fn swapped_there_and_back(text: &str) -> Option<Launch> {
    let launch = Launch::new(text);
    let mut running = started(&launch);
    kill_process(running.find_stage("export")?, Signal::STOP).ok()?;
    let program = binary("height-segmenter").display().to_string();
    refused(&launch, &["infer", "--program", &program], &["infer.model: unknown key"]);
    refused(&launch, &["infer", "--set", "model=nowhere.safetensors"], &["nowhere.safetensors"]);
    let there = swapped_before_the_end(&launch, &running, &["infer", "--program", &program, "--unset", "model"])?;
    assert!(there.ends_with("state taken over: 0 bytes\n"), "{there}");
    // A second of drive, so that a submap ends in it.
    let barrier = launch.newest_barrier().expect("it runs") + 5;
    wait_for("a second of drive", || {
        (launch.newest_barrier() >= Some(barrier) || running.ended().is_some()).then_some(())
    });
    let back = swapped_before_the_end(&launch, &running, &["infer", "--back"])?;
    println!("{there}{back}");
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    Some(launch)
}

/// A swap in a short drive: the sink is stopped until the swap is in progress.
fn swapped_before_the_end(launch: &Launch, running: &Running, arguments: &[&str]) -> Option<String> {
    let export = running.find_stage("export")?;
    kill_process(export, Signal::STOP).ok()?;
    let child = begin_swap(launch, arguments);
    kill_process(export, Signal::CONT).expect("the stage lives");
    let output = child.wait_with_output().expect("ends");
    println!("{}", swap_output(launch));
    output.status.success().then(|| String::from_utf8(output.stdout).expect("text"))
}

fn clouds(launch: &Launch) -> Vec<(String, Vertices)> {
    let names = result_files(&launch.output()).into_keys();
    let names = names.filter(|name| name.starts_with("submap_") && !name.contains("spectra"));
    names
        .map(|name| {
            let cloud = Vertices::load(&launch.output().join("clouds").join(&name)).expect("a PLY file");
            (name, cloud)
        })
        .collect()
}
