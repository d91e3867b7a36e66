//! A sensor on the network: its packets are first recorded, then decoded from the recording.
//!
//! The receiving thread writes a capture. The step reads the growing capture with the code that reads recorded drives. So the
//! recording contains all received packets even if decoding fails, and a run on the recording gives the same sweeps. A restarted
//! process begins the next capture and decodes that one, so its saved state is empty.

use crate::Settings;
use crate::doubts::Doubts;
use crate::error::{LiveError, NoSweepError};
use crate::publish::{ReportedCounts, publish_fixes, publish_sweep};
use crate::receiver::{Receiver, Sockets, bind};
use crate::recording::{self, Recording};
use crate::sweep;
use formats::drive::LiveRig;
use formats::manifest::PoseEntry;
use formats::velodyne::{DATA_PACKET_BYTES, Model, SweepError, SweepInfo, SweepPoll, SweepReader};
use messages::{Message, SweepTopic};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};
use std::net::SocketAddrV4;
use std::path::{Component, Path, PathBuf};
use std::time::{Duration, Instant};

/// Differs from the versions of recorded drives.
const STATE_VERSION: u32 = 1001;
/// Longest time of a step without packets, so that commands are handled.
const STEP_TIMEOUT: Duration = Duration::from_millis(50);
/// Size of a packet's record in a capture: record header, Ethernet, IP, UDP and data.
const RECORD_BYTES: u64 = 16 + 42 + DATA_PACKET_BYTES as u64;
/// Revolution of a sensor at 10 Hz, until one has been measured.
const TURN_NANOS: u64 = 100_000_000;
/// Least share of a revolution that measures the size of a revolution.
const COMPLETE: f64 = 0.9;
/// With a smaller buffer a stall of the disk soon drops packets: an HDL-32E fills 4 MiB per second, with bookkeeping.
const RECOMMENDED_BUFFER: usize = 4 << 20;

/// The sensor, its recording, and the state of the decoder.
pub(crate) struct Live {
    settings: Settings,
    receiver: Receiver,
    recording: Recording,
    model: Option<Model>,
    rig: LiveRig,
    reader: Option<SweepReader>,
    /// Size of the capture at the last attempt to find the sensor.
    examined_bytes: u64,
    has_no_sensor: bool,
    current: CurrentSweep,
    /// Where the current sweep begins in the capture.
    begin_bytes: u64,
    revolution_bytes: u64,
    reported: ReportedCounts,
    n_packets: u64,
    n_sweeps: u64,
    gnss_rows: u64,
    n_fixes: u64,
}

/// The sweep whose packets are arriving.
enum CurrentSweep {
    None,
    Points(Loan<SweepTopic>),
    /// The sweep will not be published.
    Discarded,
}

/// Result of [`Live::advance`].
enum Advance {
    Published,
    Waiting,
    Ended,
}

impl Live {
    /// Settings that prevent receiving or recording.
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
                Err(error) => problems.push(Problem::of_key(key, error.to_string())),
            }
        }
        if let Err(error) = mounting(settings, context) {
            problems.push(Problem::of_key(error.key(), error.to_string()));
        }
        let folder = match folder(settings, context) {
            Ok(folder) => folder,
            Err(error) => {
                problems.push(Problem::of_key(error.key(), error.to_string()));
                return problems;
            }
        };
        match recording::captures(&folder) {
            Ok(captures) if captures.is_empty() => {}
            Ok(captures) => {
                let error = LiveError::Used { n: captures.len(), folder };
                problems.push(Problem::of_key(error.key(), error.to_string()));
            }
            Err(error) => problems.push(Problem::of_key("recording", format!("{}: {error}", folder.display()))),
        }
        problems
    }

    /// Starts the recording.
    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let data = address(&settings.listen).map_err(StepError::data)?;
        let position = address(&settings.position_listen).map_err(StepError::data)?;
        let (model, rig) = mounting(settings, context).map_err(StepError::data)?;
        let sockets = Sockets::bind([data, position]).map_err(StepError::io)?;
        let (recording, recorder) =
            Recording::begin(folder(settings, context).map_err(StepError::data)?).map_err(StepError::io)?;
        let receiver = Receiver::start(sockets, recorder).map_err(StepError::io)?;
        if let Some(model) = model {
            recording.describe(model, body_from_lidar(&rig)).map_err(StepError::io)?;
        }
        // The previous process ended within a sweep. A run on the recording does not publish the rest of it either.
        let current = if recording.is_continued() { CurrentSweep::Discarded } else { CurrentSweep::None };
        Ok(Self {
            settings: settings.clone(),
            receiver,
            recording,
            model,
            rig,
            reader: None,
            examined_bytes: 0,
            has_no_sensor: false,
            current,
            begin_bytes: 0,
            revolution_bytes: 0,
            reported: ReportedCounts::default(),
            n_packets: 0,
            n_sweeps: 0,
            gnss_rows: 0,
            n_fixes: 0,
        })
    }

    /// Publishes the next sweep, or nothing if none is complete within [`STEP_TIMEOUT`].
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let until = Instant::now() + STEP_TIMEOUT;
        let flow = loop {
            if let Some(source) = self.receiver.take_error() {
                return Err(StepError::io(LiveError::File { path: self.capture(), source }));
            }
            if self.settings.quiet_s > 0.0 && self.receiver.silent_s() >= self.settings.quiet_s {
                self.receiver.close();
            }
            let advance = self.advance(outputs)?;
            if matches!(advance, Advance::Waiting) {
                self.check_decoded()?;
            }
            match advance {
                Advance::Waiting if self.receiver.wait(until) => {}
                Advance::Published | Advance::Waiting => break Flow::Continue,
                Advance::Ended => break Flow::End,
            }
        };
        self.report_counts(outputs);
        Ok(flow)
    }

    /// Ends the recording and publishes its last sweeps, as many as fit into a tick; the others are counted.
    pub(crate) fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.receiver.close();
        // The tick may already have one sweep.
        for _ in 1..SweepTopic::QUEUE {
            if !matches!(self.advance(outputs)?, Advance::Published) {
                break;
            }
        }
        self.current = CurrentSweep::Discarded;
        if let Some(reader) = &mut self.reader {
            while let SweepPoll::Sweep(info) = reader.poll_sweep(|_| {}).map_err(StepError::data)? {
                count_discarded(&self.settings, &info, outputs);
            }
        }
        self.report_counts(outputs);
        self.report_doubts(outputs);
        Ok(())
    }

    fn report_doubts(&self, outputs: &mut Outputs) {
        if self.n_sweeps == 0 && self.n_packets > 0 {
            let text = format!("{} packets were received and recorded, none of them gave a sweep", self.n_packets);
            outputs.doubt("no_sweep", self.n_packets as f64, text);
        }
        if let Some(reader) = &self.reader {
            let mut doubts = Doubts { settings: &self.settings, outputs };
            let n_bytes = self.receiver.frontier().whole_bytes();
            doubts.captures(&reader.stats(), n_bytes);
            doubts.log(&reader.log_stats(), self.gnss_rows, self.n_fixes);
        }
    }

    /// Fails if packets have arrived for too long, all of them were read, and none gave a sweep.
    fn check_decoded(&self) -> Result<(), StepError> {
        let (seconds, limit) = (self.receiver.span_s(), self.settings.max_undecoded_s);
        if self.n_sweeps > 0 || limit == 0.0 || seconds < limit || self.receiver.frontier().is_closed() {
            return Ok(());
        }
        let reason = match &self.reader {
            Some(reader) => {
                let (model, stats) = (reader.model().name(), reader.stats());
                format!(
                    "{} data packets of {model}, {} foreign packets, {} late packets",
                    stats.data_packets, stats.foreign_packets, stats.late_packets
                )
            }
            None => match SweepReader::open(self.recording.captures().to_vec(), self.model) {
                Err(error) => error.to_string(),
                Ok(_) => "too few data packets to detect the model".to_owned(),
            },
        };
        Err(StepError::data(NoSweepError::Live { seconds, n_packets: self.receiver.n_packets(), limit, reason }))
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

    /// Reads the capture until a sweep is complete or the capture ends.
    fn advance(&mut self, outputs: &mut Outputs) -> Result<Advance, StepError> {
        let is_closed = self.receiver.frontier().is_closed();
        if self.reader.is_none() && !self.open_reader(outputs)? {
            return Ok(if is_closed { Advance::Ended } else { Advance::Waiting });
        }
        loop {
            if matches!(self.current, CurrentSweep::None) {
                self.catch_up(outputs)?;
            }
            let Some(reader) = &mut self.reader else { return Ok(Advance::Waiting) };
            if matches!(self.current, CurrentSweep::None) {
                self.current = CurrentSweep::Points(sweep::loan(outputs)?);
            }
            let polled = match &mut self.current {
                CurrentSweep::Points(loan) => sweep::poll(reader, loan)?,
                CurrentSweep::Discarded | CurrentSweep::None => reader.poll_sweep(|_| {}).map_err(StepError::data)?,
            };
            let info = match polled {
                SweepPoll::Sweep(info) => info,
                SweepPoll::Pending => return Ok(Advance::Waiting),
                SweepPoll::End => return Ok(Advance::Ended),
            };
            let place = reader.place().1;
            match std::mem::replace(&mut self.current, CurrentSweep::None) {
                CurrentSweep::Points(loan) if info.turn >= self.settings.min_turn => {
                    publish_sweep(loan, &info, reader.model(), outputs)?;
                    let fixes = reader.take_fixes();
                    self.n_fixes += fixes.len() as u64;
                    self.gnss_rows += publish_fixes(&fixes, outputs)?;
                    self.n_sweeps += 1;
                    outputs.set_drive_time(info.stamp.0);
                    self.measure(&info, place);
                    return Ok(Advance::Published);
                }
                // Its fixes are published with the next sweep, as offline.
                _ => count_discarded(&self.settings, &info, outputs),
            }
            self.measure(&info, place);
        }
    }

    /// Finds the sensor in the begin of the recording. `false` while there are too few packets.
    fn open_reader(&mut self, outputs: &mut Outputs) -> Result<bool, StepError> {
        let frontier = self.receiver.frontier();
        // After the close the last packets count, too.
        let whole_bytes = frontier.whole_bytes() + u64::from(frontier.is_closed());
        if self.has_no_sensor || whole_bytes == self.examined_bytes {
            return Ok(false);
        }
        self.examined_bytes = whole_bytes;
        match SweepReader::follow(self.recording.captures().to_vec(), frontier, self.model) {
            Ok(None) => Ok(false),
            Ok(Some(reader)) => {
                let model = reader.model();
                self.recording.describe(model, body_from_lidar(&self.rig)).map_err(StepError::io)?;
                self.revolution_bytes = TURN_NANOS / u64::from(model.packet_nanos()) * RECORD_BYTES;
                self.reader = Some(reader);
                Ok(true)
            }
            Err(error @ SweepError::NoSensor { .. }) => {
                self.has_no_sensor = true;
                outputs.note(format!("{error}; packets are recorded but not decoded"));
                Ok(false)
            }
            Err(error) => Err(StepError::data(error)),
        }
    }

    /// If the backlog is too large, skips all but the newest complete revolution. Skipped revolutions are decoded for their times and
    /// boundaries, which takes a hundredth of their duration, and not published.
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
                    self.current = CurrentSweep::Discarded;
                    break;
                }
                SweepPoll::End => break,
            }
        }
        self.begin_bytes = reader.place().1;
        Ok(())
    }

    /// Measures the size of a revolution in the capture.
    fn measure(&mut self, info: &SweepInfo, end_bytes: u64) {
        if info.turn > COMPLETE && end_bytes > self.begin_bytes && self.begin_bytes > 0 {
            self.revolution_bytes = end_bytes - self.begin_bytes;
        }
        self.begin_bytes = end_bytes;
    }

    /// Updates the counters of the run summary.
    fn report_counts(&mut self, outputs: &mut Outputs) {
        if self.n_packets == 0 && self.receiver.n_packets() > 0 {
            self.note_begin(outputs);
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
            self.reported.report(reader.stats(), reader.log_stats(), outputs);
        }
    }

    fn note_begin(&self, outputs: &mut Outputs) {
        outputs.note(format!("recording to {}", self.capture().display()));
        outputs.note(self.rig.to_string());
        let n_bytes = self.receiver.buffer_bytes();
        if n_bytes < RECOMMENDED_BUFFER {
            outputs.note(format!(
                "the kernel's receive buffer has {n_bytes} bytes; set net.core.rmem_max to {RECOMMENDED_BUFFER} to avoid dropped packets \
                 when the disk stalls"
            ));
        }
    }
}

fn count_discarded(settings: &Settings, info: &SweepInfo, outputs: &mut Outputs) {
    outputs.count(if info.turn >= settings.min_turn { "sweeps_skipped" } else { "partial_sweeps" }, 1);
}

/// Folder of the recording: inside the output folder, so that a run writes nowhere else.
fn folder(settings: &Settings, context: &Context) -> Result<PathBuf, LiveError> {
    let path = Path::new(&settings.recording);
    let is_inside = path.components().all(|part| matches!(part, Component::Normal(_)));
    if is_inside && !settings.recording.is_empty() {
        return Ok(context.output.join(path));
    }
    Err(LiveError::Outside(settings.recording.clone()))
}

fn address(text: &str) -> Result<SocketAddrV4, LiveError> {
    text.parse().map_err(|_| LiveError::Address(text.to_owned()))
}

/// Model, if the settings or the rig name it, and the rig.
fn mounting(settings: &Settings, context: &Context) -> Result<(Option<Model>, LiveRig), LiveError> {
    let rig = LiveRig::find(&context.drive)?;
    let wanted = Model::from_name(&settings.model);
    let Some(manifest) = rig.manifest() else { return Ok((wanted, rig)) };
    let of_rig = Model::from_name(&manifest.lidar.model);
    if wanted.is_some() && wanted != of_rig {
        return Err(LiveError::Model { setting: settings.model.clone(), rig: manifest.lidar.model.clone() });
    }
    Ok((of_rig, rig))
}

fn body_from_lidar(rig: &LiveRig) -> PoseEntry {
    rig.manifest().map_or(PoseEntry::IDENTITY, |manifest| manifest.lidar.body_from_lidar)
}
