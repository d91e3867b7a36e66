//! The stages' binaries: where they are and what they say.

use crate::manifest::Simulate;
use serde::de::DeserializeOwned;
use stage::assignment::Description;
use stage::process::{own_folder, sibling};
use stage::{CheckRequest, DescribeRequest, Problem, nearest_key};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A program that describes itself has this long; it does nothing else.
const ANSWER_PATIENCE: Duration = Duration::from_secs(30);

/// The binary of a table: `program`, relative to the launch file, or `replica-<table>` beside this one.
pub fn find(table: &str, program: &str, launch_folder: &Path) -> Result<PathBuf, String> {
    if !program.is_empty() {
        let path = launch_folder.join(program);
        return if path.is_file() { Ok(path) } else { Err(format!("program {} is not there", path.display())) };
    }
    sibling(&format!("replica-{table}")).map_err(|absent| {
        let known = known_stages();
        let hint = nearest_key(table, known.iter().map(String::as_str)).replace("unknown key", "no such stage");
        format!("{hint} ({absent}, and no `program` is given)")
    })
}

/// Names of the binaries beside this one that are stages.
fn known_stages() -> Vec<String> {
    let entries = std::fs::read_dir(own_folder()).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.file_name().to_string_lossy().strip_prefix("replica-").map(str::to_owned))
        .filter(|name| name != "launch" && !name.contains('.'))
        .collect();
    names.sort();
    names
}

/// Asks a program what it is with the settings of its table.
pub fn describe(program: &Path, request: &DescribeRequest) -> Result<Description, String> {
    let request = serde_json::to_string(request).map_err(|error| error.to_string())?;
    ask(program, &["--describe", &request])
}

/// Asks a program what is wrong with its table.
pub fn check(program: &Path, request: &CheckRequest) -> Result<Vec<Problem>, String> {
    let request = serde_json::to_string(request).map_err(|error| error.to_string())?;
    ask(program, &["--check", &request])
}

/// Puts a question to many programs at the same time, because each takes some ms to start. The answers have the questions' order.
pub fn at_once<Q: Sync, A: Send>(questions: &[Q], ask: impl Fn(&Q) -> A + Sync) -> Vec<A> {
    let ask = &ask;
    std::thread::scope(|scope| {
        let thread = || std::thread::Builder::new().name("question".to_owned());
        let asked: Vec<_> =
            questions.iter().map(|question| thread().spawn_scoped(scope, move || ask(question))).collect();
        let answers = asked.into_iter().zip(questions).map(|(thread, question)| match thread {
            Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            // Where no thread can be had, one after the other.
            Err(_) => ask(question),
        });
        answers.collect()
    })
}

fn ask<T: DeserializeOwned>(program: &Path, arguments: &[&str]) -> Result<T, String> {
    let name = program.display();
    let failed = |error: std::io::Error| format!("{name} {}: {error}", arguments[0]);
    let mut child = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| format!("{name} cannot be started: {error}"))?;
    let stdout = read_in_background(child.stdout.take()).map_err(failed)?;
    let stderr = read_in_background(child.stderr.take()).map_err(failed)?;
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        if begun.elapsed() > ANSWER_PATIENCE {
            // Whether or not it can be killed, there is no answer.
            let _ = child.kill().and_then(|()| child.wait());
            return Err(format!("{name} {}: no answer within {} s", arguments[0], ANSWER_PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let (answer, words) = (stdout.join().unwrap_or_default(), stderr.join().unwrap_or_default());
    if !status.success() {
        return Err(format!("{name} {}: {status}: {}", arguments[0], String::from_utf8_lossy(&words).trim()));
    }
    serde_json::from_slice(&answer)
        .map_err(|error| format!("{name} {}: the answer is none of a stage of this version: {error}", arguments[0]))
}

/// Reads to the end, so that a program with much to say is not held up.
fn read_in_background(pipe: Option<impl Read + Send + 'static>) -> std::io::Result<JoinHandle<Vec<u8>>> {
    std::thread::Builder::new().name("answer".to_owned()).spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            // What was read before an error is shown.
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

/// Makes the drive with the `replica` that lies beside this program; a rig file's path is seen from the launch file's `folder`.
pub fn simulate(simulate: &Simulate, folder: &Path, drive: &Path) -> Result<(), String> {
    let program = sibling("replica")?;
    let status = Command::new(&program)
        .args(simulate.arguments())
        .current_dir(folder)
        .arg("--out")
        .arg(drive)
        .stdin(Stdio::null())
        .status()
        .map_err(|error| format!("{} cannot be started: {error}", program.display()))?;
    if status.success() { Ok(()) } else { Err(format!("{} simulate: {status}", program.display())) }
}
