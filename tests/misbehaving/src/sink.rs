//! Writes down what came.

use crate::mapping::is_shared_memory;
use stage::messages::pod::{FINGERPRINT_START, bytes_from_rows, fingerprint};
use stage::messages::{Class, Sweep};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StepError, decode_state, encode_state};
use std::fmt::Write;
use std::path::PathBuf;

stage::settings! {
    /// The sink has no settings.
    pub struct Settings {}
}

/// Writes `sink.txt`: a line per message with its number and a digest of its rows.
pub struct Sink {
    path: PathBuf,
    text: String,
}

impl Stage for Sink {
    const NAME: &'static str = "sink";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<Class>(), Port::of::<Sweep>()]
    }

    fn outputs() -> Vec<Port> {
        Vec::new()
    }

    fn new(_settings: &Settings, context: &Context) -> Result<Self, StepError> {
        Ok(Self { path: context.output.join("sink.txt"), text: String::new() })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for (sweep, class) in inputs.take::<Sweep>().iter().zip(inputs.take::<Class>()) {
            for (topic, seq, bytes) in [
                ("sweep", sweep.seq(), bytes_from_rows(sweep.rows())),
                ("class", class.seq(), bytes_from_rows(class.rows())),
            ] {
                outputs.count("bytes", bytes.len() as u64);
                if is_shared_memory(bytes) {
                    outputs.count("bytes_in_shared_memory", bytes.len() as u64);
                }
                writeln!(self.text, "{topic} {seq} {:016x}", fingerprint(FINGERPRINT_START, bytes))
                    .map_err(StepError::io)?;
            }
        }
        Ok(Flow::Continue)
    }

    fn finish(&mut self, _outputs: &mut Outputs) -> Result<(), StepError> {
        std::fs::write(&self.path, &self.text).map_err(StepError::io)
    }

    fn save(&mut self) -> Result<Vec<u8>, StepError> {
        Ok(encode_state(1, &self.text)?)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.text = decode_state(1, state)?;
        Ok(())
    }
}
