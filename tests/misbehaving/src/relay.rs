//! Turns sweeps into columns, and fails as it is told.

use crate::mapping::is_shared_memory;
use rustix::process::{Signal, getpid, kill_process};
use stage::messages::{Class, ClassRow, Sweep};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StepError, any, decode_state, encode_state, one_of};
use std::path::PathBuf;

stage::settings! {
    /// Settings of the relay.
    pub struct Settings {
        /// What goes wrong: `error` fails a step, `exit` ends the process with code 0, `panic` panics, `hang` stops the
        /// whole process, `stall` never ends a step.
        pub fault: String = "none".to_owned() => one_of(&["none", "error", "exit", "panic", "hang", "stall"]);
        /// Tick in which it goes wrong.
        pub at_tick: u64 = 0 => any();
        /// It goes wrong only if this file is not there yet, and then leaves it. Empty: always.
        pub once: String = String::new() => any();
    }
}

/// A stage with a running sum as its state.
pub struct Relay {
    settings: Settings,
    once: Option<PathBuf>,
    tick: u64,
    sum: u64,
}

impl Relay {
    fn misbehave(&self) -> Result<(), StepError> {
        if self.tick != self.settings.at_tick || self.settings.fault == "none" {
            return Ok(());
        }
        if let Some(once) = &self.once {
            if once.exists() {
                return Ok(());
            }
            std::fs::write(once, []).map_err(StepError::io)?;
        }
        match self.settings.fault.as_str() {
            "error" => Err(StepError::data(format!("told to fail in tick {}", self.tick))),
            "exit" => std::process::exit(0),
            "panic" => panic!("told to panic in tick {}", self.tick),
            "hang" => kill_process(getpid(), Signal::STOP).map_err(StepError::io),
            _ => loop {
                std::thread::park();
            },
        }
    }
}

impl Stage for Relay {
    const NAME: &'static str = "relay";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<Sweep>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<Class>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let once = (!settings.once.is_empty()).then(|| context.output.join(&settings.once));
        Ok(Self { settings: settings.clone(), once, tick: 0, sum: 0 })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.misbehave()?;
        self.tick += 1;
        for sweep in inputs.take::<Sweep>() {
            outputs.count("rows", sweep.rows().len() as u64);
            if is_shared_memory(sweep.rows()) {
                outputs.count("rows_in_shared_memory", sweep.rows().len() as u64);
            }
            let mut loan = outputs.loan::<Class>(sweep.rows().len())?;
            let rows = loan.grow(sweep.rows().len()).ok_or_else(|| StepError::data("the loan is too small"))?;
            for (row, point) in rows.iter_mut().zip(sweep.rows()) {
                self.sum = self.sum.wrapping_mul(31).wrapping_add(point.x as u64 + u64::from(point.offset_nanos));
                *row = ClassRow { class_id: (self.sum % 23) as u8, score: (self.sum >> 8) as u8 };
            }
            outputs.publish_column(loan, sweep.stamp(), sweep.seq())?;
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<Vec<u8>, StepError> {
        Ok(encode_state(1, &(self.tick, self.sum))?)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        (self.tick, self.sum) = decode_state(1, state)?;
        Ok(())
    }
}
