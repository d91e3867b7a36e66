//! The process that stands for a stage on another host: to its run a stage like any other.

use super::wire::{Answer, LaunchText, MessageBlock, Report, Request, read_block, read_head, write_head};
use crate::command_line::print_json;
use crate::program::{ConfiguredStage, Program, RunningStage};
use crate::{Context, Field, Flow, Inputs, Outputs, Port, Problem, StateBytes, StepError, exit, run_program};
use formats::text_file::{MAX_SETTINGS_BYTES, read_text};
use messages::pod::bytes_from_rows;
use run::assignment::{Assignment, Description, TopicChannels};
use run::{CheckRequest, DescribeRequest, FileIdentity, Remote};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use toml::de::DeTable;

/// A stream to a program on another host.
pub struct Connection {
    /// Fails if nothing arrives for [`Remote::hang_s`].
    pub reader: Box<dyn Read>,
    /// Fails if nothing can be sent for as long.
    pub writer: Box<dyn Write>,
}

/// Starts the program of a table on its host and connects to it. The text names the stage of the run; `None` for a question.
pub type Connect = fn(&Remote, table: &str, session: Option<&str>) -> Result<Connection, StepError>;

/// The program `replica-remote`: answers `--describe REQUEST`, `--check REQUEST` and `run ASSIGNMENT` with the program on the other
/// host. `arguments` begin with the program's name. Returns the exit code.
pub fn run(arguments: Vec<OsString>, connect: Connect) -> u8 {
    let texts: Vec<&str> = arguments.iter().filter_map(|argument| argument.to_str()).collect();
    let answered = match texts[..] {
        [_, "--describe", request] => {
            parse(request.as_bytes()).and_then(|request| describe(&request, connect)).map(|d| print_json(&d))
        }
        [_, "--check", request] => {
            parse(request.as_bytes()).and_then(|request| check(&request, connect)).map(|p| print_json(&p))
        }
        [_, "run", assignment] => {
            return match read_assignment(Path::new(assignment)).and_then(|a| RemoteProgram::of(&a, connect)) {
                Ok(program) => run_program(&program, arguments),
                Err(error) => refuse(&error),
            };
        }
        _ => {
            eprintln!(
                "replica-remote stands for a stage with the key `host`; the supervisor, replica-launch, starts it"
            );
            return exit::USAGE;
        }
    };
    answered.unwrap_or_else(|error| refuse(&error))
}

fn refuse(error: &StepError) -> u8 {
    eprintln!("{error}");
    exit::CONFIGURATION
}

fn parse<'a, T: serde::Deserialize<'a>>(text: &'a [u8]) -> Result<T, StepError> {
    serde_json::from_slice(text).map_err(StepError::configuration)
}

fn read_assignment(path: &Path) -> Result<Assignment, StepError> {
    let bytes = std::fs::read(path).map_err(|error| StepError::io(error).at(path.display()))?;
    parse(&bytes).map_err(|error| error.at(path.display()))
}

fn remote_of(remote: Option<&Remote>) -> Result<&Remote, StepError> {
    remote.ok_or_else(|| StepError::configuration("the table has no key `host`"))
}

impl LaunchText {
    fn read(file: &Path, overrides: &[String], table: &str) -> Result<Self, StepError> {
        let text = read_text(file, MAX_SETTINGS_BYTES).map_err(|error| StepError::io(error).at(file.display()))?;
        Ok(Self { text, overrides: overrides.to_vec(), table: table.to_owned() })
    }
}

fn describe(request: &DescribeRequest, connect: Connect) -> Result<Description, StepError> {
    let remote = remote_of(request.remote.as_ref())?;
    let launch = LaunchText::read(&request.launch_file, &request.overrides, &request.table)?;
    let mut far = Far::new(remote, connect(remote, &request.table, None)?);
    check_description(far.describe(&launch)?, &remote.host)
}

/// Sources and sinks have files on the host of the run. Topics of others have no type here.
fn check_description(description: Description, host: &str) -> Result<Description, StepError> {
    let name = &description.name;
    if description.inputs.is_empty() || description.outputs.is_empty() {
        let text = format!(
            "{name} has no input or no output, so it reads or writes files of this host; it cannot run on {host}"
        );
        return Err(StepError::configuration(text));
    }
    let topics = description.inputs.iter().chain(&description.outputs).map(|port| &port.topic);
    for topic in topics {
        port(topic)?;
    }
    Ok(description)
}

fn port(topic: &str) -> Result<Port, StepError> {
    let unknown = || {
        StepError::configuration(format!("{topic} is no topic of the project; a stage on another host has no others"))
    };
    Port::named(topic).ok_or_else(unknown)
}

fn check(request: &CheckRequest, connect: Connect) -> Result<Vec<Problem>, StepError> {
    let remote = remote_of(request.remote.as_ref())?;
    let launch = LaunchText::read(&request.launch_file, &request.overrides, &request.table)?;
    let mut far = Far::new(remote, connect(remote, &request.table, None)?);
    let description = far.describe(&launch)?;
    let mut problems = match far.ask(&Request::Check(launch, request.context.clone()), [])? {
        Answer::Problems(problems) => problems,
        other => return Err(far.unexpected(&other)),
    };
    problems.iter_mut().for_each(|problem| problem.text = format!("on {}: {}", remote.host, problem.text));
    let folder = &request.context.launch_folder;
    problems.extend(
        different_file(&description.files, folder, &remote.host).map(|text| Problem::of_key(&request.table, text)),
    );
    Ok(problems)
}

/// A file that lies at the same place here with another content: the launch file means one of them.
fn different_file(files: &BTreeMap<String, String>, folder: &Path, host: &str) -> Option<String> {
    files.iter().find_map(|(file, digest)| {
        let here = folder.join(file);
        // The programs of the two hosts may be built differently.
        let may_compare = Path::new(file).is_relative() && here.is_file() && !is_program(&here);
        let identity = may_compare.then(|| FileIdentity::of(&here, None).ok()).flatten()?;
        (identity.digest() != digest)
            .then(|| format!("{file} on {host} differs from {}; copy one of them", here.display()))
    })
}

fn is_program(file: &Path) -> bool {
    file.metadata().is_ok_and(|metadata| metadata.permissions().mode() & 0o111 != 0)
}

/// The other end of a connection.
struct Far {
    host: String,
    hang_s: f64,
    connection: Connection,
}

impl Far {
    fn new(remote: &Remote, connection: Connection) -> Self {
        Self { host: remote.host.clone(), hang_s: remote.hang_s, connection }
    }

    fn lost(&self, error: std::io::Error) -> StepError {
        let host = &self.host;
        StepError::io(match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => format!("{host}: no answer for {} s", self.hang_s),
            ErrorKind::UnexpectedEof => {
                format!("{host}: the connection ended; the messages of `replica agent` there say why")
            }
            _ => format!("{host}: {error}"),
        })
    }

    fn unexpected(&self, answer: &Answer) -> StepError {
        StepError::contract(format!("{}: unexpected answer {answer:?}", self.host))
    }

    fn send<'a>(&mut self, request: &Request, blocks: impl IntoIterator<Item = &'a [u8]>) -> Result<(), StepError> {
        let writer = &mut self.connection.writer;
        let sent = write_head(writer, request)
            .and_then(|()| blocks.into_iter().try_for_each(|block| writer.write_all(block)))
            .and_then(|()| writer.flush());
        sent.map_err(|error| self.lost(error))
    }

    /// The next answer. A failure of the stage is an error.
    fn receive(&mut self) -> Result<Answer, StepError> {
        match read_head(&mut self.connection.reader).map_err(|error| self.lost(error))? {
            Answer::Failed(kind, text) => Err(kind.error(format!("on {}: {text}", self.host))),
            answer => Ok(answer),
        }
    }

    /// Sends a request and waits for its only answer.
    fn ask<'a>(&mut self, request: &Request, blocks: impl IntoIterator<Item = &'a [u8]>) -> Result<Answer, StepError> {
        self.send(request, blocks)?;
        loop {
            match self.receive()? {
                Answer::Alive(_) => {}
                answer => return Ok(answer),
            }
        }
    }

    fn describe(&mut self, launch: &LaunchText) -> Result<Description, StepError> {
        match self.ask(&Request::Describe(launch.clone()), [])? {
            Answer::Described(description) => Ok(description),
            other => Err(self.unexpected(&other)),
        }
    }

    /// [`Far::ask`] where the answer says no more than that it is done.
    fn order<'a>(&mut self, request: &Request, blocks: impl IntoIterator<Item = &'a [u8]>) -> Result<(), StepError> {
        match self.ask(request, blocks)? {
            Answer::Done => Ok(()),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Publishes what a step there publishes, until it is done.
    fn publish_answers(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
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
                    read.map_err(|error| self.lost(error))?;
                    loan.publish(outputs, stamp, column)?;
                }
                Answer::Done => return Ok(()),
                other => return Err(self.unexpected(&other)),
            }
        }
    }
}

/// The program of a stage on another host, for the runner.
struct RemoteProgram {
    name: &'static str,
    configured: ConfiguredRemote,
}

#[derive(Clone)]
struct ConfiguredRemote {
    /// The stage of the run.
    session: String,
    launch: LaunchText,
    remote: Remote,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    connect: Connect,
}

impl RemoteProgram {
    fn of(assignment: &Assignment, connect: Connect) -> Result<Self, StepError> {
        let Assignment { stage, domain, launch_file, overrides, .. } = assignment;
        let ports =
            |topics: &[TopicChannels]| topics.iter().map(|topic| port(&topic.topic)).collect::<Result<Vec<_>, _>>();
        let configured = ConfiguredRemote {
            session: format!("{domain}/{stage}"),
            launch: LaunchText::read(launch_file, overrides, stage)?,
            remote: remote_of(assignment.remote.as_ref())?.clone(),
            inputs: ports(&assignment.inputs)?,
            outputs: ports(&assignment.outputs)?,
            connect,
        };
        // A process has one stage.
        Ok(Self { name: stage.clone().leak(), configured })
    }
}

/// The supervisor knows topics and settings from [`describe`]; here are those of the assignment.
impl Program for RemoteProgram {
    fn name(&self) -> &'static str {
        self.name
    }
    fn inputs(&self) -> Vec<Port> {
        self.configured.inputs.clone()
    }
    fn outputs(&self) -> Vec<Port> {
        self.configured.outputs.clone()
    }
    fn fields(&self) -> Vec<Field> {
        Vec::new()
    }
    fn configured(&self, _table: &DeTable<'_>) -> (Box<dyn ConfiguredStage>, Vec<Problem>) {
        (Box::new(self.configured.clone()), Vec::new())
    }
}

impl ConfiguredStage for ConfiguredRemote {
    fn inputs(&self, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(self.inputs.clone())
    }
    fn outputs(&self, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(self.outputs.clone())
    }
    fn check(&self, _context: &Context) -> Vec<Problem> {
        Vec::new()
    }
    fn settings_json(&self) -> Result<String, StepError> {
        Err(StepError::contract("a stage on another host cannot run alone"))
    }
    fn build(&self, context: &Context) -> Result<Box<dyn RunningStage>, StepError> {
        let connection = (self.connect)(&self.remote, &self.launch.table, Some(&self.session))?;
        let mut far = Far::new(&self.remote, connection);
        let (now, before) = (far.describe(&self.launch)?.files, &self.remote.files);
        if let Some((file, _)) = now.iter().find(|(file, digest)| before.get(*file) != Some(digest)) {
            let text = format!("{file} on {} has changed since the run was started", self.remote.host);
            return Err(StepError::configuration(text));
        }
        far.order(&Request::Open(self.launch.clone(), context.clone()), [])?;
        Ok(Box::new(RemoteStage { far: far, inputs: self.inputs.clone() }))
    }
}

struct RemoteStage {
    far: Far,
    inputs: Vec<Port>,
}

impl RunningStage for RemoteStage {
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let mut messages = Vec::new();
        for port in &self.inputs {
            messages.extend(inputs.take_untyped(port).into_iter().map(|message| (port.topic(), message)));
        }
        let parts: Vec<[&[u8]; 3]> = messages
            .iter()
            .map(|(_, message)| {
                [bytes_from_rows(std::slice::from_ref(message.envelope())), message.header(), message.rows()]
            })
            .collect();
        let blocks = messages.iter().zip(&parts).map(|((topic, _), parts)| MessageBlock {
            topic: (*topic).to_owned(),
            n_bytes: parts.iter().map(|part| part.len() as u64).sum(),
        });
        let request = Request::Step(Report::of(outputs), blocks.collect());
        let far = &mut self.far;
        far.send(&request, parts.into_iter().flatten())?;
        // Their places are free for the producers while the other host works.
        drop(messages);
        far.publish_answers(outputs)?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let far = &mut self.far;
        far.send(&Request::Finish(Report::of(outputs)), [])?;
        far.publish_answers(outputs)
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let far = &mut self.far;
        match far.ask(&Request::Save, [])? {
            Answer::State(lengths) => {
                let mut piece = |(n_bytes, row_bytes)| {
                    let bytes = read_block(&mut far.connection.reader, n_bytes).map_err(|error| far.lost(error))?;
                    Ok((bytes, row_bytes as usize))
                };
                let pieces = lengths.into_iter().map(&mut piece).collect::<Result<Vec<_>, StepError>>()?;
                Ok(StateBytes::of_pieces(pieces))
            }
            other => Err(far.unexpected(&other)),
        }
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.far.order(&Request::Load(state.len() as u64), [state])
    }
}
