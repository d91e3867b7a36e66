//! The run's end of a connection: sends requests and receives answers.

use super::wire::{Answer, LaunchText, Request, read_block, read_head, write_head};
use crate::{Outputs, Port, StepError};
use files::text_file::{MAX_SETTINGS_BYTES, read_text};
use run::assignment::Description;
use run::{Change, Remote};
use std::io::{ErrorKind, Read, Write};
use std::path::Path;

/// A stream to a program on another host.
pub struct Connection {
    /// Fails if nothing arrives for [`Remote::hang_s`].
    pub reader: Box<dyn Read>,
    /// Fails if nothing can be sent for [`Remote::hang_s`].
    pub writer: Box<dyn Write>,
}

/// Starts the program of a table on its host and connects to it. The text names the stage of the run; `None` for a
/// query.
pub type Connect = fn(&Remote, table: &str, session: Option<&str>) -> Result<Connection, StepError>;

pub(super) fn remote_of(remote: Option<&Remote>) -> Result<&Remote, StepError> {
    remote.ok_or_else(|| StepError::configuration("the table has no key `host`"))
}

/// The topic of this name: only the project's topics have a type on both hosts.
pub(super) fn port(topic: &str) -> Result<Port, StepError> {
    let unknown = || {
        StepError::configuration(format!(
            "{topic} is not a topic of the project; a stage on another host supports no third-party topics"
        ))
    };
    Port::from_name(topic).ok_or_else(unknown)
}

impl LaunchText {
    pub(super) fn read(file: &Path, changes: &[Change], table: &str) -> Result<Self, StepError> {
        let text = read_text(file, MAX_SETTINGS_BYTES).map_err(|error| StepError::io(error).at(file.display()))?;
        Ok(Self { text, changes: changes.to_vec(), table: table.to_owned() })
    }
}

/// The program at the other end.
pub(super) struct Far {
    host: String,
    hang_s: f64,
    connection: Connection,
}

impl Far {
    pub(super) fn new(remote: &Remote, connection: Connection) -> Self {
        Self { host: remote.host.clone(), hang_s: remote.hang_s, connection }
    }

    fn lost(&self, error: &std::io::Error) -> StepError {
        let host = &self.host;
        StepError::io(match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => format!("{host}: no answer for {} s", self.hang_s),
            ErrorKind::UnexpectedEof => {
                format!("{host}: the connection ended; the messages of `replica agent` there say why")
            }
            _ => format!("{host}: {error}"),
        })
    }

    pub(super) fn unexpected(&self, answer: &Answer) -> StepError {
        StepError::contract(format!("{}: unexpected answer {answer:?}", self.host))
    }

    pub(super) fn send<'a>(
        &mut self,
        request: &Request,
        blocks: impl IntoIterator<Item = &'a [u8]>,
    ) -> Result<(), StepError> {
        let writer = &mut self.connection.writer;
        let sent = write_head(writer, request)
            .and_then(|()| blocks.into_iter().try_for_each(|block| writer.write_all(block)))
            .and_then(|()| writer.flush());
        sent.map_err(|error| self.lost(&error))
    }

    /// The next answer. A failure of the stage is an error.
    fn receive(&mut self) -> Result<Answer, StepError> {
        match read_head(&mut self.connection.reader).map_err(|error| self.lost(&error))? {
            Answer::Failed(kind, text) => Err(kind.error(format!("on {}: {text}", self.host))),
            answer => Ok(answer),
        }
    }

    /// Sends a request and waits for its only answer.
    pub(super) fn ask<'a>(
        &mut self,
        request: &Request,
        blocks: impl IntoIterator<Item = &'a [u8]>,
    ) -> Result<Answer, StepError> {
        self.send(request, blocks)?;
        loop {
            match self.receive()? {
                Answer::Alive(_) => {}
                answer => return Ok(answer),
            }
        }
    }

    pub(super) fn describe(&mut self, launch: &LaunchText) -> Result<Description, StepError> {
        match self.ask(&Request::Describe(launch.clone()), [])? {
            Answer::Described(description) => Ok(description),
            other => Err(self.unexpected(&other)),
        }
    }

    /// [`Far::ask`] for requests that are answered without data.
    pub(super) fn order<'a>(
        &mut self,
        request: &Request,
        blocks: impl IntoIterator<Item = &'a [u8]>,
    ) -> Result<(), StepError> {
        match self.ask(request, blocks)? {
            Answer::Done => Ok(()),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Publishes the messages of a step on the other host, until the step is done.
    pub(super) fn publish_answers(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let mut progress = None;
        loop {
            match self.receive()? {
                Answer::Alive(mark) => {
                    if progress.replace(mark).is_some_and(|before| before != mark) {
                        outputs.mark_progress();
                    }
                }
                Answer::Reported(report) => report.replace(outputs),
                Answer::Message { topic, stamp, column, n_rows } => {
                    let mut loan = outputs.loan_untyped(&port(&topic)?, n_rows as usize)?;
                    let reader = &mut self.connection.reader;
                    let read = reader.read_exact(loan.header_mut()).and_then(|()| reader.read_exact(loan.rows_mut()));
                    read.map_err(|error| self.lost(&error))?;
                    loan.publish(outputs, stamp, column)?;
                }
                Answer::Done => return Ok(()),
                other => return Err(self.unexpected(&other)),
            }
        }
    }

    /// Reads the pieces of a state.
    pub(super) fn read_pieces(&mut self, lengths: Vec<(u64, u64)>) -> Result<Vec<(Vec<u8>, usize)>, StepError> {
        let piece = |(n_bytes, row_bytes)| {
            let bytes = read_block(&mut self.connection.reader, n_bytes).map_err(|error| self.lost(&error))?;
            Ok((bytes, row_bytes as usize))
        };
        lengths.into_iter().map(piece).collect()
    }
}
