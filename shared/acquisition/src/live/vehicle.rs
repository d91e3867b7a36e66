//! All sensors of a live vehicle: the interpretation of their settings, and their reports.

use super::auxiliary::{AuxiliaryLimits, AuxiliaryNews, AuxiliarySensors, AuxiliarySources};
use super::mounting::Mounting;
use super::receiver::{address, bind};
use super::recording::{captures, folder_inside};
use super::secondary_lidar::SecondaryLidar;
use super::sensor::{Discarded, LiveLimits, LiveSensor, SensorStats};
use crate::doubts::Doubts;
use crate::error::LiveError;
use crate::recorded::{News, Trigger};
use drive::SweepInfo;
use std::net::SocketAddrV4;
use std::path::{Path, PathBuf};

/// Recommended size of the receive buffer. With a smaller one, a stall of the disk soon drops packets: an HDL-32E fills
/// 4 MiB per second, with bookkeeping.
const RECOMMENDED_BUFFER: usize = 4 << 20;

/// Addresses of the sensors, and limits for reading them.
#[derive(Clone, Debug)]
pub struct LivePlan<'a> {
    /// Drive folder or manifest with the rig.
    pub drive: &'a Path,
    /// Folder of the output.
    pub output: &'a Path,
    /// Folder of the recording, inside the output.
    pub recording: &'a str,
    /// Addresses of the data packets of the LiDARs, separated by commas, in the order of the rig.
    pub listen: &'a str,
    /// Address of the first LiDAR's position packets.
    pub position_listen: &'a str,
    /// Model of the first LiDAR; empty = the model of the rig or of the packets.
    pub model: &'a str,
    /// Folder of the grabber.
    pub cameras: Option<PathBuf>,
    /// Source of NMEA sentences; empty = the position packets.
    pub gnss: &'a str,
    /// Source of IMU samples; empty = no IMU.
    pub imu: &'a str,
    /// Limits of the LiDAR.
    pub limits: LiveLimits,
    /// Limits of the other sensors.
    pub auxiliary_limits: AuxiliaryLimits,
    /// Rule for the images that are published.
    pub trigger: Trigger,
}

/// The LiDARs and the other sensors.
pub struct LiveVehicle {
    /// The first LiDAR, whose sweeps are the ticks.
    pub lidar: LiveSensor,
    /// The secondary LiDARs.
    pub secondary_lidars: Vec<SecondaryLidar>,
    /// The auxiliary sensors.
    pub auxiliary: AuxiliarySensors,
    n_packets: u64,
}

impl LivePlan<'_> {
    /// Problems that prevent receiving or recording: settings and texts.
    pub fn problems(&self) -> Vec<(&'static str, String)> {
        let problem = |error: &LiveError| (error.key(), error.to_string());
        let mut problems = Vec::new();
        let mut bound = Vec::new();
        let listens = self.listens().map(|value| ("listen", value));
        for (key, value) in listens.chain([("position_listen", self.position_listen)]) {
            match address(value).and_then(bind) {
                Ok(socket) => bound.push(socket),
                Err(error) => problems.push((key, error.to_string())),
            }
        }
        // A rig that cannot be read is one problem, not one problem for each sensor.
        let auxiliary = match self.mounting() {
            Err(error) => vec![error],
            Ok(_) => self.auxiliary_sources().map_or_else(|errors| errors, |sources| sources.check()),
        };
        problems.extend(auxiliary.iter().map(problem));
        match folder_inside(self.output, self.recording) {
            Err(error) => problems.push(problem(&error)),
            Ok(folder) => match captures(&folder) {
                Ok(captures) if captures.is_empty() => {}
                Ok(captures) => problems.push(problem(&LiveError::Used { n: captures.len(), folder })),
                Err(error) => problems.push(("recording", format!("{}: {error}", folder.display()))),
            },
        }
        problems
    }

    /// Starts to receive and to record.
    pub fn start(&self) -> Result<LiveVehicle, LiveError> {
        let listens = self.listens().map(address).collect::<Result<Vec<SocketAddrV4>, _>>()?;
        let addresses = [listens[0], address(self.position_listen)?];
        let mounting = self.mounting()?;
        let folder = folder_inside(self.output, self.recording)?;
        let sources = self.auxiliary_sources().map_err(|mut errors| errors.swap_remove(0))?;
        let auxiliary = AuxiliarySensors::start(&sources, folder.clone(), self.auxiliary_limits, self.trigger)?;
        let secondary_lidars = mounting.secondary_lidars.iter().zip(&listens[1..]).enumerate();
        let secondary_lidars = secondary_lidars
            .map(|(index, (other, address))| SecondaryLidar::start(*address, &folder, index + 1, other));
        let secondary_lidars = secondary_lidars.collect::<Result<_, _>>()?;
        let lidar = LiveSensor::start(addresses, folder, mounting.with_auxiliary(auxiliary.entries()), self.limits)?;
        Ok(LiveVehicle { lidar, secondary_lidars, auxiliary, n_packets: 0 })
    }

    /// Addresses of the LiDARs, one for each; at least one.
    fn listens(&self) -> impl Iterator<Item = &str> {
        self.listen.split(',').map(str::trim)
    }

    fn mounting(&self) -> Result<Mounting, LiveError> {
        let mounting = Mounting::find(self.drive, self.model)?;
        mounting.check_number(self.listens().count())?;
        Ok(mounting)
    }

    /// Finds the auxiliary sources. The error has at least one problem.
    fn auxiliary_sources(&self) -> Result<AuxiliarySources, Vec<LiveError>> {
        AuxiliarySources::find(self.cameras.clone(), self.gnss, self.imu, self.drive)
    }
}

impl LiveVehicle {
    /// Number of LiDARs.
    pub fn n_lidars(&self) -> usize {
        1 + self.secondary_lidars.len()
    }

    /// Adds a published sweep of the first LiDAR: measurements up to its end are due. Measures the clocks of the
    /// LiDARs.
    pub fn add_sweep(&mut self, sweep: &SweepInfo) {
        self.auxiliary.add_sweep(sweep, self.lidar.take_arrival());
        for lidar in &mut self.secondary_lidars {
            let arrival = lidar.take_arrival();
            self.auxiliary.add_arrival_of_lidar(lidar.name(), arrival);
        }
    }

    /// Ends the reception. Waiting data is recorded first.
    pub fn close(&mut self) {
        self.lidar.close();
        self.secondary_lidars.iter_mut().for_each(SecondaryLidar::close);
        self.auxiliary.close();
    }

    /// Reads the rest of the recording, discards it, and writes the last table of clocks.
    pub fn discard_rest(&mut self) -> Result<(), LiveError> {
        self.lidar.discard_rest()?;
        self.auxiliary.discard_rest();
        self.auxiliary.write_clocks(true)
    }

    /// Counters and notes since the last call.
    pub fn take_news(&mut self) -> News {
        let mut news = News::default();
        let n_packets = self.lidar.n_packets();
        if self.n_packets == 0 && n_packets > 0 {
            news.notes = self.notes_of_begin();
        }
        let Discarded { skipped, partial } = self.lidar.take_discarded();
        let of_lidar = [
            ("udp_packets", n_packets - self.n_packets),
            ("udp_packets_dropped", self.lidar.take_dropped()),
            ("sweeps_skipped", skipped),
            ("partial_sweeps", partial),
        ];
        self.n_packets = n_packets;
        let AuxiliaryNews { counts, notes } = self.auxiliary.take_news(self.lidar.stats());
        news.counts.extend(of_lidar.into_iter().chain(counts).map(|(name, n)| (name.into(), n)));
        for lidar in &mut self.secondary_lidars {
            news.counts.extend(lidar.take_counts().into_iter().map(|(name, n)| (name.into(), n)));
        }
        news.notes.extend(notes);
        news.notes.extend(self.lidar.waiting_note());
        news
    }

    /// Collects the doubts.
    pub fn doubt(&self, doubts: &mut Doubts) {
        if self.lidar.n_sweeps() == 0 && (self.n_packets > 0 || !self.lidar.has_earlier_packets()) {
            doubts.no_sweep(self.n_packets);
        }
        if let Some(SensorStats { lidar, log }) = self.lidar.stats() {
            doubts.captures(&lidar, self.lidar.recorded_bytes());
            self.auxiliary.doubt(&lidar, log, !self.secondary_lidars.is_empty(), doubts);
            self.secondary_lidars.iter().for_each(|lidar| lidar.doubt(doubts));
            let silent = self.secondary_lidars.iter().filter_map(SecondaryLidar::silence);
            doubts.silent(&silent.chain(self.auxiliary.silent_sensors()).collect::<Vec<_>>());
        }
    }

    fn notes_of_begin(&self) -> Vec<String> {
        let mut notes = vec![format!("recording to {}", self.lidar.capture().display()), self.lidar.rig().to_string()];
        let n_bytes = self.lidar.buffer_bytes();
        if n_bytes < RECOMMENDED_BUFFER {
            notes.push(format!(
                "the kernel's receive buffer has {n_bytes} bytes; set net.core.rmem_max to {RECOMMENDED_BUFFER} to avoid dropped packets \
                 when the disk stalls"
            ));
        }
        notes
    }
}
