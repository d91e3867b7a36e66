//! `replica record` on a running run: the recording is complete from its start on, and the run waits for the recorder
//! only if it may not drop messages.

use recording::RecordingReader;
use replica_tests::swaps::{started, stop, wait_for_two_barriers};
use replica_tests::{Launch, binary, lidar_pipeline, long_drive, output_text, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// Enough ticks that the run continues during the whole test.
const ENDLESS: &str = "ticks = 1000000\npoints = 1000";
const TOPICS: [&str; 2] = ["sweep", "class"];

/// A running `replica record`. Killed when dropped.
struct Recorder {
    child: Option<Child>,
    file: PathBuf,
}

impl Recorder {
    /// Starts it with these arguments and waits until it is attached.
    fn attached(launch: &Launch, arguments: &[&str]) -> Self {
        Self::with_topics(launch, arguments, &TOPICS)
    }
    /// [`Recorder::attached`] for other topics.
    fn with_topics(launch: &Launch, arguments: &[&str], topics: &[&str]) -> Self {
        let topics = topics.join(",");
        let file = launch.folder().join(format!("recorded {topics}.mcap"));
        let mut command = Command::new(binary("replica"));
        command.arg("record").args(arguments).arg(&file).args(["--topics", &topics]).stdin(Stdio::null());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("a pipe")).read_line(&mut line).expect("readable");
        assert_eq!(line, "ready 0\n", "{:?}", child.try_wait());
        Self { child: Some(child), file }
    }
    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(self.child.as_ref().expect("at work")), signal).expect("it lives");
    }
    /// Waits until a further chunk of the file is on the disk.
    fn wait_for_chunk(&self) {
        let bytes = || std::fs::metadata(&self.file).map_or(0, |metadata| metadata.len());
        let before = bytes();
        wait_for("a chunk of the recording", || (bytes() > before).then_some(()));
    }
    fn finish(mut self) -> Output {
        self.child.take().expect("at work").wait_with_output().expect("ends")
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Content of a recording by topic.
#[derive(Default)]
struct Recorded {
    /// Sequence number of each message.
    seqs: Vec<u64>,
    /// Tick of each message.
    ticks: Vec<u64>,
    /// Each tick, and the number of messages published up to it.
    rows: Vec<(u64, u64)>,
}

/// Reads a recording that must be complete.
fn recorded(file: &Path) -> BTreeMap<String, Recorded> {
    let mut reader = RecordingReader::open(file).expect("a recording");
    let mut topics: BTreeMap<String, Recorded> = BTreeMap::new();
    while let Some(message) = reader.next().expect("whole") {
        let name = message.topic.ticks_of().unwrap_or(&message.topic.name).to_owned();
        let topic = topics.entry(name).or_default();
        if let Some(row) = message.tick_row() {
            topic.rows.push((row.tick, row.n_published));
        } else {
            topic.seqs.push(message.envelope.seq);
            topic.ticks.push(message.envelope.tick);
        }
    }
    assert_eq!(topics.keys().map(String::as_str).collect::<Vec<_>>(), ["class", "sweep"]);
    topics
}

/// Asserts that every topic has the same ticks, and all their messages.
fn assert_without_gap(file: &Path) {
    let topics = recorded(file);
    let first = topics["sweep"].seqs.first().copied().expect("messages");
    assert!(first > 0, "it came to a run that was under way");
    let last = topics["sweep"].rows.last().expect("ticks").0;
    for (name, topic) in &topics {
        // One message per tick, except that the last tick may be only the end.
        let ticks: Vec<u64> = topic.rows.iter().map(|(tick, _)| *tick).collect();
        assert_eq!(ticks, (first..=last).collect::<Vec<_>>(), "ticks of {name}");
        assert_eq!(topic.seqs, topic.ticks, "messages of {name}");
        let until = topic.rows.last().expect("ticks").1;
        assert_eq!(topic.seqs, (first..until).collect::<Vec<_>>(), "messages of {name}");
    }
}

fn inspected(file: &Path) -> (Option<i32>, String) {
    let output = Command::new(binary("replica")).arg("inspect").arg(file).output().expect("starts");
    (output.status.code(), String::from_utf8(output.stdout).expect("UTF-8"))
}

fn output_of(launch: &Launch) -> String {
    launch.output().to_str().expect("UTF-8").to_owned()
}

#[test]
fn late_recorder_records_to_the_end() {
    for named in [&["--run"][..], &[]] {
        let launch = Launch::misbehaving("", ENDLESS, "");
        let running = started(&launch);
        let recorder = Recorder::attached(&launch, &[named, &[output_of(&launch).as_str()]].concat());
        recorder.wait_for_chunk();
        stop(&launch);
        assert_eq!(running.wait(), Some(3), "drained");
        let file = recorder.file.clone();
        let output = recorder.finish();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
        assert_without_gap(&file);
        let (code, table) = inspected(&file);
        assert_eq!(code, Some(0), "{table}");
        assert!(TOPICS.iter().all(|topic| table.contains(topic)) && table.contains(", to the end"), "{table}");
    }
}

#[test]
fn ctrl_c_finishes_the_recording_and_the_run_continues() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let recorder = Recorder::attached(&launch, &[&output_of(&launch)]);
    recorder.wait_for_chunk();
    recorder.signal(Signal::INT);
    let file = recorder.file.clone();
    let output = recorder.finish();
    assert_eq!(output.status.code(), Some(3), "{}", output_text(&output));
    assert!(output_text(&output).contains("stopped: the recording ends before the run"), "{}", output_text(&output));
    assert_without_gap(&file);
    let (code, table) = inspected(&file);
    assert_eq!(code, Some(3), "{table}");
    assert!(table.contains(", not to the end") && !table.contains("cut at byte"), "{table}");
    wait_for_two_barriers(&launch);
    // Its places are free again.
    Recorder::attached(&launch, &[&output_of(&launch)]);
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
}

#[test]
fn dropping_recorder_blocks_no_stage_and_counts_dropped_messages() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let recorder = Recorder::attached(&launch, &[&output_of(&launch), "--may-drop"]);
    recorder.wait_for_chunk();
    recorder.signal(Signal::STOP);
    // Far more messages than any queue holds.
    launch.wait_for_barrier(launch.newest_barrier().expect("it runs") + 10);
    recorder.signal(Signal::CONT);
    recorder.wait_for_chunk();
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    let file = recorder.file.clone();
    let output = recorder.finish();
    assert_eq!(output.status.code(), Some(3), "{}", output_text(&output));
    for (name, topic) in recorded(&file) {
        let dropped = output_text(&output).lines().any(|line| line.starts_with(&name) && line.ends_with(" dropped"));
        assert!(dropped, "{name}: {}", output_text(&output));
        let ticks: Vec<u64> = topic.rows.iter().map(|(tick, _)| *tick).collect();
        assert!(ticks.is_sorted_by(|a, b| a < b), "ticks of {name}");
        assert!(topic.seqs.is_sorted_by(|a, b| a < b), "messages of {name}");
        assert!(topic.seqs.windows(2).any(|pair| pair[1] > pair[0] + 1), "{name} has no gap");
        assert!(!topic.ticks.is_empty(), "{name} has messages");
        assert!(topic.ticks.iter().all(|tick| ticks.binary_search(tick).is_ok()), "messages of {name} without a tick");
    }
    let (_, table) = inspected(&file);
    assert!(!table.contains("cut at byte"), "{table}");
}

#[test]
fn recording_of_a_failed_run_is_finished() {
    let launch = Launch::misbehaving("restarts = 0", ENDLESS, "fault = \"error\"\nat_tick = 100");
    let file = launch.folder().join("recorded.mcap");
    let launch = launch.with("--record").with(file.to_str().expect("UTF-8")).with("--topics").with("sweep,class");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
    assert!(output_text(&output).contains("is not complete; the run is failed"), "{}", output_text(&output));
    assert_eq!(recorded(&file)["class"].seqs, (0..100).collect::<Vec<_>>(), "all that was published");
    let (code, table) = inspected(&file);
    assert_eq!(code, Some(3), "{table}");
    assert!(!table.contains("cut at byte"), "{table}");
}

/// Both record the topic `placement`, which moves submaps and trajectory.
#[test]
fn recorders_of_submaps_and_of_the_trajectory_run_side_by_side() {
    let launch = lidar_pipeline(&long_drive(), "");
    let running = launch.start();
    // No tick is published before both are attached.
    let source = running.stage("acquire");
    kill_process(source, Signal::STOP).expect("it lives");
    let run = output_of(&launch);
    let recorders = ["submap", "trajectory"].map(|topic| Recorder::with_topics(&launch, &[&run], &[topic]));
    kill_process(source, Signal::CONT).expect("it lives");
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    for recorder in recorders {
        let file = recorder.file.clone();
        let output = recorder.finish();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
        let (code, table) = inspected(&file);
        assert_eq!(code, Some(0), "{table}");
        assert!(table.contains("placement"), "{table}");
    }
}
