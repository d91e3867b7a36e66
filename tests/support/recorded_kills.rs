//! SIGKILL of a process of a run that is recorded: the results stay the same, and the recording is complete or reported
//! as incomplete.

use crate::kills::{Moment, await_moment};
use crate::launch::{output_text, result_files};
use crate::{Launch, Running, binary, is_alive, lidar_pipeline, processes_of, wait_for};
use random::Random;
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// All topics that export needs.
const TOPICS: &str = "submap,trajectory";
/// The processes of a run of [`lidar_pipeline`] with a recorder.
pub const RECORDED_VICTIMS: [&str; 6] = ["acquire", "slam_aggregate", "export", "recorder", "supervisor", "all"];

/// Outcomes of the recordings.
#[derive(Debug, Default)]
pub struct RecordedKills {
    /// Kills by victim.
    pub struck: BTreeMap<&'static str, usize>,
    /// Complete recordings, which were replayed with the same result.
    pub complete: usize,
    /// Recordings reported as incomplete, also by their replay.
    pub incomplete: usize,
}

/// Records `n` runs and kills one process in each: every victim once, the rest random.
///
/// # Panics
/// If a result differs, or if an incomplete recording is not reported.
pub fn kill_while_recording(drive: &Path, n: usize, random: &mut Random) -> RecordedKills {
    let calm = lidar_pipeline(drive, "");
    let output = calm.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let expected = result_files(&calm.output());
    let mut kills = RecordedKills::default();
    while kills.struck.values().sum::<usize>() < n {
        let n_struck = kills.struck.values().sum::<usize>();
        let victim = *RECORDED_VICTIMS.get(n_struck).unwrap_or(random.pick(&RECORDED_VICTIMS));
        let launch = lidar_pipeline(drive, "restarts = 9").with("--set").with("run.barrier_s=0.2");
        let moment = Moment::seeded(random);
        if !kill_one(&launch, victim, &moment) {
            continue;
        }
        *kills.struck.entry(victim).or_default() += 1;
        assert!(result_files(&launch.output()) == expected, "{victim} {moment:?} changed the result");
        check_recording(&launch, drive, victim, &expected, &mut kills);
    }
    kills
}

/// Records a run and kills the victim; continues the run if necessary. `false`: the run ended before the kill.
fn kill_one(launch: &Launch, victim: &str, moment: &Moment) -> bool {
    let file = recording(launch);
    let mut running = launch.start_again(&["--record", &file, "--topics", TOPICS]);
    if !await_moment(launch, &mut running, victim, moment) {
        return false;
    }
    let recorder = find_recorder(&running);
    if victim == "supervisor" || victim == "all" {
        running.kill(victim == "all");
        // It writes the messages that it has received.
        wait_for("the end of the recorder", || recorder.is_none_or(|pid| !is_alive(pid)).then_some(()));
        let code = launch.start_again(&["--resume"]).wait();
        assert_eq!(code, Some(0), "{victim} {moment:?}: {}", launch.stderr());
        return true;
    }
    let pid = if victim == "recorder" { recorder } else { running.find_stage(victim) };
    if pid.is_none_or(|pid| kill_process(pid, Signal::KILL).is_err()) {
        return false;
    }
    let code = running.wait();
    // The recorder may have been done already.
    let expected: &[i32] = if victim == "recorder" { &[0, 3] } else { &[0] };
    assert!(code.is_some_and(|code| expected.contains(&code)), "{victim} {moment:?}: {code:?} {}", launch.stderr());
    true
}

fn recording(launch: &Launch) -> String {
    launch.folder().join("recorded.mcap").to_str().expect("UTF-8").to_owned()
}

fn find_recorder(running: &Running) -> Option<Pid> {
    processes_of(running.pid().as_raw_nonzero().get().unsigned_abs()).into_iter().find(|pid| {
        let line = std::fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
        String::from_utf8_lossy(&line).split('\0').nth(1) == Some("record")
    })
}

/// Checks that a complete recording gives the same result, and that an incomplete one and its replay are reported as
/// such.
fn check_recording(
    launch: &Launch,
    drive: &Path,
    victim: &str,
    expected: &BTreeMap<String, Vec<u8>>,
    kills: &mut RecordedKills,
) {
    let file = recording(launch);
    let inspected = Command::new(binary("replica")).args(["inspect", &file]).output().expect("replica starts");
    let is_complete = inspected.status.code() == Some(0);
    let replay = lidar_pipeline(drive, "").with("--source").with("replay");
    let replay = replay.with("--set").with(&format!("replay.recording={file}"));
    let output = replay.run();
    let text = || format!("{victim}: {}\n{}", output_text(&inspected), output_text(&output));
    if is_complete {
        assert_eq!(output.status.code(), Some(0), "{}", text());
        assert!(result_files(&replay.output()) == *expected, "the replay differs: {}", text());
        kills.complete += 1;
    } else {
        assert_ne!(output.status.code(), Some(0), "an incomplete recording is replayed without a word: {}", text());
        kills.incomplete += 1;
    }
    let may_be_incomplete = ["recorder", "supervisor", "all"].contains(&victim);
    assert!(is_complete || may_be_incomplete, "the recording has a gap: {}", text());
}
