//! Exhausted resources: disk, shared memory, memory, permissions. The report names the stage, the resource and the
//! remedy. Once the cause is removed, `--resume` gives the result of an undisturbed run.

use replica_tests::{
    Launch, Running, binary, drive, gate, in_own_namespace, mount_tmpfs, output_text, pipeline, reference,
    resize_tmpfs, result_files, undisturbed, wait_for,
};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

const SOURCE: &str = "ticks = 400\npoints = 5000";
const SHORT: &str = "ticks = 60\npoints = 500";

/// Waits for the end. Returns exit code and messages.
fn end(mut running: Running) -> (Option<i32>, String) {
    let code = wait_for("the end of the run", || running.ended());
    (code, running.stderr())
}

fn assert_resumes(launch: &Launch, source: &str) {
    let (code, output_text) = end(launch.start_again(&["--resume"]));
    assert_eq!(code, Some(0), "{output_text}");
    assert!(output_text.contains("resuming from "), "{output_text}");
    assert!(
        launch.read("sink.txt") == undisturbed(source, ""),
        "the exhausted resource changed the result: {output_text}"
    );
}

/// Uses all space of a file system.
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
#[cfg_attr(not(mount_namespaces), ignore = "needs a mount namespace (unshare)")]
fn full_disk_ends_the_run_and_is_reported() {
    if !in_own_namespace!("full_disk_ends_the_run_and_is_reported") {
        return;
    }
    let launch = Launch::misbehaving("", SOURCE, &gate(203));
    mount_tmpfs(&launch.output(), 64 << 20);
    let running = launch.start();
    launch.wait_for_barrier(20);
    let filler = fill(&launch.output());
    launch.open_gate();
    let (code, output_text) = end(running);
    assert_eq!(code, Some(1), "{output_text}");
    // The log is on the same disk, so the heartbeat carries the error.
    assert!(output_text.contains("No space left on device (os error 28)"), "{output_text}");
    assert!(output_text.contains(".state: "), "the file is named: {output_text}");
    assert!(output_text.contains("a disk is full: make room, then continue with --resume"), "{output_text}");
    assert!(!output_text.contains("restart 1"), "a restart does not make room: {output_text}");
    std::fs::remove_file(filler).expect("removed");
    assert_resumes(&launch, SOURCE);
}

#[test]
#[cfg_attr(not(mount_namespaces), ignore = "needs a mount namespace (unshare)")]
fn disk_too_small_for_the_clouds_ends_the_run_and_is_reported() {
    if !in_own_namespace!("disk_too_small_for_the_clouds_ends_the_run_and_is_reported") {
        return;
    }
    let expected = reference("pipeline", || pipeline(&drive(), "", ""));
    let launch = pipeline(&drive(), "", "");
    let clouds = launch.output().join("clouds");
    let bytes: usize = expected.values().map(Vec::len).sum();
    mount_tmpfs(&clouds, bytes as u64 / 2);
    let (code, output_text) = end(launch.start());
    assert_eq!(code, Some(1), "{output_text}");
    assert!(output_text.contains("[export] exit: ended with exit code 1; a disk is full"), "{output_text}");
    assert!(output_text.contains("/clouds/submap_"), "the file is named: {output_text}");
    resize_tmpfs(&clouds, 2 * bytes as u64);
    let (code, output_text) = end(launch.start_again(&["--resume"]));
    assert_eq!(code, Some(0), "{output_text}");
    assert!(result_files(&launch.output()) == expected, "the full disk changed the result");
}

#[test]
#[cfg_attr(not(mount_namespaces), ignore = "needs a mount namespace (unshare)")]
fn clouds_that_will_not_fit_are_refused_before_the_start() {
    if !in_own_namespace!("clouds_that_will_not_fit_are_refused_before_the_start") {
        return;
    }
    let expected = reference("pipeline", || pipeline(&drive(), "", ""));
    let bytes: usize = expected.iter().filter(|(name, _)| name.contains("submap_")).map(|(_, file)| file.len()).sum();
    let launch = pipeline(&drive(), "", "");
    mount_tmpfs(&launch.output(), bytes as u64 / 3);
    let (code, output_text) = end(launch.start());
    assert_eq!(code, Some(78), "{output_text}");
    assert!(output_text.contains("make room, or set another run.output"), "{output_text}");
    let estimate = output_text.split("points need about ").nth(1).and_then(|rest| rest.split(" MB").next());
    let estimate: f64 = estimate.and_then(|text| text.parse().ok()).expect(&output_text);
    let ratio = estimate * 1e6 / bytes as f64;
    assert!((0.7..1.4).contains(&ratio), "{estimate} MB estimated, {bytes} bytes written");
    // Saved states also need room.
    resize_tmpfs(&launch.output(), 16 * bytes as u64);
    let (code, output_text) = end(launch.start_again(&[]));
    assert_eq!(code, Some(0), "{output_text}");
    assert!(result_files(&launch.output()) == expected);
}

#[test]
fn file_size_limit_is_reported() {
    // A shell sets the limit and becomes the relay; the relay's log and state exceed the limit of a file.
    let launch = limited_relay("ulimit -f 0");
    let (code, output_text) = end(launch.start());
    assert_eq!(code, Some(1), "{output_text}");
    assert!(
        output_text.contains("[relay] exit: was killed by SIGXFSZ: a file reached the largest size"),
        "{output_text}"
    );
    assert!(output_text.contains("raise the limit, then continue with --resume"), "{output_text}");
    std::fs::write(launch.folder().join("limit"), "true").expect("written");
    assert_resumes(&launch, SHORT);
}

/// The small pipeline whose relay runs in a shell after the command `limit`.
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

/// Runs under these limits of the shell. Returns exit code and messages.
fn run_limited(launch: &Launch, limit: &str) -> (Option<i32>, String) {
    let ended = std::process::Command::new("sh")
        .args(["-c", &format!("{limit} && exec \"$0\" \"$@\"")])
        .arg(binary("replica-launch"))
        .arg(launch.folder().join("launch.toml"))
        .arg("--overwrite")
        .output()
        .expect("a shell starts");
    (ended.status.code(), output_text(&ended))
}

/// Regression: the limits ended runs within the transport, after useless restarts.
#[test]
fn limits_too_low_for_the_run_are_refused_before_the_start() {
    let launch = Launch::misbehaving("", SHORT, "");
    for (option, low, words, unit) in [
        ("-n", "64", "limit of open files: 64 (ulimit -n), stage ", ""),
        ("-v", "2000000", "limit of address space: 2000000 KiB (ulimit -v), stage ", " KiB"),
    ] {
        let (code, text) = run_limited(&launch, &format!("ulimit {option} {low}"));
        assert_eq!(code, Some(78), "{text}");
        assert!(text.contains(words), "{text}");
        assert!(!launch.output().exists(), "nothing was started: {text}");
        let need = text.split_once(" needs ").and_then(|(_, rest)| rest.split([';', ',', ' ']).next());
        let need = need.filter(|need| need.parse::<u64>().is_ok()).unwrap_or_else(|| panic!("no need in {text}"));
        assert!(text.contains(&format!("{need}{unit}")), "{text}");
        // The limit requested by the message is sufficient.
        let (code, text) = run_limited(&launch, &format!("ulimit {option} {need}"));
        assert_eq!(code, Some(0), "ulimit {option} {need}: {text}");
        assert!(launch.read("sink.txt") == undisturbed(SHORT, ""), "{text}");
        std::fs::remove_dir_all(launch.output()).expect("removed");
    }
}

#[test]
fn unwritable_output_is_refused_before_the_start() {
    for output in ["launch.toml", "launch.toml/below", "/proc/replica", "/sys/replica"] {
        let launch = Launch::misbehaving("", SHORT, "").with("--set").with(&format!("run.output={output}"));
        let ended = launch.run();
        let output_text = output_text(&ended);
        assert_eq!(ended.status.code(), Some(1), "{output_text}");
        assert!(output_text.contains(&format!("{output}/run: ")), "{output_text}");
        assert!(output_text.contains("check [run] output"), "{output_text}");
    }
}

#[test]
#[cfg_attr(not(mount_namespaces), ignore = "needs a mount namespace (unshare)")]
fn read_only_output_is_refused_before_the_start() {
    if !in_own_namespace!("read_only_output_is_refused_before_the_start") {
        return;
    }
    let launch = Launch::misbehaving("", SHORT, "");
    mount_tmpfs(&launch.output(), 1 << 20);
    let remount = |mode: &str| {
        let mut mount = std::process::Command::new("mount");
        mount.args(["-o", &format!("remount,{mode}")]).arg(launch.output());
        assert!(mount.status().expect("mount starts").success());
    };
    remount("ro");
    let ended = launch.run();
    assert_eq!(ended.status.code(), Some(1), "{}", output_text(&ended));
    assert!(
        output_text(&ended).contains("out/run: cannot be written: Read-only file system (os error 30)"),
        "{}",
        output_text(&ended)
    );
    remount("rw");
    let ended = launch.run();
    assert_eq!(ended.status.code(), Some(0), "{}", output_text(&ended));
}

/// Asserts that the run recovers from a fault that occurs once, and that the report contains these words.
fn recovers(fault: &str, words: &[&str]) {
    let relay = format!("fault = \"{fault}\"\nat_tick = 23\nonce = \"struck\"");
    let launch = Launch::misbehaving("", SHORT, &relay);
    let ended = launch.run();
    let output_text = output_text(&ended);
    assert_eq!(ended.status.code(), Some(0), "{output_text}");
    for word in words {
        assert!(output_text.contains(word), "{word:?} is not in:\n{output_text}");
    }
    assert!(launch.read("sink.txt") == undisturbed(SHORT, ""), "{fault} changed the result: {output_text}");
}

#[test]
fn bus_error_is_reported_with_free_and_used_memory() {
    let figures = " MiB free in /dev/shm, this run uses ";
    recovers("bus_error", &["[relay] exit: was killed by SIGBUS: mapped memory was not available", figures]);
}

#[test]
fn externally_killed_stage_is_reported() {
    recovers(
        "killed",
        &["[relay] exit: was killed by SIGKILL: by another process, or by the kernel for lack of memory"],
    );
}

#[test]
fn failed_allocation_is_reported() {
    let words = ["[relay] exit: was killed by SIGABRT: an allocation failed", "memory allocation of "];
    recovers("exhausts_memory", &words);
}

#[test]
#[cfg_attr(not(mount_namespaces), ignore = "needs a mount namespace (unshare)")]
fn full_shared_memory_is_reported_and_the_run_resumes() {
    if !in_own_namespace!("full_shared_memory_is_reported_and_the_run_resumes") {
        return;
    }
    let shared_memory = Path::new("/dev/shm");
    mount_tmpfs(shared_memory, 600 << 20);
    let relay = "fault = \"fills_shared_memory\"\nat_tick = 23\nonce = \"struck\"";
    let launch = Launch::misbehaving("", SHORT, relay);
    let (code, output_text) = end(launch.start());
    assert_eq!(code, Some(1), "{output_text}");
    assert!(output_text.contains("[relay] exit: was killed by SIGBUS"), "{output_text}");
    assert!(output_text.contains("; 0.0 MiB free in /dev/shm, this run uses "), "{output_text}");
    assert!(output_text.contains("free in /dev/shm, a run needs at least 512.0 MiB"), "{output_text}");
    assert!(
        output_text.contains("giving up: too little shared memory is free; --resume would continue from barrier 4"),
        "{output_text}"
    );
    std::fs::remove_file(shared_memory.join("filler")).expect("removed");
    assert_resumes(&launch, SHORT);
}
