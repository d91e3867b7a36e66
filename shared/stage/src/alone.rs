//! Runs a stage alone: it reads its inputs from a recording and writes its outputs into another. No supervisor, no
//! shared memory.

mod configuration;

use crate::command_line::{AloneArguments, print_json, print_line, usage};
use crate::diagnostics::Diagnostics;
use crate::program::{ConfiguredStage, Program, RunningStage};
use crate::{Context, Flow, Inputs, Outputs, Port, StepError, exit, log};
use configuration::configure;
use messages::{Envelope, TickRow};
use recording::{RecordedTick, RecordingError, RecordingWriter, TickReader};
use run::health::{Latency, ReportedDoubt, Traffic};
use run::histogram::Histogram;
use run::process::{monotonic_nanos, usage as process_usage};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// The report of the run, printed as text or JSON.
#[derive(Debug, Serialize)]
struct Report {
    stage: &'static str,
    /// Whether the recording's end was reached.
    complete: bool,
    ticks: u64,
    /// Drive time from first to last tick, s.
    drive_s: f64,
    /// From the construction of the stage to its end, reading and writing of recordings included, s.
    wall_s: f64,
    /// All steps together, s.
    steps_s: f64,
    step: Latency,
    /// Rows of the first input topic; for a source, rows of the first output topic.
    points: u64,
    /// Points divided by the time in steps.
    points_per_s: f64,
    inputs: BTreeMap<&'static str, Traffic>,
    outputs: BTreeMap<&'static str, Traffic>,
    counters: BTreeMap<String, u64>,
    notes: Vec<String>,
    doubts: Vec<ReportedDoubt>,
    cpu_s: f64,
    peak_rss_bytes: u64,
}

/// `run --recording …`; the exit code.
pub(crate) fn run(program: &dyn Program, arguments: &AloneArguments) -> u8 {
    let is_source = program.inputs().is_empty();
    if arguments.recording.is_none() && !is_source {
        let topics: Vec<&str> = program.inputs().iter().map(Port::topic).collect();
        return usage(program, &format!("run: --recording must name a recording with {}", topics.join(", ")));
    }
    if arguments.recording.is_some() && is_source {
        return usage(program, "run: a source reads a drive, not a recording");
    }
    let same = |a: &Path, b: &Path| a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b));
    if let (Some(input), Some(output)) = (&arguments.recording, &arguments.record)
        && same(input, output)
    {
        return usage(program, &format!("run: --record {} is also the input recording", output.display()));
    }
    log::start();
    let (stage, context, barrier_s) = match configure(program, arguments) {
        Ok(configuration) => configuration,
        Err(problems) => {
            for problem in problems {
                eprintln!("{problem}");
            }
            return exit::CONFIGURATION;
        }
    };
    let _span = tracing::info_span!("stage", stage = program.name()).entered();
    match Alone::open(program, &*stage, &context, arguments, barrier_s).and_then(Alone::run) {
        Ok(report) => {
            let is_trusted = report.complete && report.doubts.is_empty();
            let code = if is_trusted { exit::DONE } else { exit::INCOMPLETE };
            let printed = if arguments.json { print_json(&report) } else { print_line(&text(&report)) };
            printed.max(code)
        }
        Err(error) => {
            tracing::error!("{error}");
            if context.drive.as_os_str().is_empty() {
                tracing::error!("no drive was given: if the stage reads its manifest, add --drive FOLDER");
            }
            error.exit_code()
        }
    }
}

struct Alone<'a> {
    program: &'a dyn Program,
    stage: Box<dyn RunningStage>,
    source: Option<TickReader>,
    /// The inputs that are recorded, in the order of the reader's topics.
    inputs: Vec<Port>,
    outputs: Outputs,
    writer: Option<RecordingWriter>,
    barrier_s: f64,
    begun: u64,
    step_times: Histogram,
    step_nanos: u64,
    drive: Option<(i64, i64)>,
    report: Report,
    diagnostics: Diagnostics,
}

impl<'a> Alone<'a> {
    fn open(
        program: &'a dyn Program,
        stage: &dyn ConfiguredStage,
        context: &Context,
        arguments: &AloneArguments,
        barrier_s: f64,
    ) -> Result<Self, StepError> {
        let begun = monotonic_nanos();
        let mut inputs = stage.inputs(&context.launch_folder)?;
        inputs.retain(|port| context.connected.iter().any(|topic| topic == port.topic()));
        let topics: Vec<&str> = inputs.iter().map(Port::topic).collect();
        let source = arguments.recording.as_ref().map(|path| TickReader::open(path, &topics)).transpose();
        let mut outputs = Outputs::default();
        for port in program.outputs() {
            outputs.by_topic.insert(port.topic(), (port.make.memory_output)());
        }
        let mut tables: Vec<_> = program.outputs().iter().map(Port::byte_table).collect();
        tables.sort_by(|a, b| a.topic.cmp(&b.topic));
        let about = BTreeMap::from([
            ("mode".to_owned(), "offline".to_owned()),
            ("stage".to_owned(), program.name().to_owned()),
            ("settings".to_owned(), stage.settings_json()?),
        ]);
        let writer = arguments.record.as_ref().map(|path| RecordingWriter::create(path, &about, &tables)).transpose();
        let report = Report {
            stage: program.name(),
            complete: true,
            ticks: 0,
            drive_s: 0.0,
            wall_s: 0.0,
            steps_s: 0.0,
            step: Latency::default(),
            points: 0,
            points_per_s: 0.0,
            inputs: inputs.iter().map(|port| (port.topic(), Traffic::default())).collect(),
            outputs: program.outputs().iter().map(|port| (port.topic(), Traffic::default())).collect(),
            counters: BTreeMap::new(),
            notes: Vec::new(),
            doubts: Vec::new(),
            cpu_s: 0.0,
            peak_rss_bytes: 0,
        };
        Ok(Self {
            source: source.map_err(StepError::io)?,
            writer: writer.map_err(StepError::io)?,
            stage: stage.build(context)?,
            program,
            inputs,
            outputs,
            barrier_s,
            begun,
            step_times: Histogram::default(),
            step_nanos: 0,
            drive: None,
            report,
            diagnostics: Diagnostics::default(),
        })
    }

    fn run(mut self) -> Result<Report, StepError> {
        let ended = if self.source.is_some() { self.recorded_ticks() } else { self.source_ticks() };
        // What was written before an error is a valid recording.
        let finished = self.writer.take().map_or(Ok(()), RecordingWriter::finish).map_err(StepError::io);
        self.report.complete = ended?;
        finished?;
        let mut report = self.report;
        report.wall_s = (monotonic_nanos() - self.begun) as f64 * 1e-9;
        report.steps_s = self.step_nanos as f64 * 1e-9;
        report.step = Latency::from(&self.step_times);
        report.drive_s = self.drive.map_or(0.0, |(first, last)| last.saturating_sub(first) as f64 * 1e-9);
        let inputs = self.program.inputs();
        let outputs = self.program.outputs();
        let (ports, traffic) = if inputs.is_empty() { (outputs, &report.outputs) } else { (inputs, &report.inputs) };
        report.points = ports.first().and_then(|port| traffic.get(port.topic())).map_or(0, |traffic| traffic.rows);
        report.points_per_s = if report.steps_s > 0.0 { report.points as f64 / report.steps_s } else { 0.0 };
        Outputs { counters: report.counters, notes: report.notes, doubts: report.doubts, .. } = self.outputs;
        let used = process_usage();
        report.cpu_s = used.cpu_s;
        report.peak_rss_bytes = used.peak_rss_bytes;
        Ok(report)
    }

    /// Ticks of the recording to its end. `false` if it ends before the run did.
    fn recorded_ticks(&mut self) -> Result<bool, StepError> {
        loop {
            let Some(source) = &mut self.source else { return Ok(true) };
            match source.next() {
                Ok(Some(tick)) => self.recorded_tick(tick)?,
                Ok(None) if source.ended() => return Ok(true),
                Ok(None) => {
                    let path = source.recording().path().display();
                    tracing::warn!("{path}: ends after {} ticks, before the end of its run", self.report.ticks);
                    return Ok(false);
                }
                Err(error @ RecordingError::Cut { .. }) => {
                    tracing::warn!("{error}");
                    return Ok(false);
                }
                Err(error) => return Err(StepError::data(error)),
            }
        }
    }

    fn recorded_tick(&mut self, tick: RecordedTick) -> Result<(), StepError> {
        let mut inputs = Inputs::default();
        for (port, messages) in self.inputs.iter().zip(tick.messages) {
            let table = port.byte_table();
            for message in messages {
                let rows = u64::from(message.envelope.len);
                count(self.report.inputs.entry(port.topic()).or_default(), rows, table.row_bytes);
                (port.make.push_bytes)(&mut inputs, port.topic(), &message.bytes)?;
            }
        }
        let has_input = !inputs.is_empty();
        self.step(&mut inputs, has_input)?;
        self.complete(tick.row)
    }

    /// Ticks of a source to its end.
    fn source_ticks(&mut self) -> Result<bool, StepError> {
        let mut barrier = 0;
        let mut since = None;
        for tick in 0.. {
            let end = self.step(&mut Inputs::default(), true)? == Flow::End;
            let drive_time = self.outputs.drive_time.unwrap_or_default();
            let last = *since.get_or_insert(drive_time);
            let barrier_due = !end && drive_time.saturating_sub(last) as f64 >= self.barrier_s * 1e9;
            if barrier_due {
                barrier += 1;
                since = Some(drive_time);
            }
            let progress = self.outputs.progress.unwrap_or_default() as f32;
            let barrier = if barrier_due { barrier } else { 0 };
            let end_row = u32::from(end);
            self.complete(TickRow { tick, barrier, drive_time, progress, end: end_row, ..TickRow::default() })?;
            if end {
                break;
            }
        }
        Ok(true)
    }

    fn step(&mut self, inputs: &mut Inputs, is_timed: bool) -> Result<Flow, StepError> {
        let begun = monotonic_nanos();
        let flow = self.stage.step(inputs, &mut self.outputs)?;
        if is_timed {
            let nanos = monotonic_nanos() - begun;
            self.step_times.add(nanos);
            self.step_nanos += nanos;
        }
        Ok(flow)
    }

    /// The work after a step, as in a run: the last outputs at the end, the state at a barrier, then the tick is
    /// recorded.
    fn complete(&mut self, row: TickRow) -> Result<(), StepError> {
        if row.end != 0 {
            self.stage.finish(&mut self.outputs)?;
        }
        self.diagnostics.log_notes(&self.outputs, row.tick);
        if row.barrier != 0 {
            // The state is not kept, but a stage that cannot save its state must fail here as well.
            self.stage.save()?;
        }
        for (topic, output) in &mut self.outputs.by_topic {
            let traffic = self.report.outputs.entry(topic).or_default();
            let writer = &mut self.writer;
            output.take_published(&mut |envelope, _, header, rows| {
                let envelope = Envelope { tick: row.tick, ..*envelope };
                count(traffic, u64::from(envelope.len), rows.len() / (envelope.len as usize).max(1));
                let Some(writer) = writer else { return Ok(()) };
                writer.message(topic, row.drive_time, &envelope, header, rows).map_err(StepError::io)
            })?;
            if let Some(writer) = writer {
                writer.tick(topic, &TickRow { n_published: traffic.messages, ..row }).map_err(StepError::io)?;
            }
        }
        self.report.ticks += 1;
        let (first, _) = self.drive.unwrap_or((row.drive_time, 0));
        self.drive = Some((first, row.drive_time));
        Ok(())
    }
}

fn count(traffic: &mut Traffic, rows: u64, row_bytes: usize) {
    traffic.messages += 1;
    traffic.rows += rows;
    traffic.bytes += rows * row_bytes as u64;
}

/// The report for people.
fn text(report: &Report) -> String {
    let mut lines = Vec::new();
    let Report { stage, ticks, step, .. } = report;
    lines.push(format!("{stage}: {ticks} ticks, {:.1} s of drive in {:.2} s", report.drive_s, report.wall_s));
    lines.push(format!(
        "  {} steps with input in {:.3} s: median {:.3} ms, p99 {:.3} ms, longest {:.3} ms",
        step.count, report.steps_s, step.p50_ms, step.p99_ms, step.max_ms
    ));
    lines.push(format!("  {} points, {:.2} million points/s of step time", report.points, report.points_per_s * 1e-6));
    lines.push(format!(
        "  {:.2} s of CPU, {:.0} MiB at most",
        report.cpu_s,
        report.peak_rss_bytes as f64 / f64::from(1 << 20)
    ));
    for (way, traffic) in [("in ", &report.inputs), ("out", &report.outputs)] {
        for (topic, t) in traffic {
            lines.push(format!(
                "  {way} {topic}: {} messages, {} rows, {:.1} MB",
                t.messages,
                t.rows,
                t.bytes as f64 * 1e-6
            ));
        }
    }
    for (name, n) in &report.counters {
        lines.push(format!("  {name}: {n}"));
    }
    for note in &report.notes {
        lines.push(format!("  note: {note}"));
    }
    for doubt in &report.doubts {
        lines.push(format!("  doubt: {}: {}", doubt.name, doubt.text));
    }
    lines.join("\n")
}
