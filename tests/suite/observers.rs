//! Observers of a running pipeline: they show its state, and never change results, block stages or leak resources.

use replica_tests::{Launch, Running, binary, domain_of, leftovers, output_text, undisturbed_lines, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

const ENDLESS: &str = "ticks = 1000000\npoints = 1000";

/// `replica <words> --run <output>`.
fn replica(output: &Path, words: &[&str]) -> Command {
    let mut command = Command::new(binary("replica"));
    command.args(words).arg("--run").arg(output).stdin(Stdio::null());
    command
}

fn succeeded(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", output_text(output));
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn printed(launch: &Launch, words: &[&str]) -> String {
    succeeded(&replica(&launch.output(), words).output().expect("starts"))
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// A run without end, in which all stages have processed messages.
fn endless() -> (Launch, Running) {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = launch.start();
    launch.wait_for_barrier_of("sink", 1);
    (launch, running)
}

/// Queries repeatedly, because a busy machine may delay heartbeats.
fn printed_until(launch: &Launch, words: &[&str], fits: impl Fn(&Value) -> bool) -> Value {
    wait_for(&format!("figures of {words:?}"), || Some(json(&printed(launch, words))).filter(&fits))
}

/// A running observer. Killed when dropped.
struct Observer(Child);

impl Observer {
    fn start(launch: &Launch, words: &[&str]) -> Self {
        let mut command = replica(&launch.output(), words);
        Self(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts"))
    }
    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.0), signal).expect("it lives");
    }
    /// The next line of its stdout.
    fn line(&mut self) -> String {
        let stdout = self.0.stdout.as_mut().expect("a pipe");
        // Read a line at a time: a larger buffer would lose lines for the next call.
        let mut line = String::new();
        BufReader::with_capacity(1, stdout).read_line(&mut line).expect("readable");
        line
    }
    fn finish(mut self) -> Output {
        let child = std::mem::replace(&mut self.0, Command::new("true").spawn().expect("starts"));
        child.wait_with_output().expect("ends")
    }
}

impl Drop for Observer {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn topics_lists_producers_and_consumers() {
    let (launch, running) = endless();
    let topics = printed_until(&launch, &["topics", "--json"], |topics| topics[0]["rows_per_s"].as_f64() > Some(0.0));
    let names = |list: &Value, key: &str| -> Vec<String> {
        let list = list.as_array().expect("a list").iter();
        list.map(|entry| entry[key].as_str().expect("a name").to_owned()).collect()
    };
    assert_eq!(names(&topics, "topic"), ["sweep", "class"]);
    assert_eq!(names(&topics, "producer"), ["source", "relay"]);
    assert_eq!(names(&topics[0]["consumers"], "stage"), ["relay", "sink"]);
    assert_eq!((&topics[0]["row_bytes"], &topics[1]["row_bytes"]), (&20.into(), &2.into()));
    assert!(topics[0]["published"]["messages"].as_u64() > Some(0), "{topics}");
    assert!(printed(&launch, &["topics"]).contains("relay, sink"));

    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
    let topics = json(&printed(&launch, &["topics", "--json"]));
    assert_eq!(names(&topics, "topic"), ["sweep", "class"], "also after the run");
    assert_eq!((&topics[0]["published"], &topics[0]["rows_per_s"]), (&Value::Null, &Value::Null));
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn status_shows_every_stage_and_topic() {
    let (launch, running) = endless();
    let mut watch = Observer::start(&launch, &["status", "--watch", "--json", "--interval", "0.4"]);
    // A busy machine may delay a stage for a time slice.
    let blocks = [(); 2].map(|()| wait_for("a block in which all move", || Some(json(&watch.line())).filter(all_move)));
    for block in &blocks {
        assert_eq!(block["supervisor"], running.pid().as_raw_nonzero().get());
        assert_eq!((&block["alive"], &block["started_anew"]), (&true.into(), &0.into()));
        assert!(block["shared_memory_bytes"].as_u64() > Some(0), "{block}");
        let stages = block["stages"].as_array().expect("a list");
        assert_eq!(
            stages.iter().map(|stage| stage["name"].as_str()).collect::<Vec<_>>(),
            ["source", "relay", "sink"].map(Some)
        );
        for stage in stages {
            assert!(stage["activity"]["kind"].is_string(), "{stage}");
            assert!(stage["lag_s"].as_f64() >= Some(0.0), "{stage}");
            assert!(stage["step"]["count"].as_u64() > Some(0) && stage["rss_bytes"].as_u64() > Some(0), "{stage}");
            let step = ["p50_ms", "p99_ms", "max_ms"].map(|key| stage["step"][key].as_f64().expect("a number"));
            assert!(step.is_sorted() && step[0] > 0.0, "{step:?}");
        }
        for topic in block["topics"].as_array().expect("a list") {
            let bound = topic["queue_bound"].as_u64();
            assert!(topic["waiting"].is_u64() && topic["waiting"].as_u64() <= bound, "{topic}");
            for consumer in topic["consumers"].as_array().expect("a list") {
                assert!(consumer["queue"].as_u64() <= bound, "{consumer}");
                assert!(consumer["latency"]["p50_ms"].as_f64() > Some(0.0), "{consumer}");
            }
        }
    }
    let messages = |block: &Value| block["topics"][1]["published"]["messages"].as_u64().expect("a number");
    assert!(messages(&blocks[0]) < messages(&blocks[1]), "more messages");
    watch.signal(Signal::INT);
    let output = watch.finish();
    assert_eq!(output.status.code(), Some(0), "Ctrl-C is not a failure: {}", output_text(&output));
    let table = printed(&launch, &["status"]);
    for word in ["STAGE", "source", "relay", "sink", "TOPIC", "sweep", "class"] {
        assert!(table.contains(word), "{word} is not in\n{table}");
    }
}

fn all_move(block: &Value) -> bool {
    let rises = |list: &str, rate: &str| {
        let entries = block[list].as_array().expect("a list");
        !entries.is_empty() && entries.iter().all(|entry| entry[rate].as_f64() > Some(0.0))
    };
    rises("stages", "ticks_per_s") && rises("topics", "messages_per_s")
}

#[test]
fn echo_prints_the_published_messages() {
    let (launch, _running) = endless();
    let text = printed(&launch, &["echo", "sweep", "--json", "--count", "5", "--rows", "3"]);
    let messages: Vec<Value> = text.lines().map(json).collect();
    assert_eq!(messages.len(), 5);
    let mut due = messages[0]["seq"].as_u64().expect("a number");
    for message in &messages {
        due += message["missed"].as_u64().expect("a number");
        assert_eq!(message["seq"], due, "what is missing is output_text");
        assert_eq!((&message["tick"], &message["len"]), (&due.into(), &1000.into()));
        assert_eq!(message["stamp"], due * 100_000_000);
        assert_eq!(message["header"]["n_rings"], 32);
        let rows = message["rows"].as_array().expect("a list");
        assert_eq!(rows.len(), 3);
        for (index, row) in rows.iter().enumerate() {
            assert_eq!((row["x"].as_f64(), row["offset_nanos"].as_u64()), (Some(due as f64), Some(index as u64)));
        }
        due += 1;
    }
    let csv = printed(&launch, &["echo", "class", "--csv", "--count", "2", "--rows", "2", "--fields", "score"]);
    assert_eq!(csv.lines().next(), Some("seq,stamp,tick,row,score"));
    assert_eq!(csv.lines().count(), 1 + 2 * 2, "{csv}");
    assert!(printed(&launch, &["echo", "sweep", "--count", "1"]).contains("n_rings: 32"));
}

#[test]
fn hz_prints_rates_until_ctrl_c() {
    let (launch, _running) = endless();
    let mut hz = Observer::start(&launch, &["hz", "class"]);
    let line = wait_for("a line with a rate", || Some(hz.line()).filter(|line| line.contains("messages/s")));
    let per_s: f64 = line.split(' ').next().and_then(|number| number.parse().ok()).expect("a rate");
    assert!(per_s > 0.0 && line.contains(" rows/s") && line.contains("interval mean"), "{line}");
    hz.signal(Signal::INT);
    assert_eq!(hz.finish().status.code(), Some(0));
}

#[test]
fn invalid_arguments_are_refused_with_the_valid_ones() {
    let (launch, running) = endless();
    for (words, code, expected) in [
        (vec!["echo", "cloud"], 2, "there are sweep, class"),
        (vec!["hz", "cloud"], 2, "there are sweep, class"),
        (vec!["record", "recorded.mcap", "--topics", "cloud"], 2, "there are sweep, class"),
        (vec!["record", "out", "recorded.mcap", "--topics", "sweep"], 2, "out and --run both select the run"),
        (vec!["echo", "sweep", "--fields", "x,q"], 2, "no field q"),
    ] {
        let output = replica(&launch.output(), &words).output().expect("starts");
        assert_eq!(output.status.code(), Some(code), "{words:?}: {}", output_text(&output));
        assert!(output_text(&output).contains(expected), "{words:?}: {}", output_text(&output));
    }
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
    let record = vec!["record", "recorded.mcap", "--topics", "sweep"];
    for words in
        [vec!["status"], vec!["echo", "sweep"], vec!["hz", "sweep"], record, vec!["swap", "relay"], vec!["stop"]]
    {
        let output = replica(&launch.output(), &words).output().expect("starts");
        assert_eq!(output.status.code(), Some(1), "{words:?}: {}", output_text(&output));
        assert!(output_text(&output).contains("is not alive"), "{words:?}: {}", output_text(&output));
    }
    let output = replica(launch.folder(), &["topics"]).output().expect("starts");
    assert_eq!(output.status.code(), Some(1));
    assert!(output_text(&output).contains("no run in"), "{}", output_text(&output));
}

#[test]
fn several_running_runs_are_listed() {
    let runs = [endless(), endless()];
    let record = ["record", "recorded.mcap", "--topics", "sweep"];
    for words in
        [&["topics"][..], &["status"], &["echo", "sweep"], &["hz", "sweep"], &record, &["swap", "relay"], &["stop"]]
    {
        let output = Command::new(binary("replica")).args(words).output().expect("starts");
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", output_text(&output));
        for (launch, _) in &runs {
            let folder = launch.output().canonicalize().expect("is there");
            assert!(
                output_text(&output).contains(&format!("--run {}", folder.display())),
                "{words:?}: {}",
                output_text(&output)
            );
        }
    }
}

#[test]
fn closed_pipe_is_no_failure() {
    let (launch, _running) = endless();
    for words in [vec!["echo", "sweep"], vec!["hz", "sweep"], vec!["status", "--watch"]] {
        let mut observer = Observer::start(&launch, &words);
        assert!(!observer.line().is_empty());
        drop(observer.0.stdout.take());
        assert_eq!(observer.finish().status.code(), Some(0), "{words:?}");
    }
}

#[test]
fn stopped_observers_do_not_change_the_result() {
    let (launch, running) = endless();
    let mut observers = ["sweep", "class"].map(|topic| Observer::start(&launch, &["echo", topic, "--json"]));
    for observer in &mut observers {
        assert!(json(&observer.line())["seq"].is_u64(), "it has received a message");
        observer.signal(Signal::STOP);
    }
    // Twenty messages are more than any queue holds.
    launch.wait_for_barrier_of("sink", launch.newest_barrier().expect("it runs") + 4);
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
    let text = launch.read("sink.txt");
    let n_ticks = String::from_utf8_lossy(&text).lines().count() / 2;
    let text = String::from_utf8(text).expect("text");
    assert!(text.lines().eq(undisturbed_lines(n_ticks, "")), "the observers changed the result");
    for observer in observers {
        observer.signal(Signal::CONT);
        let output = observer.finish();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    }
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn lossless_observer_receives_every_message() {
    let (launch, running) = endless();
    let words = ["echo", "class", "--lossless", "--csv", "--rows", "1", "--fields", "score"];
    let mut observer = Observer::start(&launch, &words);
    let mut text: String = (0..200).map(|_| observer.line()).collect();
    running.signal(Signal::INT);
    // Read before the run is waited for, which waits for the observer.
    let output = observer.finish();
    text += &succeeded(&output);
    assert_eq!(running.wait(), Some(3));
    let seqs: Vec<u64> =
        text.lines().skip(1).map(|line| line.split(',').next().expect("a field").parse().expect("a number")).collect();
    let n_published = launch.stage_summary("relay")["outputs"]["class"]["messages"].as_u64().expect("a number");
    assert_eq!(seqs, (seqs[0]..n_published).collect::<Vec<_>>());
    assert!(output_text(&output).contains(" 0 missed"), "{}", output_text(&output));
}

/// The supervisor removes a killed lossless observer; until then the run waits for it.
#[test]
fn killed_lossless_observer_is_removed() {
    let (launch, running) = endless();
    let mut observer = Observer::start(&launch, &["echo", "sweep", "--lossless", "--json"]);
    assert!(json(&observer.line())["seq"].is_u64(), "it has received a message");
    observer.signal(Signal::STOP);
    let source_when = |fits: fn(&Value) -> bool| {
        printed_until(&launch, &["status", "--json", "--interval", "0.4"], |status| fits(&status["stages"][0]))
    };
    let status = source_when(|source| source["ticks_per_s"] == 0.0 && source["activity"]["kind"] == "blocked");
    let held = &status["stages"][0]["ticks"];
    observer.signal(Signal::KILL);
    wait_for("the run to go on", || {
        let status = source_when(|source| source["ticks"].is_u64());
        (status["stages"][0]["ticks"].as_u64() > held.as_u64().map(|held| held + 20)).then_some(())
    });
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
}

#[test]
fn repeated_observers_leave_nothing_behind() {
    let (launch, running) = endless();
    let domain = domain_of(&launch.output());
    let before = leftovers(&domain);
    for round in 0..20 {
        let lossless = if round % 2 == 0 { "--lossless" } else { "--csv" };
        printed(&launch, &["echo", "sweep", "--count", "1", lossless]);
    }
    // A connection is removed with the next message of its other end.
    wait_for("the last one's connections to go", || (leftovers(&domain) == before).then_some(()));
    let places: Vec<Observer> = (0..3).map(|_| Observer::start(&launch, &["echo", "sweep", "--json"])).collect();
    for mut observer in places {
        assert!(json(&observer.line())["seq"].is_u64(), "all places are free again");
    }
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
    assert_eq!(leftovers(&domain), Vec::<String>::new());
}

#[test]
fn observer_continues_after_a_restart() {
    let (launch, running) = endless();
    let mut observer = Observer::start(&launch, &["echo", "class", "--json", "--rows", "0"]);
    let mut seq = || json(&observer.line())["seq"].as_u64().expect("a number");
    seq();
    let relay = running.stage("relay");
    // While it is stopped, the source has sent all messages that it can have answered: later numbers are from after the
    // restart.
    kill_process(relay, Signal::STOP).expect("it lives");
    let sent = |status: &Value| status["topics"][0]["published"]["next_seq"].as_u64();
    let sent = sent(&printed_until(&launch, &["status", "--json"], |status| sent(status).is_some()));
    kill_process(relay, Signal::KILL).expect("it lives");
    wait_for("messages since the restart", || (Some(seq()) > sent).then_some(()));
    assert_eq!(json(&printed(&launch, &["status", "--json"]))["started_anew"], 1);
    observer.signal(Signal::TERM);
    let output = observer.finish();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert!(output_text(&output).contains("restart 1"), "{}", output_text(&output));
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
}

#[test]
fn metrics_are_written_during_the_run_and_at_its_end() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let file = launch.folder().join("replica.prom");
    let launch = launch.with("--metrics").with(file.to_str().expect("UTF-8"));
    let running = launch.start();
    let value = |name: &str| -> Option<f64> {
        let text = std::fs::read_to_string(&file).ok()?;
        text.lines().find_map(|line| line.strip_prefix(name)?.trim().parse().ok())
    };
    let ticks = "replica_stage_ticks_total{stage=\"sink\"}";
    let first = wait_for("ticks in the metrics", || value(ticks).filter(|ticks| *ticks > 0.0));
    wait_for("more ticks", || value(ticks).filter(|ticks| *ticks > first));
    wait_for("shared memory", || value("replica_shared_memory_bytes").filter(|bytes| *bytes > 0.0));
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
    let all = launch.stage_summary("sink")["ticks"].as_f64();
    assert_eq!(value(ticks), all, "the last file has the final figures");
    assert_eq!(value("replica_topic_messages_total{topic=\"class\",stage=\"relay\"}"), all);
    assert_eq!(value("replica_topic_latency_seconds_count{topic=\"class\",consumer=\"sink\"}"), all);
    let latency = &launch.stage_summary("sink")["latencies"]["class"];
    assert_eq!(latency["count"].as_f64(), all, "and the summary has the same");
}

#[test]
fn json_log_has_one_object_per_line() {
    let fault = "fault = \"panic\"\nat_tick = 100\nonce = \"struck\"";
    let launch = Launch::misbehaving("", ENDLESS, fault).with("--log").with("json");
    let running = launch.start();
    let events = || -> Vec<Value> {
        // The last line may be half written.
        running.stderr().split_inclusive('\n').filter(|line| line.ends_with('\n')).map(json).collect()
    };
    let of_kind = |kind: &str| events().into_iter().find(|event| event["kind"] == kind);
    let fault = wait_for("the fault", || of_kind("fault"));
    assert_eq!(fault["stage"], "relay");
    let lines = fault["last_log_lines"].as_array().expect("a list");
    assert!(
        lines.iter().any(|line| line["message"].as_str().is_some_and(|text| text.contains("configured to panic"))),
        "{fault}"
    );
    assert_eq!(wait_for("the restart", || of_kind("restart"))["restart"], 1);
    let progress = wait_for("progress", || of_kind("progress"));
    assert_eq!(progress["stages"].as_array().map(Vec::len), Some(3), "{progress}");
    running.signal(Signal::INT);
    wait_for("the end", || of_kind("done"));
    let all = events();
    assert_eq!(running.wait(), Some(3));
    assert!(all.iter().all(|event| event["timestamp"].as_str().is_some_and(|time| time.ends_with('Z'))), "{all:?}");
    assert_eq!(all.last().map(|event| event["outcome"].clone()), Some("drained".into()));
    for stage in ["source", "relay", "sink"] {
        let log = String::from_utf8(launch.read(&format!("run/logs/{stage}.log"))).expect("UTF-8");
        // Only a stage with something to report has lines.
        assert!(!log.is_empty() || stage != "relay", "{stage} has panicked");
        assert!(log.lines().all(|line| json(line)["level"].is_string()), "{stage}: {log}");
    }
    let bad = Launch::misbehaving("", "tocks = 3", "").with("--log").with("json").run();
    assert_eq!(bad.status.code(), Some(78));
    assert!(String::from_utf8_lossy(&bad.stderr).lines().map(json).any(|event| event["kind"] == "problem"));
}
