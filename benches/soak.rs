//! Searches for leaks: a million messages through the pipeline of tests/misbehaving while descriptors, memory and
//! shared memory are sampled; then 200 runs that are killed at seeded moments, after which no files or processes may be
//! left behind.
//! `cargo build --release -p launch -p misbehaving && cargo bench -p replica-tests --bench soak [-- MESSAGES KILLS SEED]`

use replica_tests::{Launch, Random, Running, domain_of, leftovers, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::time::{Duration, Instant};

const PROCESSES: [&str; 4] = ["supervisor", "source", "relay", "sink"];
/// Growth of a process that does not count as a leak, bytes: pages of stacks and tables that are touched late.
const SLACK: u64 = 1 << 20;
/// Files that a heartbeat opens for a moment to read its own figures.
const OPEN_FOR_A_MOMENT: u64 = 2;

/// The resources of one process.
#[derive(Clone, Copy, Default)]
struct ProcessSample {
    descriptors: u64,
    threads: u64,
    /// Its memory and the shared memory that it has touched, bytes.
    resident: u64,
}

fn sample_process(pid: Pid) -> Option<ProcessSample> {
    let folder = format!("/proc/{}", pid.as_raw_nonzero());
    let status = std::fs::read_to_string(format!("{folder}/status")).ok()?;
    let number = |key: &str| -> Option<u64> {
        status.lines().find(|line| line.starts_with(key))?.split_whitespace().nth(1)?.parse().ok()
    };
    let descriptors = std::fs::read_dir(format!("{folder}/fd")).ok()?.count() as u64;
    Some(ProcessSample { descriptors, threads: number("Threads:")?, resident: number("VmRSS:")? * 1024 })
}

/// Files of the domain in shared memory, and bytes that they use.
fn shared_memory(domain: &str) -> (u64, u64) {
    use std::os::unix::fs::MetadataExt;
    let files = leftovers(domain);
    let files = files.iter().filter(|file| file.starts_with("/dev/shm"));
    files
        .filter_map(|file| std::fs::metadata(file).ok())
        .fold((0, 0), |(n, bytes), m| (n + 1, bytes + m.blocks() * 512))
}

/// All samples of one moment.
struct Sample {
    processes: [ProcessSample; PROCESSES.len()],
    shared: (u64, u64),
}

fn sample(pids: [Pid; PROCESSES.len()], domain: &str) -> Option<Sample> {
    let mut processes = [ProcessSample::default(); PROCESSES.len()];
    for (process, pid) in processes.iter_mut().zip(pids) {
        *process = sample_process(pid)?;
    }
    Some(Sample { processes, shared: shared_memory(domain) })
}

/// Prints a figure at 10 %, at 100 % and its maximum. Returns whether it does not grow.
fn print(name: &str, samples: &[Sample], slack: u64, figure: impl Fn(&Sample) -> u64) -> bool {
    let values: Vec<u64> = samples.iter().map(figure).collect();
    let first = values[0];
    let last = values[values.len() - 1];
    let max = values.iter().copied().max().unwrap_or_default();
    let flat = max <= first + slack;
    println!("| {name} | {first} | {last} | {max} | {} |", if flat { "flat" } else { "GROWS" });
    flat
}

fn many_messages(messages: u64) -> bool {
    let source = format!("ticks = {messages}\npoints = 16\n");
    // Every tick is a tenth of a second of drive: a barrier every 5000.
    let settings = ["run.barrier_s=500.0", "relay.look_up=false", "sink.look_up=false", "sink.lines=false"];
    let launch = Launch::misbehaving("", &source, "");
    let launch = settings.iter().fold(launch, |launch, setting| launch.with("--set").with(setting));
    let running = launch.start();
    let pids = [running.pid(), running.stage("source"), running.stage("relay"), running.stage("sink")];
    let domain = domain_of(&launch.output());
    let begun = Instant::now();
    let mut samples = Vec::new();
    while let Some(sample) = sample(pids, &domain) {
        samples.push(sample);
        std::thread::sleep(Duration::from_millis(200));
    }
    let seconds = begun.elapsed().as_secs_f64();
    assert_eq!(running.wait(), Some(0), "the run itself");
    assert_eq!(launch.stage_summary("sink")["inputs"]["class"]["messages"], messages);
    // The last samples may be from processes that are ending.
    samples.truncate(samples.len().saturating_sub(3));
    let samples = &samples[samples.len() / 10..];
    println!(
        "\n{messages} sweeps and as many columns in {seconds:.0} s, {} samples from 10 % to 100 %\n",
        samples.len()
    );
    println!("| figure | at 10 % | at 100 % | largest | |\n|---|---|---|---|---|");
    let mut flat = true;
    for (index, name) in PROCESSES.iter().enumerate() {
        flat &= print(&format!("{name}: descriptors"), samples, OPEN_FOR_A_MOMENT, |s| s.processes[index].descriptors);
        flat &= print(&format!("{name}: threads"), samples, 0, |s| s.processes[index].threads);
        flat &= print(&format!("{name}: resident bytes"), samples, SLACK, |s| s.processes[index].resident);
    }
    flat &= print("files in shared memory", samples, 0, |s| s.shared.0);
    flat &= print("bytes of shared memory", samples, SLACK, |s| s.shared.1);
    flat && left_by(&launch, &domain) == 0
}

/// Processes and files that a run has left behind.
fn left_by(launch: &Launch, domain: &str) -> usize {
    let files = leftovers(domain);
    let processes = processes_that_name(launch.folder());
    if !files.is_empty() || !processes.is_empty() {
        println!("left behind: {files:?} {processes:?}");
    }
    files.len() + processes.len()
}

/// Processes with the folder on their command line.
fn processes_that_name(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir("/proc").expect("Linux").flatten();
    let numbers = entries.filter(|entry| entry.file_name().to_string_lossy().bytes().all(|b| b.is_ascii_digit()));
    let lines = numbers.filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok());
    let lines = lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " "));
    lines.filter(|line| line.contains(&*folder.to_string_lossy())).collect()
}

/// Kills the supervisor, or a stage whose run must then succeed. Returns whether the supervisor still runs.
fn kill_one(running: &Running, random: &mut Random) -> bool {
    std::thread::sleep(Duration::from_millis(random.index(700) as u64));
    let victim = PROCESSES[random.index(PROCESSES.len())];
    if victim == "supervisor" {
        running.signal(Signal::KILL);
        return false;
    }
    if let Some(pid) = running.find_stage(victim) {
        // It may have ended in the meantime.
        let _ = kill_process(pid, Signal::KILL);
    }
    true
}

fn many_kills(kills: u64, seed: u64) -> bool {
    const SOURCE: &str = "ticks = 300\npoints = 2000";
    let launch = || Launch::misbehaving("restarts = 9", SOURCE, "");
    let undisturbed = launch();
    assert_eq!(undisturbed.start().wait(), Some(0));
    // All runs use one folder: the next run must clean up after a dead one.
    let disturbed = launch().with("--overwrite");
    let mut random = Random::new(seed);
    let mut survived = 0_u64;
    let mut same = 0_u64;
    let begun = Instant::now();
    for _ in 0..kills {
        let running = disturbed.start();
        let lives = kill_one(&running, &mut random);
        let code = running.wait();
        if lives {
            survived += 1;
            let right = code == Some(0) && disturbed.read("sink.txt") == undisturbed.read("sink.txt");
            same += u64::from(right);
        }
        wait_for("the stages' end", || processes_that_name(disturbed.folder()).is_empty().then_some(()));
    }
    let mut left = 0;
    assert_eq!(disturbed.start().wait(), Some(0), "a last undisturbed run");
    for launch in [&undisturbed, &disturbed] {
        left += left_by(launch, &domain_of(&launch.output()));
    }
    println!(
        "\n{kills} runs killed with seed {seed} in {:.0} s: {} supervisors, {survived} stages; of the latter {same} runs ended \
         with the bytes of an undisturbed one; {left} files or processes left",
        begun.elapsed().as_secs_f64(),
        kills - survived
    );
    left == 0 && same == survived
}

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let number = |index: usize, default: u64| numbers.get(index).copied().unwrap_or(default);
    let flat = number(0, 1_000_000) == 0 || many_messages(number(0, 1_000_000));
    let clean = many_kills(number(1, 200), number(2, 1));
    if !(flat && clean) {
        std::process::exit(1);
    }
}
