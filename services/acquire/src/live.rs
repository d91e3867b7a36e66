//! A sensor on the network: its packets go to the disk first, and are decoded from there.
//!
//! The receiving thread writes a capture; the step reads it as it grows, with the code that reads recorded drives. So the
//! recording is what was received, whatever becomes of the decoding, and a run over it gives the same sweeps. A process that
//! is started again begins the next capture and decodes that; its saved state is therefore empty.

use crate::Settings;
use crate::publish::{Told, publish_fixes, publish_sweep};
use crate::receiver::{Receiver, Sockets, bind};
use crate::recording::{self, Recording};
use crate::sweep;
use formats::drive::{Drive, DriveSweep, read_manifest};
use formats::manifest::{Manifest, PoseEntry};
use formats::velodyne::{DATA_PACKET_BYTES, Model, SweepError, SweepInfo, SweepPoll, SweepReader};
use messages::{Message, Sweep};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};
use std::net::SocketAddrV4;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Kept apart from the states of recorded drives.
const STATE_VERSION: u32 = 1001;
/// A step takes no longer when nothing comes, so that commands are heard.
const PATIENCE: Duration = Duration::from_millis(50);
/// A packet's record in a capture: its own header, Ethernet, IP and UDP.
const RECORD_BYTES: u64 = 16 + 42 + DATA_PACKET_BYTES as u64;
/// Of a sensor at 10 Hz, until its revolutions have been seen.
const TURN_NANOS: u64 = 100_000_000;
/// Below this share of a turn a sweep says nothing about the size of a revolution.
const WHOLE: f64 = 0.9;
/// With less in its buffer a stalled disk costs packets soon: an HDL-32E fills 4 MiB a second, bookkeeping included.
const GOOD_BUFFER: usize = 4 << 20;

/// The sensor, its recording, and how far that has been decoded.
pub(crate) struct Live {
    settings: Settings,
    receiver: Receiver,
    recording: Recording,
    model: Option<Model>,
    body_from_lidar: PoseEntry,
    reader: Option<SweepReader>,
    /// The recording's beginning was looked at up to here.
    surveyed_bytes: u64,
    has_no_sensor: bool,
    under_way: UnderWay,
    /// Where the sweep under way begins in the capture.
    begin_bytes: u64,
    revolution_bytes: u64,
    told: Told,
    n_packets: u64,
}

/// The sweep whose packets are coming in.
enum UnderWay {
    Nothing,
    Points(Loan<Sweep>),
    /// It will not be published.
    Discarded,
}

/// How far a step got.
enum Advance {
    Published,
    Waiting,
    Ended,
}

impl Live {
    /// What cannot be received, recorded or mounted as the settings say.
    pub(crate) fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let mut problems = Vec::new();
        for (key, value) in [("start_s", settings.start_s), ("end_s", settings.end_s)] {
            if value != 0.0 {
                problems.push(Problem::of_key(
                    key,
                    format!("value {value} is for recorded drives; must be 0 in live mode"),
                ));
            }
        }
        let mut bound = Vec::new();
        for (key, value) in [("listen", &settings.listen), ("position_listen", &settings.position_listen)] {
            match address(value).and_then(bind) {
                Ok(socket) => bound.push(socket),
                Err(text) => problems.push(Problem::of_key(key, text)),
            }
        }
        if let Err((key, text)) = mounting(settings, context) {
            problems.push(Problem::of_key(key, text));
        }
        let folder = folder(settings, context);
        match recording::captures(&folder) {
            Ok(captures) if captures.is_empty() => {}
            Ok(captures) => {
                let n = captures.len();
                let text = format!("{} holds {n} captures of an earlier run; must be another folder", folder.display());
                problems.push(Problem::of_key("recording", text));
            }
            Err(error) => problems.push(Problem::of_key("recording", format!("{}: {error}", folder.display()))),
        }
        problems
    }

    /// Begins to record.
    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let addresses = [address(&settings.listen), address(&settings.position_listen)];
        let [Ok(data), Ok(position)] = addresses else {
            let faults = addresses.into_iter().filter_map(Result::err).collect::<Vec<_>>();
            return Err(StepError::data(faults.join("; ")));
        };
        let (model, body_from_lidar) = mounting(settings, context).map_err(|(_, text)| StepError::Data(text))?;
        let sockets = Sockets::bind([data, position]).map_err(StepError::Io)?;
        let (recording, recorder) = Recording::begin(folder(settings, context)).map_err(StepError::Io)?;
        let receiver = Receiver::start(sockets, recorder).map_err(StepError::io)?;
        if let Some(model) = model {
            recording.describe(model, body_from_lidar).map_err(StepError::Io)?;
        }
        // The process before this one was torn away from a sweep: the rest of that is no sweep that the recording gives.
        let under_way = if recording.is_continued() { UnderWay::Discarded } else { UnderWay::Nothing };
        Ok(Self {
            settings: settings.clone(),
            receiver,
            recording,
            model,
            body_from_lidar,
            reader: None,
            surveyed_bytes: 0,
            has_no_sensor: false,
            under_way,
            begin_bytes: 0,
            revolution_bytes: 0,
            told: Told::default(),
            n_packets: 0,
        })
    }

    /// Publishes the next sweep, or nothing if none is complete within [`PATIENCE`].
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let until = Instant::now() + PATIENCE;
        let flow = loop {
            if let Some(text) = self.receiver.fault() {
                return Err(StepError::Io(format!("{}: {text}", self.capture().display())));
            }
            if self.settings.quiet_s > 0.0 && self.receiver.silent_s() >= self.settings.quiet_s {
                self.receiver.close();
            }
            match self.advance(outputs)? {
                Advance::Waiting if self.receiver.wait(until) => {}
                Advance::Published | Advance::Waiting => break Flow::Continue,
                Advance::Ended => break Flow::End,
            }
        };
        self.tell(outputs);
        Ok(flow)
    }

    /// Ends the recording and publishes its last sweeps, as many as a tick may have; the others are counted.
    pub(crate) fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.receiver.close();
        // The tick may have a sweep already.
        for _ in 1..Sweep::QUEUE {
            if !matches!(self.advance(outputs)?, Advance::Published) {
                break;
            }
        }
        self.under_way = UnderWay::Discarded;
        if let Some(reader) = &mut self.reader {
            while let SweepPoll::Sweep(info) = reader.poll_sweep(|_| {}).map_err(StepError::data)? {
                count_discarded(&self.settings, &info, outputs);
            }
        }
        self.tell(outputs);
        Ok(())
    }

    pub(crate) fn save() -> Result<Vec<u8>, StepError> {
        Ok(encode_state(STATE_VERSION, &())?)
    }

    pub(crate) fn load(state: &[u8]) -> Result<(), StepError> {
        Ok(decode_state(STATE_VERSION, state)?)
    }

    fn capture(&self) -> PathBuf {
        self.recording.captures().last().cloned().unwrap_or_default()
    }

    /// Reads on in the capture until a sweep is complete or there is no more.
    fn advance(&mut self, outputs: &mut Outputs) -> Result<Advance, StepError> {
        let is_closed = self.receiver.frontier().is_closed();
        if self.reader.is_none() && !self.open_reader(outputs)? {
            return Ok(if is_closed { Advance::Ended } else { Advance::Waiting });
        }
        loop {
            if matches!(self.under_way, UnderWay::Nothing) {
                self.catch_up(outputs)?;
            }
            let Some(reader) = &mut self.reader else { return Ok(Advance::Waiting) };
            if matches!(self.under_way, UnderWay::Nothing) {
                self.under_way = UnderWay::Points(sweep::loan(outputs)?);
            }
            let polled = match &mut self.under_way {
                UnderWay::Points(loan) => sweep::poll(reader, loan)?,
                UnderWay::Discarded | UnderWay::Nothing => reader.poll_sweep(|_| {}).map_err(StepError::data)?,
            };
            let info = match polled {
                SweepPoll::Sweep(info) => info,
                SweepPoll::Pending => return Ok(Advance::Waiting),
                SweepPoll::End => return Ok(Advance::Ended),
            };
            let place = reader.place().1;
            match std::mem::replace(&mut self.under_way, UnderWay::Nothing) {
                UnderWay::Points(loan) if info.turn >= self.settings.min_turn => {
                    publish_sweep(loan, &DriveSweep::from(info), reader.model(), outputs)?;
                    publish_fixes(&reader.take_fixes(), outputs)?;
                    outputs.set_drive_time(info.stamp.0);
                    self.measure(&info, place);
                    return Ok(Advance::Published);
                }
                // Its fixes come with the next one, as offline.
                _ => count_discarded(&self.settings, &info, outputs),
            }
            self.measure(&info, place);
        }
    }

    /// Looks at the recording's beginning. `false` while that does not say enough.
    fn open_reader(&mut self, outputs: &mut Outputs) -> Result<bool, StepError> {
        let frontier = self.receiver.frontier();
        // A look that the close could change is worth its time.
        let whole_bytes = frontier.whole_bytes() + u64::from(frontier.is_closed());
        if self.has_no_sensor || whole_bytes == self.surveyed_bytes {
            return Ok(false);
        }
        self.surveyed_bytes = whole_bytes;
        match SweepReader::follow(self.recording.captures().to_vec(), frontier, self.model) {
            Ok(None) => Ok(false),
            Ok(Some(reader)) => {
                let model = reader.model();
                self.recording.describe(model, self.body_from_lidar).map_err(StepError::Io)?;
                self.revolution_bytes = TURN_NANOS / u64::from(model.packet_nanos()) * RECORD_BYTES;
                self.reader = Some(reader);
                Ok(true)
            }
            Err(error @ SweepError::NoSensor { .. }) => {
                self.has_no_sensor = true;
                outputs.note(format!("{error}; what comes is recorded and not decoded"));
                Ok(false)
            }
            Err(error) => Err(StepError::data(error)),
        }
    }

    /// If decoding is too far behind, passes over all but the newest whole revolution. They are decoded for their time and
    /// their cut points, which costs a hundredth of the time that they took, and published by nobody.
    fn catch_up(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let Some(reader) = &mut self.reader else { return Ok(()) };
        let frontier = self.receiver.frontier();
        let behind = |reader: &SweepReader| frontier.whole_bytes().saturating_sub(reader.place().1);
        if behind(reader) <= u64::from(self.settings.max_behind) * self.revolution_bytes {
            return Ok(());
        }
        while behind(reader) > 2 * self.revolution_bytes {
            match reader.poll_sweep(|_| {}).map_err(StepError::data)? {
                SweepPoll::Sweep(info) => count_discarded(&self.settings, &info, outputs),
                SweepPoll::Pending => {
                    self.under_way = UnderWay::Discarded;
                    break;
                }
                SweepPoll::End => break,
            }
        }
        self.begin_bytes = reader.place().1;
        Ok(())
    }

    /// Learns how much of the capture a revolution takes.
    fn measure(&mut self, info: &SweepInfo, end_bytes: u64) {
        if info.turn > WHOLE && end_bytes > self.begin_bytes && self.begin_bytes > 0 {
            self.revolution_bytes = end_bytes - self.begin_bytes;
        }
        self.begin_bytes = end_bytes;
    }

    /// Brings the counters up to date.
    fn tell(&mut self, outputs: &mut Outputs) {
        if self.n_packets == 0 && self.receiver.n_packets() > 0 {
            self.say_first_words(outputs);
        }
        let n_packets = self.receiver.n_packets();
        for (name, n) in
            [("udp_packets", n_packets - self.n_packets), ("udp_packets_dropped", self.receiver.take_dropped())]
        {
            if n > 0 {
                outputs.count(name, n);
            }
        }
        self.n_packets = n_packets;
        if let Some(reader) = &self.reader {
            self.told.tell(reader.stats(), reader.log_stats(), outputs);
        }
    }

    fn say_first_words(&self, outputs: &mut Outputs) {
        outputs.note(format!("recording to {}", self.capture().display()));
        let n_bytes = self.receiver.buffer_bytes();
        if n_bytes < GOOD_BUFFER {
            outputs.note(format!(
                "the kernel holds {n_bytes} bytes of unread packets; raise net.core.rmem_max to {GOOD_BUFFER} so that a stalled \
                 disk costs none"
            ));
        }
    }
}

fn count_discarded(settings: &Settings, info: &SweepInfo, outputs: &mut Outputs) {
    outputs.count(if info.turn >= settings.min_turn { "sweeps_skipped" } else { "partial_sweeps" }, 1);
}

/// Where the recording goes.
fn folder(settings: &Settings, context: &Context) -> PathBuf {
    context.output.join(&settings.recording)
}

fn address(text: &str) -> Result<SocketAddrV4, String> {
    text.parse().map_err(|_| format!("value {text:?} must be an IPv4 address and a port, as 127.0.0.1:2368"))
}

/// Sensor (if the settings or the rig name it) and mounting; the error has the key that it is about.
fn mounting(settings: &Settings, context: &Context) -> Result<(Option<Model>, PoseEntry), (&'static str, String)> {
    let manifest: Option<Manifest> = if settings.rig.is_empty() {
        Drive::rig_alone(&context.drive).map_err(|error| ("rig", error.to_string()))?
    } else {
        let path = context.resolve(Path::new(&settings.rig));
        Some(read_manifest(&path).map_err(|error| ("rig", error.to_string()))?)
    };
    let wanted = Model::from_name(&settings.model);
    let Some(manifest) = manifest else { return Ok((wanted, PoseEntry::IDENTITY)) };
    let of_rig = Model::from_name(&manifest.lidar.model);
    if wanted.is_some() && wanted != of_rig {
        let text = format!("value {:?} must be that of the rig, {:?}, or empty", settings.model, manifest.lidar.model);
        return Err(("model", text));
    }
    Ok((of_rig, manifest.lidar.body_from_lidar))
}
