//! Writes a line per message.

use crate::mapping::is_shared_memory;
use stage::messages::pod::{FINGERPRINT_START, bytes_from_rows, fingerprint};
use stage::messages::{ClassTopic, SweepTopic};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StepError, any, decode_state, encode_state};
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;

stage::settings! {
    /// Settings of the sink.
    pub struct Settings {
        /// Duration of each tick, ms.
        pub slow_ms: u64 = 0 => any();
        /// A line per message; else one digest of all lines, so that a long run needs no more memory than a short one.
        pub lines: bool = true => any();
        /// Check the memory of the rows.
        pub look_up: bool = true => any();
    }
}

/// Writes `sink.txt`: a line per message with its number and a digest of its rows.
pub struct Sink {
    path: PathBuf,
    slow: Duration,
    lines: bool,
    look_up: bool,
    text: String,
    digest: u64,
}

impl Sink {
    fn write_line(&mut self, topic: &str, seq: u64, bytes: &[u8], outputs: &mut Outputs) -> Result<(), StepError> {
        outputs.count("bytes", bytes.len() as u64);
        if self.look_up && is_shared_memory(bytes) {
            outputs.count("bytes_in_shared_memory", bytes.len() as u64);
        }
        writeln!(self.text, "{topic} {seq} {:016x}", fingerprint(FINGERPRINT_START, bytes)).map_err(StepError::io)
    }
}

impl Stage for Sink {
    const NAME: &'static str = "sink";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<ClassTopic>(), Port::of::<SweepTopic>()]
    }

    fn outputs() -> Vec<Port> {
        Vec::new()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let lines = settings.lines;
        let look_up = settings.look_up;
        let slow = Duration::from_millis(settings.slow_ms);
        let path = context.output.join("sink.txt");
        Ok(Self { path, slow, lines, look_up, text: String::new(), digest: FINGERPRINT_START })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        if !self.slow.is_zero() {
            std::thread::sleep(self.slow);
        }
        for sweep in inputs.take::<SweepTopic>() {
            self.write_line("sweep", sweep.seq(), bytes_from_rows(sweep.rows()), outputs)?;
        }
        for class in inputs.take::<ClassTopic>() {
            self.write_line("class", class.seq(), bytes_from_rows(class.rows()), outputs)?;
        }
        if !self.lines {
            self.digest = fingerprint(self.digest, self.text.as_bytes());
            self.text.clear();
        }
        Ok(Flow::Continue)
    }

    fn finish(&mut self, _outputs: &mut Outputs) -> Result<(), StepError> {
        if !self.lines {
            self.text = format!("{:016x}\n", self.digest);
        }
        std::fs::write(&self.path, &self.text).map_err(StepError::io)
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(encode_state(2, &(&self.text, self.digest))?.into())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        (self.text, self.digest) = decode_state(2, state)?;
        Ok(())
    }
}
