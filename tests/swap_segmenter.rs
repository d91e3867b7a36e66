//! The real stages: another segmenter takes infer's place in the middle of a drive, and hands back.

use formats::ply::Vertices;
use replica_tests::swaps::{begin_swap, refused, started, swap_said};
use replica_tests::{Launch, PATIENT, Running, binary, result_files, said, wait_for};
use rustix::process::{Signal, kill_process};
use std::path::Path;
use std::process::{Command, Stdio};

#[test]
fn another_segmenter_takes_over_in_the_middle_of_a_drive_and_hands_back() {
    let drive = Path::new(env!("CARGO_TARGET_TMPDIR")).join("drive_of_swaps");
    // One made by an older simulator would test something else.
    let _ = std::fs::remove_dir_all(&drive);
    let simulated = Command::new(binary("replica"))
        .args(["simulate", "--seed", "5", "--seconds", "6", "--out"])
        .arg(&drive)
        .stdout(Stdio::null())
        .status();
    assert!(simulated.expect("replica starts").success());
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    let text = format!(
        "[run]\ndrive = '{}'\noutput = 'out'\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{PATIENT}\n\
         [acquire]\n[slam_aggregate]\nsubmap_m = 2.0\n[colorize]\n[infer]\nmodel = '{}'\n[export]\n",
        drive.display(),
        model.display()
    );
    let undisturbed = Launch::new(&text);
    let output = undisturbed.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));

    let launch = (0..3).find_map(|_| swapped_there_and_back(&text)).expect("the run was over too soon each time");
    let (expected, got) = (clouds(&undisturbed), clouds(&launch));
    assert_eq!(expected.len(), got.len(), "all clouds are there");
    let mut n_other_classes = 0;
    for ((name, expected), (_, got)) in expected.iter().zip(&got) {
        for field in ["x", "y", "z", "intensity", "timestamp", "red"] {
            assert!(expected.f64s(field).expect("a column") == got.f64s(field).expect("a column"), "{name}: {field}");
        }
        n_other_classes += usize::from(expected.f64s("semantic").ok() != got.f64s("semantic").ok());
    }
    assert!((1..got.len()).contains(&n_other_classes), "{n_other_classes} of {} clouds are by the other", got.len());
    assert_eq!(undisturbed.read("trajectory.txt"), launch.read("trajectory.txt"));
}

/// A run with two swaps. `None` if it was over before: on a machine that is busy elsewhere.
fn swapped_there_and_back(text: &str) -> Option<Launch> {
    let launch = Launch::new(text);
    let mut running = started(&launch);
    kill_process(running.find_stage("export")?, Signal::STOP).ok()?;
    let program = binary("height-segmenter").display().to_string();
    refused(&launch, &["infer", "--program", &program], &["infer.model: unknown key"]);
    refused(&launch, &["infer", "--set", "model=nowhere.safetensors"], &["nowhere.safetensors"]);
    let there = swapped_before_the_end(&launch, &running, &["infer", "--program", &program, "--unset", "model"])?;
    assert!(there.ends_with("state taken over: 0 bytes\n"), "{there}");
    // Two seconds of drive, so that a submap ends in them.
    let barrier = launch.newest_barrier().expect("it runs") + 4;
    wait_for("two seconds of drive", || {
        (launch.newest_barrier() >= Some(barrier) || running.ended().is_some()).then_some(())
    });
    let back = swapped_before_the_end(&launch, &running, &["infer", "--back"])?;
    println!("{there}{back}");
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    Some(launch)
}

/// A swap in a drive that is short: the sink is held up until the swap is under way.
fn swapped_before_the_end(launch: &Launch, running: &Running, arguments: &[&str]) -> Option<String> {
    let export = running.find_stage("export")?;
    kill_process(export, Signal::STOP).ok()?;
    let child = begin_swap(launch, arguments);
    kill_process(export, Signal::CONT).expect("the stage lives");
    let output = child.wait_with_output().expect("ends");
    println!("{}", swap_said(launch));
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
