//! The first request on a connection: the program that the agent starts. Request and answer are JSON behind their
//! length (u32, little-endian). All later bytes are exchanged between the run and the program.

use crate::{LinkError, Receiver, Sender};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind, Read, Write};

/// Largest request, far more than one has.
const MAX_BYTES: u32 = 64 << 10;

/// A stage's program on another host.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageProgram {
    /// The `--version` of the requesting program: both hosts need the same build.
    pub version: String,
    /// Its table in launch.toml; without `program`, the program is `replica-<table>` in the folder of the agent's
    /// program.
    pub table: String,
    /// Path in the agent's folder; empty: see `table`.
    pub program: String,
    /// Interpreter of a program `*.py`: a command, or a path in the agent's folder.
    pub python: String,
    /// Threads of its parallel loops; 0 = one per core.
    pub threads: usize,
    /// The stage of a run: the agent ends a program that it has started for the same stage. `None`: a query.
    pub session: Option<String>,
}

/// The answer of an agent.
pub(crate) type Answer = Result<(), String>;

/// Requests the agent `peer` to start a program. Afterwards the connection leads to the program.
pub fn start(
    peer: &str,
    program: &StageProgram,
    sender: &mut Sender,
    receiver: &mut Receiver,
) -> Result<(), LinkError> {
    let ended = |source| LinkError::Ended { peer: peer.to_owned(), source };
    send(sender, program).map_err(ended)?;
    let answer: Answer = receive(receiver).map_err(ended)?;
    answer.map_err(|text| LinkError::Refused { peer: peer.to_owned(), text })
}

pub(crate) fn send(sender: &mut Sender, value: &impl Serialize) -> std::io::Result<()> {
    let text = serde_json::to_vec(value).map_err(Error::other)?;
    sender.write_all(&(text.len() as u32).to_le_bytes())?;
    sender.write_all(&text)?;
    sender.flush()
}

pub(crate) fn receive<T: DeserializeOwned>(receiver: &mut Receiver) -> std::io::Result<T> {
    let mut len = [0; 4];
    receiver.read_exact(&mut len)?;
    let len = u32::from_le_bytes(len);
    if len > MAX_BYTES {
        let text = format!("a request of {len} bytes; up to {MAX_BYTES} are allowed");
        return Err(Error::new(ErrorKind::InvalidData, text));
    }
    let mut text = vec![0; len as usize];
    receiver.read_exact(&mut text)?;
    serde_json::from_slice(&text).map_err(Error::other)
}
