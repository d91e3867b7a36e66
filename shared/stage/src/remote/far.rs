//! A stage's program on another host than its run. Its standard input is the socket to the agent, for both directions.

use super::wire::{Answer, Failure, LaunchText, MessageBlock, Report, Request, read_block, read_head, write_head};
use crate::own_table::own_table;
use crate::program::{Program, RunningStage};
use crate::table::{check_table, describe_table};
use crate::{Context, Field, Inputs, Outputs, Port, Problem, StepError, exit, log};
use run::health::{HEARTBEAT, Pulse};
use run::launch_file::LaunchFile;
use run::process::end_with;
use run::{FileIdentity, files_of_settings};
use std::collections::BTreeMap;
use std::io::{BufReader, BufWriter, ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Buffer size of each direction: a Noise message.
const BUFFER_BYTES: usize = 64 << 10;

/// Serves `run --linked AGENT`. Returns the exit code.
pub(crate) fn serve(program: &dyn Program, agent: u32) -> u8 {
    log::start();
    let _span = tracing::info_span!("stage", stage = program.name(), pid = std::process::id()).entered();
    match Far::open(program, agent).and_then(Far::run) {
        Ok(()) => exit::DONE,
        Err(error) => {
            tracing::error!("{error}");
            error.exit_code()
        }
    }
}

/// The writing end, shared with the thread that reports that the stage is alive.
struct Answers {
    writer: Mutex<BufWriter<UnixStream>>,
    /// Whether the run waits for an answer.
    is_awaited: AtomicBool,
    pulse: Arc<Pulse>,
}

impl Answers {
    fn writer(&self) -> MutexGuard<'_, BufWriter<UnixStream>> {
        self.writer.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send<'a>(&self, answer: &Answer, blocks: impl IntoIterator<Item = &'a [u8]>) -> Result<(), StepError> {
        let mut writer = self.writer();
        write_head(&mut *writer, answer).map_err(StepError::io)?;
        blocks.into_iter().try_for_each(|block| writer.write_all(block)).map_err(StepError::io)
    }

    /// The last answer to a request.
    fn finish<'a>(&self, answer: &Answer, blocks: impl IntoIterator<Item = &'a [u8]>) -> Result<(), StepError> {
        self.send(answer, blocks)?;
        self.is_awaited.store(false, Ordering::Relaxed);
        self.writer().flush().map_err(StepError::io)
    }

    /// Reports until the process ends.
    fn report_alive(&self) {
        loop {
            std::thread::park_timeout(HEARTBEAT);
            if self.is_awaited.load(Ordering::Relaxed) {
                let sent = self.send(&Answer::Alive(self.pulse.progress()), []);
                if sent.is_err() || self.writer().flush().is_err() {
                    return;
                }
            }
        }
    }
}

struct Far<'a> {
    program: &'a dyn Program,
    requests: BufReader<UnixStream>,
    answers: Arc<Answers>,
    /// The agent's folder.
    folder: PathBuf,
    stage: Option<Box<dyn RunningStage>>,
    /// Topics that the stage reads.
    inputs: Vec<Port>,
    outputs: Outputs,
}

impl<'a> Far<'a> {
    fn open(program: &'a dyn Program, agent: u32) -> Result<Self, StepError> {
        end_with(agent).map_err(StepError::io)?;
        let socket = std::io::stdin().as_fd().try_clone_to_owned().map(UnixStream::from).map_err(StepError::io)?;
        let writer = socket.try_clone().map_err(StepError::io)?;
        let pulse = Arc::new(Pulse::default());
        let answers = Arc::new(Answers {
            writer: Mutex::new(BufWriter::with_capacity(BUFFER_BYTES, writer)),
            is_awaited: AtomicBool::new(false),
            pulse: Arc::clone(&pulse),
        });
        let reporter = Arc::clone(&answers);
        let thread = std::thread::Builder::new().name("alive".to_owned());
        thread.spawn(move || reporter.report_alive()).map_err(StepError::io)?;
        Ok(Self {
            program,
            requests: BufReader::with_capacity(BUFFER_BYTES, socket),
            answers,
            folder: std::env::current_dir().map_err(StepError::io)?,
            stage: None,
            inputs: Vec::new(),
            outputs: Outputs { pulse: Some(pulse), ..Outputs::default() },
        })
    }

    /// Answers requests until the connection ends.
    fn run(mut self) -> Result<(), StepError> {
        loop {
            let request = match read_head(&mut self.requests) {
                Ok(request) => request,
                Err(error) if [ErrorKind::UnexpectedEof, ErrorKind::ConnectionReset].contains(&error.kind()) => {
                    return Ok(());
                }
                Err(error) => return Err(StepError::io(error)),
            };
            self.answers.is_awaited.store(true, Ordering::Relaxed);
            if let Err(error) = self.answer(request) {
                let failed = Answer::Failed(Failure::from_error(&error), error.to_string());
                // Whether or not the run receives it, the error is in the log.
                let _ = self.answers.finish(&failed, []);
                return Err(error);
            }
        }
    }

    fn answer(&mut self, request: Request) -> Result<(), StepError> {
        match request {
            Request::Describe(launch) => {
                let file = self.launch_file(&launch)?;
                let mut description = describe_table(self.program, Some(&file), &launch.table, &self.folder)?;
                description.files = self.files(&file, &launch.table, &description.settings)?;
                self.answers.finish(&Answer::Described(description), [])
            }
            Request::Check(launch, context) => {
                let file = self.launch_file(&launch)?;
                let problems = check_table(self.program, &file, &launch.table, &self.here(context));
                self.answers.finish(&Answer::Problems(problems), [])
            }
            Request::Open(launch, context) => {
                self.build(&launch, context)?;
                self.answers.finish(&Answer::Done, [])
            }
            Request::Load(n_bytes) => {
                let state = read_block(&mut self.requests, n_bytes).map_err(StepError::io)?;
                self.stage.as_mut().ok_or_else(not_open)?.load(&state)?;
                self.answers.finish(&Answer::Done, [])
            }
            Request::Step(report, messages) => {
                let mut inputs = self.read_messages(messages)?;
                report.replace(&mut self.outputs);
                let stage = self.stage.as_mut().ok_or_else(not_open)?;
                stage.step(&mut inputs, &mut self.outputs)?;
                self.publish()
            }
            Request::Finish(report) => {
                report.replace(&mut self.outputs);
                let stage = self.stage.as_mut().ok_or_else(not_open)?;
                stage.finish(&mut self.outputs)?;
                self.publish()
            }
            Request::Save => self.save(),
        }
    }

    fn launch_file(&self, launch: &LaunchText) -> Result<LaunchFile, StepError> {
        let path = self.folder.join("launch.toml");
        LaunchFile::parse(&path, launch.text.clone(), &launch.changes).map_err(|problems| {
            let texts: Vec<String> = problems.into_iter().map(|problem| problem.text).collect();
            StepError::configuration(texts.join("; "))
        })
    }

    /// The program and the files that its settings name, with their digests. Files in the agent's folder have relative
    /// paths, as on the host of the run.
    fn files(&self, file: &LaunchFile, table: &str, settings: &[Field]) -> Result<BTreeMap<String, String>, StepError> {
        let mut paths = files_of_settings(file, table, settings, &self.folder);
        paths.insert(std::env::current_exe().map_err(StepError::io)?);
        let digest = |path: PathBuf| {
            let identity = FileIdentity::read(&path, None).map_err(|error| StepError::io(error).at(path.display()))?;
            let shown = path.strip_prefix(&self.folder).unwrap_or(&path).to_string_lossy().into_owned();
            Ok((shown, identity.digest().to_owned()))
        };
        paths.into_iter().map(digest).collect()
    }

    /// The context of the run, with the paths of settings in the agent's folder.
    fn here(&self, context: Context) -> Context {
        Context { launch_folder: self.folder.clone(), ..context }
    }

    fn build(&mut self, launch: &LaunchText, context: Context) -> Result<(), StepError> {
        let context = self.here(context);
        let file = self.launch_file(launch)?;
        let refused = |problem: &Problem| StepError::configuration(file.render(problem));
        let table = own_table(&file, &launch.table).map_err(|problem| refused(&problem))?;
        let (stage, problems) = self.program.configured(&table);
        if let Some(problem) = problems.first() {
            return Err(refused(problem));
        }
        self.inputs = stage.inputs(&self.folder)?;
        for port in stage.outputs(&self.folder)? {
            self.outputs.by_topic.insert(port.topic(), (port.make.remote_output)());
        }
        self.stage = Some(stage.build(&context)?);
        Ok(())
    }

    fn read_messages(&mut self, messages: Vec<MessageBlock>) -> Result<Inputs, StepError> {
        let mut inputs = Inputs::default();
        for MessageBlock { topic, n_bytes } in messages {
            let port = self.inputs.iter().find(|port| port.topic() == topic);
            let port = port.ok_or_else(|| StepError::contract(format!("topic {topic} is not among the inputs")))?;
            let bytes = read_block(&mut self.requests, n_bytes).map_err(StepError::io)?;
            (port.make.push_bytes)(&mut inputs, port.topic(), &bytes)?;
        }
        Ok(inputs)
    }

    /// Answers with the messages that the step has published.
    fn publish(&mut self) -> Result<(), StepError> {
        self.answers.send(&Answer::Reported(Report::from_outputs(&self.outputs)), [])?;
        for (topic, output) in &mut self.outputs.by_topic {
            output.take_published(&mut |envelope, column, header, rows| {
                let topic = (*topic).to_owned();
                let stamp = envelope.stamp;
                let n_rows = u64::from(envelope.len);
                self.answers.send(&Answer::Message { topic, stamp, column, n_rows }, [header, rows])
            })?;
        }
        self.answers.finish(&Answer::Done, [])
    }

    fn save(&mut self) -> Result<(), StepError> {
        let state = self.stage.as_mut().ok_or_else(not_open)?.save()?;
        if let Some(file) = state.files().first() {
            let text = format!("the state needs {}, which the host of the run does not have", file.display());
            return Err(StepError::configuration(text));
        }
        let lengths = state.pieces().map(|piece| (piece.bytes.len() as u64, piece.row_bytes as u64)).collect();
        self.answers.finish(&Answer::State(lengths), state.pieces().map(|piece| piece.bytes))
    }
}

fn not_open() -> StepError {
    StepError::contract("a request for a stage that was not opened")
}
