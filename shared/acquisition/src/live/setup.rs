//! What a live run receives and where it records, from its settings.

use super::mounting::Mounting;
use super::other::LiveOther;
use super::receiver::{address, bind};
use super::recording::{captures, folder_inside};
use super::sensor::{LiveLimits, LiveSensor};
use crate::error::LiveError;
use std::net::SocketAddrV4;
use std::path::Path;

/// The settings of a live run.
#[derive(Clone, Copy, Debug)]
pub struct LiveSetup<'a> {
    /// Addresses of the data packets of the LiDARs, separated by commas, in the order of the rig.
    pub listen: &'a str,
    /// Address of the position packets.
    pub position_listen: &'a str,
    /// Model of the first LiDAR; empty = that of the rig or of the packets.
    pub model: &'a str,
    /// Name of the recording's folder.
    pub recording: &'a str,
    /// Folder or file of the rig.
    pub drive: &'a Path,
    /// The output folder.
    pub output: &'a Path,
}

impl LiveSetup<'_> {
    /// Settings that prevent receiving or recording, with their keys.
    pub fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        let mut bound = Vec::new();
        let listens = self.listen.split(',').map(|text| ("listen", text));
        for (key, text) in listens.chain([("position_listen", self.position_listen)]) {
            match address(text.trim()).and_then(bind) {
                Ok(socket) => bound.push(socket),
                Err(error) => problems.push((key, error.to_string())),
            }
        }
        let mounting = Mounting::find(self.drive, self.model);
        let mounting = mounting.and_then(|mounting| mounting.check_number(self.listen.split(',').count()));
        problems.extend(mounting.err().map(|error| (error.key(), error.to_string())));
        let folder = match folder_inside(self.output, self.recording) {
            Ok(folder) => folder,
            Err(error) => {
                problems.push((error.key(), error.to_string()));
                return problems;
            }
        };
        match captures(&folder) {
            Ok(captures) if captures.is_empty() => {}
            Ok(captures) => {
                let error = LiveError::Used { n: captures.len(), folder };
                problems.push((error.key(), error.to_string()));
            }
            Err(error) => problems.push(("recording", format!("{}: {error}", folder.display()))),
        }
        problems
    }

    /// Starts the recordings of all LiDARs.
    pub fn start(&self, limits: LiveLimits) -> Result<(LiveSensor, Vec<LiveOther>), LiveError> {
        let listens: Vec<SocketAddrV4> =
            self.listen.split(',').map(|text| address(text.trim())).collect::<Result<_, _>>()?;
        let mounting = Mounting::find(self.drive, self.model)?;
        mounting.check_number(listens.len())?;
        let folder = folder_inside(self.output, self.recording)?;
        let others = mounting.others.iter().zip(&listens[1..]).enumerate();
        let others = others.map(|(index, (other, address))| LiveOther::start(*address, &folder, index + 1, other));
        let others = others.collect::<Result<_, _>>()?;
        let addresses = [listens[0], address(self.position_listen)?];
        Ok((LiveSensor::start(addresses, folder, mounting, limits)?, others))
    }
}
