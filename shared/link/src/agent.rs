//! The agent of a host: for each connection with the correct key it starts a stage's program and passes bytes between
//! both.
//!
//! The program uses the connection, a Unix socket, as both standard input and output. It ends with the connection, and
//! with the agent.

use crate::start::{Answer, receive, send};
use crate::{Key, LinkError, Receiver, Sender, StageProgram, accept};
use run::process::{interpreter, named_program, sibling, stage_command};
use rustix::net::sockopt;
use rustix::process::{Pid, Signal, kill_process_group};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{IpAddr, Shutdown, TcpListener, TcpStream};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Component, Path, PathBuf};
use std::process::Child;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Largest number of simultaneous connections with the key: a run has a stage or two here, and a check connects for each
/// of them.
const MAX_SESSIONS: usize = 64;
/// Largest number of simultaneous handshakes, in all and with one host: whoever has no key cannot keep other hosts out.
/// A handshake takes milliseconds, and at most seconds.
const MAX_HANDSHAKES: usize = 256;
const MAX_HANDSHAKES_PER_HOST: usize = 64;
/// Longest silence of a client before its request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);
/// Time after which a silent client whose host or network has failed is given up.
const GONE_AFTER: Duration = Duration::from_secs(30);
/// Interval of polling for the end of a program. A program without a connection has nothing to finish.
const END_POLL: Duration = Duration::from_millis(10);
const END_POLLS: u32 = 20;
/// Bytes that are passed on at a time: the size of a Noise message.
const PIECE: usize = 64 << 10;

/// The configuration and sessions of an agent.
pub struct Agent {
    /// Key of all clients.
    pub key: Key,
    /// Folder of relative paths: programs, models.
    pub folder: PathBuf,
    /// `--version`; clients of another build are refused.
    pub version: String,
    /// Receives a line about each session.
    pub report: fn(&str),
    sessions: Mutex<BTreeMap<String, (usize, TcpStream)>>,
    /// Number of handshakes with each host.
    handshakes: Mutex<BTreeMap<IpAddr, usize>>,
    n_sessions: AtomicUsize,
    n_started: AtomicUsize,
}

impl Agent {
    /// An agent without sessions.
    pub fn new(key: Key, folder: PathBuf, version: String, report: fn(&str)) -> Self {
        let (sessions, handshakes, n_sessions, n_started) = Default::default();
        Self { key, folder, version, report, sessions, handshakes, n_sessions, n_started }
    }

    /// Serves connections, each in its own thread. Does not return.
    pub fn serve(&self, listener: &TcpListener) {
        std::thread::scope(|scope| {
            loop {
                let accepted = listener.accept().and_then(|(stream, _)| {
                    let session = move || self.serve_one(stream);
                    std::thread::Builder::new().name("session".to_owned()).spawn_scoped(scope, session)
                });
                if let Err(error) = accepted {
                    (self.report)(&format!("a connection cannot be served: {error}"));
                    // Too many open files or threads: not only for a moment.
                    std::thread::sleep(Duration::from_millis(100));
                }
            }
        });
    }

    fn serve_one(&self, stream: TcpStream) {
        // The host has closed the connection before it was accepted.
        let Ok(address) = stream.peer_addr() else { return };
        let peer = address.to_string();
        let result = self.shake_hands(&peer, address.ip(), stream).and_then(|(sender, receiver)| {
            let is_served = self.n_sessions.fetch_add(1, Ordering::Relaxed) < MAX_SESSIONS;
            let too_many = || LinkError::TooMany { peer: peer.clone(), limit: MAX_SESSIONS };
            let result = if is_served { self.session(&peer, sender, receiver) } else { Err(too_many()) };
            self.n_sessions.fetch_sub(1, Ordering::Relaxed);
            result
        });
        if let Err(error) = result {
            (self.report)(&error.to_string());
        }
    }

    /// Checks the key of the other end.
    fn shake_hands(&self, peer: &str, host: IpAddr, stream: TcpStream) -> Result<(Sender, Receiver), LinkError> {
        {
            let mut handshakes = lock(&self.handshakes);
            let n_all: usize = handshakes.values().sum();
            let n_host = handshakes.entry(host).or_default();
            if n_all >= MAX_HANDSHAKES || *n_host >= MAX_HANDSHAKES_PER_HOST {
                return Err(LinkError::TooManyHandshakes { peer: peer.to_owned() });
            }
            *n_host += 1;
        }
        let ended = |source| LinkError::Ended { peer: peer.to_owned(), source };
        let shaken = notice_lost_peer(&stream).map_err(ended).and_then(|()| accept(stream, &self.key));
        let mut handshakes = lock(&self.handshakes);
        if let Some(n_host) = handshakes.get_mut(&host) {
            *n_host -= 1;
            if *n_host == 0 {
                handshakes.remove(&host);
            }
        }
        shaken
    }

    fn session(&self, peer: &str, mut sender: Sender, mut receiver: Receiver) -> Result<(), LinkError> {
        let ended = |source| LinkError::Ended { peer: peer.to_owned(), source };
        sender.set_timeout(Some(REQUEST_TIMEOUT)).map_err(ended)?;
        let wanted: StageProgram = receive(&mut receiver).map_err(ended)?;
        let (answer, started): (Answer, _) = match self.start(&wanted) {
            Ok(started) => (Ok(()), Some(started)),
            Err(text) => (Err(text), None),
        };
        let answered = send(&mut sender, &answer).and_then(|()| sender.set_timeout(None));
        let Some((mut child, socket)) = started else {
            (self.report)(&format!("{peer}: refused: {}", answer.err().unwrap_or_default()));
            return answered.map_err(ended);
        };
        let number = self.n_started.fetch_add(1, Ordering::Relaxed);
        if let Some(session) = &wanted.session {
            // It may have several lines, which would look like lines of the agent.
            let name = session.escape_debug();
            (self.report)(&format!("{peer}: {name} started (process {})", child.id()));
            self.replace(session, number, sender.stream());
        }
        let passed = answered.and_then(|()| pass(&socket, sender, receiver));
        let status = end(&mut child);
        if let Some(session) = &wanted.session {
            let mut sessions = lock(&self.sessions);
            if sessions.get(session).is_some_and(|(current, _)| *current == number) {
                sessions.remove(session);
            }
            drop(sessions);
            let cause = passed.err().map(|error| format!(", {error}")).unwrap_or_default();
            (self.report)(&format!("{peer}: {} ended ({status}{cause})", session.escape_debug()));
        }
        Ok(())
    }

    /// Ends the program that was started for the same stage of the same run: that run has lost its connection to the
    /// program.
    fn replace(&self, session: &str, number: usize, stream: &TcpStream) {
        let Ok(stream) = stream.try_clone() else { return };
        if let Some((_, before)) = lock(&self.sessions).insert(session.to_owned(), (number, stream)) {
            // It may have ended in the meantime.
            let _ = before.shutdown(Shutdown::Both);
        }
    }

    /// Starts a program. Returns the other end of its socket. The text gives the reason for a refusal.
    fn start(&self, wanted: &StageProgram) -> Result<(Child, UnixStream), String> {
        if wanted.version != self.version {
            let theirs = &wanted.version;
            let ours = &self.version;
            return Err(format!(
                "the run has build {theirs}, this agent has build {ours}; install the same build on both hosts"
            ));
        }
        let program = program_path(&self.folder, wanted)?;
        if program.extension().is_some_and(|extension| extension == "py") {
            check_interpreter(&wanted.python)?;
        }
        let failed = |error: std::io::Error| format!("{}: cannot be started: {error}", program.display());
        let python = interpreter(&wanted.python, &self.folder);
        let mut command = stage_command(&program, &python, wanted.threads);
        allocator::keep_freed_memory(&mut command, allocator::Keep::Sweeps);
        let (ours, theirs) = UnixStream::pair().map_err(failed)?;
        let child = command
            .args(["run", "--linked", &std::process::id().to_string()])
            .current_dir(&self.folder)
            .stdin(OwnedFd::from(theirs))
            // Output of a stage belongs to the log.
            .stdout(std::io::stderr())
            .process_group(0)
            .spawn();
        child.map(|child| (child, ours)).map_err(failed)
    }
}

/// The program: `replica-<table>` in the folder of this one, or the program that the table names, never outside of the
/// agent's folder.
fn program_path(folder: &Path, wanted: &StageProgram) -> Result<PathBuf, String> {
    if wanted.program.is_empty() {
        let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
        if !wanted.table.bytes().all(is_plain) {
            return Err(format!("[{}] is not a stage name", wanted.table));
        }
        return sibling(&format!("replica-{}", wanted.table)).map_err(|error| error.to_string());
    }
    if !is_in_folder(&wanted.program) {
        return Err(format!("program {}: must be a path in the agent's folder, without `..`", wanted.program));
    }
    named_program(&wanted.program, folder).map_err(|error| error.to_string())
}

/// Refuses an interpreter that is neither a Python of the search path nor in the agent's folder: the key permits programs
/// of this folder only.
fn check_interpreter(python: &str) -> Result<(), String> {
    let is_python = |command: &str| {
        let version = command.strip_prefix("python").or_else(|| command.strip_prefix("pypy"));
        version.is_some_and(|version| version.bytes().all(|b| b.is_ascii_digit() || b == b'.'))
    };
    if is_python(python) || python.contains('/') && is_in_folder(python) {
        return Ok(());
    }
    Err(format!(
        "python {python}: must be `python3`, `python3.N` or `pypy3`, or a path in the agent's folder, without `..`"
    ))
}

fn is_in_folder(path: &str) -> bool {
    Path::new(path).components().all(|component| matches!(component, Component::Normal(_) | Component::CurDir))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes the kernel report a client whose host or network has failed, even if nothing is sent. There is no limit for
/// data that is sent and not acknowledged: a run whose queues are full reads nothing for a while.
fn notice_lost_peer(stream: &TcpStream) -> std::io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, GONE_AFTER / 3)?;
    sockopt::set_tcp_keepintvl(stream, GONE_AFTER / 6)?;
    Ok(sockopt::set_tcp_keepcnt(stream, 4)?)
}

/// Passes bytes on until the program or the connection ends.
fn pass(program: &UnixStream, mut sender: Sender, mut receiver: Receiver) -> std::io::Result<()> {
    std::thread::scope(|scope| {
        let connection = sender.stream().try_clone()?;
        let to_program = move || {
            let mut program = program;
            // An error of the connection ends it; an error of the program is detected by the other thread.
            while let Ok(bytes) = receiver.next_bytes() {
                if bytes.is_empty() || program.write_all(bytes).is_err() {
                    break;
                }
            }
            // The program and the other thread both read the end.
            let _ = program.shutdown(Shutdown::Both);
        };
        std::thread::Builder::new().name("to program".to_owned()).spawn_scoped(scope, to_program)?;
        let mut program = program;
        let mut piece = vec![0; PIECE];
        let passed = loop {
            match program.read(&mut piece) {
                Ok(0) => break Ok(()),
                Ok(n) => {
                    if let Err(error) = sender.write_all(&piece[..n]).and_then(|()| sender.flush()) {
                        break Err(error);
                    }
                }
                Err(error) => break Err(error),
            }
        };
        // Ends the thread above, whichever side has ended.
        let _ = (connection.shutdown(Shutdown::Both), program.shutdown(Shutdown::Both));
        passed
    })
}

/// Waits for the end of a program that has lost its socket, and kills a busy one.
fn end(child: &mut Child) -> String {
    for _ in 0..END_POLLS {
        match child.try_wait() {
            Ok(Some(status)) => return status.to_string(),
            Ok(None) => std::thread::sleep(END_POLL),
            Err(_) => break,
        }
    }
    if let Some(group) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        // It may have ended in the meantime.
        let _ = kill_process_group(group, Signal::KILL);
    }
    child.wait().map_or_else(|error| error.to_string(), |status| status.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpreter_is_a_python_or_in_the_folder() {
        for python in ["python3", "python3.11", "pypy3", "venv/bin/python", "./python"] {
            assert_eq!(check_interpreter(python), Ok(()), "{python}");
        }
        for python in ["/bin/sh", "sh", "../venv/bin/python", "/usr/bin/python3", "", "python3 -c"] {
            let text = check_interpreter(python).expect_err("refused");
            assert!(text.starts_with(&format!("python {python}: must be `python3`")), "{text}");
        }
    }
}
