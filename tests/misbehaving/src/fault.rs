//! The faults of the relay.

use crate::relay::Settings;
use rustix::process::{Signal, getpid, kill_process};
use stage::messages::{ClassTopic, Message};
use stage::{Context, Loan, Outputs, StepError};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Far more than saving takes on a busy machine.
const MAX_WAIT: Duration = Duration::from_mins(3);

/// The fault that the settings select.
///
/// | fault | what happens |
/// |---|---|
/// | `error` | a step fails |
/// | `exit` | the process ends with code 0 |
/// | `panic` | panic |
/// | `hang` | the whole process is stopped |
/// | `stall` | a step never ends, not even on SIGTERM |
/// | `killed`, `bus_error` | SIGKILL, SIGBUS |
/// | `exhausts_memory` | an allocation that nothing can satisfy |
/// | `fills_shared_memory` | takes what is free in /dev/shm, then writes into a loan: only in a mount namespace |
/// | `leaks_loans` | keeps every loan |
/// | `floods_topic` | more messages in a tick than the queue takes |
/// | `hangs_at_start`, `stalls_at_start` | as `hang` and `stall`, before it is ready |
/// | `fails_at_start` | it cannot be constructed |
/// | `loads_no_state` | it cannot load any state |
/// | `relies_on_nothing` | its states refer to a file that does not exist |
/// | `waits`, `waits_at_start` | the step does not end, or it is not ready, before the file `once` exists |
pub struct Fault {
    settings: Settings,
    output: PathBuf,
}

impl Fault {
    pub fn new(settings: &Settings, context: &Context) -> Self {
        Self { settings: settings.clone(), output: context.output.clone() }
    }

    /// While the stage is constructed.
    pub fn strike_at_start(&self) -> Result<(), StepError> {
        match self.settings.fault.as_str() {
            "waits_at_start" => {
                self.await_gate();
                Ok(())
            }
            "hangs_at_start" if self.is_due(0)? => stop(),
            "stalls_at_start" if self.is_due(0)? => stall(),
            "fails_at_start" if self.is_due(0)? => Err(StepError::data("configured to fail at the start")),
            _ => Ok(()),
        }
    }

    /// While a state is loaded.
    pub fn strike_at_load(&self) -> Result<(), StepError> {
        let refuses = self.settings.fault == "loads_no_state";
        if refuses { Err(StepError::data("configured to load no state")) } else { Ok(()) }
    }

    /// Files that a state refers to.
    pub fn relied_on(&self) -> Option<PathBuf> {
        (self.settings.fault == "relies_on_nothing").then(|| self.output.join("not_there.ply"))
    }

    /// Before the step of a tick.
    pub fn strike(&self, tick: u64, kept: &mut Vec<Loan<ClassTopic>>, outputs: &mut Outputs) -> Result<(), StepError> {
        let fault = self.settings.fault.as_str();
        if fault == "waits" {
            if tick == self.settings.at_tick {
                self.await_gate();
            }
            return Ok(());
        }
        if fault == "none"
            || fault.ends_with("_at_start")
            || ["loads_no_state", "relies_on_nothing"].contains(&fault)
            || !self.is_due(tick)?
        {
            return Ok(());
        }
        self.await_barrier(tick);
        match fault {
            "error" => Err(StepError::data(format!("configured to fail in tick {tick}"))),
            "exit" => std::process::exit(0),
            "panic" => panic!("configured to panic in tick {tick}"),
            "hang" => stop(),
            "killed" => send(Signal::KILL),
            // Rust's own handler takes the first signal for an access to the stack's guard page, and ignores the second.
            "bus_error" => kill_process(getpid(), Signal::BUS).map_err(StepError::io).and_then(|()| send(Signal::BUS)),
            "exhausts_memory" => {
                let block = std::hint::black_box(Vec::<u8>::with_capacity(isize::MAX as usize));
                Err(StepError::data(format!("there were {} bytes", block.capacity())))
            }
            "fills_shared_memory" => {
                fill("/dev/shm/filler")?;
                let mut loan = outputs.loan::<ClassTopic>(ClassTopic::MAX_ROWS)?;
                loan.grow(ClassTopic::MAX_ROWS)?;
                Err(StepError::data("there was shared memory left"))
            }
            "leaks_loans" => loop {
                kept.push(outputs.loan::<ClassTopic>(1)?);
            },
            "floods_topic" => (0..=ClassTopic::QUEUE).try_for_each(|_| {
                let loan = outputs.loan::<ClassTopic>(0)?;
                outputs.publish(loan, 0)
            }),
            _ => stall(),
        }
    }

    /// Waits until the file `once` exists: the test creates it when it has changed something in mid-run.
    fn await_gate(&self) {
        while !self.output.join(&self.settings.once).exists() {
            std::thread::park_timeout(Duration::from_millis(1));
        }
    }

    /// Waits until the barrier before `tick` is complete, so that the run resumes from a known barrier. There is one after every
    /// fifth tick; where none is possible, the wait ends after `MAX_WAIT`.
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

    /// Whether the fault happens now; a fault that happens once leaves a file.
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
