//! `replica campaign` on a real SLURM of three nodes, which the test starts on this machine.

use replica_tests::{
    ANY_DEVIATION, ANY_FIXES, Launch, PATIENT, Slurm, binary, result_files, simulated_drive, wait_for,
};
use rustix::process::{Pid, Signal, kill_process};
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// Drives that are disturbed have 12 s, the others 2 s.
const REQUEUED: &str = "d00";
const LIMITED: &str = "d01";
const LOST_NODE: &str = "d02";
const FAULTY: &str = "d03";
const N_DRIVES: usize = 12;
/// Longest wait for all jobs: requeued jobs and lost nodes alone cost SLURM a minute.
const JOBS_TIMEOUT: Duration = Duration::from_mins(15);

struct Campaign {
    launch: Launch,
    slurm: Slurm,
}

/// A run whose source stands still, so that the test can act in its middle.
struct Held {
    source: Pid,
}

impl Held {
    fn continue_source(self) {
        // SLURM may have continued and ended it.
        let _ = kill_process(self.source, Signal::CONT);
    }
}

impl Campaign {
    fn new() -> Self {
        let launch = Launch::new(&format!(
            "[run]\n{PATIENT}\nstall_s = 600.0\nbarrier_s = 0.5\nreport = false\n[acquire]\n[slam_aggregate]\nsubmap_m = 1.0\n\
             {ANY_FIXES}\n[export]\n{ANY_DEVIATION}\n"
        ));
        let campaign = Self { launch, slurm: Slurm::start() };
        std::fs::create_dir(campaign.path("drives")).expect("made");
        for k in 0..N_DRIVES {
            let seconds = if k < 3 { "12" } else { "2" };
            let seed = (20 + k).to_string();
            simulated_drive(
                &campaign.path(&format!("drives/d{k:02}")),
                &["--seed", &seed, "--seconds", seconds, "--rig", "survey"],
            );
        }
        std::fs::write(campaign.path("drives").join(FAULTY).join("lidar/000000.pcap"), "no capture").expect("written");
        let text = "version = 1\nname = \"twelve\"\nlaunch = \"launch.toml\"\ndrives = [\"drives/*\"]\nout = \"out\"\n\
                    [slurm]\ncpus = 2\nminutes = 10\ndrain_s = 120\noptions = [\"--partition=all\"]\n\
                    [deliver]\noptions = [\"--allow-unreferenced\"]\n";
        std::fs::write(campaign.path("campaign.toml"), text).expect("written");
        campaign
    }
    fn path(&self, name: &str) -> PathBuf {
        self.launch.folder().join(name)
    }
    fn run(&self, subcommand: &[&str]) -> Output {
        let mut command = self.slurm.command(binary("replica"));
        command.arg("campaign").arg(subcommand[0]).arg(self.path("campaign.toml")).args(&subcommand[1..]);
        command.output().expect("replica starts")
    }
    fn ok(&self, subcommand: &[&str]) -> String {
        let output = self.run(subcommand);
        assert!(output.status.success(), "{subcommand:?}: {}", text(&output));
        text(&output)
    }
    fn status(&self) -> serde_json::Value {
        serde_json::from_slice(&self.run(&["status", "--json"]).stdout).expect("JSON")
    }
    /// A drive in the answer of `status`.
    fn drive(&self, name: &str) -> serde_json::Value {
        let status = self.status();
        let drives = status["drives"].as_array().expect("a list");
        drives.iter().find(|drive| drive["drive"] == name).expect("a drive").clone()
    }
    /// Stops the source of a drive after a barrier.
    fn hold(&self, drive: &str) -> Held {
        let assignment = format!("/out/{drive}/run/acquire.json");
        let states = self.path("out").join(drive).join("run/states");
        let source = wait_for("a barrier", || {
            std::fs::read_dir(&states)
                .ok()?
                .flatten()
                .find(|barrier| barrier.path().join("acquire.state").is_file())?;
            process_with(&assignment)
        });
        kill_process(source, Signal::STOP).expect("it lives");
        Held { source }
    }
    fn log(&self, drive: &str) -> String {
        std::fs::read_to_string(self.path("out").join(format!("{drive}.log"))).unwrap_or_default()
    }
    fn wait_for_all_jobs(&self) {
        let begun = Instant::now();
        while !self.slurm.ask("squeue", &["--noheader"]).trim().is_empty() {
            assert!(begun.elapsed() < JOBS_TIMEOUT, "{}", self.slurm.ask("squeue", &[]));
            std::thread::park_timeout(Duration::from_millis(500));
        }
    }
}

/// The process whose command line ends with these words.
fn process_with(words: &str) -> Option<Pid> {
    let entries = std::fs::read_dir("/proc").ok()?.flatten();
    let mut pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let pid = pids.find(|pid| {
        let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&line).trim_end_matches('\0').ends_with(words)
    });
    pid.and_then(Pid::from_raw)
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

#[test]
#[ignore = "long: .ci/run --nightly, where SLURM can be installed"]
fn disturbed_campaign_gives_the_bytes_of_one_machine() {
    let campaign = Campaign::new();
    print!("{}", campaign.ok(&["submit", "--engine", "slurm"]));
    // The first three drives run at the same time, each on a node of its own.
    let requeued = campaign.hold(REQUEUED);
    let limited = campaign.hold(LIMITED);
    let lost = campaign.hold(LOST_NODE);
    let job = |drive: &str| campaign.drive(drive)["task"]["job"].as_str().expect("a job").to_owned();

    // A drive gets the signal before its time limit. The batch alone receives it, and the run drains.
    campaign.slurm.ask("scontrol", &["update", &format!("JobId={}", job(LIMITED)), "TimeLimit=3"]);
    wait_for("the drain", || campaign.log(LIMITED).contains("draining").then_some(()));
    limited.continue_source();
    wait_for("the end of the limited run", || {
        campaign.path("out").join(LIMITED).join("summary.json").exists().then_some(())
    });

    // SLURM sends SIGTERM to every process of the job, and SIGKILL 5 s later.
    campaign.slurm.ask("scontrol", &["requeue", &job(REQUEUED)]);
    requeued.continue_source();

    // A node is lost for SLURM while its processes live on. The next job must wait for them.
    let node = campaign.drive(LOST_NODE)["task"]["state"]["nodes"].as_str().expect("a node").to_owned();
    campaign.slurm.kill_node(&node);
    let lock = campaign.path("out").canonicalize().expect("a path").join(LOST_NODE).join("run/lock");
    wait_for("a second job", || {
        let batch = format!("--wait\0{}", 3600);
        let waiting = process_holding(&lock, &["--check", &batch])?;
        Some(waiting)
    });
    lost.continue_source();
    campaign.slurm.start_node(&node);
    campaign.wait_for_all_jobs();

    let status = campaign.run(&["status"]);
    print!("{}", text(&status));
    assert_eq!(status.status.code(), Some(1), "{}", text(&status));
    assert_eq!(campaign.drive(FAULTY)["outcome"], "failed");
    assert_eq!(campaign.drive(LIMITED)["outcome"], "unfinished", "{}", campaign.log(LIMITED));
    let ended = text(&status).lines().filter(|line| line.contains(" COMPLETED ") || line.contains(" FAILED ")).count();
    assert!(ended >= N_DRIVES, "every job has ended: {}", text(&status));
    assert!(campaign.log(REQUEUED).contains("resuming from barrier"), "{}", campaign.log(REQUEUED));

    print!("{}", campaign.ok(&["resume"]));
    campaign.wait_for_all_jobs();
    let status = campaign.run(&["status"]);
    print!("{}", text(&status));
    assert!(campaign.log(LIMITED).contains("resuming from barrier"), "{}", campaign.log(LIMITED));

    let alone = campaign.path("alone");
    let mut batch = Command::new(binary("replica"));
    batch.arg("batch").arg(campaign.path("launch.toml")).arg("--out").arg(&alone);
    batch.args((0..N_DRIVES).map(|k| campaign.path(&format!("drives/d{k:02}"))));
    batch.output().expect("replica starts");
    for k in 0..N_DRIVES {
        let drive = format!("d{k:02}");
        if drive == FAULTY {
            assert_eq!(campaign.drive(&drive)["outcome"], "failed");
            continue;
        }
        let outcome = campaign.drive(&drive)["outcome"].clone();
        assert!(outcome == "complete" || outcome == "doubts", "{drive}: {outcome}: {}", campaign.log(&drive));
        let expected = result_files(&alone.join(&drive));
        assert!(expected.contains_key("submap_0000.ply"), "{:?}", expected.keys());
        assert!(expected == result_files(&campaign.path("out").join(&drive)), "{drive} differs");
        assert!(campaign.path("out/deliveries").join(&drive).is_dir(), "{drive} is delivered");
    }
    assert!(!campaign.path("out/deliveries").join(FAULTY).exists());
}

/// A process with these words in its command line that has the file open.
fn process_holding(file: &std::path::Path, words: &[&str]) -> Option<Pid> {
    let entries = std::fs::read_dir("/proc").ok()?.flatten();
    let mut pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let pid = pids.find(|pid| {
        let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line).into_owned();
        let open = std::fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
        words.iter().all(|words| line.contains(words))
            && open.filter_map(|entry| std::fs::read_link(entry.path()).ok()).any(|open| open == file)
    });
    pid.and_then(Pid::from_raw)
}

#[test]
#[cfg_attr(not(slurm), ignore = "needs SLURM and the superuser: apt-get install slurmctld slurmd slurm-client munge")]
fn queue_that_refuses_is_named_and_nothing_is_lost() {
    let launch = Launch::misbehaving("", "ticks = 8\npoints = 500", "");
    let path = |name: &str| launch.folder().join(name);
    for drive in ["drives/a", "drives/b"] {
        std::fs::create_dir_all(path(drive)).expect("made");
    }
    let slurm = Slurm::start();
    let campaign = |options: &str, subcommand: &[&str]| {
        let text = format!(
            "version = 1\nname = \"two\"\nlaunch = \"launch.toml\"\ndrives = [\"drives/*\"]\nout = \"out\"\n[slurm]\noptions = [{options}]\n"
        );
        std::fs::write(path("campaign.toml"), text).expect("written");
        let mut command = slurm.command(binary("replica"));
        command.arg("campaign").arg(subcommand[0]).arg(path("campaign.toml")).args(&subcommand[1..]);
        let output = command.output().expect("replica starts");
        (output.status.code(), self::text(&output))
    };
    let submit = ["submit", "--engine", "slurm"];
    let (code, refused) = campaign("\"--partition=absent\"", &submit);
    assert_eq!(code, Some(1), "{refused}");
    assert!(refused.contains("sbatch ") && refused.contains("invalid partition specified: absent"), "{refused}");
    let (code, submitted) = campaign("\"--partition=all\"", &submit);
    assert_eq!(code, Some(0), "{submitted}");
    let (code, again) = campaign("\"--partition=all\"", &submit);
    assert!(code == Some(0) && again.contains("no drive is left to submit"), "{again}");
    wait_for("the end of all jobs", || slurm.ask("squeue", &["--noheader"]).trim().is_empty().then_some(()));
    let (code, status) = campaign("\"--partition=all\"", &["status"]);
    assert_eq!(code, Some(0), "{status}");
    assert!(status.contains("2 drives: 2 finished, 0 jobs active"), "{status}");
    // A cancelled job leaves nothing active.
    let (code, cancelled) = campaign("\"--partition=all\"", &["cancel"]);
    assert!(code == Some(0) && cancelled.contains("0 active drives of 2"), "{cancelled}");
    // A script that a person has changed is neither replaced nor lost.
    let script = path("out/campaign/array.sh");
    let changed = std::fs::read_to_string(&script).expect("written") + "# changed\n";
    std::fs::write(&script, &changed).expect("written");
    let (code, refused) = campaign("\"--partition=all\"", &submit);
    assert!(code == Some(1) && refused.contains("array.sh: was changed since it was written"), "{refused}");
    assert_eq!(std::fs::read_to_string(&script).expect("there"), changed);
}
