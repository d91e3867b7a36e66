//! A stage alone on a recording gives byte for byte its output in a run. An unsuitable recording is refused with the
//! reason.

use replica_tests::{Launch, binary, output_text};
use std::path::Path;
use std::process::{Command, Output};

/// `<program> run <arguments>`.
fn alone(program: &str, arguments: &[&str], files: &[(&str, &Path)]) -> Output {
    let mut command = Command::new(binary(program));
    command.arg("run").args(arguments);
    for (option, path) in files {
        command.arg(option).arg(path);
    }
    command.output().expect("starts")
}

fn succeeded(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", output_text(output));
    String::from_utf8(output.stdout.clone()).expect("text")
}

#[test]
fn stages_run_alone_in_sequence_reproduce_the_run() {
    let launch = Launch::misbehaving("", "ticks = 60\npoints = 500", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));

    let folder = launch.folder();
    let file = folder.join("launch.toml");
    let sweeps = folder.join("sweep.mcap");
    let classes = folder.join("class.mcap");
    let both = folder.join("both.mcap");
    let out = folder.join("alone");
    std::fs::create_dir(&out).expect("made");
    succeeded(&alone("misbehaving-source", &[], &[("--record", &sweeps), ("--launch", &file)]));
    let report = alone("misbehaving-relay", &["--json"], &[("--recording", &sweeps), ("--record", &classes)]);
    let report: serde_json::Value = serde_json::from_str(&succeeded(&report)).expect("JSON");
    assert_eq!((&report["ticks"], &report["points"], &report["complete"]), (&60.into(), &30_000.into(), &true.into()));
    assert_eq!(report["outputs"]["class"]["messages"], 60);
    assert_eq!(report["step"]["count"], 60);

    // The sink reads both topics from one file.
    merge(&[(&sweeps, "sweep"), (&classes, "class")], &both);
    succeeded(&alone("misbehaving-sink", &[], &[("--recording", &both), ("--output", &out)]));
    assert!(std::fs::read(out.join("sink.txt")).expect("written") == launch.read("sink.txt"));
}

/// One recording with a topic from each of several.
fn merge(parts: &[(&Path, &str)], into: &Path) {
    use recording::{RecordingReader, RecordingWriter, TickReader};
    let table = |path: &Path, topic: &str| {
        let reader = RecordingReader::open(path).expect("opens");
        reader.topics().iter().find(|t| t.name == topic).expect("there").table.clone()
    };
    let tables: Vec<_> = parts.iter().map(|(path, topic)| table(path, topic)).collect();
    let mut readers: Vec<_> =
        parts.iter().map(|(path, topic)| TickReader::open(path, &[*topic]).expect("opens")).collect();
    let mut writer = RecordingWriter::create(into, &std::collections::BTreeMap::new(), &tables).expect("creates");
    while readers.iter().any(|reader| !reader.ended()) {
        for ((reader, table), (_, topic)) in readers.iter_mut().zip(&tables).zip(parts) {
            let tick = reader.next().expect("whole").expect("as many ticks in each");
            let mut n_published = 0;
            for message in &tick.messages[0] {
                let (header, rows) = message.bytes[64..].split_at(table.header_bytes);
                writer.message(topic, tick.row.drive_time, &message.envelope, header, rows).expect("writes");
                n_published = message.envelope.seq + 1;
            }
            writer.tick(topic, &messages::TickRow { n_published, ..tick.row }).expect("writes");
        }
    }
    writer.finish().expect("finishes");
}

#[test]
fn truncated_recording_is_processed_up_to_the_cut() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole.mcap");
    let cut = folder.path().join("cut.mcap");
    let out = folder.path().join("class.mcap");
    let set = ["--set", "source.points=30000"];
    let drive = ("--drive", folder.path());
    succeeded(&alone("misbehaving-source", &set, &[("--record", &whole), drive]));
    let bytes = std::fs::read(&whole).expect("written");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("written");
    let output = alone("misbehaving-relay", &["--json"], &[("--recording", &cut), ("--record", &out)]);
    assert_eq!(output.status.code(), Some(3), "{}", output_text(&output));
    assert!(
        output_text(&output).contains(&format!("cut.mcap: cut at byte {}", bytes.len() / 2)),
        "{}",
        output_text(&output)
    );
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["complete"], false);
    let ticks = report["ticks"].as_u64().expect("a number");
    assert!((10..30).contains(&ticks), "half of 40 ticks is not {ticks}");
    let mut written = recording::TickReader::open(&out, &["class"]).expect("opens");
    let mut n_ticks = 0;
    while written.next().expect("whole").is_some() {
        n_ticks += 1;
    }
    assert_eq!(
        (n_ticks, written.ended()),
        (ticks, false),
        "what was done is a recording that says that it is not done"
    );
}

#[test]
fn unsuitable_recording_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let sweeps = folder.path().join("sweep.mcap");
    let classes = folder.path().join("class.mcap");
    succeeded(&alone("misbehaving-source", &[], &[("--record", &sweeps), ("--drive", folder.path())]));
    succeeded(&alone("misbehaving-relay", &[], &[("--recording", &sweeps), ("--record", &classes)]));
    for (program, arguments, files, code, words) in [
        ("misbehaving-relay", &[][..], &[("--recording", &*classes)][..], 78, "has no topic sweep, which relay needs"),
        ("misbehaving-relay", &[], &[], 2, "--recording must name a recording with sweep"),
        ("misbehaving-source", &[], &[("--recording", &*sweeps)], 2, "a source reads a drive, not a recording"),
        ("misbehaving-source", &[], &[], 78, "a source needs --drive"),
        ("replica-slam_aggregate", &[], &[("--recording", &*sweeps)], 1, "add --drive FOLDER"),
        ("misbehaving-sink", &["--set", "relay.fault=9"], &[("--recording", &*sweeps)], 78, "needs --output"),
        ("misbehaving-relay", &["--set", "relay.fault=odd"], &[("--recording", &*sweeps)], 78, "relay.fault"),
        ("misbehaving-relay", &["--recordng"], &[], 2, "unexpected argument '--recordng' found"),
        (
            "misbehaving-relay",
            &[],
            &[("--recording", &*sweeps), ("--record", &*sweeps)],
            2,
            "is also the input recording",
        ),
    ] {
        let output = alone(program, arguments, files);
        assert_eq!(output.status.code(), Some(code), "{}", output_text(&output));
        assert!(output_text(&output).contains(words), "{words:?} is not in {}", output_text(&output));
    }
}

#[test]
fn closed_stdout_is_no_failure() {
    let folder = tempfile::tempdir().expect("a folder");
    let launch_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("launch.toml");
    let drive = folder.path().to_str().expect("UTF-8");
    let check = launch_file.to_str().expect("UTF-8");
    for (program, arguments) in [
        ("misbehaving-source", &["run", "--drive", drive][..]),
        ("misbehaving-source", &["run", "--drive", drive, "--json"]),
        ("replica-launch", &[check, "--graph"]),
        ("replica-launch", &[check, "--check"]),
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output = Command::new(binary(program)).args(arguments).stdout(writer).output().expect("starts");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", output_text(&output));
    }
}
