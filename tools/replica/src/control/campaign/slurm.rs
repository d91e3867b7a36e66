//! The commands of SLURM: `sbatch`, `squeue`, `scontrol`, `sacct`, `scancel`.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

/// A command of SLURM that failed.
#[derive(Debug, thiserror::Error)]
pub enum SlurmError {
    /// The program is not installed.
    #[error(
        "{program}: not found: --engine slurm needs the commands of SLURM on this host\nhint: Debian: apt-get install slurm-client"
    )]
    Absent {
        /// Its name.
        program: &'static str,
    },
    /// The program cannot be started.
    #[error("{program}: {source}")]
    Start {
        /// Its name.
        program: &'static str,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// SLURM has refused the request.
    #[error("{command}: {message}")]
    Refused {
        /// The command.
        command: String,
        /// Its message.
        message: String,
    },
    /// The answer does not have its format.
    #[error("{command}: the answer {answer:?} is not a job number")]
    Answer {
        /// The command.
        command: String,
        /// The answer.
        answer: String,
    },
}

/// A job or a task of an array, as SLURM describes it.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct JobState {
    /// SLURM's word: PENDING, RUNNING, COMPLETED, FAILED, `NODE_FAIL`, TIMEOUT ...
    pub state: String,
    /// Its reason, for example of a job that waits.
    pub reason: String,
    /// The nodes.
    pub nodes: String,
}

impl JobState {
    /// Whether the job waits, runs, or will run again.
    pub fn is_active(&self) -> bool {
        const ACTIVE: [&str; 11] = [
            "PENDING",
            "RUNNING",
            "SUSPENDED",
            "COMPLETING",
            "CONFIGURING",
            "REQUEUED",
            "REQUEUE_HOLD",
            "REQUEUE_FED",
            "RESIZING",
            "SIGNALING",
            "STAGE_OUT",
        ];
        ACTIVE.contains(&self.state.as_str())
    }
}

/// Submits a script. Returns the number of its job. `options` come before the script and replace its own.
pub fn submit(script: &Path, options: &[String]) -> Result<String, SlurmError> {
    let script = script.display().to_string();
    let arguments: Vec<&str> =
        ["--parsable"].into_iter().chain(options.iter().map(String::as_str)).chain([script.as_str()]).collect();
    let answer = answer("sbatch", &arguments)?;
    // On several clusters: number;cluster.
    let job = answer.trim().split(';').next().unwrap_or_default().to_owned();
    let is_number = !job.is_empty() && job.chars().all(|c| c.is_ascii_digit());
    if is_number { Ok(job) } else { Err(SlurmError::Answer { command: format!("sbatch {script}"), answer }) }
}

/// The states of a job and of its tasks by `JOB` or `JOB_TASK`. Empty if SLURM no longer knows the job.
pub fn states(job: &str) -> Result<BTreeMap<String, JobState>, SlurmError> {
    let queue = answer("squeue", &["--noheader", "--array", "--states=all", "--format=%i|%T|%r|%N", "--jobs", job]);
    let mut states = match queue {
        Ok(text) => parse_states(&text),
        // SLURM forgets a job minutes after its end.
        Err(SlurmError::Refused { message, .. }) if message.contains("Invalid job id") => BTreeMap::new(),
        Err(error) => return Err(error),
    };
    // Only accounting (slurmdbd) remembers older tasks. Without it, the command fails.
    if let Ok(text) = answer(
        "sacct",
        &["--noheader", "--parsable2", "--allocations", "--format=JobID,State,Reason,NodeList", "--jobs", job],
    ) {
        for (task, state) in parse_states(&text) {
            states.entry(task).or_insert(state);
        }
    }
    Ok(states)
}

/// Lines of number, state, reason and nodes, separated by `|`.
fn parse_states(text: &str) -> BTreeMap<String, JobState> {
    let lines = text.lines().filter_map(|line| {
        let mut cells = line.trim().split('|');
        let task = cells.next().filter(|task| !task.is_empty())?.to_owned();
        // sacct adds who cancelled: "CANCELLED by 0".
        let state = cells.next()?.split_whitespace().next().unwrap_or_default().to_owned();
        let mut rest = cells.map(|cell| if cell == "None" { String::new() } else { cell.to_owned() });
        let (reason, nodes) = (rest.next().unwrap_or_default(), rest.next().unwrap_or_default());
        Some((task, JobState { state, reason, nodes }))
    });
    lines.collect()
}

/// How tasks that run are cancelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cancel {
    /// Their batch process alone gets SIGTERM. They end when their run has drained.
    Drain,
    /// All their processes get SIGTERM, and SIGKILL after the cluster's `KillWait`.
    Now,
}

/// Cancels a job that is active.
pub fn cancel(job: &str, how: Cancel) -> Result<(), SlurmError> {
    if how == Cancel::Now {
        return answer("scancel", &[job]).map(drop);
    }
    answer("scancel", &["--state=PENDING", job])?;
    answer("scancel", &["--state=RUNNING", "--batch", "--signal=TERM", job]).map(drop)
}

/// Runs a command. Returns what it printed.
fn answer(program: &'static str, arguments: &[&str]) -> Result<String, SlurmError> {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).output();
    let output = output.map_err(|source| match source.kind() {
        ErrorKind::NotFound => SlurmError::Absent { program },
        _ => SlurmError::Start { program, source },
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let message = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    let message = if message.is_empty() { output.status.to_string() } else { message };
    Err(SlurmError::Refused { command: format!("{program} {}", arguments.join(" ")), message })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_of_squeue_and_of_sacct_are_read() {
        let text = "12_0|RUNNING|None|n1\n12_1|PENDING|(Resources)|\n\n12_2|CANCELLED by 0|None|n2\n";
        let states = parse_states(text);
        assert_eq!(states.len(), 3);
        assert_eq!(states["12_0"], JobState { state: "RUNNING".into(), reason: String::new(), nodes: "n1".into() });
        assert_eq!(states["12_1"].reason, "(Resources)");
        assert!(states["12_1"].is_active() && !states["12_2"].is_active());
        assert_eq!(states["12_2"].state, "CANCELLED");
    }

    #[test]
    fn absent_program_and_refusal_are_named() {
        let error = answer("program-that-is-absent", &[]).expect_err("is absent");
        assert!(error.to_string().contains("not found"), "{error}");
        let error = answer("ls", &["/absent"]).expect_err("fails");
        assert!(error.to_string().starts_with("ls /absent: "), "{error}");
    }
}
