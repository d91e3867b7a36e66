//! The faults of the relay.

use crate::relay::Settings;
use rustix::process::{Signal, getpid, kill_process};
use rustix::time::{ClockId, clock_gettime};
use stage::messages::{ClassTopic, Message};
use stage::{Context, Loan, Outputs, StepError};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Longest wait, far more than saving takes on a busy machine.
const MAX_WAIT: Duration = Duration::from_mins(3);

/// Processor time of a long step.
const WORK: Duration = Duration::from_secs(2);

stage::words! {
    /// Kind of the fault.
    pub enum FaultKind {
        /// No fault.
        None = "none",
        /// A step fails.
        Error = "error",
        /// The process ends with code 0.
        Exit = "exit",
        /// A panic.
        Panic = "panic",
        /// The whole process is stopped.
        Hang = "hang",
        /// A step never ends, not even on SIGTERM.
        Stall = "stall",
        /// The step waits until the file `once` exists.
        Waits = "waits",
        /// The step uses `WORK` of processor time.
        Works = "works",
        /// SIGKILL.
        Killed = "killed",
        /// SIGBUS.
        BusError = "bus_error",
        /// An allocation that nothing can satisfy.
        ExhaustsMemory = "exhausts_memory",
        /// Takes all free space in /dev/shm, then writes into a loan: only in a mount namespace.
        FillsSharedMemory = "fills_shared_memory",
        /// Keeps every loan.
        LeaksLoans = "leaks_loans",
        /// Sends more messages in a tick than the queue takes.
        FloodsTopic = "floods_topic",
        /// Hangs as `hang`, before it is ready.
        HangsAtStart = "hangs_at_start",
        /// Stalls as `stall`, before it is ready.
        StallsAtStart = "stalls_at_start",
        /// Is not ready before the file `once` exists.
        WaitsAtStart = "waits_at_start",
        /// Cannot be constructed.
        FailsAtStart = "fails_at_start",
        /// Cannot load any state.
        LoadsNoState = "loads_no_state",
        /// Its states refer to a file that does not exist.
        ReliesOnNothing = "relies_on_nothing",
    }
}

impl FaultKind {
    /// Whether the fault occurs in a step, when it is due: not by waiting for the test, and not at the start.
    fn is_in_a_step(self) -> bool {
        match self {
            Self::None
            | Self::Waits
            | Self::HangsAtStart
            | Self::StallsAtStart
            | Self::WaitsAtStart
            | Self::FailsAtStart
            | Self::LoadsNoState
            | Self::ReliesOnNothing => false,
            Self::Error
            | Self::Exit
            | Self::Panic
            | Self::Hang
            | Self::Stall
            | Self::Works
            | Self::Killed
            | Self::BusError
            | Self::ExhaustsMemory
            | Self::FillsSharedMemory
            | Self::LeaksLoans
            | Self::FloodsTopic => true,
        }
    }
}

/// The fault that the settings select.
pub struct Fault {
    settings: Settings,
    output: PathBuf,
}

impl Fault {
    pub fn new(settings: &Settings, context: &Context) -> Self {
        Self { settings: settings.clone(), output: context.output.clone() }
    }

    /// Called while the stage is constructed.
    pub fn strike_at_start(&self) -> Result<(), StepError> {
        match self.settings.fault {
            FaultKind::WaitsAtStart => {
                self.await_gate();
                Ok(())
            }
            FaultKind::HangsAtStart if self.is_due(0)? => stop(),
            FaultKind::StallsAtStart if self.is_due(0)? => stall(),
            FaultKind::FailsAtStart if self.is_due(0)? => Err(StepError::data("configured to fail at the start")),
            _ => Ok(()),
        }
    }

    /// Called while a state is loaded.
    pub fn strike_at_load(&self) -> Result<(), StepError> {
        let refuses = self.settings.fault == FaultKind::LoadsNoState;
        if refuses { Err(StepError::data("configured to load no state")) } else { Ok(()) }
    }

    /// Files that a state refers to.
    pub fn relied_on(&self) -> Option<PathBuf> {
        (self.settings.fault == FaultKind::ReliesOnNothing).then(|| self.output.join("not_there.ply"))
    }

    /// Called before the step of a tick.
    pub fn strike(&self, tick: u64, kept: &mut Vec<Loan<ClassTopic>>, outputs: &mut Outputs) -> Result<(), StepError> {
        let fault = self.settings.fault;
        if fault == FaultKind::Waits && tick == self.settings.at_tick {
            self.await_gate();
        }
        if !fault.is_in_a_step() || !self.is_due(tick)? {
            return Ok(());
        }
        self.await_barrier(tick);
        match fault {
            FaultKind::Error => Err(StepError::data(format!("configured to fail in tick {tick}"))),
            FaultKind::Exit => std::process::exit(0),
            FaultKind::Panic => panic!("configured to panic in tick {tick}"),
            FaultKind::Hang => stop(),
            FaultKind::Killed => send(Signal::KILL),
            // Rust's own handler takes the first signal for an access to the stack's guard page, and ignores the second.
            FaultKind::BusError => {
                kill_process(getpid(), Signal::BUS).map_err(StepError::io).and_then(|()| send(Signal::BUS))
            }
            FaultKind::ExhaustsMemory => {
                let block = std::hint::black_box(Vec::<u8>::with_capacity(isize::MAX as usize));
                Err(StepError::data(format!("there were {} bytes", block.capacity())))
            }
            FaultKind::FillsSharedMemory => {
                fill("/dev/shm/filler")?;
                let mut loan = outputs.loan::<ClassTopic>(ClassTopic::MAX_ROWS)?;
                loan.grow(ClassTopic::MAX_ROWS)?;
                Err(StepError::data("there was shared memory left"))
            }
            FaultKind::LeaksLoans => loop {
                kept.push(outputs.loan::<ClassTopic>(1)?);
            },
            FaultKind::FloodsTopic => (0..=ClassTopic::QUEUE).try_for_each(|_| {
                let loan = outputs.loan::<ClassTopic>(0)?;
                outputs.publish(loan, 0)
            }),
            FaultKind::Stall => stall(),
            FaultKind::Works => {
                let begun = processor_time();
                while processor_time().saturating_sub(begun) < WORK {}
                Ok(())
            }
            FaultKind::None
            | FaultKind::Waits
            | FaultKind::HangsAtStart
            | FaultKind::StallsAtStart
            | FaultKind::WaitsAtStart
            | FaultKind::FailsAtStart
            | FaultKind::LoadsNoState
            | FaultKind::ReliesOnNothing => Ok(()),
        }
    }

    /// Waits until the file `once` exists: the test creates it after changing something in mid-run.
    fn await_gate(&self) {
        while !self.output.join(&self.settings.once).exists() {
            std::thread::park_timeout(Duration::from_millis(1));
        }
    }

    /// Waits until the barrier before `tick` is complete, so that the run resumes from a known barrier. There is a
    /// barrier after every fifth tick; where no barrier is possible, the wait ends after `MAX_WAIT`.
    fn await_barrier(&self, tick: u64) {
        let barrier = tick.saturating_sub(1) / 5;
        let states = self.output.join(format!("run/states/{barrier}"));
        let is_whole =
            || ["source", "relay", "sink"].iter().all(|stage| states.join(format!("{stage}.state")).is_file());
        let begun = Instant::now();
        while barrier > 0 && !is_whole() && begun.elapsed() < MAX_WAIT {
            std::thread::park_timeout(Duration::from_millis(1));
        }
    }

    /// Whether the fault occurs now; a fault that occurs once leaves a file.
    fn is_due(&self, tick: u64) -> Result<bool, StepError> {
        let Settings { at_tick, once, every, .. } = &self.settings;
        let mark = match every {
            0 if tick != *at_tick => return Ok(false),
            0 if once.is_empty() => return Ok(true),
            0 => self.output.join(once),
            every if tick == 0 || !tick.is_multiple_of(*every) => return Ok(false),
            _ => self.output.join(format!("struck_{tick}")),
        };
        if mark.exists() {
            return Ok(false);
        }
        std::fs::write(mark, []).map_err(StepError::io)?;
        Ok(true)
    }
}

/// Processor time of this thread.
fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

fn send(signal: Signal) -> Result<(), StepError> {
    kill_process(getpid(), signal).map_err(StepError::io)?;
    stall()
}

fn stop() -> Result<(), StepError> {
    kill_process(getpid(), Signal::STOP).map_err(StepError::io)
}

fn stall() -> Result<(), StepError> {
    loop {
        std::thread::park();
    }
}

/// Writes until there is no room.
fn fill(path: &str) -> Result<(), StepError> {
    let mut file = std::fs::File::create(path).map_err(StepError::io)?;
    while std::io::Write::write(&mut file, &[1; 1 << 12]).is_ok() {}
    Ok(())
}
