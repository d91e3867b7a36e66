//! The secondary LiDARs on the network: recorded like the first one, and decoded up to the end of each of its sweeps.

use super::mounting::SecondaryMounting;
use super::receiver::{Receiver, Sockets};
use super::recording::{Recording, folder_of};
use crate::counters::ReportedCounts;
use crate::doubts::Doubts;
use crate::error::LiveError;
use crate::rows::StampedHeader;
use crate::secondary_tally::{SecondaryTally, named};
use drive::SweepInfo;
use lidar::nmea::LogStats;
use lidar::{Lidar, PacketArrival, SlicePoll, SweepError, SweepPoint, SweepReader};
use std::net::SocketAddrV4;
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest wait for the packets up to the end of a sweep of the first LiDAR. A LiDAR on the same clock sends its own
/// within some milliseconds.
const WAIT: Duration = Duration::from_millis(100);

/// A secondary LiDAR, its recording, and the state of its decoder.
pub struct SecondaryLidar {
    name: String,
    /// Index in the rig.
    index: usize,
    lidar: Lidar,
    receiver: Receiver,
    recording: Recording,
    reader: Option<SweepReader>,
    /// Size of the capture at the last attempt to find the sensor.
    examined_bytes: u64,
    tally: SecondaryTally,
    /// Sweeps whose packets arrived too late.
    n_late: u64,
    reported: Reported,
}

/// Counts at the last report.
#[derive(Default)]
struct Reported {
    counts: ReportedCounts,
    tally: SecondaryTally,
    n_packets: u64,
    n_late: u64,
}

impl SecondaryLidar {
    /// Starts the recording in `folder`. `index` is the index of the LiDAR in the rig.
    pub(super) fn start(
        address: SocketAddrV4,
        folder: &Path,
        index: usize,
        mounting: &SecondaryMounting,
    ) -> Result<Self, LiveError> {
        let name = mounting.name().to_owned();
        let sockets = Sockets::bind(&[address])?;
        let (recording, recorder) = Recording::begin(folder.to_owned(), &folder_of(&name))?;
        Ok(Self {
            receiver: Receiver::start(sockets, recorder).map_err(LiveError::Thread)?,
            name,
            index,
            lidar: mounting.lidar.clone(),
            recording,
            reader: None,
            examined_bytes: 0,
            tally: SecondaryTally::default(),
            n_late: 0,
            reported: Reported::default(),
        })
    }

    /// Passes the returns during a sweep of the first LiDAR to `sink`. Waits for their packets up to 100 ms, while
    /// packets arrive. `None` without returns.
    pub fn next_sweep(
        &mut self,
        first: &SweepInfo,
        mut sink: impl FnMut(&[SweepPoint]),
    ) -> Result<Option<StampedHeader>, LiveError> {
        if let Some(source) = self.receiver.take_error() {
            let path = self.recording.captures().last().cloned().unwrap_or_default();
            return Err(LiveError::File { path, source });
        }
        let window = [first.stamp.0, first.stamp.0 + i64::from(first.duration_nanos)];
        let until = Instant::now() + WAIT;
        let slice = loop {
            self.open_reader()?;
            match self.reader.as_mut().map(|reader| reader.poll_slice(window, &mut sink)).transpose()? {
                Some(SlicePoll::Complete(slice)) => break Some(slice),
                Some(SlicePoll::End) => break None,
                Some(SlicePoll::Pending) | None if self.is_sending() && self.receiver.wait(until) => {}
                Some(SlicePoll::Pending) | None => {
                    self.n_late += u64::from(self.reader.is_some());
                    break self.reader.as_mut().and_then(SweepReader::take_slice);
                }
            }
        };
        let n_rings = self.reader.as_ref().map_or(0, SweepReader::n_rings);
        Ok(self.tally.add(slice, first, self.index, n_rings))
    }

    /// Whether it sends packets now. A LiDAR that has failed must not delay the others.
    fn is_sending(&self) -> bool {
        self.receiver.n_packets() > 0 && self.receiver.silent_s() < WAIT.as_secs_f64()
    }

    /// Finds the sensor in the start of the recording, once it has been recorded.
    fn open_reader(&mut self) -> Result<(), LiveError> {
        let whole_bytes = self.receiver.frontier().whole_bytes();
        if self.reader.is_some() || whole_bytes == self.examined_bytes {
            return Ok(());
        }
        self.examined_bytes = whole_bytes;
        let captures = self.recording.captures().to_vec();
        match SweepReader::follow(captures, self.receiver.frontier(), Some(&self.lidar)) {
            Ok(reader) => self.reader = reader,
            // The packets are foreign: the LiDAR is silent.
            Err(SweepError::NoSensor { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }

    /// Its name in the rig.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Stamp and capture time of the packet with the least delay since the last call.
    pub fn take_arrival(&mut self) -> Option<PacketArrival> {
        self.reader.as_mut().and_then(SweepReader::take_arrival)
    }

    /// Names and numbers since the last call.
    pub fn take_counts(&mut self) -> Vec<(String, u64)> {
        let n_packets = self.receiver.n_packets();
        let n_late = self.n_late;
        let reported = &mut self.reported;
        let own = [
            ("udp_packets", n_packets - reported.n_packets),
            ("udp_packets_dropped", self.receiver.take_dropped()),
            ("sweeps_late", n_late - reported.n_late),
        ];
        let of_sweeps = self.tally.since(&reported.tally);
        let counts = &mut reported.counts;
        let of_packets = self.reader.as_ref().map(|reader| counts.take_new(reader.stats(), LogStats::default()));
        reported.tally = self.tally;
        reported.n_packets = n_packets;
        reported.n_late = n_late;
        named(&self.name, own.into_iter().chain(of_sweeps).chain(of_packets.into_iter().flatten())).collect()
    }

    /// Ends the recording.
    pub fn close(&mut self) {
        self.receiver.close();
    }

    /// Collects the doubts about its data.
    pub fn doubt(&self, doubts: &mut Doubts) {
        if let Some(reader) = self.reader.as_ref().filter(|_| self.tally.sweeps > 0) {
            let n_bytes = self.receiver.frontier().whole_bytes();
            self.tally.doubt(&self.name, &reader.stats(), n_bytes, doubts);
        }
    }

    /// Name and number of packets of a LiDAR that gave no returns during any sweep of the first LiDAR.
    pub fn silence(&self) -> Option<String> {
        let is_silent = self.tally.ticks > 0 && self.tally.sweeps == 0;
        is_silent.then(|| format!("lidar {} ({} packets, no returns)", self.name, self.receiver.n_packets()))
    }
}
