//! The process of a stage: open, connect, process ticks, save states at barriers, drain.

mod barrier;
mod live;
mod saving;
mod source;

use crate::diagnostics::Diagnostics;
use crate::outputs::TickedOutput;
use crate::ports::{Clock, PortContext, TickedInput, Waiter};
use crate::program::{ConfiguredStage, Program, RunningStage};
use crate::{Flow, Inputs, Mode, Outputs, Port, StepError};
use ipc::{Domain, LatestSubscriber};
use messages::{NO_DRIVE_TIME, TickRow};
use run::assignment::{Assignment, Command, wake_name};
use run::health::{Activity, Health, Heartbeat, Latency, Pulse};
use run::histogram::Histogram;
use run::process::{boottime_nanos, end_with, monotonic_nanos};
use saving::Saving;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Largest error text in the heartbeat, which has 64 KiB and also carries the notes of [`Outputs::note`].
const MAX_ERROR_CHARS: usize = 2000;

/// Ticks after which the heartbeat reports the queues again. A stage that waits reports them at each wake.
const TICKS_PER_LOOK: u64 = 8;

/// How a run of a stage ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// All ticks are processed.
    Done,
    /// The supervisor asked for a stop.
    Stopped,
}

/// Runs a stage to its end.
pub(crate) fn run(
    program: &dyn Program,
    stage: &dyn ConfiguredStage,
    assignment: &Assignment,
    stop: Arc<AtomicBool>,
) -> Result<Ending, StepError> {
    end_with(assignment.supervisor).map_err(StepError::io)?;
    let domain = Domain::new(&assignment.domain)?;
    let pulse = Arc::new(Pulse::default());
    // The heartbeat starts before anything that may take long.
    let heartbeat = Heartbeat::start(&domain, &assignment.stage, Arc::clone(&pulse)).map_err(StepError::io)?;
    let ending = Runner::open(program, stage, assignment, &domain, &pulse, stop).and_then(|mut runner| {
        let connected = runner.connect();
        let ending = connected.and_then(|connected| if connected { runner.ticks() } else { Ok(Ending::Stopped) });
        runner.report();
        match (ending, runner.saving.settle()) {
            // A state that could not be saved is also an error of a stopped stage.
            (Ok(_) | Err(StepError::Stopped { .. }), Err(unsaved)) => Err(unsaved),
            (ending, _) => ending,
        }
    });
    match &ending {
        Ok(Ending::Done) => pulse.set(Activity::Done),
        Err(error) if !matches!(error, StepError::Stopped { .. }) => {
            pulse.update().error = Some(error.to_string().chars().take(MAX_ERROR_CHARS).collect());
        }
        _ => {}
    }
    // The last beat carries these figures.
    drop(heartbeat);
    match ending {
        Err(StepError::Stopped { .. }) => Ok(Ending::Stopped),
        other => other,
    }
}

struct Runner<'a> {
    program: &'a dyn Program,
    stage: Box<dyn RunningStage>,
    assignment: &'a Assignment,
    inputs: Vec<Box<dyn TickedInput>>,
    outputs: Outputs,
    control: LatestSubscriber,
    command: Command,
    ports: PortContext,
    pulse: &'a Pulse,
    tick: u64,
    barrier: u64,
    /// Drive time of the first tick.
    drive_begin: Option<i64>,
    /// Drive time of the last barrier, or of the first tick.
    barrier_time: Option<i64>,
    /// Row of the last tick.
    last_row: TickRow,
    /// Writes the last barrier's state to the disk.
    saving: Saving,
    step_times: Histogram,
    ages: Histogram,
    diagnostics: Diagnostics,
}

impl<'a> Runner<'a> {
    fn open(
        program: &'a dyn Program,
        stage: &dyn ConfiguredStage,
        assignment: &'a Assignment,
        domain: &Domain,
        pulse: &'a Arc<Pulse>,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, StepError> {
        let node = Rc::new(domain.node(&assignment.stage)?);
        let wake = node.open_wake(&wake_name(&assignment.stage))?;
        let control = LatestSubscriber::open(&node, &format!("{}.control", assignment.stage))?;
        let waiter = Rc::new(Waiter::new(Rc::clone(&node), wake, stop, Arc::clone(pulse)));
        let ports = PortContext { node, waiter, clock: Rc::new(Clock::default()) };
        let mut inputs = Vec::new();
        for port in stage.inputs(&assignment.context.launch_folder)? {
            // An optional topic without a producer has no channels and stays empty; several topics may be merged in one
            // port.
            for channels in assignment.inputs.iter().filter(|channels| channels.port == port.topic()) {
                inputs.push((port.make.shared_input)(&ports, channels, port.topic(), &wake_name(&assignment.stage))?);
            }
        }
        let mut outputs = Outputs { pulse: Some(Arc::clone(pulse)), ..Outputs::default() };
        for port in stage.outputs(&assignment.context.launch_folder)? {
            let channels = assignment.outputs.iter().find(|channels| channels.port == port.topic());
            let channels =
                channels.ok_or_else(|| StepError::contract(format!("no channels for output {}", port.topic())))?;
            outputs.by_topic.insert(port.topic(), (port.make.shared_output)(&ports, channels)?);
        }
        let mut runner = Self {
            stage: stage.build(&assignment.context)?,
            program,
            assignment,
            inputs,
            outputs,
            control,
            command: Command::default(),
            ports,
            pulse,
            tick: 0,
            barrier: 0,
            drive_begin: None,
            barrier_time: None,
            last_row: TickRow::default(),
            saving: Saving::default(),
            step_times: Histogram::default(),
            ages: Histogram::default(),
            diagnostics: Diagnostics::default(),
        };
        if let Some(barrier) = assignment.resume {
            runner.load(barrier)?;
        }
        if let Some(restart) = &assignment.restart {
            runner.follow(restart);
        }
        Ok(runner)
    }

    fn is_source(&self) -> bool {
        self.program.inputs().is_empty()
    }

    fn ticked_outputs(outputs: &mut Outputs) -> impl Iterator<Item = &mut dyn TickedOutput> {
        outputs.by_topic.values_mut().filter_map(|output| output.ticked())
    }

    /// Waits until all producers and consumers are connected; a source then waits for the start. `false` if the run is
    /// being stopped.
    fn connect(&mut self) -> Result<bool, StepError> {
        let inputs = &self.inputs;
        let outputs = &mut self.outputs;
        let control = &self.control;
        let missing = std::cell::RefCell::new(String::new());
        let waiter = Rc::clone(&self.ports.waiter);
        let connected = waiter.wait_until(
            || Activity::Connecting(missing.borrow().clone()),
            || {
                let mut all = control.connect()?;
                for input in inputs {
                    if !input.connect()? {
                        missing.replace(input.topic().to_owned());
                        all = false;
                    }
                }
                for output in Self::ticked_outputs(outputs) {
                    if !output.connect()? {
                        missing.replace(output.topic().to_owned());
                        all = false;
                    }
                }
                Ok(all)
            },
        )?;
        if !connected {
            return Ok(false);
        }
        self.pulse.announce(Activity::Ready);
        if !self.is_source() {
            return Ok(true);
        }
        let control = &self.control;
        let command = &mut self.command;
        waiter.wait_until(|| Activity::Ready, || read_command(control, command).map(|()| command.go))
    }

    fn ticks(&mut self) -> Result<Ending, StepError> {
        loop {
            let ended = if self.is_source() { self.source_tick()? } else { self.any_tick()? };
            match ended {
                None => return Ok(Ending::Stopped),
                Some(true) => break,
                Some(false) => {}
            }
        }
        let outputs = &mut self.outputs;
        let end = self.last_row;
        let control = &self.control;
        let command = &mut self.command;
        let repeats = self.assignment.context.mode == Mode::Live;
        let taken = self.ports.waiter.wait_until(
            || Activity::Draining,
            || {
                read_command(control, command)?;
                // A process that ends before the supervisor has received a heartbeat would count as failed.
                let mut all = command.heard;
                for output in Self::ticked_outputs(outputs) {
                    if !output.is_drained()? {
                        all = false;
                        // A consumer that has just been restarted has not received the end.
                        if repeats {
                            output.publish_tick(end)?;
                        }
                    }
                }
                Ok(all)
            },
        )?;
        Ok(if taken { Ending::Done } else { Ending::Stopped })
    }

    fn any_tick(&mut self) -> Result<Option<bool>, StepError> {
        match self.assignment.context.mode {
            Mode::Offline => self.tick(),
            Mode::Live => self.live_tick(),
        }
    }

    /// One tick of a stage that is not a source.
    fn tick(&mut self) -> Result<Option<bool>, StepError> {
        let waiter = Rc::clone(&self.ports.waiter);
        let Some(row) = waiter.transporting(|| self.gather())? else { return Ok(None) };
        if !self.wait_for_lease()? {
            return Ok(None);
        }
        let _span = tracing::debug_span!("tick", tick = row.tick).entered();
        let mut inputs = Inputs::default();
        for input in &mut self.inputs {
            input.deliver(&mut inputs);
        }
        self.work(&row, inputs)?;
        self.complete(row)?;
        self.ages.add(monotonic_nanos().saturating_sub(row.born_nanos));
        Ok(Some(row.end != 0))
    }

    /// Waits until the supervisor has renewed the lease of the output, if its time has passed: the machine or the disk stood
    /// still, and another run may write into the output since. `false` if the run is being stopped.
    fn wait_for_lease(&mut self) -> Result<bool, StepError> {
        if boottime_nanos() < self.command.valid_until_nanos {
            return Ok(true);
        }
        let control = &self.control;
        let command = &mut self.command;
        let is_renewed = || read_command(control, command).map(|()| boottime_nanos() < command.valid_until_nanos);
        self.ports.waiter.wait_until(|| Activity::Paused, is_renewed)
    }

    /// The step of a tick. `true` if it had input; only then is its time measured.
    fn work(&mut self, row: &TickRow, mut inputs: Inputs) -> Result<bool, StepError> {
        self.ports.clock.tick.set(row.tick);
        self.ports.clock.born_nanos.set(row.born_nanos);
        let has_input = !inputs.is_empty();
        self.pulse.set(Activity::Working);
        if has_input {
            self.timed_step(&mut inputs)?;
        } else {
            self.stage.step(&mut inputs, &mut self.outputs)?;
        }
        Ok(has_input)
    }

    /// Runs a step. Its measured time excludes the wait for room at its consumers.
    fn timed_step(&mut self, inputs: &mut Inputs) -> Result<Flow, StepError> {
        let _span = tracing::debug_span!("step").entered();
        let slept = self.ports.waiter.slept_nanos.get();
        let begun = monotonic_nanos();
        let flow = self.stage.step(inputs, &mut self.outputs)?;
        let slept = self.ports.waiter.slept_nanos.get() - slept;
        self.step_times.add((monotonic_nanos() - begun).saturating_sub(slept));
        Ok(flow)
    }

    /// Waits until every input has the whole tick, and checks that all inputs agree on barrier and end.
    fn gather(&mut self) -> Result<Option<TickRow>, StepError> {
        let inputs = &mut self.inputs;
        let outputs = &mut self.outputs;
        let tick = self.tick;
        let saving = &mut self.saving;
        let late = std::cell::RefCell::new(String::new());
        let mut agreed: Option<TickRow> = None;
        let here = self.ports.waiter.wait_until(
            || Activity::Waiting(late.borrow().clone()),
            || {
                // A state that could not be saved is reported even if no further message arrives.
                saving.check()?;
                agreed = None;
                for input in inputs.iter_mut() {
                    let Some(row) = input.gather(tick)? else {
                        late.replace(input.topic().to_owned());
                        for output in Self::ticked_outputs(outputs) {
                            output.note_waiting()?;
                        }
                        return Ok(false);
                    };
                    let first = agreed.get_or_insert(row);
                    if (first.barrier, first.end) != (row.barrier, row.end) {
                        let text =
                            format!("tick {tick}: {} disagrees with the other inputs on barrier or end", input.topic());
                        return Err(StepError::contract(text));
                    }
                }
                Ok(true)
            },
        )?;
        // The producers have room again, before a step that may take long.
        self.ports.node.wake_urged();
        Ok(if here { agreed } else { None })
    }

    /// The work after a step: the last outputs at the end, the state at a barrier, the tick on all outputs.
    fn complete(&mut self, row: TickRow) -> Result<(), StepError> {
        self.saving.check()?;
        if row.end != 0 {
            self.stage.finish(&mut self.outputs)?;
        }
        self.diagnostics.log_notes(&self.outputs, row.tick);
        if row.end != 0 {
            Diagnostics::log_counters(&self.outputs, row.tick);
        }
        self.tick += 1;
        self.last_row = row;
        if row.drive_time != NO_DRIVE_TIME {
            self.drive_begin.get_or_insert(row.drive_time);
        }
        if row.barrier != 0 {
            self.barrier = row.barrier;
            self.barrier_time = Some(row.drive_time);
            self.pulse.set(Activity::Saving);
            let begun = monotonic_nanos();
            self.save()?;
            self.ports.waiter.count_wait(&Activity::Saving, monotonic_nanos() - begun);
        }
        let outputs = &mut self.outputs;
        self.ports.waiter.transporting(|| {
            Self::ticked_outputs(outputs).try_for_each(|output| output.publish_tick(row))?;
            self.ports.node.wake_urged();
            Ok::<_, StepError>(())
        })?;
        self.pulse.mark_progress();
        if self.tick.is_multiple_of(TICKS_PER_LOOK) {
            for output in Self::ticked_outputs(&mut self.outputs) {
                output.note_waiting()?;
            }
        }
        let now = monotonic_nanos();
        let is_first = {
            let mut health = self.pulse.update();
            health.last_tick_nanos = Some(now);
            health.ticks = self.tick;
            health.drive_begin = self.drive_begin;
            health.drive_time = Some(row.drive_time).filter(|time| *time != NO_DRIVE_TIME);
            health.progress = f64::from(row.progress);
            *health.first_tick_nanos.get_or_insert(now) == now
        };
        self.report();
        if is_first {
            self.pulse.beat_now();
        }
        Ok(())
    }

    /// Updates the figures of the heartbeat.
    fn report(&mut self) {
        let inputs: BTreeMap<_, _> = self.inputs.iter().map(|i| (i.topic().to_owned(), i.traffic())).collect();
        let arrivals = self.inputs.iter().map(|i| (i.topic().to_owned(), i.arrivals())).collect();
        let outputs: BTreeMap<_, _> =
            Self::ticked_outputs(&mut self.outputs).map(|o| (o.topic().to_owned(), o.traffic())).collect();
        // Images have more rows than any cloud; points are the rows of the stage's first topic.
        let (ports, channels, traffic) = if self.is_source() {
            (self.program.outputs(), &self.assignment.outputs, &outputs)
        } else {
            (self.program.inputs(), &self.assignment.inputs, &inputs)
        };
        let first = ports.first().map(Port::topic);
        let carried = channels.iter().filter(|channels| Some(channels.port.as_str()) == first);
        let points = carried.filter_map(|channels| traffic.get(&channels.topic)).map(|traffic| traffic.rows).sum();
        let mut health = self.pulse.update();
        health.points = points;
        let Health { step, age, .. } = &mut *health;
        *step = Latency::from(&self.step_times);
        *age = Latency::from(&self.ages);
        health.inputs = inputs;
        health.outputs = outputs;
        health.arrivals = arrivals;
        health.waits = self.ports.waiter.waits();
        health.transport_cpu_s = self.ports.waiter.transport_nanos.get() as f64 * 1e-9;
        health.counters.clone_from(&self.outputs.counters);
        health.notes.clone_from(&self.outputs.notes);
        health.doubts.clone_from(&self.outputs.doubts);
    }
}

fn read_command(control: &LatestSubscriber, command: &mut Command) -> Result<(), StepError> {
    if let Some(bytes) = control.poll()? {
        *command = serde_json::from_slice(&bytes)
            .map_err(|error| StepError::contract(format!("unknown command of the supervisor: {error}")))?;
    }
    Ok(())
}
