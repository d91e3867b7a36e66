//! `replica batch`: many drives with one command. No drive disturbs another, an interrupted batch continues, and the
//! jobs of an array together give the results of one batch.

use replica_tests::{
    ANY_DEVIATION, ANY_FIXES, Launch, PATIENT, binary, domain_of, gate, is_alive, leftovers, processes_of,
    result_files, simulated_drive, undisturbed, wait_for,
};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::SystemTime;

const SOURCE: &str = "ticks = 40\npoints = 500";
/// Most tests run without reports.
const REPORT: &[&str] = &["--set", "run.report=true"];
const DRIVES: [&str; 3] = ["monday", "tuesday", "wednesday"];

/// A launch file, drives next to it, and the results of a batch over them.
struct Batch {
    launch: Launch,
}

/// Exit code and messages of a batch.
struct Ended {
    code: Option<i32>,
    text: String,
}

impl Batch {
    /// The small pipeline; it does not read its drives.
    fn misbehaving(source: &str, relay: &str) -> Self {
        let batch = Self { launch: Launch::misbehaving("", source, relay) };
        for drive in DRIVES {
            std::fs::create_dir_all(batch.drive(drive)).expect("made");
        }
        batch
    }
    /// The stages of a LiDAR, and three simulated drives of two seconds.
    fn with_lidar() -> Self {
        let launch = Launch::new(&format!(
            "[run]\n{PATIENT}\nbarrier_s = 0.5\n[acquire]\n[slam_aggregate]\nsubmap_m = 1.0\n{ANY_FIXES}\n\
             [export]\n{ANY_DEVIATION}\n"
        ));
        let batch = Self { launch };
        std::fs::create_dir(batch.launch.folder().join("drives")).expect("made");
        for (drive, seed) in DRIVES.iter().zip(["5", "6", "7"]) {
            let arguments = ["--seed", seed, "--seconds", "2", "--rig", "survey"];
            simulated_drive(&batch.drive(drive), &arguments);
        }
        batch
    }
    fn drive(&self, name: &str) -> PathBuf {
        self.launch.folder().join("drives").join(name)
    }
    fn out(&self) -> PathBuf {
        self.launch.folder().join("results")
    }
    fn output(&self, drive: &str) -> PathBuf {
        self.out().join(drive)
    }
    fn log(&self, drive: &str) -> String {
        std::fs::read_to_string(self.out().join(format!("{drive}.log"))).unwrap_or_default()
    }
    /// The command for these drives with further arguments.
    fn command(&self, out: &Path, drives: &[&str], arguments: &[&str]) -> Command {
        let mut command = Command::new(binary("replica"));
        command.arg("batch").arg(self.launch.folder().join("launch.toml"));
        command.args(drives.iter().map(|drive| self.drive(drive))).arg("--out").arg(out).args(arguments);
        command.stdin(Stdio::null());
        command
    }
    fn run(&self, drives: &[&str], arguments: &[&str]) -> Ended {
        ended(self.command(&self.out(), drives, arguments))
    }
    fn start(&self, drives: &[&str]) -> Child {
        let mut command = self.command(&self.out(), drives, &[]);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("replica starts")
    }
    /// Waits until a stage of the drive's run has saved its state at a barrier of at least this number.
    fn wait_for_barrier(&self, drive: &str, stage: &str, barrier: u64) {
        wait_for("a saved state", || {
            let folders = std::fs::read_dir(self.output(drive).join("run/states")).ok()?.flatten();
            let saved = folders.filter(|folder| folder.path().join(format!("{stage}.state")).is_file());
            let mut barriers = saved.filter_map(|folder| folder.file_name().to_str()?.parse::<u64>().ok());
            barriers.any(|saved| saved >= barrier).then_some(())
        });
    }
    fn assert_undisturbed(&self, drives: &[&str]) {
        for drive in drives {
            let found = std::fs::read(self.output(drive).join("sink.txt")).expect("the sink has written");
            assert!(found == undisturbed(SOURCE, ""), "{drive} differs");
        }
    }
    /// Times of change of all files of the results.
    fn times(&self) -> BTreeMap<PathBuf, SystemTime> {
        let mut folders = vec![self.out()];
        let mut times = BTreeMap::new();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
                if entry.path().is_dir() {
                    folders.push(entry.path());
                } else {
                    times.insert(entry.path(), entry.metadata().expect("a file").modified().expect("a time"));
                }
            }
        }
        times
    }
}

fn ended(mut command: Command) -> Ended {
    let output = command.output().expect("replica starts");
    let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    Ended { code: output.status.code(), text }
}

/// A batch that was killed between the summary of a drive and its end, in steps after the clouds.
#[test]
fn drive_without_report_or_with_leftovers_is_completed_without_another_run() {
    let batch = Batch::misbehaving(SOURCE, "");
    assert_eq!(batch.run(&["monday"], REPORT).code, Some(0));
    let output = batch.output("monday");
    let domain = domain_of(&output);
    let socket = PathBuf::from(format!("/tmp/replica_{domain}_control"));
    let written = |name: &str| std::fs::metadata(output.join(name)).and_then(|file| file.modified()).expect("written");
    let result = written("sink.txt");
    for name in ["report.html", "report.json"] {
        std::fs::remove_file(output.join(name)).expect("removed");
    }
    std::fs::create_dir_all(output.join("run/states/3")).expect("made");
    std::fs::DirBuilder::new().mode(0o700).create(&socket).expect("made");
    assert_eq!(batch.run(&["monday"], REPORT).code, Some(0), "{}", batch.log("monday"));
    assert!(output.join("report.html").exists() && output.join("report.json").exists(), "{}", batch.log("monday"));
    assert!(!output.join("run/states/3").exists() && !socket.exists(), "leftovers");
    assert_eq!(written("sink.txt"), result, "the drive was not run again");
    let report = written("report.html");
    let again = batch.run(&["monday"], REPORT);
    assert!(again.text.contains("monday: complete") && again.text.contains("(done before)"), "{}", again.text);
    assert_eq!(written("report.html"), report, "a complete drive is left alone");
}

#[test]
fn damaged_drive_costs_no_other_drive_its_result() {
    let batch = Batch::with_lidar();
    let capture = batch.drive("tuesday").join("lidar/000000.pcap");
    let recorded = std::fs::read(&capture).expect("a capture");
    std::fs::write(&capture, "no capture").expect("written");
    let first = batch.run(&DRIVES, &[]);
    assert_eq!(first.code, Some(1), "{}", first.text);
    assert!(
        first.text.contains("[1/3] monday: complete, ") && first.text.contains("[2/3] tuesday: failed (exit status: ")
    );
    assert!(first.text.contains("[3/3] wednesday: complete, "), "{}", first.text);
    assert!(batch.log("tuesday").contains("000000.pcap"), "{}", batch.log("tuesday"));
    let table = batch.run(&DRIVES, &["--table=csv"]);
    assert_eq!(table.code, Some(1), "{}", table.text);
    let outcomes: Vec<&str> = table.text.lines().filter_map(|line| line.split(',').nth(1)).collect();
    assert_eq!(outcomes, ["outcome", "complete", "failed", "complete"]);

    // Only the repaired drive is run again.
    std::fs::write(&capture, recorded).expect("written");
    let second = batch.run(&DRIVES, &[]);
    assert_eq!(second.code, Some(0), "{}\n{}", second.text, batch.log("tuesday"));
    assert_eq!(second.text.matches("(done before)").count(), 2, "{}", second.text);
    assert!(second.text.contains("[2/3] tuesday: complete, "), "{}", second.text);
}

#[test]
fn second_call_runs_nothing() {
    let batch = Batch::misbehaving(SOURCE, "");
    let first = batch.run(&DRIVES, &[]);
    assert_eq!(first.code, Some(0), "{}", first.text);
    batch.assert_undisturbed(&DRIVES);
    let before = batch.times();
    let second = batch.run(&DRIVES, &[]);
    assert_eq!(second.code, Some(0), "{}", second.text);
    assert_eq!(second.text.matches("(done before)").count(), 3, "{}", second.text);
    assert!(batch.times() == before, "the second call has changed files");
    let table = batch.run(&DRIVES, &["--table"]);
    assert_eq!(table.code, Some(0), "{}", table.text);
    assert!(table.text.contains("3 drives: 3 complete; finished: 11.7 s of drive"), "{}", table.text);
}

/// SIGKILL leaves no run behind that would lock the output, and the next call continues it from its last barrier.
#[test]
fn killed_batch_continues_with_the_same_bytes() {
    let batch = Batch::misbehaving(SOURCE, &gate(20));
    let gate = batch.out().join("gate");
    std::fs::create_dir(batch.out()).expect("made");
    std::fs::write(&gate, []).expect("written");
    assert_eq!(batch.run(&DRIVES[..1], &[]).code, Some(0));
    std::fs::remove_file(&gate).expect("removed");

    let mut killed = batch.start(&DRIVES);
    batch.wait_for_barrier("tuesday", "relay", 2);
    // The last stage saves its state of a barrier after the others.
    batch.wait_for_barrier("tuesday", "sink", 1);
    let run = processes_of(killed.id());
    assert_eq!(run.len(), 1, "one drive at a time");
    let stages = processes_of(run[0].as_raw_nonzero().get() as u32);
    assert_eq!(stages.len(), 3);
    killed.kill().expect("a child can be killed");
    killed.wait().expect("waits");
    wait_for("the end of the run", || run.iter().chain(&stages).all(|pid| !is_alive(*pid)).then_some(()));
    let table = batch.run(&DRIVES, &["--table"]);
    assert_eq!(table.code, Some(3), "{}", table.text);
    assert!(table.text.contains("3 drives: 1 complete, 1 unfinished, 1 not_run;"), "{}", table.text);

    std::fs::write(&gate, []).expect("written");
    let again = batch.run(&DRIVES, &[]);
    assert_eq!(again.code, Some(0), "{}", again.text);
    assert_eq!(again.text.matches("(done before)").count(), 1, "{}", again.text);
    assert!(batch.log("tuesday").contains("resuming from barrier"), "{}", batch.log("tuesday"));
    batch.assert_undisturbed(&DRIVES);
    for drive in DRIVES {
        assert_eq!(leftovers(&domain_of(&batch.output(drive))), Vec::<String>::new(), "{drive}");
    }
}

#[test]
fn ctrl_c_drains_the_run_and_the_same_command_continues() {
    // Slow enough that the signal comes before the last drive ends.
    let batch = Batch::misbehaving(&format!("{SOURCE}\npace_ms = 100"), "");
    let mut stopped = batch.start(&DRIVES);
    batch.wait_for_barrier("monday", "source", 1);
    kill_process(Pid::from_child(&stopped), Signal::INT).expect("it lives");
    assert_eq!(stopped.wait().expect("waits").code(), Some(3));
    assert_eq!(leftovers(&domain_of(&batch.output("monday"))), Vec::<String>::new());
    let table = batch.run(&DRIVES, &["--table"]);
    assert!(table.text.contains("not_run") && !table.text.contains("failed"), "{}", table.text);
    let again = batch.run(&DRIVES, &[]);
    assert_eq!(again.code, Some(0), "{}", again.text);
    batch.assert_undisturbed(&DRIVES);
}

#[test]
fn jobs_of_an_array_at_once_give_what_one_batch_gives() {
    let batch = Batch::with_lidar();
    let one = batch.run(&DRIVES, &[]);
    assert_eq!(one.code, Some(0), "{}", one.text);
    let out = batch.launch.folder().join("of_jobs");
    let jobs = ["1/2", "2/2"].map(|job| {
        let mut command = batch.command(&out, &DRIVES, &["--job", job]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("replica starts")
    });
    let texts = jobs.map(|job| {
        let output = job.wait_with_output().expect("ends");
        let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert_eq!(output.status.code(), Some(0), "{text}");
        text
    });
    assert!(texts[0].contains("monday") && texts[0].contains("wednesday") && !texts[0].contains("tuesday"));
    assert!(texts[1].contains("[1/1] tuesday: complete"), "{texts:?}");
    let mut all_bytes = Vec::new();
    for drive in DRIVES {
        let expected = result_files(&batch.output(drive));
        let found = result_files(&out.join(drive));
        assert!(expected.contains_key("submap_0000.ply"), "{:?}", expected.keys());
        assert!(expected == found, "{drive} differs");
        all_bytes.push(found);
    }
    assert!(all_bytes[0] != all_bytes[1], "the drives are different, or this test shows nothing");
}

#[test]
fn results_of_other_settings_are_refused_unless_overwritten() {
    let batch = Batch::misbehaving(SOURCE, "");
    assert_eq!(batch.run(&DRIVES[..2], &[]).code, Some(0));
    let before = batch.times();
    let others = ["--set", "source.points=400"];
    let refused = batch.run(&DRIVES, &others);
    assert_eq!(refused.code, Some(78), "{}", refused.text);
    assert_eq!(refused.text.matches("was started with other settings").count(), 2, "{}", refused.text);
    assert!(batch.times() == before, "the refused batch has changed files");

    let replaced = batch.run(&DRIVES, &[&others[..], &["--overwrite"]].concat());
    assert_eq!(replaced.code, Some(0), "{}", replaced.text);
    assert!(!replaced.text.contains("(done before)"), "{}", replaced.text);
    let again = batch.run(&DRIVES, &[&others[..], &["--overwrite"]].concat());
    assert_eq!(again.text.matches("(done before)").count(), 3, "{}", again.text);

    // The same settings, another drive.
    std::fs::write(batch.drive("monday").join("drive.toml"), "[lidar]\nmodel = \"vlp16\"").expect("written");
    let changed = batch.run(&DRIVES, &others);
    assert_eq!(changed.code, Some(78), "{}", changed.text);
    assert!(changed.text.contains("drive.toml: its content has changed"), "{}", changed.text);
}

#[test]
fn all_faults_of_a_batch_are_reported_before_the_start() {
    let batch = Batch::misbehaving(SOURCE, "");
    let refused = batch.run(&["monday", "monday", "absent", "tuesday"], &[]);
    assert_eq!(refused.code, Some(78), "{}", refused.text);
    assert!(refused.text.contains("monday: is given twice"), "{}", refused.text);
    assert!(refused.text.contains("absent: No such file"), "{}", refused.text);
    assert!(!batch.out().exists());
    let setting = batch.run(&DRIVES, &["--set", "source.tick=3"]);
    assert_eq!(setting.code, Some(78), "no drive fits the launch file: {}", setting.text);
    assert!(batch.log("monday").contains("source.tick"), "{}", batch.log("monday"));
    for job in ["0/2", "3/2", "1"] {
        assert_eq!(batch.run(&DRIVES, &["--job", job]).code, Some(2), "{job}");
    }
}

#[test]
fn failed_drive_ends_the_batch_only_on_request() {
    let batch = Batch::misbehaving(SOURCE, "fault = \"error\"\nat_tick = 3");
    let settings = ["--set", "run.restarts=0"];
    let stopped = batch.run(&DRIVES, &[&settings[..], &["--stop-at-first"]].concat());
    assert_eq!(stopped.code, Some(1), "{}", stopped.text);
    assert!(stopped.text.contains("3 drives: 1 failed, 2 not_run;"), "{}", stopped.text);
    let all = batch.run(&DRIVES, &settings);
    assert_eq!(all.code, Some(1), "{}", all.text);
    assert!(all.text.contains("3 drives: 3 failed;"), "{}", all.text);
}

#[test]
fn plan_follows_from_the_drives_that_are_finished() {
    let batch = Batch::misbehaving(SOURCE, "");
    for (drive, n_bytes) in DRIVES.iter().zip([3_000_000, 1_000_000, 2_000_000]) {
        std::fs::write(batch.drive(drive).join("capture"), vec![0; n_bytes]).expect("written");
    }
    let early = batch.run(&DRIVES, &["--plan", "3"]);
    assert_eq!(early.code, Some(1), "{}", early.text);
    assert!(early.text.contains("no drive is finished"), "{}", early.text);
    assert_eq!(batch.run(&DRIVES[..1], &[]).code, Some(0));
    let plan = batch.run(&DRIVES, &["--plan", "3"]);
    assert_eq!(plan.code, Some(0), "{}", plan.text);
    assert!(plan.text.contains("3 drives, 1 of them measured: "), "{}", plan.text);
    // 3, 1 and 2 MB: two machines have 5 and 1, three machines have 3 at most.
    let efficiencies: Vec<&str> = plan.text.lines().skip(2).filter_map(|line| line.split_whitespace().nth(2)).collect();
    assert_eq!(efficiencies, ["100", "60", "67"], "{}", plan.text);
}

/// SLURM signals every process of a job when it is requeued, cancelled, or at its limit.
#[test]
fn sigterm_to_every_process_of_a_batch_drains_it_and_the_same_command_continues() {
    let batch = Batch::misbehaving(&format!("{SOURCE}\npace_ms = 100"), "");
    let mut stopped = batch.start(&DRIVES);
    batch.wait_for_barrier("monday", "sink", 1);
    let run = processes_of(stopped.id());
    let stages: Vec<Pid> = run.iter().flat_map(|run| processes_of(run.as_raw_nonzero().get() as u32)).collect();
    assert_eq!((run.len(), stages.len()), (1, 3));
    for process in stages.into_iter().chain(run).chain([Pid::from_child(&stopped)]) {
        kill_process(process, Signal::TERM).expect("it lives");
    }
    assert_eq!(stopped.wait().expect("waits").code(), Some(3), "{}", batch.log("monday"));
    assert!(batch.log("monday").contains("draining"), "{}", batch.log("monday"));
    assert_eq!(leftovers(&domain_of(&batch.output("monday"))), Vec::<String>::new());
    let again = batch.run(&DRIVES, &[]);
    assert_eq!(again.code, Some(0), "{}", again.text);
    assert!(batch.log("monday").contains("resuming from barrier"), "{}", batch.log("monday"));
    batch.assert_undisturbed(&DRIVES);
}
