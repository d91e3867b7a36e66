//! Requests to a running supervisor and its answers.
//!
//! They use a Unix socket, not a topic: the socket outlives the attempts of a run, each of which has its own services;
//! a request is not repeated; and the operating system reports at once when the supervisor ends.
//!
//! One request per connection, one JSON text per line. The supervisor sends [`Answer::Working`] at least once a second until
//! its final answer. The client may disconnect; the supervisor completes the request.

use crate::Change;
use crate::outcome::Outcome;
use crate::wiring::{Wiring, WiringError};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Silence after which the supervisor counts as hung: it sends every second, and stopping an attempt takes up to three.
const SILENCE: Duration = Duration::from_secs(10);

/// Largest request, bytes.
pub const MAX_REQUEST: usize = 64 << 10;

/// A request to the supervisor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Replaces the program or the settings of a stage, from a barrier on.
    Swap(SwapRequest),
    /// Ends the run.
    Stop {
        /// Whether to end without draining in-flight data.
        now: bool,
    },
}

/// The change of one stage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwapRequest {
    /// Its table.
    pub stage: String,
    /// Undo earlier swaps of this stage first: the changes below apply to the launch file alone.
    pub back: bool,
    /// Changes of its table, in their order. Another program is the key `program`, an absolute path.
    pub changes: Vec<Change>,
}

/// An answer of the supervisor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// The request is being processed; the text names the current step.
    Working(String),
    /// Nothing was changed. The texts state the reasons.
    Refused(Vec<String>),
    /// The stage was replaced, or the attempt was undone ([`Swapped::undone`]).
    Swapped(Swapped),
    /// The run has ended.
    Ended(Outcome),
}

/// The result of a swap. Kept in the run folder and in summary.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Swapped {
    /// Its table.
    pub stage: String,
    /// Barrier of the change: the old program processed the ticks up to it, the new one all later ticks.
    pub barrier: u64,
    /// Ticks up to the barrier.
    pub ticks: u64,
    /// Drive time at the barrier, ns since the Unix epoch.
    pub drive_time: i64,
    /// Drive time at the barrier, from the first tick on, s.
    pub drive_s: f64,
    /// The changes in readable form: `--set infer.model=…`, `--unset infer.model`.
    pub changes: Vec<String>,
    /// Saved state that the new program loaded, bytes; an empty state is not loaded.
    pub state_bytes: u64,
    /// Time between the sink's last tick before the swap and its first tick after, s. None if there was no tick after.
    pub seconds_without_output: Option<f64>,
    /// Reason for undoing the swap. None if it was not undone.
    pub undone: Option<String>,
}

impl std::fmt::Display for Swapped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { stage, barrier, drive_s, state_bytes, .. } = self;
        let verb = if self.undone.is_some() { "not swapped" } else { "swapped" };
        write!(f, "{verb} {stage} at barrier {barrier} ({drive_s:.1} s of drive): ")?;
        match self.seconds_without_output {
            Some(seconds) => write!(f, "{seconds:.2} s without output")?,
            None => write!(f, "no output since then")?,
        }
        match &self.undone {
            None => write!(f, "; state taken over: {state_bytes} bytes"),
            Some(reason) => write!(f, "; the swap was undone: {reason}"),
        }
    }
}

/// Socket of the supervisor of a domain, in a folder that only its owner can access. The path is short, because socket
/// paths have at most 108 bytes.
pub fn socket_of(domain: &str) -> PathBuf {
    PathBuf::from(format!("/tmp/replica_{domain}_control/socket"))
}

/// A request that got no final answer.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// There is no run.
    #[error(transparent)]
    Wiring(#[from] WiringError),
    /// The supervisor does not listen.
    #[error("no run in {}: its supervisor has ended or is not ready yet", output.display())]
    NotListening {
        /// Output folder.
        output: PathBuf,
        /// Reason why the socket cannot be connected.
        #[source]
        cause: std::io::Error,
    },
    /// The supervisor sent nothing for too long.
    #[error("the supervisor (process {supervisor}) has sent nothing for {} s: it hangs", SILENCE.as_secs())]
    Hangs {
        /// Its process id.
        supervisor: u32,
    },
    /// The connection failed.
    #[error("connection to the supervisor: {0}")]
    Connection(#[source] std::io::Error),
    /// An answer in an unknown format.
    #[error("invalid reply of the supervisor: {cause}: {line}")]
    Reply {
        /// The reply as received.
        line: String,
        /// Parse error with its position.
        #[source]
        cause: serde_json::Error,
    },
    /// The supervisor ended before its final answer.
    #[error("the supervisor (process {supervisor}) ended before it answered")]
    Ended {
        /// Its process id.
        supervisor: u32,
    },
}

/// Sends a request to the supervisor of the run into `output` and waits for its final answer. `progress` receives the
/// texts of [`Answer::Working`].
pub fn ask(output: &Path, request: &Request, mut progress: impl FnMut(&str)) -> Result<Answer, AskError> {
    let wiring = Wiring::read(output)?;
    let supervisor = wiring.supervisor;
    let stream = UnixStream::connect(socket_of(&wiring.domain))
        .map_err(|cause| AskError::NotListening { output: output.to_owned(), cause })?;
    let failed = |cause: std::io::Error| match cause.kind() {
        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut => AskError::Hangs { supervisor },
        _ => AskError::Connection(cause),
    };
    stream.set_read_timeout(Some(SILENCE)).and_then(|()| stream.set_write_timeout(Some(SILENCE))).map_err(failed)?;
    let mut text = serde_json::to_vec(request).map_err(|error| AskError::Connection(error.into()))?;
    text.push(b'\n');
    (&stream).write_all(&text).map_err(failed)?;
    for line in BufReader::new(&stream).lines() {
        let line = line.map_err(failed)?;
        match serde_json::from_str(&line).map_err(|cause| AskError::Reply { line, cause })? {
            Answer::Working(text) => progress(&text),
            last => return Ok(last),
        }
    }
    Err(AskError::Ended { supervisor })
}
