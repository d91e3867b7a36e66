//! The stages' programs: their paths, their descriptions, and the problems of their settings.

use run::assignment::Description;
use run::process::{ProgramMissing, named_program, own_folder, sibling, stage_command};
use run::{CheckRequest, DescribeDriveRequest, DescribeRequest, DriveDescription};
use serde::Serialize;
use serde::de::DeserializeOwned;
use settings::{Problem, nearest_key};
use std::io::{ErrorKind, Read};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest wait for an answer. A program that describes itself does nothing else in the meantime.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);

/// `ENOEXEC`: the file is not a program of this machine.
const NOT_EXECUTABLE: i32 = 8;

/// A program that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    /// `program` names no file.
    #[error("program {program} does not exist")]
    Absent {
        /// The path.
        program: PathBuf,
    },
    /// There is no stage of the table's name.
    #[error("{hint} ({absent}, and the table has no `program`)")]
    UnknownStage {
        /// The closest names.
        hint: String,
        /// The program that was expected.
        absent: ProgramMissing,
    },
    /// A program of the project is not in the folder of this one.
    #[error(transparent)]
    NotBesideThis(#[from] ProgramMissing),
    /// The program cannot be started.
    #[error("{program}: cannot be started: {source}")]
    Start {
        /// The program.
        program: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The program cannot be waited for or read.
    #[error("{program} {question}: {source}")]
    Read {
        /// The program.
        program: PathBuf,
        /// Its first argument.
        question: String,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// No answer in time.
    #[error("{program} {question}: no answer within {} s", ANSWER_TIMEOUT.as_secs())]
    Timeout {
        /// The program.
        program: PathBuf,
        /// Its first argument.
        question: String,
    },
    /// The program failed.
    #[error("{program} {question}: {status}: {stderr}")]
    Failed {
        /// The program.
        program: PathBuf,
        /// Its first argument.
        question: String,
        /// Exit status.
        status: ExitStatus,
        /// Its output on stderr.
        stderr: String,
    },
    /// The answer cannot be read.
    #[error("{program} {question}: invalid answer; is it of this version? {source}")]
    Answer {
        /// The program.
        program: PathBuf,
        /// Its first argument.
        question: String,
        /// Parse error.
        source: serde_json::Error,
    },
}

impl ProgramError {
    /// Whether the program or the machine failed: the launch file may be valid, and another attempt may succeed.
    pub fn is_failure(&self) -> bool {
        match self {
            Self::Read { .. } | Self::Timeout { .. } => true,
            Self::Failed { status, .. } => status.signal().is_some(),
            Self::Start { source, .. } => {
                !matches!(source.kind(), ErrorKind::NotFound | ErrorKind::PermissionDenied)
                    && source.raw_os_error() != Some(NOT_EXECUTABLE)
            }
            Self::Absent { .. } | Self::UnknownStage { .. } | Self::NotBesideThis(_) | Self::Answer { .. } => false,
        }
    }
}

/// The program of a table: the value of the key `program` ([`named_program`]), or `replica-<table>` in the folder of
/// this one.
pub fn find(table: &str, program: &str, launch_folder: &Path) -> Result<PathBuf, ProgramError> {
    if !program.is_empty() {
        return named_program(program, launch_folder).map_err(|absent| ProgramError::Absent { program: absent.path });
    }
    sibling(&format!("replica-{table}")).map_err(|absent| {
        let mut known = known_stages();
        known.extend(["run".to_owned(), "simulate".to_owned()]);
        let hint = nearest_key(table, known.iter().map(String::as_str)).replace("unknown key", "no such stage");
        ProgramError::UnknownStage { hint, absent }
    })
}

/// Names of the stages among the binaries in the folder of this one.
fn known_stages() -> Vec<String> {
    let entries = std::fs::read_dir(own_folder()).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.file_name().to_string_lossy().strip_prefix("replica-").map(str::to_owned))
        .filter(|name| !["launch", "remote"].contains(&name.as_str()) && !name.contains('.'))
        .collect();
    names.sort();
    names
}

/// Topics and settings of a program, with the settings of its table.
pub fn describe(program: &Path, python: &str, request: &DescribeRequest) -> Result<Description, ProgramError> {
    ask(program, stage_command(program, python, 0), "--describe", request)
}

/// The problems of a program's table.
pub fn check(program: &Path, python: &str, request: &CheckRequest) -> Result<Vec<Problem>, ProgramError> {
    ask(program, stage_command(program, python, 0), "--check", request)
}

/// The table `[simulate]` of a launch file, as interpreted by the `replica` in the folder of this program.
pub fn describe_drive(request: &DescribeDriveRequest) -> Result<DriveDescription, ProgramError> {
    let program = sibling("replica")?;
    let mut command = Command::new(&program);
    command.arg("simulate");
    ask(&program, command, "--describe", request)
}

/// Queries many programs at the same time, because each takes some ms to start. The answers have the order of the
/// questions.
pub fn ask_all<Q: Sync, A: Send>(questions: &[Q], ask: impl Fn(&Q) -> A + Sync) -> Vec<A> {
    let ask = &ask;
    std::thread::scope(|scope| {
        let thread = || std::thread::Builder::new().name("question".to_owned());
        let asked: Vec<_> =
            questions.iter().map(|question| thread().spawn_scoped(scope, move || ask(question))).collect();
        let answers = asked.into_iter().zip(questions).map(|(thread, question)| match thread {
            Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            // If no thread can be started, query one after the other.
            Err(_) => ask(question),
        });
        answers.collect()
    })
}

/// Starts the command with the question and reads its answer.
fn ask<T: DeserializeOwned>(
    program: &Path,
    mut command: Command,
    question: &str,
    request: &impl Serialize,
) -> Result<T, ProgramError> {
    let program_path = || program.to_owned();
    let question_text = || question.to_owned();
    let failed = |source| ProgramError::Read { program: program_path(), question: question_text(), source };
    let invalid = |source| ProgramError::Answer { program: program_path(), question: question_text(), source };
    let started = PathBuf::from(command.get_program());
    let mut child = command
        .args([question, &serde_json::to_string(request).map_err(invalid)?])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|source| ProgramError::Start { program: started, source })?;
    let stdout = read_in_background(child.stdout.take()).map_err(failed)?;
    let stderr = read_in_background(child.stderr.take()).map_err(failed)?;
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        if begun.elapsed() > ANSWER_TIMEOUT {
            // The program has not answered, whether or not it can be killed.
            let _ = child.kill().and_then(|()| child.wait());
            return Err(ProgramError::Timeout { program: program_path(), question: question_text() });
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let answer = stdout.join().unwrap_or_default();
    let stderr = stderr.join().unwrap_or_default();
    if !status.success() {
        let stderr = String::from_utf8_lossy(&stderr).trim().to_owned();
        return Err(ProgramError::Failed { program: program_path(), question: question_text(), status, stderr });
    }
    serde_json::from_slice(&answer).map_err(invalid)
}

/// Reads to the end, so that a full pipe does not block the program.
fn read_in_background(pipe: Option<impl Read + Send + 'static>) -> std::io::Result<JoinHandle<Vec<u8>>> {
    std::thread::Builder::new().name("answer".to_owned()).spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            // Data read before an error is shown.
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

/// Simulates the drive with the `replica` in the folder of this program and the arguments of its description. The path
/// of a rig file is relative to `folder`.
pub fn simulate(arguments: &[String], folder: &Path, drive: &Path) -> Result<(), ProgramError> {
    let program = sibling("replica")?;
    let status = Command::new(&program)
        .args(arguments)
        .current_dir(folder)
        .arg("--out")
        .arg(drive)
        .stdin(Stdio::null())
        .status()
        .map_err(|source| ProgramError::Start { program: program.clone(), source })?;
    if status.success() {
        return Ok(());
    }
    Err(ProgramError::Failed {
        program,
        question: "simulate".to_owned(),
        status,
        stderr: "see the messages above".to_owned(),
    })
}
