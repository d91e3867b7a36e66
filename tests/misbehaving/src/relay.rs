//! Turns sweeps into columns, and fails as set.

use crate::fault::{Fault, FaultKind};
use crate::mapping::is_shared_memory;
use stage::messages::{ClassRow, ClassTopic, SweepTopic};
use stage::{
    Context, Flow, Inputs, Loan, Outputs, Port, Stage, StateBytes, StepError, any, decode_state, encode_state, one_word,
};

stage::settings! {
    /// Settings of the relay.
    pub struct Settings {
        /// The fault, see `fault.rs`.
        pub fault: FaultKind = FaultKind::None => one_word();
        /// Tick of the fault.
        pub at_tick: u64 = 0 => any();
        /// Part of every row: another salt gives other rows.
        pub salt: u64 = 0 => any();
        /// The fault occurs only if this file does not exist yet, and creates it. Empty: always. `waits` and
        /// `waits_at_start` wait for it.
        pub once: String = String::new() => any();
        /// The fault occurs in every tick that is a multiple of this, once in each; 0 = only in `at_tick`.
        pub every: u64 = 0 => any();
        /// Doubt the rows in this tick; 0 = never.
        pub doubt_at_tick: u64 = 0 => any();
        /// Check the memory of the rows.
        pub look_up: bool = true => any();
    }
}

/// A stage with a running sum as its state.
pub struct Relay {
    fault: Fault,
    /// Loans that `leaks_loans` keeps.
    kept: Vec<Loan<ClassTopic>>,
    doubt_at_tick: u64,
    look_up: bool,
    salt: u64,
    tick: u64,
    sum: u64,
}

impl Stage for Relay {
    const NAME: &'static str = "relay";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SweepTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<ClassTopic>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let fault = Fault::new(settings, context);
        fault.strike_at_start()?;
        let Settings { doubt_at_tick, look_up, salt, .. } = *settings;
        Ok(Self { fault, kept: Vec::new(), doubt_at_tick, look_up, salt, tick: 0, sum: 0 })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.fault.strike(self.tick, &mut self.kept, outputs)?;
        if self.doubt_at_tick > 0 && self.tick == self.doubt_at_tick {
            outputs.doubt("rows_invented", 0.5, "50 % of the rows are invented (limit 0 %)");
        }
        self.tick += 1;
        for sweep in inputs.take::<SweepTopic>() {
            outputs.count("rows", sweep.rows().len() as u64);
            if self.look_up && is_shared_memory(sweep.rows()) {
                outputs.count("rows_in_shared_memory", sweep.rows().len() as u64);
            }
            let mut loan = outputs.loan::<ClassTopic>(sweep.rows().len())?;
            let rows = loan.grow(sweep.rows().len())?;
            for (row, point) in rows.iter_mut().zip(sweep.rows()) {
                self.sum = self.sum.wrapping_mul(31).wrapping_add(point.x as u64 + u64::from(point.offset_nanos));
                let salted = self.sum ^ self.salt;
                *row = ClassRow { class_id: (salted % 23) as u8, score: (salted >> 8) as u8 };
            }
            outputs.publish_column(loan, sweep.stamp(), sweep.seq())?;
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let mut state = StateBytes::from(encode_state(1, &(self.tick, self.sum))?);
        state.rely_on(self.fault.relied_on());
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.fault.strike_at_load()?;
        (self.tick, self.sum) = decode_state(1, state)?;
        Ok(())
    }
}
