//! The first request on a connection: which program the agent starts. Request and answer are JSON behind their length (u32,
//! little-endian). Everything after them is between the run and the program.

use crate::{LinkError, Receiver, Sender};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind, Read, Write};

/// Far more than a request has.
const MAX_BYTES: u32 = 64 << 10;

/// A stage's program on another host.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageProgram {
    /// `--version` of the program that asks: both hosts need the same build.
    pub version: String,
    /// Its table in launch.toml; without `program`, the program is `replica-<table>` beside the agent.
    pub table: String,
    /// Path in the agent's folder; empty: see `table`.
    pub program: String,
    /// Interpreter of a program `*.py`: a command, or a path in the agent's folder.
    pub python: String,
    /// Threads of its parallel loops; 0 = one per core.
    pub threads: usize,
    /// The stage of a run: the agent ends a program that it has started for the same one. `None`: a question.
    pub session: Option<String>,
}

/// What an agent answers.
pub(crate) type Answer = Result<(), String>;

/// Asks the agent `peer` to start a program. Afterwards the connection leads to it.
pub fn start(
    peer: &str,
    program: &StageProgram,
    (sender, receiver): (&mut Sender, &mut Receiver),
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
