//! Means that are used up: disk, shared memory, memory, rights. The report says which stage, what was full and what to do, and
//! once the cause is gone `--resume` leads to the result of an undisturbed run.

use replica_tests::{
    Launch, Running, binary, gate, in_own_namespace, mount_tmpfs, pipeline, resize_tmpfs, result_files, said,
    simulated_drive, undisturbed, wait_for,
};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

const SOURCE: &str = "ticks = 400\npoints = 5000";
const SHORT: &str = "ticks = 60\npoints = 500";

/// Waits for the end; exit code and what was said.
fn end(mut running: Running) -> (Option<i32>, String) {
    let code = wait_for("the end of the run", || running.ended());
    (code, running.stderr())
}

fn assert_resumes(launch: &Launch, source: &str) {
    let (code, said) = end(launch.start_again(&["--resume"]));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("resuming from "), "{said}");
    assert!(launch.read("sink.txt") == undisturbed(source, ""), "the result shows what was used up: {said}");
}

/// Takes all room of a file system.
fn fill(folder: &Path) -> std::path::PathBuf {
    let filler = folder.join("filler");
    let mut file = std::fs::File::create(&filler).expect("created");
    // By blocks first, then to the last byte.
    for size in [1 << 16, 1 << 12, 1] {
        while file.write_all(&vec![7; size]).is_ok() {}
    }
    filler
}

#[test]
fn a_full_disk_ends_the_run_and_says_so() {
    if !in_own_namespace("a_full_disk_ends_the_run_and_says_so") {
        return;
    }
    let launch = Launch::of_misbehaving("", SOURCE, &gate(203));
    mount_tmpfs(&launch.output(), 64 << 20);
    let running = launch.start();
    launch.wait_for_barrier(20);
    let filler = fill(&launch.output());
    launch.open_gate();
    let (code, said) = end(running);
    assert_eq!(code, Some(1), "{said}");
    // The log is on the same disk: what cannot stand there comes by the heartbeat.
    assert!(said.contains("No space left on device (os error 28)"), "{said}");
    assert!(said.contains(".state: "), "the file is named: {said}");
    assert!(said.contains("a disk is full: make room, then go on with --resume"), "{said}");
    assert!(!said.contains("restart 1"), "a restart does not make room: {said}");
    std::fs::remove_file(filler).expect("removed");
    assert_resumes(&launch, SOURCE);
}

#[test]
fn a_disk_too_small_for_the_clouds_ends_the_run_and_says_so() {
    if !in_own_namespace("a_disk_too_small_for_the_clouds_ends_the_run_and_says_so") {
        return;
    }
    let drive = Path::new(env!("CARGO_TARGET_TMPDIR")).join("resources_drive");
    simulated_drive(&drive, 7, 1.5);
    let undisturbed = pipeline(&drive, "", "");
    let output = undisturbed.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let expected = result_files(&undisturbed.output());
    let launch = pipeline(&drive, "", "");
    let clouds = launch.output().join("clouds");
    let bytes: usize = expected.values().map(Vec::len).sum();
    mount_tmpfs(&clouds, bytes as u64 / 2);
    let (code, said) = end(launch.start());
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("[export] exit: ended with exit code 1; a disk is full"), "{said}");
    assert!(said.contains("/clouds/submap_"), "the file is named: {said}");
    resize_tmpfs(&clouds, 2 * bytes as u64);
    let (code, said) = end(launch.start_again(&["--resume"]));
    assert_eq!(code, Some(0), "{said}");
    assert!(result_files(&launch.output()) == expected, "the result shows that the disk was full");
}

#[test]
fn a_limit_on_files_is_named() {
    // A shell sets the limit and becomes the relay; the file that outgrows it is made by the relay's log and state.
    let launch = limited_relay("ulimit -f 0");
    let (code, said) = end(launch.start());
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("[relay] exit: was killed by SIGXFSZ: a file reached the largest size"), "{said}");
    assert!(said.contains("raise the limit, then go on with --resume"), "{said}");
    std::fs::write(launch.folder().join("limit"), "true").expect("written");
    assert_resumes(&launch, SHORT);
}

/// The small pipeline whose relay runs under what `limit` does to its shell.
fn limited_relay(limit: &str) -> Launch {
    let mut text = String::from("[run]\ndrive = \".\"\noutput = \"out\"\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n");
    write!(text, "[source]\nprogram = '{}'\n{SHORT}\n", binary("misbehaving-source").display()).expect("a string");
    writeln!(text, "[relay]\nprogram = 'relay.sh'\n[sink]\nprogram = '{}'", binary("misbehaving-sink").display())
        .expect("a string");
    let launch = Launch::new(&text);
    let script = launch.folder().join("relay.sh");
    let relay = binary("misbehaving-relay").display().to_string();
    let lines = format!(
        "#!/bin/sh\nif [ \"$1\" = run ]; then . '{}/limit'; fi\nexec '{relay}' \"$@\"\n",
        launch.folder().display()
    );
    std::fs::write(&script, lines).expect("written");
    std::fs::set_permissions(&script, std::os::unix::fs::PermissionsExt::from_mode(0o755)).expect("a script");
    std::fs::write(launch.folder().join("limit"), limit).expect("written");
    launch
}

#[test]
fn an_output_that_cannot_be_written_is_refused_at_once() {
    for output in ["launch.toml", "launch.toml/below", "/proc/replica", "/sys/replica"] {
        let launch = Launch::of_misbehaving("", SHORT, "").with("--set").with(&format!("run.output={output}"));
        let ended = launch.run();
        let said = said(&ended);
        assert_eq!(ended.status.code(), Some(1), "{said}");
        assert!(said.contains(&format!("{output}/run: ")), "{said}");
        assert!(said.contains("cannot be written; is [run] output right?"), "{said}");
    }
}

#[test]
fn a_read_only_output_is_refused_at_once() {
    if !in_own_namespace("a_read_only_output_is_refused_at_once") {
        return;
    }
    let launch = Launch::of_misbehaving("", SHORT, "");
    mount_tmpfs(&launch.output(), 1 << 20);
    let remount = |mode: &str| {
        let mut mount = std::process::Command::new("mount");
        mount.args(["-o", &format!("remount,{mode}")]).arg(launch.output());
        assert!(mount.status().expect("mount starts").success());
    };
    remount("ro");
    let ended = launch.run();
    assert_eq!(ended.status.code(), Some(1), "{}", said(&ended));
    assert!(said(&ended).contains("out/run: Read-only file system (os error 30)"), "{}", said(&ended));
    remount("rw");
    let ended = launch.run();
    assert_eq!(ended.status.code(), Some(0), "{}", said(&ended));
}

/// The run recovers by itself from what strikes once, and the report has these words.
fn recovers(fault: &str, words: &[&str]) {
    let relay = format!("fault = \"{fault}\"\nat_tick = 23\nonce = \"struck\"");
    let launch = Launch::of_misbehaving("", SHORT, &relay);
    let ended = launch.run();
    let said = said(&ended);
    assert_eq!(ended.status.code(), Some(0), "{said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
    assert!(launch.read("sink.txt") == undisturbed(SHORT, ""), "the result shows {fault}: {said}");
}

#[test]
fn a_bus_error_is_reported_with_what_is_free_and_used() {
    let figures = " MiB are free in /dev/shm, this run uses ";
    recovers("bus_error", &["[relay] exit: was killed by SIGBUS: memory behind a mapped file was not there", figures]);
}

#[test]
fn a_stage_killed_from_outside_is_reported_in_words() {
    recovers("killed", &["[relay] exit: was killed by signal 9: by someone, or by the kernel for lack of memory"]);
}

#[test]
fn an_allocation_that_fails_is_reported_in_words() {
    let words = ["[relay] exit: was killed by SIGABRT: an allocation that failed", "memory allocation of "];
    recovers("exhausts_memory", &words);
}

#[test]
fn full_shared_memory_is_reported_and_the_run_resumed() {
    if !in_own_namespace("full_shared_memory_is_reported_and_the_run_resumed") {
        return;
    }
    let shared_memory = Path::new("/dev/shm");
    mount_tmpfs(shared_memory, 600 << 20);
    let relay = "fault = \"fills_shared_memory\"\nat_tick = 23\nonce = \"struck\"";
    let launch = Launch::of_misbehaving("", SHORT, relay);
    let (code, said) = end(launch.start());
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("[relay] exit: was killed by SIGBUS"), "{said}");
    assert!(said.contains("; 0.0 MiB are free in /dev/shm, this run uses "), "{said}");
    assert!(said.contains("are free in /dev/shm, at least 512.0 MiB are needed"), "{said}");
    assert!(said.contains("given up; --resume would go on from barrier 4"), "{said}");
    std::fs::remove_file(shared_memory.join("filler")).expect("removed");
    assert_resumes(&launch, SHORT);
}
