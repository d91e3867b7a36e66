//! The decoder of a sensor whose packets are being recorded.

use super::mounting::Mounting;
use super::receiver::{Receiver, Sockets};
use super::recording::{LIDAR, Recording};
use crate::error::{LiveError, NoSweepError};
use drive::LiveRig;
use lidar::nmea::{Fix, LogStats};
use lidar::{LidarStats, PacketArrival, SweepError, SweepInfo, SweepPoint, SweepPoll, SweepReader};
use std::net::SocketAddrV4;
use std::path::PathBuf;
use std::time::Instant;

/// Size of a packet's record in a capture without the payload: record header, Ethernet, IP and UDP.
const HEADER_BYTES: u64 = 16 + 42;
/// Revolution of a sensor at 10 Hz, used until one has been measured.
const TURN_NANOS: u64 = 100_000_000;
/// Least share of a revolution that measures the size of a revolution.
const COMPLETE: f64 = 0.9;

/// Silence without an end after which a run says that it waits, s. A start of a LiDAR takes up to a minute, and someone may
/// watch the console.
const WAITING_S: f64 = 5.0;

/// Limits for discarding sweeps and for giving up the sensor.
#[derive(Clone, Copy, Debug)]
pub struct LiveLimits {
    /// Least share of a revolution, 0 to 1. Smaller sweeps are discarded.
    pub min_turn: f64,
    /// Time without packets after which the sensor has ended, s; 0 = never.
    pub quiet_s: f64,
    /// Time with packets and without a sweep after which the sensor has failed, s; 0 = never.
    pub max_undecoded_s: f64,
    /// Largest backlog of revolutions; with a larger one decoding continues at the newest complete revolution.
    pub max_behind: u32,
}

/// A sensor, its recording, and the state of the decoder.
pub struct LiveSensor {
    limits: LiveLimits,
    mounting: Mounting,
    receiver: Receiver,
    recording: Recording,
    reader: Option<SweepReader>,
    /// Size of the capture at the last attempt to find the sensor.
    examined_bytes: u64,
    has_no_sensor: bool,
    current: CurrentSweep,
    /// Start of the current sweep in the capture.
    begin_bytes: u64,
    revolution_bytes: u64,
    n_sweeps: u64,
    discarded: Discarded,
}

/// The sweep whose packets are arriving.
#[derive(Clone, Copy, PartialEq)]
enum CurrentSweep {
    None,
    /// Its points are passed on.
    Points,
    /// Its points are not passed on.
    Discarded,
}

/// Result of [`LiveSensor::poll`].
pub enum LivePoll {
    /// A sweep is complete, with the number of rings of the sensor and the fixes up to its end.
    Sweep(SweepInfo, usize, Vec<Fix>),
    /// The sweep is discarded, and its points must be discarded.
    Discarded,
    /// The packets do not belong to the sensor. They are recorded, not decoded.
    NoSensor(SweepError),
    /// All packets were read.
    Waiting,
    /// The recording has ended.
    Ended,
}

/// Counters of a sensor.
#[derive(Clone, Debug)]
pub struct SensorStats {
    /// Packets.
    pub lidar: LidarStats,
    /// Sentences in its position packets.
    pub log: LogStats,
}

/// Numbers of sweeps that were not passed on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Discarded {
    /// Sweeps skipped to catch up, or that began before a restart.
    pub skipped: u64,
    /// Sweeps of less than the least share of a revolution.
    pub partial: u64,
}

impl LiveSensor {
    /// Starts the recording in `folder`. The first address is for data packets, the second for position packets.
    pub fn start(
        addresses: [SocketAddrV4; 2],
        folder: PathBuf,
        mounting: Mounting,
        limits: LiveLimits,
    ) -> Result<Self, LiveError> {
        let sockets = Sockets::bind(&addresses)?;
        let (recording, recorder) = Recording::begin(folder, LIDAR)?;
        let receiver = Receiver::start(sockets, recorder).map_err(LiveError::Thread)?;
        if let Some(lidar) = &mounting.lidar {
            recording.describe(lidar, &mounting)?;
        }
        // The previous process ended within a sweep. A run on the recording does not publish the rest of it either.
        let current = if recording.is_continued() { CurrentSweep::Discarded } else { CurrentSweep::None };
        Ok(Self {
            limits,
            mounting,
            receiver,
            recording,
            reader: None,
            examined_bytes: 0,
            has_no_sensor: false,
            current,
            begin_bytes: 0,
            revolution_bytes: 0,
            n_sweeps: 0,
            discarded: Discarded::default(),
        })
    }

    /// Fails if the receiving thread has failed, or if no packet has ever arrived; ends the recording if the sensor is silent for too long.
    pub fn check_receiver(&mut self) -> Result<(), LiveError> {
        if let Some(source) = self.receiver.take_error() {
            return Err(LiveError::File { path: self.capture(), source });
        }
        let limit = self.limits.quiet_s;
        let seconds = self.receiver.silent_s();
        if limit > 0.0 && seconds >= limit && !self.receiver.frontier().is_closed() {
            // After a restart of the process, the sensor may have ended in the meantime.
            if self.receiver.n_packets() == 0 && !self.recording.has_earlier_packets() {
                return Err(LiveError::Silent { seconds, limit, addresses: self.receiver.addresses() });
            }
            self.receiver.close();
        }
        Ok(())
    }

    /// Whether the recording has packets of an earlier process.
    pub fn has_earlier_packets(&self) -> bool {
        self.recording.has_earlier_packets()
    }

    /// What a silent sensor means for a run without a limit of silence.
    pub fn waiting_note(&self) -> Option<String> {
        let is_waiting = self.limits.quiet_s == 0.0 && !self.receiver.frontier().is_closed();
        (is_waiting && self.receiver.silent_s() >= WAITING_S).then(|| {
            let addresses = self.receiver.addresses();
            let more = if self.receiver.n_packets() > 0 { " more" } else { "" };
            format!(
                "no{more} packet in {WAITING_S:.0} s at {addresses}; the run waits without a limit (quiet_s = 0): check cable and power of \
                 the LiDAR, and whether it sends to this address and port; Ctrl-C ends the run"
            )
        })
    }

    /// Fails if packets have arrived for too long, all of them were read, and no sweep was found.
    pub fn check_decoded(&self) -> Result<(), LiveError> {
        let seconds = self.receiver.span_s();
        let limit = self.limits.max_undecoded_s;
        if self.n_sweeps > 0 || limit == 0.0 || seconds < limit || self.receiver.frontier().is_closed() {
            return Ok(());
        }
        let reason = match &self.reader {
            Some(reader) => {
                let model = reader.model().name();
                let stats = reader.stats();
                format!(
                    "{} data packets of {model}, {} foreign packets, {} late packets",
                    stats.data_packets, stats.foreign_packets, stats.late_packets
                )
            }
            None => match SweepReader::open(self.recording.captures().to_vec(), self.mounting.lidar.as_ref()) {
                Err(error) => error.to_string(),
                Ok(_) => "too few data packets to detect the model".to_owned(),
            },
        };
        Err(NoSweepError::Live { seconds, n_packets: self.receiver.n_packets(), limit, reason }.into())
    }

    /// Reads the capture until a sweep is complete or the capture ends. Passes the points of the current sweep to `sink`, in pieces.
    pub fn poll(&mut self, mut sink: impl FnMut(&[SweepPoint])) -> Result<LivePoll, LiveError> {
        if self.reader.is_none()
            && let Some(poll) = self.open_reader()?
        {
            return Ok(poll);
        }
        loop {
            if self.current == CurrentSweep::None {
                self.catch_up()?;
            }
            let Some(reader) = &mut self.reader else { return Ok(LivePoll::Waiting) };
            if self.current == CurrentSweep::None {
                self.current = CurrentSweep::Points;
            }
            let is_passed_on = self.current == CurrentSweep::Points;
            let polled = if is_passed_on { reader.poll_sweep(&mut sink)? } else { reader.poll_sweep(|_| {})? };
            let info = match polled {
                SweepPoll::Sweep(info) => info,
                SweepPoll::Pending => return Ok(LivePoll::Waiting),
                SweepPoll::End => return Ok(LivePoll::Ended),
            };
            let n_rings = reader.n_rings();
            let end_bytes = reader.place().1;
            self.current = CurrentSweep::None;
            if is_passed_on && info.turn >= self.limits.min_turn {
                let fixes = reader.take_fixes();
                self.n_sweeps += 1;
                self.measure(&info, end_bytes);
                return Ok(LivePoll::Sweep(info, n_rings, fixes));
            }
            // Its fixes are published with the next sweep, as offline.
            self.discarded.add(&info, &self.limits);
            self.measure(&info, end_bytes);
            if is_passed_on {
                return Ok(LivePoll::Discarded);
            }
        }
    }

    /// Reads the rest of the recording and discards its sweeps.
    pub fn discard_rest(&mut self) -> Result<(), LiveError> {
        self.current = CurrentSweep::Discarded;
        if let Some(reader) = &mut self.reader {
            while let SweepPoll::Sweep(info) = reader.poll_sweep(|_| {})? {
                self.discarded.add(&info, &self.limits);
            }
        }
        Ok(())
    }

    /// Finds the sensor in the start of the recording. `None` if it is found.
    fn open_reader(&mut self) -> Result<Option<LivePoll>, LiveError> {
        let frontier = self.receiver.frontier();
        let unchanged = if frontier.is_closed() { LivePoll::Ended } else { LivePoll::Waiting };
        // After the close, the last packets also count.
        let whole_bytes = frontier.whole_bytes() + u64::from(frontier.is_closed());
        if self.has_no_sensor || whole_bytes == self.examined_bytes {
            return Ok(Some(unchanged));
        }
        self.examined_bytes = whole_bytes;
        match SweepReader::follow(self.recording.captures().to_vec(), frontier, self.mounting.lidar.as_ref()) {
            Ok(None) => Ok(Some(unchanged)),
            Ok(Some(reader)) => {
                self.recording.describe(reader.lidar(), &self.mounting)?;
                let (n_bytes, nanos) = reader.typical_packet();
                self.revolution_bytes = TURN_NANOS / nanos * (HEADER_BYTES + n_bytes);
                self.reader = Some(reader);
                Ok(None)
            }
            Err(error @ SweepError::NoSensor { .. }) => {
                self.has_no_sensor = true;
                Ok(Some(LivePoll::NoSensor(error)))
            }
            Err(error) => Err(error.into()),
        }
    }

    /// If the backlog is too large, skips all but the newest complete revolution. Skipped revolutions are decoded for their times and
    /// boundaries, which takes a hundredth of their duration, and not published.
    fn catch_up(&mut self) -> Result<(), LiveError> {
        let Some(reader) = &mut self.reader else { return Ok(()) };
        let frontier = self.receiver.frontier();
        let behind = |reader: &SweepReader| frontier.whole_bytes().saturating_sub(reader.place().1);
        if behind(reader) <= u64::from(self.limits.max_behind) * self.revolution_bytes {
            return Ok(());
        }
        while behind(reader) > 2 * self.revolution_bytes {
            match reader.poll_sweep(|_| {})? {
                SweepPoll::Sweep(info) => self.discarded.add(&info, &self.limits),
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

    /// Ends the recording.
    pub fn close(&mut self) {
        self.receiver.close();
    }

    /// Waits a short time for packets. `false` from `until` on.
    pub fn wait(&self, until: Instant) -> bool {
        self.receiver.wait(until)
    }

    /// Packets received so far from any sender.
    pub fn n_packets(&self) -> u64 {
        self.receiver.n_packets()
    }

    /// Packets dropped by the kernel since the last call.
    pub fn take_dropped(&mut self) -> u64 {
        self.receiver.take_dropped()
    }

    /// Sweeps discarded since the last call.
    pub fn take_discarded(&mut self) -> Discarded {
        std::mem::take(&mut self.discarded)
    }

    /// Sweeps passed on so far.
    pub fn n_sweeps(&self) -> u64 {
        self.n_sweeps
    }

    /// Counters; `None` until the sensor is found.
    pub fn stats(&self) -> Option<SensorStats> {
        self.reader.as_ref().map(|reader| SensorStats { lidar: reader.stats(), log: reader.log_stats() })
    }

    /// Stamp and capture time of the packet with the least delay since the last call.
    pub fn take_arrival(&mut self) -> Option<PacketArrival> {
        self.reader.as_mut().and_then(SweepReader::take_arrival)
    }

    /// Size of the capture that is being written.
    pub fn recorded_bytes(&self) -> u64 {
        self.receiver.frontier().whole_bytes()
    }

    /// Size of the kernel's receive buffer, bytes.
    pub fn buffer_bytes(&self) -> usize {
        self.receiver.buffer_bytes()
    }

    /// The capture that is being written.
    pub fn capture(&self) -> PathBuf {
        self.recording.captures().last().cloned().unwrap_or_default()
    }

    /// The rig of the sensor.
    pub fn rig(&self) -> &LiveRig {
        &self.mounting.rig
    }
}

impl Discarded {
    fn add(&mut self, info: &SweepInfo, limits: &LiveLimits) {
        *(if info.turn >= limits.min_turn { &mut self.skipped } else { &mut self.partial }) += 1;
    }
}
