//! Stage `replay`: a source that publishes the messages and ticks of a recording. It replaces the stages that published them.
//!
//! `replica record` and `replica import` write recordings. A run from a recording repeats a part of another run without
//! its sensors: for example, all stages after the odometry, with another model. With `speed`, it keeps the pace of the
//! recorded drive.
//!
//! Start at `Replay::step` below: it publishes one recorded tick. `pace.rs` waits until the tick is due.
//!
//! The stage must never change a message: it publishes the recorded bytes, in the recorded ticks and order. It refuses
//! a topic whose version or layout differs from its own, and it never ignores damage silently: a recording that ends
//! early is replayed to its end and raises the doubt `recording_incomplete`; damaged messages end the run. Topics that
//! were not recorded, but that stages read, raise the doubt `topics_not_replayed`.

mod pace;

use doubts::Doubt;
use pace::Pace;
use recording::{RecordedTick, RecordingError, RecordingReader, TickReader};
use stage::messages::ByteTable;
use stage::{Context, Flow, Inputs, Outputs, Port, Problem, Stage, StepError, any, decode_state, encode_state, within};
use std::path::Path;

stage::settings! {
    /// Settings of the replay.
    pub struct Settings {
        /// The recording.
        pub recording: String = String::new() => any();
        /// Topics to publish; empty = all recorded topics.
        pub topics: Vec<String> = Vec::new() => any();
        /// Playback speed: drive time per wall-clock time; 1 = real time, 0 = as fast as the consumers allow. Pauses longer
        /// than 5 s are shortened to 5 s.
        pub speed: f64 = 0.0 => within(0.0, 1000.0);
    }
}

/// A recording as a source.
pub struct Replay {
    ticks: TickReader,
    topics: Vec<Port>,
    pace: Pace,
    n_ticks: u64,
    /// Share of the recorded drive that was published, 0 to 1.
    progress: f64,
    /// Topics of [`Context::missing`].
    missing: Vec<String>,
    /// The tick after the last published one: a tick is the last one if there is no further tick.
    next: Option<RecordedTick>,
}

/// Topics to publish, by name.
fn recorded(path: &Path, settings: &Settings) -> Result<Vec<Port>, StepError> {
    let reader = RecordingReader::open(path).map_err(StepError::data)?;
    let known = Port::all();
    let mut found = Vec::new();
    for wanted in &settings.topics {
        if !reader.topics().iter().any(|topic| topic.ticks_of() == Some(wanted)) {
            return Err(StepError::data(format!("{}: has no topic {wanted} to replay", path.display())));
        }
    }
    let is_wanted = |name: &String| settings.topics.is_empty() || settings.topics.contains(name);
    for topic in reader.topics().iter().filter(|topic| topic.ticks_of().is_none() && is_wanted(&topic.name)) {
        let file = path.display();
        let name = &topic.name;
        // A topic with a name from a launch file has the layout of its type.
        let is_type = |port: &&Port| {
            let ByteTable { version, layout, .. } = port.byte_table();
            (version, layout) == (topic.table.version, topic.table.layout)
        };
        let own = known.iter().find(|known| known.topic() == name).copied();
        let Some(known) = own.or_else(|| known.iter().find(is_type).map(|port| port.named(name))) else {
            return Err(StepError::data(format!(
                "{file}: topic {name} cannot be replayed: this program does not know its type"
            )));
        };
        let ByteTable { version, layout, .. } = known.byte_table();
        if (topic.table.version, topic.table.layout) != (version, layout) {
            let theirs = topic.table.version;
            let their_layout = topic.table.layout;
            return Err(StepError::data(format!(
                "{file}: topic {name} has version {theirs} and layout {their_layout:016x}; this program knows version {version} \
                 and layout {layout:016x}"
            )));
        }
        if !reader.topics().iter().any(|ticks| ticks.ticks_of() == Some(name)) {
            return Err(StepError::data(format!(
                "{file}: topic {name} cannot be replayed: its ticks, channel {name}.tick, are not declared before the first message \
                 or in a summary; write the file again with a summary"
            )));
        }
        found.push(known);
    }
    if found.is_empty() {
        return Err(StepError::data(format!("{}: has no topic to replay", path.display())));
    }
    found.sort_by_key(Port::topic);
    Ok(found)
}

impl Stage for Replay {
    const NAME: &'static str = "replay";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        Vec::new()
    }

    fn outputs() -> Vec<Port> {
        Port::all()
    }

    fn outputs_with(settings: &Settings, launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        if settings.recording.is_empty() {
            return Ok(Self::outputs());
        }
        recorded(&launch_folder.join(&settings.recording), settings)
    }

    fn check(settings: &Settings, _context: &Context) -> Vec<Problem> {
        if settings.recording.is_empty() { vec![Problem::for_key("recording", "must be given")] } else { Vec::new() }
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let path = context.resolve(Path::new(&settings.recording));
        let topics = recorded(&path, settings)?;
        let names: Vec<&str> = topics.iter().map(Port::topic).collect();
        let ticks = TickReader::open(&path, &names).map_err(StepError::data)?;
        let pace = Pace::new(settings.speed);
        let missing = context.missing.clone();
        Ok(Self { ticks, topics, pace, n_ticks: 0, progress: 0.0, missing, next: None })
    }

    fn step(&mut self, _inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        if !self.missing.is_empty() {
            outputs.report_doubt(&Doubt::TopicsNotReplayed { topics: self.missing.clone() });
        }
        let tick = match self.next.take() {
            Some(tick) => tick,
            None => match self.read(outputs)? {
                Some(tick) => tick,
                None => {
                    return Err(StepError::data(format!("{}: has no tick", self.ticks.recording().path().display())));
                }
            },
        };
        self.pace.wait_for(tick.row.drive_time);
        outputs.set_drive_time(tick.row.drive_time);
        self.progress = f64::from(tick.row.progress);
        outputs.set_progress(self.progress);
        for (topic, messages) in self.topics.iter().zip(&tick.messages) {
            for message in messages {
                outputs.publish_bytes(topic, &message.bytes)?;
            }
        }
        self.n_ticks += 1;
        if tick.row.end == 0 {
            self.next = self.read(outputs)?;
        }
        Ok(if self.next.is_some() { Flow::Continue } else { Flow::End })
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(encode_state(1, &self.n_ticks)?.into())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.n_ticks = decode_state(1, state)?;
        for _ in 0..self.n_ticks {
            let tick = self.ticks.next().map_err(StepError::data)?;
            self.progress = tick.map_or(0.0, |tick| f64::from(tick.row.progress));
        }
        Ok(())
    }
}

impl Replay {
    /// The next tick. A recording that ends before its run is replayed to its end, and its results are doubtful.
    fn read(&mut self, outputs: &mut Outputs) -> Result<Option<RecordedTick>, StepError> {
        let fault = match self.ticks.next() {
            Ok(None) if !self.ticks.ended() => {
                format!("{}: the recording ends before the end of its run", self.ticks.recording().path().display())
            }
            Err(error @ RecordingError::Cut { .. }) => error.to_string(),
            Ok(tick) => return Ok(tick),
            // A restart reads the same bytes again.
            Err(error @ RecordingError::Damaged { .. }) => return Err(StepError::configuration(error)),
            Err(error) => return Err(StepError::data(error)),
        };
        outputs.report_doubt(&Doubt::RecordingIncomplete { fault, progress: self.progress });
        outputs.count("recordings_not_complete", 1);
        Ok(None)
    }
}
