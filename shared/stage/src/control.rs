//! What is asked of a running supervisor from outside, what it answers, and the asking.
//!
//! A Unix socket and no topic: it outlives the attempts of a run, each of which has services of its own; it needs no
//! repeating; and the operating system tells at once when the supervisor is gone.
//!
//! One request per connection, one JSON text per line. The supervisor says [`Answer::Working`] at least once a second until
//! it has the last word. Who asked may leave; what was asked for goes on.

use crate::wiring::Wiring;
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A supervisor that says nothing for so long hangs: it speaks every second, and stopping an attempt takes up to three.
const PATIENCE: Duration = Duration::from_secs(10);

/// Bytes of a request at most.
pub const MAX_REQUEST: usize = 64 << 10;

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Another program or other settings for a stage, from a barrier on.
    Swap(SwapRequest),
    /// The end of the run.
    Stop {
        /// Without finishing what is on the way.
        now: bool,
    },
}

/// The change of one stage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwapRequest {
    /// Its table.
    pub stage: String,
    /// Forget earlier swaps of this stage first: what follows is laid over the launch file alone.
    pub back: bool,
    /// Another program, absolute.
    pub program: Option<PathBuf>,
    /// Keys that are left out, as if launch.toml did not have them.
    pub unset: Vec<String>,
    /// `key=value`, as after `--set`.
    pub set: Vec<String>,
}

/// What the supervisor says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// It is at it; what it does now.
    Working(String),
    /// Nothing was changed, for these reasons.
    Refused(Vec<String>),
    /// The stage was replaced, or the attempt was undone ([`Swapped::undone`]).
    Swapped(Swapped),
    /// The run has ended so: `done`, `drained`, `stopped` or `failed`.
    Ended(String),
}

/// A swap as it went. Kept in the run folder and in summary.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Swapped {
    /// Its table.
    pub stage: String,
    /// Barrier at which it changed: ticks up to it are by the old, all later ones by the new.
    pub barrier: u64,
    /// Ticks up to the barrier.
    pub ticks: u64,
    /// Drive time at the barrier, ns since the Unix epoch.
    pub drive_time: i64,
    /// The same from the first tick on, s.
    pub drive_s: f64,
    /// What changed: `infer.model=…`, `!infer.model` for a key left out.
    pub changes: Vec<String>,
    /// Saved state that the new one was given, bytes; an empty one is not passed on.
    pub state_bytes: u64,
    /// From the sink's last tick before to its first tick after, s. None if there was no tick after.
    pub seconds_without_output: Option<f64>,
    /// Why everything is as before after all. None: the swap holds.
    pub undone: Option<String>,
}

impl std::fmt::Display for Swapped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { stage, barrier, drive_s, state_bytes, .. } = self;
        let verb = if self.undone.is_some() { "not swapped" } else { "swapped" };
        write!(f, "{verb} {stage} at barrier {barrier} ({drive_s:.1} s of drive): ")?;
        match self.seconds_without_output {
            Some(seconds) => write!(f, "{seconds:.2} s without output")?,
            None => write!(f, "no output since")?,
        }
        match &self.undone {
            None => write!(f, "; state taken over: {state_bytes} bytes"),
            Some(reason) => write!(f, "; everything is as before: {reason}"),
        }
    }
}

/// Where the supervisor of a domain listens: a folder of its owner alone, with the socket in it. Short, because socket paths
/// have at most 108 bytes.
pub fn socket_of(domain: &str) -> PathBuf {
    PathBuf::from(format!("/tmp/replica_{domain}_control/socket"))
}

/// Asks the supervisor of the run into `output` and waits for its last word. The error is a sentence.
pub fn ask(output: &Path, request: &Request, mut working: impl FnMut(&str)) -> Result<Answer, String> {
    let wiring = Wiring::read(output)?;
    let stream = UnixStream::connect(socket_of(&wiring.domain))
        .map_err(|_gone| format!("no run in {}: its supervisor is gone, or not ready yet", output.display()))?;
    let failed = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut => {
            let supervisor = wiring.supervisor;
            format!("the supervisor (process {supervisor}) says nothing for {} s: it hangs", PATIENCE.as_secs())
        }
        _ => format!("the supervisor cannot be asked: {error}"),
    };
    stream.set_read_timeout(Some(PATIENCE)).and_then(|()| stream.set_write_timeout(Some(PATIENCE))).map_err(failed)?;
    let mut text = serde_json::to_vec(request).map_err(|error| error.to_string())?;
    text.push(b'\n');
    (&stream).write_all(&text).map_err(failed)?;
    for line in BufReader::new(&stream).lines() {
        let line = line.map_err(failed)?;
        match serde_json::from_str(&line).map_err(|error| format!("an answer that is none: {error}: {line}"))? {
            Answer::Working(text) => working(&text),
            last => return Ok(last),
        }
    }
    Err(format!("the supervisor (process {}) ended before it had answered", wiring.supervisor))
}
